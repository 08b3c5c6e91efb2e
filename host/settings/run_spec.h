// run_spec.h - a run with every value resolved: what passes between processes and is kept
// in run.json.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dreamsearch/parameter.h"
#include "host/plugins/description.h"

namespace dreamsearch {

enum class ValueOrigin : std::uint32_t {
  kDefault = 0,
  kPreset = 1,
  kFile = 2,
  kCommandLine = 3,
  kModel = 4,        // the preset of the model, for a value of the runner's own
  kEnvironment = 5,  // of the environment
};

const char* ValueOriginName(ValueOrigin origin);

struct ResolvedValue {
  std::string name;
  ParameterType type = ParameterType::kReal;
  double number = 0;   // kBool (0, 1), kInt, kReal
  std::string choice;  // what IsText; of a file its absolute path
  std::string sha256;  // of the file that a kPath names; else empty
  ValueOrigin origin = ValueOrigin::kDefault;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("name", &name);
    (*archive)("type", &type);
    (*archive)("number", &number);
    (*archive)("choice", &choice);
    (*archive)("sha256", &sha256);
    (*archive)("origin", &origin);
  }
};

// The shortest text that reads back as the same number; integers in full.
std::string NumberText(ParameterType type, double number);

// "12", "0.5", "true", "sample": reads back as the same value.
std::string ValueText(const ResolvedValue& value);

// Values in declared order. The names given to the getters must be declared.
struct ResolvedValues {
  std::vector<ResolvedValue> values;

  const ResolvedValue* Find(std::string_view name) const;
  double Number(std::string_view name) const;
  std::uint64_t Integer(std::string_view name) const;
  bool Flag(std::string_view name) const { return Number(name) != 0; }
  const std::string& Choice(std::string_view name) const;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("values", &values);
  }
};

struct ResolvedComponent {
  std::shared_ptr<const ComponentInfo> info;
  ResolvedValues parameters;
  // EnvironmentSpec::ingredients when the environment was probed for the run; empty: not probed,
  // or it has none.
  std::map<std::string, std::string> ingredients;

  const std::string& name() const { return info->name; }
  // Of an environment what it is called as a task: its name, or NAME:TEXT where it plays many
  // things.
  std::string task() const;
  bool Has(Trait trait) const { return info->Has(trait); }

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("info", &info);
    (*archive)("parameters", &parameters);
    archive->AddedLater("ingredients", &ingredients);
  }
};

// Which decisions of an evaluation the simulator judges (host/acting/root_ranking.h).
struct RankingSpec {
  std::uint64_t every = 0;       // decisions, the first of an episode among them; 0: none
  std::uint64_t decisions = 50;  // that a return counts

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("every", &every);
    (*archive)("decisions", &decisions);
  }
};

// What `runner eval` plays, instead of training.
struct EvaluationSpec {
  // The trained run; 0 and empty for a model that needs no training.
  std::int64_t parent_run_id = 0;
  std::string parent_uuid;
  std::uint64_t env_step = 0;       // environment steps of training in its checkpoint
  std::uint64_t episode_steps = 0;  // environment steps of an episode of the task
  std::string agent_sha256;         // of the trained model as saved there
  // The trained run's model, when it gives only proposal and value to the run's
  // own model: ModelContext::trained_model.
  std::optional<ResolvedComponent> trained_model;
  RankingSpec ranks;  // of a planner that searches; none of others

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("parent_run_id", &parent_run_id);
    (*archive)("parent_uuid", &parent_uuid);
    (*archive)("env_step", &env_step);
    (*archive)("episode_steps", &episode_steps);
    (*archive)("agent_sha256", &agent_sha256);
    (*archive)("behaviour", &trained_model);
    archive->AddedLater("ranks", &ranks);
  }
};

// One run, complete: it can be handed to another process as JSON.
struct RunSpec {
  std::string study;
  std::string preset;
  ResolvedComponent environment;
  ResolvedComponent model;
  ResolvedComponent planner;
  ResolvedComponent eval_planner;
  ResolvedValues run;  // the host's own parameters, see run_parameters.h
  std::uint64_t seed = 0;
  std::optional<EvaluationSpec> evaluation;  // not set: the run trains

  // Environment steps of the run, and environment steps a decision.
  std::uint64_t steps() const { return run.Integer("steps"); }
  // Actions kept of a search's improved policy; 0: searches are not kept.
  std::uint64_t search_candidates() const {
    return run.Flag("search_targets") ? run.Integer("search_candidates") : 0;
  }
  std::uint32_t action_repeat() const {
    return static_cast<std::uint32_t>(run.Integer("action_repeat"));
  }
  // Environment steps that its process makes, for progress: those of the training, or
  // of the episodes evaluated.
  std::uint64_t work_steps() const {
    return evaluation ? run.Integer("eval_episodes") * evaluation->episode_steps : steps();
  }

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("study", &study);
    (*archive)("preset", &preset);
    (*archive)("environment", &environment);
    (*archive)("model", &model);
    (*archive)("planner", &planner);
    (*archive)("eval_planner", &eval_planner);
    (*archive)("run", &run);
    (*archive)("seed", &seed);
    (*archive)("evaluation", &evaluation);
  }
};

// Its components, each plugin of which decides its results.
std::vector<const ResolvedComponent*> ComponentsOf(const RunSpec& spec);

// What decides the run's results beside its values: its plugins, the files that its settings
// name, and the environment's ingredients. Their SHA-256, or versions, by name.
std::map<std::string, std::string> DigestsOf(const RunSpec& spec);
// Which of them is not the one it was `then`, and how; empty if none.
std::string ChangedSince(const RunSpec& spec, const std::map<std::string, std::string>& then);
// Which of the files that are there now is not the one that the run names, and how; empty if
// none. Throws what Sha256HexOfFile throws.
std::string ChangedFile(const RunSpec& spec);
// How the environment's ingredients differ from what they were `then`; empty if they do not.
std::string IngredientChange(const ResolvedComponent& environment,
                             const std::map<std::string, std::string>& then);
// Takes the files that values name as they are now. Returns the first that changed, and how.
std::string DigestFilesAnew(ResolvedValues* values);

// What makes two runs the same configuration: every resolved value and the names
// of the components, keys sorted, no space; of an evaluation what decides its
// episodes. Not in it: study, seed, preset's name, versions of components and
// plugins, where a value came from, the content of files and ingredients (DigestsOf), a factor of
// variation that has its default, nor a run parameter that came later and has the value of before
// (LaterRunParameter).
std::string CanonicalJson(const RunSpec& spec);
std::string ConfigurationSha256(const RunSpec& spec);

// Throws Failure 65 unless the values are those of the parameters, each in its range. `where`
// begins the name of one in the message: "run.".
void CheckValues(const ResolvedValues& values, const std::vector<ParameterInfo>& parameters,
                 const std::string& where);

// Round trip; doubles keep every bit.
nlohmann::json ToJson(const RunSpec& spec);
RunSpec RunSpecFromJson(const nlohmann::json& json);  // kInternal when it is not one

// Resolved values as a factory gets them. Owns the texts; not movable, because
// what view() returns points into it.
class ParameterStorage {
 public:
  explicit ParameterStorage(const ResolvedValues& resolved);
  ParameterStorage(const ParameterStorage&) = delete;
  ParameterStorage& operator=(const ParameterStorage&) = delete;

  Parameters view() const { return {{values_.data(), values_.size()}}; }

 private:
  std::deque<std::string> texts_;
  std::vector<ParameterValue> values_;
};

}  // namespace dreamsearch
