// command.h - what a command of `runner` or `results` understands, declared once.
//
// A command is a struct. Its members are the answers, with their defaults; Declare binds
// each to a flag or an argument; Run does the work and returns the exit status:
//
//   struct ShowStatus {
//     std::string db = "results/dreamsearch.db";
//
//     CommandSpec Declare() {
//       return {.name = "runner status",
//               .summary = "shows how far the runs of a database are",
//               .examples = {"runner status --db walker.db"},
//               .groups = {{"Where", {{"db", "FILE", Text(&db), "the results database"}}}}};
//     }
//     int Run();
//   };
//   Command StatusCommand() { return MakeCommand<ShowStatus>(); }
//
// The parser, the help and the error texts come from the declaration. `values.h` has
// Text and the other kinds of values.
//
// Errors   Failure 2 for what is wrong on the command line, 65 for the same in a file of
//          flags; the message says where, what was expected and what was found.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace dreamsearch {

using Words = std::vector<std::string>;

struct Flag;

// A flag or an argument as somebody wrote it.
struct Given {
  const Flag* flag = nullptr;
  std::string text;   // its value; of a switch on the command line empty
  std::string where;  // "runner list", "/path/x.cfg, line 3"
  bool from_file = false;
  std::string file = {};  // its absolute path, if from_file

  // Begins a message: "runner list: --plugin-path", "/path/x.cfg, line 3: plugin-path".
  std::string Where() const;
};

// How the text of a flag becomes an answer.
struct FlagValue {
  enum class Takes {
    kNothing,  // a switch
    kText,
    kTexts,      // may be given several times; an argument takes all that follow
    kFlagsFile,  // the path of a file with further flags
  };

  // Stores the answer. Throws std::invalid_argument with what it expected ("expected a
  // whole number from 1 to 9"), or a Failure that says all but where.
  std::function<void(const Given&)> read;
  Takes takes = Takes::kText;
  std::string default_text = {};  // what the answer is without the flag; empty: not said
  std::string choices = {};       // "steps, seconds or transitions"; empty: not a fixed list
  bool required = false;

  FlagValue Default(std::string text) && {
    default_text = std::move(text);
    return std::move(*this);
  }
  FlagValue Required() && {
    required = true;
    return std::move(*this);
  }
};

struct Flag {
  std::string name;        // "seeds"; empty for an argument
  std::string value_name;  // "N", "RUN"; empty for a switch
  FlagValue value;
  std::string help;

  bool is_argument() const { return name.empty(); }
};

struct FlagGroup {
  std::string title;
  std::vector<Flag> flags;
};

struct CommandSpec {
  std::string name;                        // "runner list"
  std::string summary;                     // one line: "lists the components of all plugins"
  std::vector<std::string> usage = {};     // lines; empty: made of what follows
  std::vector<std::string> examples = {};  // the first is also part of some messages
  std::string about = {};                  // what else there is to know; paragraphs
  std::vector<Flag> arguments = {};        // words without dashes, in their order
  std::vector<FlagGroup> groups = {};
  // Flags of which only one can be given: {{"seeds", "seed-list"}}.
  std::vector<std::pair<std::string, std::string>> exclusive = {};

  // The flag of that name; null if there is none.
  const Flag* Find(const std::string& name) const;
};

// Reads the words after the command's name into the answers, and the file of flags if they
// name one. What the words say wins over the file; texts of a flag that may be given
// several times are joined.
void ReadCommandLine(const CommandSpec& spec, const Words& words);

struct Command {
  CommandSpec spec;
  std::function<int(const Words&)> run;  // after ReadCommandLine, with the same words

  // Reads the words after the command's name and does the work.
  int Call(const Words& words) const {
    ReadCommandLine(spec, words);
    return run(words);
  }
  // "list" of "runner list".
  std::string name() const { return spec.name.substr(spec.name.find(' ') + 1); }
};

template <typename T>
Command MakeCommand() {
  const auto command = std::make_shared<T>();
  return {command->Declare(), [command](const Words& words) {
            if constexpr (requires { command->Run(words); }) {
              return command->Run(words);
            } else {
              return command->Run();
            }
          }};
}

}  // namespace dreamsearch
