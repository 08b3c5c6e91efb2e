// Over 400 lines: every rule of which setting wins reads the same targets.
#include "host/settings/settings.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "host/settings/named_file.h"
#include "host/settings/parameter_text.h"
#include "host/settings/run_parameters.h"
#include "results/system/error.h"
#include "results/text/names.h"

namespace dreamsearch {
namespace {

constexpr std::size_t kMostRuns = 100000;

// Of settings that reach one parameter the strongest stands.
constexpr int StrengthOf(bool from_file, bool specific) {
  return (from_file ? 0 : 2) + (specific ? 1 : 0);
}
constexpr int kSpecificOnCommandLine = StrengthOf(false, true);

ResolvedValue PresetOrDefault(const ParameterInfo& parameter, const std::string& preset) {
  ResolvedValue value;
  value.name = parameter.name;
  value.type = parameter.type;
  value.number = parameter.default_number + 0.0;
  value.choice = parameter.default_choice;
  for (const PresetInfo& info : parameter.presets) {
    if (info.preset != preset) continue;
    value.number = info.number + 0.0;
    value.choice = info.choice;
    value.origin = ValueOrigin::kPreset;
  }
  return value;
}

// Puts the recorded values where the declaration still has them.
void Restore(const ResolvedValues& recorded, ResolvedValues* values) {
  for (ResolvedValue& value : values->values) {
    const ResolvedValue* old = recorded.Find(value.name);
    if (old != nullptr && old->type == value.type) value = *old;
  }
}

std::string KindText(ComponentKind kind) {
  return kind == ComponentKind::kEnvironment ? "env" : ComponentKindName(kind);
}

std::optional<ComponentKind> KindFromText(std::string_view text) {
  if (text == "env" || text == "environment") return ComponentKind::kEnvironment;
  if (text == "model") return ComponentKind::kModel;
  if (text == "planner") return ComponentKind::kPlanner;
  return std::nullopt;
}

// Something that has parameters: a component of the command, or the host.
struct Target {
  std::shared_ptr<const ComponentInfo> info;  // null for the host's `run`
  const std::vector<ParameterInfo>* parameters = nullptr;
  std::string task;    // the TEXT of `--env NAME:TEXT`
  bool listed = true;  // false for an evaluation planner that is not in --planner
  ResolvedValues values;
  // The setting that gave each value, by parameter; the strongest so far.
  struct Source {
    int strength = -1;
    std::string where;
  };
  std::vector<Source> sources;

  std::string label() const {
    if (info == nullptr) return "run";
    return KindText(info->kind) + "/" + info->name + (task.empty() ? "" : ":" + task);
  }
  bool IsCalled(std::string_view name) const {
    return info != nullptr &&
           (info->name == name ||
            std::find(info->aliases.begin(), info->aliases.end(), name) != info->aliases.end());
  }
};

class Resolver {
 public:
  Resolver(const RunOptions& options, const Catalogue& catalogue, const RunSpec* base)
      : catalogue_(catalogue),
        preset_(options.preset),
        of_trained_run_(base != nullptr && options.evaluate) {
    for (const ParameterSpec& spec : RunParameters()) {
      run_parameters_.push_back(DescribeParameter(spec));
    }
    Add(nullptr, &run_parameters_, true);
    environments_ = AddAll(catalogue, ComponentKind::kEnvironment, "env", options.environments);
    planners_ = AddAll(catalogue, ComponentKind::kPlanner, "planner", options.planners);
    std::vector<std::string> models = options.models;
    if (models.empty()) models = {catalogue.DefaultModel(!options.evaluate)->name};
    models_ = AddAll(catalogue, ComponentKind::kModel, "model", models);
    if (!options.eval_planner.empty()) {
      const auto info = catalogue.Find(ComponentKind::kPlanner, options.eval_planner);
      for (const std::size_t i : planners_) {
        if (targets_[i].info == info) eval_planner_ = i;
      }
      if (!eval_planner_) eval_planner_ = Add(info, &info->parameters, false);
    }
    CheckPreset();
    for (Target& target : targets_) {
      for (const ParameterInfo& parameter : *target.parameters) {
        target.values.values.push_back(PresetOrDefault(parameter, preset_));
      }
      target.sources.resize(target.parameters->size());
      if (base != nullptr) RestoreFrom(*base, &target);
      if (!target.task.empty()) SetTask(&target);
    }
    for (const Setting& setting : options.settings) Apply(setting);
    for (const std::size_t environment : environments_) {
      for (const std::size_t model : models_) {
        runs_.push_back(base == nullptr ? RunOf(*targets_[model].info, *targets_[environment].info)
                                        : targets_[0].values);
        if (!options.evaluate) CheckRun(runs_.back());
      }
    }
  }

  std::vector<RunSpec> Matrix(const RunOptions& options) const {
    const std::size_t combinations = environments_.size() * planners_.size() * models_.size();
    if (options.seeds.size() > kMostRuns / combinations) {
      throw Failure(ExitCode::kUsage, "expected at most " + std::to_string(kMostRuns) +
                                          " runs, found " + std::to_string(combinations) +
                                          " combinations of " +
                                          std::to_string(options.seeds.size()) + " seeds");
    }
    std::vector<RunSpec> runs;
    // Seeds outermost: what is finished of a matrix is balanced at any moment.
    for (const std::uint64_t seed : options.seeds) {
      for (std::size_t i = 0; i < environments_.size(); ++i) {
        for (const std::size_t planner : planners_) {
          for (std::size_t j = 0; j < models_.size(); ++j) {
            RunSpec spec;
            spec.study = options.study;
            spec.preset = options.preset;
            spec.environment = Resolved(environments_[i]);
            spec.model = Resolved(models_[j]);
            spec.planner = Resolved(planner);
            spec.eval_planner = Resolved(eval_planner_.value_or(planner));
            spec.run = runs_[i * models_.size() + j];
            spec.seed = seed;
            if (!options.evaluate) CheckSearchTargets(spec);
            CheckGradients(spec);
            runs.push_back(std::move(spec));
          }
        }
      }
    }
    return runs;
  }

 private:
  static void RestoreFrom(const RunSpec& base, Target* target) {
    if (target->info == nullptr) return Restore(base.run, &target->values);
    // The planner last: of a planner that both trained and evaluated they are equal.
    for (const ResolvedComponent* component :
         {&base.environment, &base.model, &base.eval_planner, &base.planner}) {
      if (component->info->kind == target->info->kind && component->name() == target->info->name) {
        Restore(component->parameters, &target->values);
      }
    }
  }

  std::size_t Add(std::shared_ptr<const ComponentInfo> info,
                  const std::vector<ParameterInfo>* parameters, bool listed) {
    Target target;
    target.info = std::move(info);
    target.parameters = parameters;
    target.listed = listed;
    targets_.push_back(std::move(target));
    return targets_.size() - 1;
  }

  std::vector<std::size_t> AddAll(const Catalogue& catalogue, ComponentKind kind,
                                  const std::string& flag, const std::vector<std::string>& names) {
    std::vector<std::size_t> indices;
    for (const std::string& given : names) {
      const auto colon = kind == ComponentKind::kEnvironment ? given.find(':') : std::string::npos;
      const std::string name = given.substr(0, colon);
      const std::string task = colon == std::string::npos ? "" : given.substr(colon + 1);
      const auto info = catalogue.Find(kind, name);
      if (colon != std::string::npos && (info->task_parameter.empty() || !IsOneLine(task))) {
        throw Failure(ExitCode::kUsage, "--" + flag + ": '" + given + "': environment '" + name +
                                            "' is one task; expected its name alone");
      }
      for (const std::size_t i : indices) {
        if (targets_[i].info == info && targets_[i].task == task) {
          throw Failure(ExitCode::kUsage, "--" + flag + ": '" + name + "' and '" +
                                              targets_[i].info->name +
                                              "' are the same component; expected it once");
        }
      }
      indices.push_back(Add(info, &info->parameters, true));
      targets_.back().task = task;
    }
    return indices;
  }

  // As if the TEXT of `--env NAME:TEXT` were given by a setting that names the component.
  static void SetTask(Target* target) {
    for (std::size_t i = 0; i < target->parameters->size(); ++i) {
      if ((*target->parameters)[i].name != target->info->task_parameter) continue;
      target->values.values[i].choice = target->task;
      target->values.values[i].origin = ValueOrigin::kCommandLine;
      target->sources[i] = {kSpecificOnCommandLine, "--env"};
    }
  }

  ResolvedComponent Resolved(std::size_t i) const { return {targets_[i].info, targets_[i].values}; }

  void CheckPreset() const {
    std::set<std::string> known;
    for (const Target& target : targets_) {
      for (const ParameterInfo& parameter : *target.parameters) {
        for (const PresetInfo& preset : parameter.presets) known.insert(preset.preset);
      }
    }
    if (known.contains(preset_)) return;
    throw Failure(ExitCode::kUsage, "--preset: no preset '" + preset_ + "'. " +
                                        KnownNames(preset_, {known.begin(), known.end()}));
  }

  [[noreturn]] static void Fail(const Setting& setting, const std::string& message) {
    throw Failure(setting.from_file ? ExitCode::kBadInput : ExitCode::kUsage,
                  setting.where + ": " + setting.key + ": " + message);
  }

  // The targets a key's part before the dot names. *specific: it names one
  // component, not a kind.
  std::vector<Target*> Matching(const Setting& setting, const std::string& scope, bool* specific) {
    std::vector<Target*> matching;
    *specific = false;
    if (scope == "run") return {&targets_[0]};
    if (const auto kind = KindFromText(scope)) {
      for (Target& target : targets_) {
        if (target.info != nullptr && target.info->kind == *kind && target.listed) {
          matching.push_back(&target);
        }
      }
      return matching;
    }
    *specific = true;
    const auto slash = scope.find('/');
    const auto kind =
        slash == std::string::npos ? std::nullopt : KindFromText(scope.substr(0, slash));
    const std::string name = kind ? scope.substr(slash + 1) : scope;
    for (Target& target : targets_) {
      if (target.IsCalled(name) && (!kind || target.info->kind == *kind)) {
        matching.push_back(&target);
      }
    }
    if (!matching.empty()) return matching;
    std::vector<std::string> known = {"run", "env", "model", "planner"};
    for (const Target& target : targets_) {
      const bool seen = target.info == nullptr ||
                        std::find(known.begin(), known.end(), target.info->name) != known.end();
      if (!seen) known.push_back(target.info->name);
    }
    Fail(setting, "'" + scope + "' is no component of this command. " + KnownNames(scope, known));
  }

  void Apply(const Setting& setting) {
    const auto dot = setting.key.find('.');
    if (dot == std::string::npos || dot == 0 || dot + 1 == setting.key.size()) {
      Fail(setting, "expected a key such as planner.k, run.k or mcts_pw.k");
    }
    const std::string scope = setting.key.substr(0, dot);
    const std::string name = setting.key.substr(dot + 1);
    bool specific = false;
    std::vector<Target*> matching = Matching(setting, scope, &specific);

    std::vector<std::pair<Target*, std::size_t>> declaring;
    std::vector<std::string> known;
    for (Target* target : matching) {
      for (std::size_t i = 0; i < target->parameters->size(); ++i) {
        const std::string& parameter = (*target->parameters)[i].name;
        if (parameter == name) declaring.emplace_back(target, i);
        if (std::find(known.begin(), known.end(), parameter) == known.end()) {
          known.push_back(parameter);
        }
      }
    }
    if (declaring.empty()) {
      std::vector<std::string> labels;
      for (const Target* target : matching) labels.push_back(target->label());
      Fail(setting,
           "no parameter '" + name + "' in " + JoinNames(labels) + ". " + KnownNames(name, known));
    }
    const bool tasks_of_one = std::all_of(declaring.begin(), declaring.end(), [&](const auto& d) {
      return d.first->info != nullptr && d.first->info == declaring.front().first->info;
    });
    if (specific && declaring.size() > 1 && !tasks_of_one) {
      std::vector<std::string> keys;
      for (const auto& [target, i] : declaring) keys.push_back(target->label() + "." + name);
      Fail(setting, "names more than one component; expected one of " + JoinNames(keys));
    }
    for (const auto& [target, i] : declaring) Set(setting, specific, target, i);
  }

  void Set(const Setting& setting, bool specific, Target* target, std::size_t i) const {
    const ParameterInfo& parameter = (*target->parameters)[i];
    ResolvedValue value = target->values.values[i];
    const bool of_task = target->info && target->info->kind == ComponentKind::kEnvironment;
    if (of_trained_run_ && of_task && !parameter.variation) {
      Fail(setting,
           ExpectedVariation(*target->parameters) + ", because the trained run keeps its task");
    }
    if (!ParseValue(parameter, setting.value, &value)) {
      std::string message = Expectation(parameter) + ", found '" + Quotable(setting.value) + "'";
      const auto near = parameter.type == ParameterType::kChoice
                            ? NearestNames(setting.value, parameter.choices)
                            : std::vector<std::string>();
      if (!near.empty()) message += ". Did you mean " + near.front() + "?";
      Fail(setting, message);
    }
    Target::Source& source = target->sources[i];
    const int strength = StrengthOf(setting.from_file, specific);
    if (strength == source.strength) {
      Fail(setting, "set twice; it was set by " + source.where + " already");
    }
    if (strength < source.strength) return;
    source = {strength, setting.where + " (" + setting.key + ")"};
    value.origin = setting.from_file ? ValueOrigin::kFile : ValueOrigin::kCommandLine;
    if (parameter.type == ParameterType::kPath) TakeFile(parameter, setting, &value);
    target->values.values[i] = value;
  }

  // The runner's own values of runs with that model on that environment, whose wish is the
  // stronger one.
  ResolvedValues RunOf(const ComponentInfo& model, const ComponentInfo& environment) const {
    ResolvedValues run = targets_[0].values;
    Grant(model, ValueOrigin::kModel, &run);
    Grant(environment, ValueOrigin::kEnvironment, &run);
    return run;
  }

  void Grant(const ComponentInfo& component, ValueOrigin origin, ResolvedValues* run) const {
    for (const RunPresetInfo& wish : component.run_presets) {
      const auto refuse = [&](const std::string& message) {
        throw Failure(ExitCode::kPluginRefused,
                      "plugin " + component.plugin.path + ": " + ComponentKindName(component.kind) +
                          " '" + component.name + "' asks for run." + wish.name + " = " +
                          NumberText(ParameterType::kReal, wish.number) + ": " + message);
      };
      const auto parameter =
          std::find_if(run_parameters_.begin(), run_parameters_.end(),
                       [&](const ParameterInfo& info) { return info.name == wish.name; });
      if (parameter == run_parameters_.end()) {
        std::vector<std::string> known;
        for (const ParameterInfo& info : run_parameters_) known.push_back(info.name);
        refuse("no such parameter. " + KnownNames(wish.name, known));
      }
      ResolvedValue value;
      if (!ParseValue(*parameter, NumberText(ParameterType::kReal, wish.number), &value)) {
        refuse(Expectation(*parameter));
      }
      ResolvedValue& present =
          run->values[static_cast<std::size_t>(parameter - run_parameters_.begin())];
      if (wish.preset != preset_ || present.origin == ValueOrigin::kFile ||
          present.origin == ValueOrigin::kCommandLine) {
        continue;
      }
      present.number = value.number;
      present.origin = origin;
    }
  }

  // What no single range can say.
  static void CheckRun(const ResolvedValues& run) {
    const std::uint64_t steps = run.Integer("steps"), repeat = run.Integer("action_repeat");
    if (steps % repeat == 0) return;
    const bool from_file = run.Find("steps")->origin == ValueOrigin::kFile ||
                           (run.Find("steps")->origin != ValueOrigin::kCommandLine &&
                            run.Find("action_repeat")->origin == ValueOrigin::kFile);
    const std::uint64_t below = steps / repeat * repeat;
    throw Failure(from_file ? ExitCode::kBadInput : ExitCode::kUsage,
                  "--steps: expected a multiple of run.action_repeat = " + std::to_string(repeat) +
                      " such as " + std::to_string(below == 0 ? repeat : below) + ", found " +
                      std::to_string(steps));
  }

  // That who plans with the model's gradients has a model that gives them.
  void CheckGradients(const RunSpec& spec) const {
    if (spec.model.Has(kGivesGradients)) return;
    for (const ResolvedComponent* planner : {&spec.planner, &spec.eval_planner}) {
      if (!planner->Has(kNeedsGradients)) continue;
      throw Failure(ExitCode::kUsage,
                    "planner '" + planner->name() + "': expected a model that gives gradients of " +
                        "imagined returns, found '" + spec.model.name() + "'. Known: " +
                        JoinNames(catalogue_.NamesOf(ComponentKind::kModel, kGivesGradients)));
    }
  }

  // That those who are to teach and to learn from searches can.
  void CheckSearchTargets(const RunSpec& spec) const {
    const auto refuse = [](const std::string& message) {
      throw Failure(ExitCode::kUsage, message);
    };
    if (!spec.run.Flag("search_targets")) {
      if (spec.run.Number("reanalyse") > 0) {
        refuse(
            "run.reanalyse: expected run.search_targets=true beside it, found false; without "
            "search targets there is nothing to plan anew");
      }
      return;
    }
    const auto need = [&](const ResolvedComponent& component, Trait trait, const char* what) {
      if (component.Has(trait)) return;
      const ComponentKind kind = component.info->kind;
      refuse(std::string("run.search_targets: expected a ") + ComponentKindName(kind) + " that " +
             what + ", found '" + component.name() +
             "'. Known: " + JoinNames(catalogue_.NamesOf(kind, trait)));
    };
    need(spec.planner, kReportsPolicy, "reports its improved policy");
    need(spec.model, kLearnsFromSearch, "learns from searches");
    if (spec.run.Number("reanalyse") > 0 && spec.model.Has(kNeedsEnvironment)) {
      refuse("run.reanalyse: expected a model that needs no environment, found '" +
             spec.model.name() + "'; the states of its environment are not kept");
    }
  }

  const Catalogue& catalogue_;
  std::string preset_;
  bool of_trained_run_;
  std::vector<ParameterInfo> run_parameters_;
  std::deque<Target> targets_;  // the host's first; addresses stay
  std::vector<std::size_t> environments_, planners_, models_;
  std::optional<std::size_t> eval_planner_;
  std::vector<ResolvedValues> runs_;  // of each environment with each model
};

}  // namespace

std::vector<RunSpec> ResolveMatrix(const RunOptions& options, const Catalogue& catalogue,
                                   const RunSpec* base) {
  return Resolver(options, catalogue, base).Matrix(options);
}

ResolvedComponent Rebased(const ResolvedComponent& recorded, const std::string& preset,
                          const Catalogue& catalogue) {
  ResolvedComponent now{catalogue.Find(recorded.info->kind, recorded.name()), {}};
  for (const ParameterInfo& parameter : now.info->parameters) {
    now.parameters.values.push_back(PresetOrDefault(parameter, preset));
  }
  Restore(recorded.parameters, &now.parameters);
  return now;
}

void AddLaterRunParameters(ResolvedValues* run) {
  for (const ParameterSpec& spec : RunParameters()) {
    const auto* later = std::find_if(std::begin(kLaterRunParameters), std::end(kLaterRunParameters),
                                     [&](const auto& one) { return one.name == spec.name; });
    if (later == std::end(kLaterRunParameters) || run->Find(spec.name) != nullptr) continue;
    run->values.push_back(PresetOrDefault(DescribeParameter(spec), ""));
    run->values.back().number = later->before;
  }
}

}  // namespace dreamsearch
