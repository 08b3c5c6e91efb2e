// component_laws.cc - the laws of every component, whatever its kind.
#include <dirent.h>
#include <fenv.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cctype>
#include <clocale>
#include <cstring>
#include <set>

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

#include "law.h"
#include "tools.h"

namespace dreamsearch::check {
namespace {

// --- C2 ----------------------------------------------------------------------

void ExpectText(const char* text, const std::string& what) {
  Expect(text != nullptr && text[0] != '\0', what + " to be a text",
         text == nullptr ? "null" : "\"\"");
  Expect(std::strchr(text, '\n') == nullptr, what + " to be one line", "several");
}

void DescribesItself(const Trial& trial) {
  const ComponentDescriptor& component = trial.component();
  ExpectText(component.name, "the component's name");
  ExpectText(component.version, "the component's version");
  ExpectText(component.summary, "the component's summary");
  std::set<std::string> names;
  for (const ParameterSpec& spec : component.parameters) {
    ExpectText(spec.name, "the name of every parameter");
    const std::string of = " of parameter '" + std::string(spec.name) + "'";
    ExpectText(spec.help, "the help" + of);
    Expect(spec.unit != nullptr, "the unit" + of + " to be \"\" or a text", "null");
    Expect(names.insert(spec.name).second, "every parameter declared once", spec.name);
    if (spec.type == ParameterType::kInt || spec.type == ParameterType::kReal) {
      Expect(std::isfinite(spec.min) && std::isfinite(spec.max), "finite ends of the range" + of,
             Number(spec.min) + " .. " + Number(spec.max));
      Expect(spec.min <= spec.default_number && spec.default_number <= spec.max,
             "the default" + of + " in its range",
             Number(spec.default_number) + " in " + Number(spec.min) + " .. " + Number(spec.max));
    }
  }
  names.clear();
  for (const MetricSpec& metric : component.metrics) {
    ExpectText(metric.name, "the name of every metric");
    ExpectText(metric.help, "the help of metric '" + std::string(metric.name) + "'");
    Expect(names.insert(metric.name).second, "every metric declared once", metric.name);
  }
  Expect(component.kind != ComponentKind::kModel || component.metrics.empty() || trial.Has(kLearns),
         "the trait kLearns of a model with metrics, which Train reports",
         "none: Train is never called");
  Expect((component.traits & ~TraitsOf(component.kind)) == 0, "traits of its kind",
         Format("%#x", component.traits));
}

// --- C3 ----------------------------------------------------------------------

void IsMade(const Trial& trial) { Use(trial, 2); }

std::vector<Case> Presets(const Subject& subject) {
  std::vector<Case> cases = {{.label = ""}};
  std::set<std::string> presets;
  for (const ParameterSpec& spec : subject.component->parameters) {
    for (std::uint32_t i = 0; i < spec.preset_count; ++i) presets.insert(spec.presets[i].preset);
  }
  for (const std::string& preset : presets) {
    Case tried = {.label = "preset " + preset};
    for (const ParameterSpec& spec : subject.component->parameters) {
      for (std::uint32_t i = 0; i < spec.preset_count; ++i) {
        const PresetValue& value = spec.presets[i];
        if (value.preset != preset) continue;
        tried.settings.push_back(
            {spec.name, value.number, value.choice == nullptr ? "" : value.choice});
      }
    }
    cases.push_back(tried);
  }
  return cases;
}

// --- C4 ----------------------------------------------------------------------

std::uint64_t Entries(const char* folder) {
  DIR* opened = ::opendir(folder);
  if (opened == nullptr) return 0;
  std::uint64_t count = 0;
  while (::readdir(opened) != nullptr) ++count;
  ::closedir(opened);
  return count;
}

// What all of a process shares.
struct ProcessState {
  unsigned modes = 0;
  int rounding = 0;
  std::string locale;
  std::string folder;
  unsigned mask = 0;
  struct sigaction handlers[32] = {};

  static ProcessState Now() {
    ProcessState state;
#if defined(__x86_64__)
    state.modes = _mm_getcsr() & ~0x3fu;  // without the flags that operations raise
#endif
    state.rounding = ::fegetround();
    state.locale = std::setlocale(LC_ALL, nullptr);
    char path[4096];
    if (::getcwd(path, sizeof path) != nullptr) state.folder = path;
    const mode_t mask = ::umask(0);
    ::umask(mask);
    state.mask = mask;
    for (int signal = 1; signal < 32; ++signal) {
      ::sigaction(signal, nullptr, &state.handlers[signal]);
    }
    return state;
  }

  void CheckUnchanged() const {
    const ProcessState now = Now();
    Expect(now.modes == modes, Format("floating-point modes as they were (MXCSR %#x)", modes),
           Format("%#x: rounding, exceptions or flush-to-zero changed", now.modes));
    Expect(now.rounding == rounding, "the rounding mode as it was", "another one");
    Expect(now.locale == locale, "the locale '" + locale + "'", "'" + now.locale + "'");
    Expect(now.folder == folder, "the working folder " + folder, now.folder);
    Expect(now.mask == mask, Format("the file mode mask %03o", mask), Format("%03o", now.mask));
    for (int signal = 1; signal < 32; ++signal) {
      Expect(now.handlers[signal].sa_handler == handlers[signal].sa_handler,
             "the handler of every signal as it was",
             "another one for " + std::string(::strsignal(signal)));
    }
  }
};

void LeavesTheProcessAlone(const Trial& trial) {
  const ProcessState before = ProcessState::Now();
  // Files and threads are counted after a first use: a library may keep some for all that follow.
  Use(trial, 1);
  const std::uint64_t files = Entries("/proc/self/fd"), threads = Entries("/proc/self/task");
  Use(trial, 4);
  before.CheckUnchanged();
  Expect(Entries("/proc/self/fd") <= files, "as many open files as before",
         Format("%d more", static_cast<int>(Entries("/proc/self/fd") - files)));
  std::uint64_t left = 0;
  for (int i = 0; i < 100; ++i) {  // a joined thread leaves the list a moment later
    left = Entries("/proc/self/task");
    if (left <= threads) return;
    ::usleep(10000);
  }
  Break("no thread left behind by Destroy", std::to_string(left - threads) + " more than before");
}

// --- C5 ----------------------------------------------------------------------

std::vector<Case> EndsOfParameters(const Subject& subject) {
  std::vector<Case> cases;
  const auto add = [&](const ParameterSpec& spec, double number, const std::string& text) {
    Case tried = {
        .label = std::string(spec.name) + " = " + (IsText(spec.type) ? text : Number(number)),
        .may_refuse = true,
        .strict = true};
    tried.settings.push_back({spec.name, number, text});
    cases.push_back(tried);
  };
  for (const ParameterSpec& spec : subject.component->parameters) {
    switch (spec.type) {
      case ParameterType::kBool:
        add(spec, spec.default_number == 0 ? 1 : 0, "");
        break;
      case ParameterType::kInt:
      case ParameterType::kReal:
        for (const double end : {spec.min, spec.max}) {
          if (end != spec.default_number) add(spec, end, "");
        }
        break;
      case ParameterType::kChoice: {
        const std::string choices = spec.choices;
        for (std::size_t begin = 0; begin <= choices.size();) {
          const std::size_t end = std::min(choices.find(',', begin), choices.size());
          const std::string choice = choices.substr(begin, end - begin);
          if (choice != spec.default_choice) add(spec, 0, choice);
          begin = end + 1;
        }
        break;
      }
      case ParameterType::kText:
      case ParameterType::kPath:
        break;  // has no ends; a text of one's own comes with --set
    }
  }
  return cases;
}

void WorksAtTheEnds(const Trial& trial) { Use(trial, 1); }

// --- C6 ----------------------------------------------------------------------

std::vector<Case> OtherSizes(const Subject& subject) {
  std::vector<Case> cases;
  const auto add = [&](Sizes sizes) {
    const std::string o = std::to_string(sizes.observation), a = std::to_string(sizes.action);
    const bool model = subject.component->kind == ComponentKind::kModel;
    cases.push_back({.label = model ? "O = " + o + ", A = " + a
                                    : "A = " + a + ", latents of " +
                                          std::to_string(sizes.latent_bytes) + " bytes",
                     .sizes = sizes,
                     .strict = true});
  };
  add({1, 1, 64});
  add({2, 1, 128});
  add({1, 2, 192});
  add({17, 6, 1088});
  add({33, 7, 64});
  add({7, 31, 4096});
  add({64, 64, 128});
  return cases;
}

void WorksAtOtherSizes(const Trial& trial) { Use(trial, 2); }

// --- C7 ----------------------------------------------------------------------

std::uint64_t OwnResidentBytes() {
  std::uint64_t total = 0, resident = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    unsigned long long a = 0, b = 0;
    if (std::fscanf(file, "%llu %llu", &a, &b) == 2) total = a, resident = b;
    std::fclose(file);
  }
  return total == 0 ? 0 : resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

// Used again and again for as long as half its time limit, with a measurement in the middle.
void DoesNotGrow(const Trial& trial) {
  constexpr int kRounds = 40, kCalls = 50;
  constexpr std::uint64_t kSlack = 4 << 20;
  std::uint64_t half = 0;
  for (int round = 0; round < kRounds; ++round) {
    Use(trial, kCalls);
    if (round == kRounds / 2) half = OwnResidentBytes();
  }
  const std::uint64_t end = OwnResidentBytes();
  Expect(
      end <= half + kSlack, "memory that does not grow once everything was done before",
      Format("%.1f MiB more after the second half", static_cast<double>(end - half) / (1 << 20)));
}

constexpr Law kLaws[] = {
    {"C2", kOfAll, Level::kDescribe, "describes itself completely",
     "Complete the descriptor: `runner describe`, tables and help texts are made of it",
     DescribesItself},
    {"C3", kOfAll, Level::kMake, "can be made, used and destroyed",
     "Mend the call that failed; where a default cannot serve, give values with --set", IsMade,
     Presets},
    {"C4", kOfAll, Level::kLaws, "leaves the process as it was",
     "Rounding, locale, signals, working folder, open files and threads belong to the host: put "
     "back "
     "what a library changes, and join threads in Destroy",
     LeavesTheProcessAlone},
    {"C5", kOfAll, Level::kExtremes,
     "works, or refuses with a sentence, at both ends of a parameter",
     "Narrow the declared range, or refuse the value in the factory with kInvalidArgument and a "
     "sentence (throw std::invalid_argument under CreatePlanner)",
     WorksAtTheEnds, EndsOfParameters},
    {"C6", kOfModels | kOfPlanners, Level::kExtremes,
     "works at observation and action sizes 1 to 64",
     "Take the sizes from the context, never from the first task it was tried on",
     WorksAtOtherSizes, OtherSizes},
    {"C7", kOfAll, Level::kSoak, "does not grow",
     "Something is kept for each call, episode or object: look for containers that are only added "
     "to",
     DoesNotGrow},
};

}  // namespace

View<const Law> ComponentLaws() { return ViewOf(kLaws); }

void Use(const Trial& trial, int calls) {
  switch (trial.component().kind) {
    case ComponentKind::kPlanner:
      return UsePlanner(trial, calls);
    case ComponentKind::kModel:
      return UseModel(trial, calls);
    case ComponentKind::kEnvironment:
      return UseEnvironment(trial, calls);
  }
}

}  // namespace dreamsearch::check
