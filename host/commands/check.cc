// runner check FILE.so|[KIND/]NAME - does a plugin keep the laws of the interfaces?
//
// The supervisor loads no plugin: a child process does (`check-component`), and puts every case
// into a process of its own. It tells each outcome as a line of JSON on descriptor 3. Over 400
// lines: both ends of that pipe stand here, and what is printed of it.
#include "dreamsearch/check/check.h"

#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include "host/acting/activity_clock.h"
#include "host/commands/commands.h"
#include "host/commands/own_folder.h"
#include "host/flags/flags.h"
#include "host/plugins/catalogue.h"
#include "host/plugins/plugin_loader.h"
#include "host/processes/child_process.h"
#include "host/settings/named_file.h"
#include "host/settings/parameter_text.h"
#include "results/system/child.h"
#include "results/system/error.h"
#include "results/text/json_fields.h"
#include "results/text/json_text.h"
#include "results/text/names.h"
#include "results/text/table.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr std::size_t kReportWidth = 100;

// What the child is asked for.
struct CheckRequest {
  std::string path;
  ComponentKind kind = ComponentKind::kPlanner;
  std::string name;
  std::vector<ResolvedValue> values;
  check::Level level = check::Level::kExtremes;
  std::vector<std::string> laws;
  double case_seconds = 0;
  std::uint64_t memory_bytes = 0;
  bool exact_rows = false;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("path", &path);
    (*archive)("kind", &kind);
    (*archive)("name", &name);
    (*archive)("values", &values);
    (*archive)("level", &level);
    (*archive)("laws", &laws);
    (*archive)("case_seconds", &case_seconds);
    (*archive)("memory_bytes", &memory_bytes);
    (*archive)("exact_rows", &exact_rows);
  }
};

// An outcome on its way from the child.
struct OutcomeMessage : check::Outcome {
  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("law", &law);
    (*archive)("title", &title);
    (*archive)("of", &of);
    (*archive)("verdict", &verdict);
    (*archive)("expected", &expected);
    (*archive)("found", &found);
    (*archive)("advice", &advice);
    (*archive)("seconds", &seconds);
  }
};

// An outcome as `--json` prints it.
nlohmann::json JsonOf(const check::Outcome& outcome) {
  return {{"law", outcome.law},
          {"title", outcome.title},
          {"case", outcome.of},
          {"verdict", check::VerdictName(outcome.verdict)},
          {"expected", outcome.expected},
          {"found", outcome.found},
          {"advice", outcome.good() ? "" : outcome.advice},
          {"seconds", outcome.seconds}};
}

void CheckHere(const CheckRequest& request, bool in_this_process,
               const std::function<void(const check::Outcome&)>& observer) {
  const double begin = ActivityClock::Now();
  const PluginDescriptor& plugin = LoadPlugin(request.path);
  const check::Outcome loaded = check::LoadOutcome(ActivityClock::Now() - begin);
  if (request.laws.empty() ||
      std::find(request.laws.begin(), request.laws.end(), loaded.law) != request.laws.end()) {
    observer(loaded);
  }
  check::Subject subject;
  subject.component = &FindComponent(plugin, request.kind, request.name);
  subject.exact_rows = request.exact_rows;
  for (const ResolvedValue& value : request.values) {
    subject.settings.push_back({value.name, value.number, value.choice});
  }
  check::Options options;
  options.level = request.level;
  options.only = request.laws;
  options.case_seconds = request.case_seconds;
  options.memory_bytes = request.memory_bytes;
  options.in_this_process = in_this_process;
  options.observer = observer;
  check::Check(subject, options);
}

// The library that counts allocations, in front of the child's. Not under a sanitizer, which has
// to be first, nor where something else is preloaded.
class PreloadedCounter {
 public:
  PreloadedCounter() {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    std::error_code error;
    const std::filesystem::path library = OwnFolder() / "libdreamsearch_allocations.so";
    if (std::getenv(kVariable) != nullptr || !std::filesystem::exists(library, error)) return;
    ::setenv(kVariable, library.c_str(), 1);
    set_ = true;
#endif
  }
  ~PreloadedCounter() {
    if (set_) ::unsetenv(kVariable);
  }
  PreloadedCounter(const PreloadedCounter&) = delete;
  PreloadedCounter& operator=(const PreloadedCounter&) = delete;

 private:
  static constexpr char kVariable[] = "LD_PRELOAD";
  bool set_ = false;
};

// Asks a child and tells `observer` each outcome as it comes. Throws Failure with the child's
// message if the plugin cannot be loaded, 71 if the child ended otherwise.
void CheckInChild(const CheckRequest& request,
                  const std::function<void(const check::Outcome&)>& observer) {
  Pipe pipe = MakePipe();
  const FileDescriptor input = MemoryFile(results::JsonText(results::FieldsToJson(request)));
  ChildSpec child;
  child.arguments = {"check-component"};
  child.input = input.get();
  child.report = pipe.write.get();
  const pid_t pid = [&] {
    const PreloadedCounter counter;
    return StartChild(child);
  }();
  pipe.write.Close();
  std::string text;
  bool done = false;
  for (bool open = true; open;) {
    pollfd polled{pipe.read.get(), POLLIN, 0};
    ::poll(&polled, 1, -1);
    char buffer[65536];
    const ssize_t got = ::read(pipe.read.get(), buffer, sizeof buffer);
    if (got > 0) text.append(buffer, static_cast<std::size_t>(got));
    open = got > 0 || (got < 0 && (errno == EAGAIN || errno == EINTR));
    std::size_t begin = 0;
    for (std::size_t end; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1) {
      const nlohmann::json line = results::ParseJson(text.substr(begin, end - begin));
      if (line.contains("error")) {
        WaitForEnd(pid);
        throw Failure(static_cast<ExitCode>(line.at("code").get<int>()), line.at("error"));
      }
      if (line.contains("done")) {
        done = true;
      } else {
        observer(results::FieldsFromJson<OutcomeMessage>(line));
      }
    }
    text.erase(0, begin);
  }
  const int status = WaitForEnd(pid);
  if (!done) {
    throw Failure(ExitCode::kPluginCrashed, "plugin " + request.path +
                                                ": the process that checks it ended with " +
                                                DescribeWaitStatus(status));
  }
}

// What came of one component.
struct Report {
  std::shared_ptr<const ComponentInfo> component;
  std::vector<check::Outcome> outcomes;
  double seconds = 0;

  std::uint64_t Count(check::Verdict verdict) const {
    std::map<std::string, check::Verdict> laws;  // the worst of each law's cases
    for (const check::Outcome& outcome : outcomes) {
      check::Verdict& worst = laws.emplace(outcome.law, outcome.verdict).first->second;
      if (!outcome.good() || worst == check::Verdict::kSkipped) {
        worst =
            std::max(worst == check::Verdict::kSkipped ? outcome.verdict : worst, outcome.verdict);
      }
    }
    return static_cast<std::uint64_t>(std::count_if(
        laws.begin(), laws.end(), [verdict](const auto& law) { return law.second == verdict; }));
  }
};

// Prints the outcomes of one law after the other, each when its last case is known.
class Printer {
 public:
  void Add(const check::Outcome& outcome) {
    if (!outcomes_.empty() && outcomes_.front().law != outcome.law) Flush();
    outcomes_.push_back(outcome);
  }
  void Flush() {
    if (outcomes_.empty()) return;
    const auto bad = std::find_if(outcomes_.begin(), outcomes_.end(),
                                  [](const check::Outcome& outcome) { return !outcome.good(); });
    const check::Outcome& shown = bad == outcomes_.end() ? outcomes_.front() : *bad;
    std::string verdict = check::VerdictName(shown.verdict);
    if (bad != outcomes_.end()) {
      std::transform(verdict.begin(), verdict.end(), verdict.begin(), ::toupper);
    }
    std::cout << "  " << shown.law
              << std::string(6 - std::min<std::size_t>(5, shown.law.size()), ' ') << verdict
              << std::string(11 - std::min<std::size_t>(10, verdict.size()), ' ') << shown.title;
    if (outcomes_.size() > 1) std::cout << " (" << Counted(outcomes_.size(), "case") << ")";
    std::cout << '\n';
    std::map<std::string, std::vector<std::string>> remarks;  // cases by what was remarked
    std::vector<Fault> faults;
    for (const check::Outcome& outcome : outcomes_) {
      if (!outcome.good()) {
        const auto same = std::find_if(faults.begin(), faults.end(), [&](const Fault& fault) {
          return fault.expected == outcome.expected && fault.found == outcome.found;
        });
        if (same != faults.end()) {
          same->cases += "; " + outcome.of;
        } else {
          faults.push_back({outcome.expected, outcome.found, outcome.of});
        }
      } else if (!outcome.found.empty()) {
        remarks[outcome.found].push_back(outcome.of);
      }
    }
    for (const Fault& fault : faults) {
      if (!fault.cases.empty()) Line("case", fault.cases);
      Line("expected", fault.expected);
      Line("found", fault.found);
    }
    if (bad != outcomes_.end()) Line("to do", bad->advice);
    for (const auto& [remark, cases] : remarks) {
      Line("note", (cases.front().empty() ? "" : JoinNames(cases) + ": ") + remark);
    }
    std::cout << std::flush;
    outcomes_.clear();
  }

 private:
  // What several cases have in common is printed once.
  struct Fault {
    std::string expected, found, cases;
  };

  static void Line(const std::string& name, const std::string& text) {
    constexpr std::size_t kIndent = 30;
    std::string wrapped = WrapText(Printable(text), kReportWidth - kIndent, kIndent);
    const std::string head = std::string(19, ' ') + name;
    wrapped.replace(0, std::min(head.size(), kIndent - 1), head);
    std::cout << wrapped << '\n';
  }

  std::vector<check::Outcome> outcomes_;
};

int ExitStatus(const std::vector<Report>& reports) {
  for (const Report& report : reports) {
    for (const check::Outcome& outcome : report.outcomes) {
      if (outcome.good()) continue;
      return static_cast<int>(outcome.verdict == check::Verdict::kBroken
                                  ? ExitCode::kVerificationFailed
                                  : ExitCode::kPluginCrashed);
    }
  }
  return static_cast<int>(ExitCode::kOk);
}

struct CheckPlugin {
  std::string what;
  std::vector<Setting> settings;
  check::Level level = check::Level::kExtremes;
  std::vector<std::string> laws;
  double case_seconds = 20;
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
  bool exact_rows = false;
  bool in_process = false;
  bool json = false;
  bool list_laws = false;
  std::vector<std::string> plugin_path;

  CommandSpec Declare() {
    const Choices<check::Level> levels = {{"describe", check::Level::kDescribe},
                                          {"make", check::Level::kMake},
                                          {"laws", check::Level::kLaws},
                                          {"extremes", check::Level::kExtremes},
                                          {"soak", check::Level::kSoak}};
    return {
        .name = "runner check",
        .summary = "puts a plugin through the laws of the interfaces",
        .examples = {"runner check build/my_planner.so", "runner check mcts_pw --level soak",
                     "runner check my_model.so --set my_model.units=64 --law M8 --json"},
        .about =
            "Every law has a number; sdk/README.md gives the reason for each. Each case of a law "
            "runs in a process of its own, so that a component which crashes, hangs or fills "
            "memory costs that case alone.\n"
            "The exit status is 0 if every law is kept, 78 if the first fault is a broken law, 71 "
            "if it is a crash, a hang or too much memory, and that of the refusal (66, 69 or 71) "
            "if the plugin cannot be loaded.",
        .arguments = {{"", "FILE.so|[KIND/]NAME", Text(&what),
                       "a plugin's file, or a component from `runner list`"}},
        .groups = {
            {"What to check",
             {{"level", "LEVEL", OneOf(&level, levels),
               "how far to go; each level holds those before it"},
              {"law", "NUMBER", ListOf(&laws), "check these laws alone: P5, or P5,P6"},
              SetFlag(&settings),
              {"exact-rows", "", Switch(&exact_rows),
               "a model's answer may not depend on the number of rows, to the bit; without it to "
               "five digits"},
              {"list", "", Switch(&list_laws), "list the laws and check nothing"}}},
            {"How",
             {{"case-limit", "TIME", Duration(&case_seconds).Default("20 s"),
               "wall time for one case"},
              {"memory-limit", "SIZE", Size(&memory_bytes).Default("1G"),
               "memory that one case may take"},
              {"in-process", "", Switch(&in_process),
               "check in this process, without limits: for `gdb --args runner check ...`"},
              {"json", "", Switch(&json), "print one JSON object"}}},
            {"Where", {PluginPathFlag(&plugin_path)}}}};
  }
  int Run();

 private:
  std::vector<std::shared_ptr<const ComponentInfo>> Components() const;
  std::vector<ResolvedValue> ValuesOf(const ComponentInfo& component,
                                      std::vector<bool>* used) const;
  void PrintLaws() const;
};

std::vector<std::shared_ptr<const ComponentInfo>> CheckPlugin::Components() const {
  std::vector<std::shared_ptr<const ComponentInfo>> found;
  const bool is_file = what.ends_with(".so") || what[0] == '/' || what[0] == '.' ||
                       std::filesystem::is_regular_file(what);
  if (std::filesystem::is_directory(what)) {
    throw Failure(ExitCode::kNotFound,
                  "runner check: expected a plugin's file or the name of a component, found " +
                      what + ", a folder. For example: runner check " +
                      (std::filesystem::path(what) / "my_planner.so").string());
  }
  if (!is_file) {
    const Catalogue catalogue = ScanPlugins(plugin_path);
    found = ComponentsNamed(catalogue, "runner check", what);
    if (!found.empty()) return found;
    for (const auto& component : catalogue.components()) {
      if (component->plugin.name == what) found.push_back(component);
    }
    if (!found.empty()) return found;
    std::vector<std::string> known;
    for (const auto& component : catalogue.components()) known.push_back(component->name);
    throw Failure(ExitCode::kNotFound,
                  "runner check: no component '" + what + "'. " + KnownNames(what, known));
  }
  const PluginDescription description =
      DescribeInChild(std::filesystem::absolute(what).lexically_normal().string(), {});
  if (description.refused) throw Failure(description.refusal.code, description.refusal.message);
  for (const ComponentInfo& component : description.components) {
    found.push_back(std::make_shared<const ComponentInfo>(component));
  }
  return found;
}

// The values of --set that are this component's.
std::vector<ResolvedValue> CheckPlugin::ValuesOf(const ComponentInfo& component,
                                                 std::vector<bool>* used) const {
  std::vector<ResolvedValue> values;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const Setting& setting = settings[i];
    const auto dot = setting.key.find('.');
    const std::string of = setting.key.substr(0, dot), name = setting.key.substr(dot + 1);
    const bool meant = of == component.name || of == ComponentKindName(component.kind) ||
                       (of == "env" && component.kind == ComponentKind::kEnvironment) ||
                       std::find(component.aliases.begin(), component.aliases.end(), of) !=
                           component.aliases.end();
    if (!meant) continue;
    const auto parameter =
        std::find_if(component.parameters.begin(), component.parameters.end(),
                     [&](const ParameterInfo& declared) { return declared.name == name; });
    if (parameter == component.parameters.end()) {
      std::vector<std::string> known;
      for (const ParameterInfo& declared : component.parameters) known.push_back(declared.name);
      throw Failure(ExitCode::kUsage, setting.where + ": " + component.name +
                                          " has no parameter '" + name + "'. " +
                                          KnownNames(name, known));
    }
    ResolvedValue value;
    value.name = name;
    value.type = parameter->type;
    if (!ParseValue(*parameter, setting.value, &value)) {
      throw Failure(ExitCode::kUsage, setting.where + ": " + setting.key + ": " +
                                          Expectation(*parameter) + ", found '" +
                                          Quotable(setting.value) + "'");
    }
    if (parameter->type == ParameterType::kPath) TakeFile(*parameter, setting, &value);
    (*used)[i] = true;
    values.push_back(value);
  }
  return values;
}

void CheckPlugin::PrintLaws() const {
  if (json) {
    nlohmann::json list = nlohmann::json::array();
    for (const check::LawInfo& law : check::AllLaws()) {
      list.push_back({{"law", law.number},
                      {"kind", law.kinds},
                      {"level", check::LevelName(law.level)},
                      {"title", law.title},
                      {"advice", law.advice}});
    }
    std::cout << list.dump(2) << '\n';
    return;
  }
  results::Table table = {{"LAW", "OF", "LEVEL", "WHAT MUST HOLD"}, {}};
  for (const check::LawInfo& law : check::AllLaws()) {
    table.rows.push_back(
        {law.number, law.kinds, std::string(check::LevelName(law.level)), law.title});
  }
  std::cout << table.Print(results::TableForm::kText);
}

int CheckPlugin::Run() {
  if (list_laws) {
    PrintLaws();
    return 0;
  }
  if (what.empty()) {
    throw Failure(ExitCode::kUsage,
                  "runner check: expected a plugin's file or the name of a component. For "
                  "example: runner check build/my_planner.so");
  }
  std::vector<std::string> known;
  for (const check::LawInfo& law : check::AllLaws()) known.push_back(law.number);
  for (const std::string& law : laws) {
    if (std::find(known.begin(), known.end(), law) != known.end()) continue;
    throw Failure(ExitCode::kUsage,
                  "runner check: --law: no law '" + law + "'. Known: " + JoinNames(known));
  }
  const std::vector<std::shared_ptr<const ComponentInfo>> components = Components();
  std::vector<bool> used(settings.size(), false);
  std::vector<CheckRequest> requests;
  for (const auto& component : components) {
    CheckRequest request;
    request.path = component->plugin.path;
    request.kind = component->kind;
    request.name = component->name;
    request.values = ValuesOf(*component, &used);
    request.level = level;
    request.laws = laws;
    request.case_seconds = case_seconds;
    request.memory_bytes = memory_bytes;
    request.exact_rows = exact_rows;
    requests.push_back(request);
  }
  for (std::size_t i = 0; i < settings.size(); ++i) {
    if (used[i]) continue;
    throw Failure(ExitCode::kUsage, settings[i].where +
                                        ": no component that is checked is called '" +
                                        settings[i].key.substr(0, settings[i].key.find('.')) + "'");
  }

  std::vector<Report> reports;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    Report report{.component = components[i]};
    const ComponentInfo& component = *components[i];
    if (!json) {
      std::cout << (i == 0 ? "" : "\n") << ComponentKindName(component.kind) << ' '
                << component.name << ' ' << component.version << " (" << component.plugin.path
                << ")\n";
    }
    Printer printer;
    const auto observer = [&](const check::Outcome& outcome) {
      report.outcomes.push_back(outcome);
      if (!json) printer.Add(outcome);
    };
    const double begin = ActivityClock::Now();
    if (in_process) {
      CheckHere(requests[i], true, observer);
    } else {
      CheckInChild(requests[i], observer);
    }
    report.seconds = ActivityClock::Now() - begin;
    if (!json) {
      printer.Flush();
      std::uint64_t bad = 0;
      for (const check::Verdict verdict : {check::Verdict::kBroken, check::Verdict::kCrashed,
                                           check::Verdict::kTimedOut, check::Verdict::kTooLarge}) {
        bad += report.Count(verdict);
      }
      std::cout << component.name << ": " << Counted(report.Count(check::Verdict::kKept), "law")
                << " kept, " << bad << " not kept, " << report.Count(check::Verdict::kSkipped)
                << " skipped, in " << FormatNumber("%.1f", report.seconds) << " s\n";
    }
    reports.push_back(std::move(report));
  }
  if (json) {
    nlohmann::json out = {{"exit_status", ExitStatus(reports)},
                          {"components", nlohmann::json::array()}};
    for (const Report& report : reports) {
      nlohmann::json outcomes = nlohmann::json::array();
      for (const check::Outcome& outcome : report.outcomes) outcomes.push_back(JsonOf(outcome));
      out["components"].push_back({{"kind", ComponentKindName(report.component->kind)},
                                   {"name", report.component->name},
                                   {"version", report.component->version},
                                   {"file", report.component->plugin.path},
                                   {"sha256", report.component->plugin.sha256},
                                   {"seconds", report.seconds},
                                   {"outcomes", outcomes}});
    }
    std::cout << results::JsonTextReplacing(out) << '\n';
  }
  return ExitStatus(reports);
}

}  // namespace

int CheckComponentMain() {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  const auto say = [](const nlohmann::json& line) {
    WriteAll(kReportDescriptor, results::JsonTextReplacing(line) + "\n");
  };
  try {
    const auto request = results::FieldsFromJson<CheckRequest>(results::ParseJson(ReadAll(0)));
    CheckHere(request, false, [&](const check::Outcome& outcome) {
      say(results::FieldsToJson(OutcomeMessage{outcome}));
    });
    say({{"done", true}});
    return 0;
  } catch (const Failure& error) {
    say({{"error", error.what()}, {"code", error.exit_status()}});
  } catch (const std::exception& error) {
    say({{"error",
          std::string("runner check-component is started by `runner check`: ") + error.what()},
         {"code", static_cast<int>(ExitCode::kInternal)}});
  }
  return static_cast<int>(ExitCode::kInternal);
}

Command CheckCommand() { return MakeCommand<CheckPlugin>(); }

}  // namespace dreamsearch
