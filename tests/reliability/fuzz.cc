// fuzz - what reads a stranger's bytes, fed with changed ones.
//
//   fuzz TARGET [--executions N | --seconds S] [--seed N]
//
// Targets: configuration (flag files, run.json, stored configurations), descriptor (what a library
// says of itself, ELF headers, descriptions of child processes), checkpoint (of a run, its
// checksums made anew after each change), importer (published scores), model_file (expressions
// about a model and model files; MuJoCo's own parser works in a child process, and its crashes are
// counted, not ours to mend).
//
// A target may refuse (Failure 2, 65, 66, 69) and nothing else: another exception, a signal, an
// execution that takes longer than ten seconds or, when built with AddressSanitizer and UBSan, what
// these find, ends the program with the number of the execution. The same seed makes the same
// executions; --first N begins with one of them.
#include "tests/reliability/fuzz.h"

#include <signal.h>

#include <chrono>
#include <cstdio>
#include <exception>
#include <iostream>
#include <iterator>

#include "results/system/error.h"

namespace dreamsearch {
// --- changing ------------------------------------------------------------------

namespace {

const char* const kWords[] = {"nan",  "inf",     "-1",       "1e999", "18446744073709551616",
                              "\"",   "[",       "{",        "]}",    ":",
                              ",",    "\\u0000", "null",     "true",  "= ",
                              "\n",   "../",     "%s",       "--",    "value",
                              "name", "0x",      "\xff\xfe", "#"};

}  // namespace

std::string Changed(std::string bytes, Random* random) {
  const std::uint64_t changes = 1 + random->Below(4);
  for (std::uint64_t i = 0; i < changes; ++i) {
    const auto at = static_cast<std::size_t>(random->Below(bytes.size() + 1));
    switch (random->Below(8)) {
      case 0:
        if (at < bytes.size()) bytes[at] = static_cast<char>(bytes[at] ^ (1 << random->Below(8)));
        break;
      case 1:
        if (at < bytes.size()) bytes[at] = static_cast<char>(random->Below(256));
        break;
      case 2:
        bytes.erase(at, static_cast<std::size_t>(random->Below(16)));
        break;
      case 3:
        bytes.insert(at, kWords[random->Below(std::size(kWords))]);
        break;
      case 4: {  // a piece of it again
        const auto from = static_cast<std::size_t>(random->Below(bytes.size() + 1));
        bytes.insert(at, bytes.substr(from, static_cast<std::size_t>(random->Below(64))));
        break;
      }
      case 5: {  // a number of the size of a length
        const std::uint64_t numbers[] = {
            0, 1, ~0ull, 1ull << 31, 1ull << 32, 1ull << 62, 1ull << 63, random->Below(1 << 20)};
        const std::uint64_t number = numbers[random->Below(std::size(numbers))];
        for (std::size_t k = 0; k < 8 && at + k < bytes.size(); ++k) {
          bytes[at + k] = static_cast<char>(number >> (8 * k));
        }
        break;
      }
      case 6:
        bytes.resize(at);
        break;
      default:
        bytes.insert(at, static_cast<std::size_t>(random->Below(200)),
                     static_cast<char>(random->Below(2) == 0 ? '[' : random->Below(256)));
    }
  }
  return bytes;
}

namespace {

// --- running -------------------------------------------------------------------

std::uint64_t execution = 0;

void SayWhich(int signal) {
  std::fprintf(stderr, "execution %llu: signal %d\n", static_cast<unsigned long long>(execution),
               signal);
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

int Main(int argc, char** argv) {
  const auto& targets = Targets();
  const auto found = argc < 2 ? targets.end() : targets.find(argv[1]);
  std::map<std::string, std::uint64_t> numbers = {
      {"--executions", 0}, {"--seconds", 0}, {"--seed", 0}, {"--first", 0}};
  bool understood = found != targets.end() && argc % 2 == 0;
  for (int i = 2; understood && i < argc; i += 2) {
    understood = numbers.count(argv[i]) == 1;
    numbers[argv[i]] = std::strtoull(argv[i + 1], nullptr, 10);
  }
  if (!understood) {
    std::cerr << "fuzz TARGET [--executions N | --seconds S] [--seed N] [--first N]; targets:";
    for (const auto& [name, make] : targets) std::cerr << " " << name;
    std::cerr << "\n";
    return 2;
  }
  ::signal(SIGALRM, SayWhich);
  const Target target = found->second();
  const auto begin = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  const std::uint64_t most =
      numbers["--executions"] + numbers["--seconds"] == 0 ? 10000 : numbers["--executions"];
  for (execution = numbers["--first"];; ++execution) {
    const std::uint64_t done = execution - numbers["--first"];
    if (most > 0 ? done >= most : seconds() >= static_cast<double>(numbers["--seconds"])) break;
    Random random(numbers["--seed"] * 1'000'003 + execution);
    ::alarm(10);
    try {
      target(&random);
    } catch (const Failure& error) {
      const ExitCode code = error.code();
      if (code != ExitCode::kUsage && code != ExitCode::kBadInput && code != ExitCode::kNotFound &&
          code != ExitCode::kPluginRefused) {
        std::cerr << "execution " << execution << ": exit code " << error.exit_status() << ": "
                  << error.what() << "\n";
        return 1;
      }
      ++refusals;
    } catch (const std::exception& error) {
      std::cerr << "execution " << execution << ": " << error.what() << "\n";
      return 1;
    }
  }
  ::alarm(0);
  const std::uint64_t done = execution - numbers["--first"];
  std::printf("%s: %llu executions in %.0f s, %llu refused, no fault\n", argv[1],
              static_cast<unsigned long long>(done), seconds(),
              static_cast<unsigned long long>(refusals));
  return refusals > 0 ? 0 : 1;
}

}  // namespace
}  // namespace dreamsearch

int main(int argc, char** argv) { return dreamsearch::Main(argc, argv); }
