// check.cc - puts the laws through: which concern a component, a child for each case, and what
// became of it. Over 400 lines: parent and child speak to each other and to nobody else.
#include "dreamsearch/check/check.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdarg>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <stdexcept>

#include "law.h"
#include "tools.h"

// Of the shared library allocation_counter.cc, if it is loaded.
extern "C" __attribute__((weak)) std::uint64_t dreamsearch_allocations();

namespace dreamsearch::check {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

// What a child says of itself, in memory that it shares with its parent: the call under way shows
// where it crashed or hangs.
struct Notes {
  char call[128];
  bool over;
  std::uint32_t verdict;
  char expected[512];
  char found[512];
};
Notes* notes = nullptr;  // of this process's case

template <std::size_t N>
void Keep(char (&to)[N], std::string_view text) {
  const std::size_t size = std::min(text.size(), N - 1);
  std::memcpy(to, text.data(), size);
  to[size] = '\0';
}

class SharedNotes {
 public:
  SharedNotes() {
    void* memory =
        ::mmap(nullptr, sizeof(Notes), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) throw std::runtime_error("cannot map memory for a check");
    notes_ = static_cast<Notes*>(memory);
    std::memset(memory, 0, sizeof(Notes));
  }
  ~SharedNotes() { ::munmap(notes_, sizeof(Notes)); }
  SharedNotes(const SharedNotes&) = delete;
  SharedNotes& operator=(const SharedNotes&) = delete;
  Notes* get() const { return notes_; }

 private:
  Notes* notes_;
};

void Conclude(Verdict verdict, const std::string& expected, const std::string& found) {
  notes->verdict = static_cast<std::uint32_t>(verdict);
  Keep(notes->expected, expected);
  if (!found.empty()) Keep(notes->found, found);
  notes->over = true;
}

// Holds one case against its law, in this process, and leaves the verdict in `notes`.
void Hold(const Subject& subject, const Law& law, const Case& tried) {
  try {
    const Trial trial(subject, tried);
    law.hold(trial);
    Conclude(Verdict::kKept, "", "");
  } catch (const Broken& broken) {
    Conclude(Verdict::kBroken, broken.expected, broken.found);
  } catch (const Skipped& skipped) {
    Conclude(Verdict::kSkipped, "", skipped.why);
  } catch (const Refused& refused) {
    const std::string text = Text(refused.status);
    if (tried.may_refuse) return Conclude(Verdict::kKept, "", "refused: " + text);
    Conclude(Verdict::kBroken, "a component made under these settings", text);
  } catch (const std::exception& error) {
    Conclude(Verdict::kBroken, "no exception", error.what());
  }
}

std::uint64_t ResidentBytes(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/statm");
  std::uint64_t total = 0, resident = 0;
  file >> total >> resident;
  return resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

// The end of what a child printed: mostly why it died.
class LastWords {
 public:
  LastWords() {
    if (::pipe2(ends_, O_CLOEXEC) != 0) throw std::runtime_error("cannot make a pipe for a check");
    ::fcntl(ends_[0], F_SETFL, O_NONBLOCK);
  }
  ~LastWords() {
    ::close(ends_[0]);
    ::close(ends_[1]);
  }
  LastWords(const LastWords&) = delete;
  LastWords& operator=(const LastWords&) = delete;

  // In the child: takes its standard output and error.
  void Capture() const {
    ::dup2(ends_[1], STDOUT_FILENO);
    ::dup2(ends_[1], STDERR_FILENO);
  }
  // In the parent: what has come since, so that the child never waits for room.
  void Drain() {
    char block[65536];
    for (ssize_t got; (got = ::read(ends_[0], block, sizeof block)) > 0;) {
      text_.append(block, static_cast<std::size_t>(got));
      if (text_.size() > kMost) text_.erase(0, text_.size() - kMost);
    }
  }
  // Its last line, printable.
  std::string Line() const {
    const std::size_t end = text_.find_last_not_of("\r\n \t");
    if (end == std::string::npos) return "";
    const std::size_t begin = text_.find_last_of("\r\n", end);
    std::string line = text_.substr(begin == std::string::npos ? 0 : begin + 1,
                                    begin == std::string::npos ? end + 1 : end - begin);
    for (char& c : line) c = c >= ' ' && c <= '~' ? c : '?';
    return line.substr(0, 200);
  }

 private:
  static constexpr std::size_t kMost = 4096;
  int ends_[2];
  std::string text_;
};

// Runs a case in a child and fills *outcome from what it left, or from how it ended.
void HoldInChild(const Subject& subject, const Law& law, const Case& tried, const Options& options,
                 Outcome* outcome) {
  const SharedNotes shared;
  LastWords words;
  const std::uint64_t own_bytes = ResidentBytes(::getpid());
  const pid_t child = ::fork();
  if (child < 0) throw std::runtime_error(std::string("cannot fork: ") + std::strerror(errno));
  if (child == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const rlimit no_core = {0, 0};
    ::setrlimit(RLIMIT_CORE, &no_core);
    for (const int signal : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGPIPE}) {
      ::signal(signal, SIG_DFL);
    }
    words.Capture();
    notes = shared.get();
    Hold(subject, law, tried);
    // Without exit handlers: those of the parent are not its own.
    ::_exit(0);
  }
  const Clock::time_point begin = Clock::now();
  const double most_seconds = tried.may_refuse ? options.extreme_seconds : options.case_seconds;
  bool late = false, large = false;
  int status = 0;
  for (int wait_us = 100;; wait_us = std::min(2 * wait_us, 10000)) {
    words.Drain();
    const pid_t ended = ::waitpid(child, &status, WNOHANG);
    if (ended == child) break;
    late = SecondsSince(begin) > most_seconds;
    large = ResidentBytes(child) > own_bytes + options.memory_bytes;
    if (late || large) {
      ::kill(child, SIGKILL);
      while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
      }
      break;
    }
    ::usleep(static_cast<useconds_t>(wait_us));
  }
  const Notes& left = *shared.get();
  const std::string where = left.call[0] == '\0' ? "" : std::string(" in ") + left.call;
  if (late || large) {
    const std::string limit =
        large ? Format("more than %.0f MiB", static_cast<double>(options.memory_bytes) / (1 << 20))
              : Format("no end after %g s", most_seconds);
    if (tried.may_refuse) {
      outcome->found = (large ? "ended at the memory limit: took " : "ended at the time limit: ") +
                       limit + where;
      return;
    }
    outcome->verdict = large ? Verdict::kTooLarge : Verdict::kTimedOut;
    outcome->expected = large ? "less memory than the limit" : "an end within the time limit";
    outcome->found = limit + where;
    outcome->advice = large
                          ? "If it needs as much, allow it with --memory-limit; otherwise look for "
                            "what is kept for each call"
                          : "If it is only slow, allow it longer with --case-limit; otherwise see "
                            "where it waits, under gdb with --in-process and this --law";
    return;
  }
  if (left.over) {
    outcome->verdict = static_cast<Verdict>(left.verdict);
    outcome->expected = left.expected;
    outcome->found = left.found;
    return;
  }
  outcome->verdict = Verdict::kCrashed;
  outcome->expected = "every call to return";
  outcome->advice =
      "Run it under a debugger: gdb --args runner check FILE.so --in-process --law " + outcome->law;
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    outcome->found = "signal " + std::to_string(signal) + " (" + ::strsignal(signal) + ")" + where;
  } else {
    outcome->found = "the process ended with status " + std::to_string(WEXITSTATUS(status)) + where;
  }
  words.Drain();
  if (const std::string line = words.Line(); !line.empty()) {
    outcome->found += "; its last words: " + line;
  }
}

std::vector<const Law*> LawsOf(ComponentKind kind) {
  std::vector<const Law*> laws;
  for (const View<const Law> some :
       {ComponentLaws(), PlannerLaws(), ModelLaws(), EnvironmentLaws()}) {
    for (const Law& law : some) {
      if ((law.kinds & KindBit(kind)) != 0) laws.push_back(&law);
    }
  }
  return laws;
}

bool Wanted(const Law& law, const Options& options) {
  if (!options.only.empty()) {
    return std::find(options.only.begin(), options.only.end(), law.number) != options.only.end();
  }
  return law.level <= options.level;
}

}  // namespace

std::string Format(const char* format, ...) {
  char text[1024];
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

std::string Text(const Status& status) {
  return std::string(StatusCodeName(status.code)) + ": " + status.message;
}

std::string Number(double number) {
  for (int digits = 6; digits < 17; ++digits) {
    const std::string text = Format("%.*g", digits, number);
    if (std::strtod(text.c_str(), nullptr) == number) return text;
  }
  return Format("%.17g", number);
}

void NoteCall(std::string_view call) {
  if (notes != nullptr) Keep(notes->call, call);
}
void Remark(const std::string& text) {
  if (notes != nullptr) Keep(notes->found, text);
}

std::uint64_t Allocations() {
  return dreamsearch_allocations != nullptr ? dreamsearch_allocations() : 0;
}
bool CountsAllocations() {
  // A sanitizer's allocator may stand before the counter.
  const std::uint64_t before = Allocations();
  void* volatile memory = std::malloc(1);
  std::free(memory);
  return Allocations() != before;
}

Trial::Trial(const Subject& subject, const Case& tried)
    : subject_(subject), case_(tried), settings_(subject.settings) {
  settings_.insert(settings_.end(), tried.settings.begin(), tried.settings.end());
  for (const ParameterSpec& spec : subject.component->parameters) {
    ParameterValue value{spec.name, spec.default_number, spec.default_choice};
    for (const Setting& setting : settings_) {
      if (setting.name != spec.name) continue;
      value.number = setting.number;
      value.choice = IsText(spec.type) ? setting.text.c_str() : nullptr;
    }
    values_.push_back(value);
  }
}

const char* LevelName(Level level) {
  switch (level) {
    case Level::kDescribe:
      return "describe";
    case Level::kMake:
      return "make";
    case Level::kLaws:
      return "laws";
    case Level::kExtremes:
      return "extremes";
    case Level::kSoak:
      return "soak";
  }
  return "unknown";
}

const char* VerdictName(Verdict verdict) {
  switch (verdict) {
    case Verdict::kKept:
      return "kept";
    case Verdict::kSkipped:
      return "skipped";
    case Verdict::kBroken:
      return "broken";
    case Verdict::kCrashed:
      return "crashed";
    case Verdict::kTimedOut:
      return "timed out";
    case Verdict::kTooLarge:
      return "too large";
  }
  return "unknown";
}

std::string Describe(const Outcome& outcome) {
  std::string text = outcome.law + " " + outcome.title;
  if (!outcome.of.empty()) text += " (" + outcome.of + ")";
  text += std::string(": ") + VerdictName(outcome.verdict);
  if (!outcome.expected.empty()) text += "; expected " + outcome.expected;
  if (!outcome.found.empty())
    text += (outcome.expected.empty() ? "; " : ", found ") + outcome.found;
  if (!outcome.good()) text += ". " + outcome.advice;
  return text;
}

std::vector<Outcome> Check(const Subject& subject, const Options& options) {
  const Records<ParameterSpec>& declared = subject.component->parameters;
  for (const Setting& setting : subject.settings) {
    if (std::none_of(declared.begin(), declared.end(),
                     [&](const ParameterSpec& spec) { return setting.name == spec.name; })) {
      throw std::invalid_argument(std::string(subject.component->name) + " has no parameter '" +
                                  setting.name + "'");
    }
  }
  std::vector<Outcome> outcomes;
  for (const Law* law : LawsOf(subject.component->kind)) {
    if (!Wanted(*law, options)) continue;
    const std::vector<Case> cases =
        law->cases == nullptr ? std::vector<Case>{{.label = ""}} : law->cases(subject);
    for (const Case& tried : cases) {
      Outcome outcome;
      outcome.law = law->number;
      outcome.title = law->title;
      outcome.of = tried.label;
      outcome.advice = law->advice;
      const Clock::time_point begin = Clock::now();
      if (options.in_this_process) {
        Notes own = {};
        notes = &own;
        Hold(subject, *law, tried);
        notes = nullptr;
        outcome.verdict = static_cast<Verdict>(own.verdict);
        outcome.expected = own.expected;
        outcome.found = own.found;
      } else {
        HoldInChild(subject, *law, tried, options, &outcome);
      }
      outcome.seconds = SecondsSince(begin);
      if (options.observer) options.observer(outcome);
      outcomes.push_back(outcome);
      // What cannot be made under the given settings cannot be checked either.
      if (law->level == Level::kMake && tried.label.empty() && !outcome.good()) return outcomes;
    }
  }
  return outcomes;
}

namespace {
constexpr double kMostLoadSeconds = 0.1;
constexpr char kLoadLaw[] = "C1";
constexpr char kLoadTitle[] = "loads and describes itself within 100 ms";
constexpr char kLoadAdvice[] =
    "Move what takes time from static initialisers into the factory: every command loads every "
    "plugin to describe it";

std::string KindsText(std::uint32_t kinds) {
  if (kinds == kOfPlanners) return "planner";
  if (kinds == kOfModels) return "model";
  if (kinds == kOfEnvironments) return "environment";
  if (kinds == (kOfModels | kOfPlanners)) return "model, planner";
  return "every component";
}
}  // namespace

Outcome LoadOutcome(double seconds) {
  Outcome outcome;
  outcome.law = kLoadLaw;
  outcome.title = kLoadTitle;
  outcome.advice = kLoadAdvice;
  outcome.seconds = seconds;
  if (seconds <= kMostLoadSeconds) return outcome;
  outcome.verdict = Verdict::kBroken;
  outcome.expected = "at most 100 ms";
  outcome.found = Format("%.0f ms", seconds * 1000);
  return outcome;
}

std::vector<LawInfo> AllLaws() {
  std::vector<LawInfo> infos = {
      {kLoadLaw, kLoadTitle, KindsText(kOfAll), kLoadAdvice, Level::kDescribe}};
  for (const View<const Law> some :
       {ComponentLaws(), PlannerLaws(), ModelLaws(), EnvironmentLaws()}) {
    for (const Law& law : some) {
      infos.push_back({law.number, law.title, KindsText(law.kinds), law.advice, law.level});
    }
  }
  return infos;
}

const PluginDescriptor& LoadPlugin(const std::string& path) {
  void* library = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) throw std::runtime_error(::dlerror());
  const auto entry = reinterpret_cast<PluginEntry>(::dlsym(library, kPluginEntrySymbol));
  if (entry == nullptr) {
    throw std::runtime_error(path + ": expected the symbol " + kPluginEntrySymbol +
                             ", found none: not a plugin of this SDK");
  }
  const PluginDescriptor* plugin = entry();
  if (plugin == nullptr || plugin->magic != kPluginMagic ||
      plugin->sdk_major != DREAMSEARCH_SDK_MAJOR) {
    throw std::runtime_error(path + ": built against another SDK than " +
                             std::to_string(DREAMSEARCH_SDK_MAJOR) + "; rebuild it");
  }
  return *plugin;
}

}  // namespace dreamsearch::check
