#include "host/clusters/slurm.h"

#include <spawn.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <sstream>

#include "host/processes/child_process.h"
#include "results/system/child.h"
#include "results/system/error.h"
#include "results/system/file_descriptor.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr char kQueueFormat[] = "%F|%K|%T|%N|%r";

struct Answer {
  int status = 0;
  std::string out;
  std::string err;
};

bool IsNumber(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(),
                                      [](unsigned char c) { return std::isdigit(c) != 0; });
}

std::string Written(const FileDescriptor& file) {
  ::lseek(file.get(), 0, SEEK_SET);
  return ReadAll(file.get());
}

// Runs a command of PATH to its end.
Answer Ask(std::vector<std::string> words) {
  const FileDescriptor out = MemoryFile("");
  const FileDescriptor err = MemoryFile("");
  std::vector<char*> argv = ArgumentVector(&words);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", 0, 0);
  posix_spawn_file_actions_adddup2(&actions, out.get(), 1);
  posix_spawn_file_actions_adddup2(&actions, err.get(), 2);
  pid_t pid = -1;
  const int error = ::posix_spawnp(&pid, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) {
    throw Failure(ExitCode::kNotFound,
                  "there is no program " + words[0] +
                      " on PATH: expected the commands of Slurm (Debian has them in slurm-client). "
                      "Run this on a machine that submits to the cluster");
  }
  if (error != 0) {
    throw Failure(ExitCode::kInputOutput, "cannot start " + words[0] + ": " + std::strerror(error));
  }
  Answer answer;
  answer.status = WaitForEnd(pid);
  answer.out = Written(out);
  answer.err = Written(err);
  return answer;
}

[[noreturn]] void Refused(const std::vector<std::string>& words, const Answer& answer) {
  std::string said = answer.err.empty() ? answer.out : answer.err;
  while (!said.empty() && said.back() == '\n') said.pop_back();
  throw Failure(ExitCode::kInputOutput, "`" + ShellCommand(words) + "` ended with " +
                                            DescribeWaitStatus(answer.status) + ": " +
                                            Printable(said));
}

}  // namespace

std::string SubmitScript(const std::filesystem::path& script) {
  const std::vector<std::string> words = {"sbatch", "--parsable", script.string()};
  const Answer answer = Ask(words);
  std::string job = answer.status == 0 ? JobNumber(answer.out) : "";
  if (job.empty()) Refused(words, answer);
  return job;
}

Queue AskQueue(const std::vector<std::string>& jobs) {
  if (jobs.empty()) return {};
  std::string list;
  for (const std::string& job : jobs) list += (list.empty() ? "" : ",") + job;
  const std::vector<std::string> words = {"squeue", "--noheader", "--array", "--jobs=" + list,
                                          std::string("--format=") + kQueueFormat};
  const Answer answer = Ask(words);
  // Slurm forgets jobs some minutes after their end.
  const bool forgotten = answer.err.find("Invalid job id") != std::string::npos;
  if (answer.status != 0 && !forgotten) Refused(words, answer);
  return ParseQueue(answer.out);
}

std::uint64_t MaxArraySize() {
  const Answer answer = Ask({"scontrol", "show", "config"});
  return answer.status == 0 ? ParseMaxArraySize(answer.out) : kDefaultMaxArraySize;
}

std::string JobNumber(const std::string& answer) {
  std::string job = answer.substr(0, answer.find_first_of(";\n"));
  return IsNumber(job) ? job : "";
}

Queue ParseQueue(const std::string& lines) {
  Queue queue;
  std::istringstream stream(lines);
  for (std::string line; std::getline(stream, line);) {
    std::vector<std::string> fields;
    std::istringstream parts(line);
    for (std::string field; std::getline(parts, field, '|');) fields.push_back(field);
    if (fields.size() < 3 || !IsNumber(fields[0])) continue;
    fields.resize(5);
    // Of a job that is no array the task is "N/A".
    const std::string job = fields[0] + (IsNumber(fields[1]) ? "_" + fields[1] : "");
    queue[job] = {fields[2], fields[3], fields[4] == "None" ? "" : fields[4]};
  }
  return queue;
}

std::uint64_t ParseMaxArraySize(const std::string& configuration) {
  std::istringstream stream(configuration);
  for (std::string line; std::getline(stream, line);) {
    std::istringstream words(line);
    std::string name, equals;
    std::uint64_t size = 0;
    if (words >> name >> equals >> size && name == "MaxArraySize" && equals == "=") return size;
  }
  return kDefaultMaxArraySize;
}

}  // namespace dreamsearch
