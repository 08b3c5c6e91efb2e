// child_request.h - asks something of plugins in a child process, without a run.
//
// The supervisor loads no plugin. What it must know of one, or have done by one, it
// asks of a child: JSON on the child's standard input, JSON back on descriptor 3.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace dreamsearch {

struct ChildRequest {
  std::string command;                   // the runner's own subcommand that answers
  std::string who;                       // what is asked, for messages: "cartpole_swingup, dreamer"
  double timeout_seconds = 0;            // of wall time; 0: none
  std::uint64_t memory_limit_bytes = 0;  // of resident size; 0: none
  bool show_messages = false;            // the child's standard error is ours
};

// The answer. Throws Failure with the child's message and exit code; 71 if it
// crashed, took longer than the timeout or more memory than the limit.
nlohmann::json AskChild(const ChildRequest& request, const nlohmann::json& content);

// The child's side: answers the request on standard input. Returns the exit status.
int AnswerMain(const std::function<nlohmann::json(const nlohmann::json&)>& answer);

}  // namespace dreamsearch
