// planner_latency.cc - how long a decision takes with the real networks, at the paper's
// sizes, against the bound of the machine it runs on.
//
//     tests/bin/planner_latency [--planner NAME[,NAME...]] [decisions]
//     tests/bin/planner_latency --tasks [decisions]
//     tests/bin/planner_latency --roots [decisions]
//
// Every planner decides on a latent of the Dreamer model (preset `paper`, sizes of
// walker_walk). Times are CPU time of the thread, the median over decisions; run it on
// one quiet core. The bounds are measured in the same process:
//   rollout and shooting  multiply-adds of the networks over the rate of a large
//                         product;
//   tree searches         bytes of the weights that one simulation after the other
//                         must read, over the rate at which an array of that size is
//                         summed. With leaf batches weights are read once a batch.
// Both are of float. The second table is with planning_precision=bfloat16, which has no
// bound here.
//
// --tasks: the paper's 20 tasks, each with its own observations and actions, against the
// time that two environment steps (action repeat 2) take in the simulated world.
//
// --roots: the tree searches from 1 root and from 64 that are planned together, as the search
// targets are made anew (host/training/reanalysis.h): time a node and their ratio.
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <numeric>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "dreamsearch/planning.h"
#include "host/acting/joint_model.h"
#include "tests/benchmark/yardstick.h"
#include "tests/plugins/planners/loaded_planner.h"
#include "tests/twenty_tasks.h"

namespace dreamsearch {
namespace {

constexpr std::uint64_t kObservations = 24, kActions = 6;

// Multiply-adds a row at the paper's sizes: deterministic latent and hidden layers
// 200, stochastic latent 30.
constexpr double kHidden = 200, kStochastic = 30, kInput = kHidden + kStochastic;
constexpr double kTransition = (kStochastic + kActions) * kHidden + 6 * kHidden * kHidden +
                               kHidden * kHidden + kHidden * 2 * kStochastic;
constexpr double kReward = kInput * kHidden + kHidden * kHidden + kHidden;
constexpr double kValue = kInput * kHidden + 2 * kHidden * kHidden + kHidden;
constexpr double kActor = kInput * kHidden + 3 * kHidden * kHidden + kHidden * 2 * kActions;

double Seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

template <typename F>
double MedianSeconds(int repetitions, F f) {
  std::vector<double> seconds;
  for (int i = 0; i < repetitions; ++i) {
    const double begin = Seconds();
    f();
    seconds.push_back(Seconds() - begin);
  }
  std::nth_element(seconds.begin(), seconds.begin() + repetitions / 2, seconds.end());
  return seconds[static_cast<std::size_t>(repetitions / 2)];
}

// Bytes a second of reading `bytes` over and over.
double StreamRate(double bytes) {
  // Sums of whole numbers, which any compiler adds a register at a time.
  const std::vector<std::uint64_t> weights(static_cast<std::size_t>(bytes / 8), 1);
  std::uint64_t sink = 0;
  const double seconds =
      MedianSeconds(201, [&] { sink = std::accumulate(weights.begin(), weights.end(), sink); });
  if (sink != 201 * weights.size()) std::puts("unexpected");
  return bytes / seconds;
}

// Counts what a search asks the model for.
class Counting final : public LatentModel {
 public:
  explicit Counting(LatentModel* model) : model_(model) {}
  std::uint64_t latent_bytes() const noexcept override { return model_->latent_bytes(); }
  std::uint64_t action_size() const noexcept override { return model_->action_size(); }
  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override {
    macs += static_cast<double>(request.latents.rows) * (kTransition + kReward);
    weights += kTransition + kReward;
    transitions += request.latents.rows;
    return model_->Imagine(request, result);
  }
  Status Value(ConstLatents latents, View<double> values) noexcept override {
    macs += static_cast<double>(latents.rows) * kValue;
    weights += kValue;
    return model_->Value(latents, values);
  }
  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override {
    macs += static_cast<double>(latents.rows) * kActor;
    weights += kActor;
    return model_->ProposeMode(latents, actions);
  }
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept override {
    macs += static_cast<double>(latents.rows) * kActor;
    weights += kActor;
    return model_->ProposeSamples(latents, seeds, actions);
  }

  double macs = 0;     // multiply-adds
  double weights = 0;  // weights read, once a call
  std::uint64_t transitions = 0;

 private:
  LatentModel* model_;
};

// The values of a preset, where the component declares one.
std::vector<ParameterValue> ResolvePreset(const ComponentDescriptor& component,
                                          const char* preset) {
  std::vector<ParameterValue> values = Resolve(component, {});
  for (std::size_t i = 0; i < values.size(); ++i) {
    const ParameterSpec& spec = component.parameters[i];
    for (std::uint32_t j = 0; j < spec.preset_count; ++j) {
      if (std::strcmp(spec.presets[j].preset, preset) != 0) continue;
      values[i].number = spec.presets[j].number;
      if (spec.presets[j].choice != nullptr) values[i].choice = spec.presets[j].choice;
    }
  }
  return values;
}

struct Row {
  const char* planner;
  const char* label;
  Settings settings;
};

// The model `dreamer` at the paper's sizes and a latent to decide on.
class Subject {
 public:
  Subject(const char* precision, std::uint64_t observation_size, std::uint64_t action_size) {
    const ComponentDescriptor& dreamer = LoadPlugin("model_dreamer").components[0];
    std::vector<ParameterValue> values = ResolvePreset(dreamer, "paper");
    for (ParameterValue& value : values) {
      if (std::strcmp(value.name, "planning_precision") == 0) value.choice = precision;
    }
    ModelContext context;
    context.parameters = {{values.data(), values.size()}};
    context.observation_size = observation_size;
    context.action_size = action_size;
    context.action_repeat = 2;
    context.episode_decisions = 500;
    context.seed = 1;
    Check(dreamer.create_model(context, &model_));
    latents_ = LatentBuffer(2, model_->latent_bytes());
    std::vector<double> observation(observation_size, 0.1), action(action_size);
    Check(model_->InitialLatent(latents_.row(0)));
    const std::uint64_t seed = 0;
    Check(model_->Observe({.previous = latents_.row(0),
                           .actions = {action.data(), 1, action_size},
                           .observations = {observation.data(), 1, observation_size},
                           .seeds = {&seed, 1}},
                          latents_.row(1)));
  }
  Subject(const Subject&) = delete;
  Subject& operator=(const Subject&) = delete;
  ~Subject() { model_->Destroy(); }

  static void Check(const Status& status) {
    if (status.ok()) return;
    std::fprintf(stderr, "%s\n", status.message);
    std::exit(70);
  }
  Model* model() { return model_; }
  Latents root() { return latents_.row(1); }

 private:
  Model* model_ = nullptr;
  LatentBuffer latents_;
};

struct Measured {
  double seconds = 0;  // median of a decision
  double macs = 0;     // of a decision
  double weights = 0;
  std::uint64_t transitions = 0;
  std::uint32_t nodes = 0;
};

Measured Measure(Subject* subject, const Row& row, int decisions) {
  Counting counting(subject->model());
  LoadedPlanner planner(row.planner, &counting, row.settings);
  PlanOptions options{.tree = false};
  const Decision first = planner.Plan(subject->root(), options);
  Subject::Check(first.status);
  const bool slow = counting.transitions > 5000;
  counting = Counting(subject->model());
  const int repetitions = slow ? std::max(3, decisions / 20) : decisions;
  Measured measured;
  measured.seconds = MedianSeconds(repetitions, [&] {
    ++options.seed;
    Subject::Check(planner.Plan(subject->root(), options).status);
  });
  measured.macs = counting.macs / repetitions;
  measured.weights = counting.weights / repetitions;
  measured.transitions = counting.transitions / static_cast<std::uint64_t>(repetitions);
  measured.nodes = first.result.nodes;
  return measured;
}

// The planners named in `only`; all if it is empty.
void Run(const std::vector<std::string>& only, int decisions) {
  const double product_rate = MachineLimit() / 2;  // multiply-adds a second
  const double stream_rate = StreamRate(4 * (kTransition + kReward + kValue + kActor));
  std::printf("products %.1f GFLOP/s, weights %.1f GB/s, one thread\n", 2e-9 * product_rate,
              1e-9 * stream_rate);
  std::vector<Row> rows = {
      {"dreamer", "dreamer", {}},
      {"rollout", "rollout", {}},
      {"mcts_pw", "mcts_pw", {}},
      {"mcts_pw", "mcts_pw leaf_batch=8", {{"leaf_batch", 8}}},
      {"mcts_fixed", "mcts_fixed", {}},
      {"mcts_fixed", "mcts_fixed leaf_batch=8", {{"leaf_batch", 8}}},
      {"mcts_gumbel", "mcts_gumbel", {}},
      {"mcts_gumbel", "mcts_gumbel leaf_batch=8", {{"leaf_batch", 8}}},
      {"hoot", "hoot", {}},
      {"mppi", "mppi", {}},
      {"random_shooting", "random_shooting", {}},
      {"cem", "cem", {}},
      {"icem", "icem", {}},
  };
  for (const std::string& name : only) {
    if (std::none_of(rows.begin(), rows.end(), [&](const Row& r) { return r.planner == name; })) {
      std::fprintf(stderr, "no planner '%s' here\n", name.c_str());
      std::exit(64);
    }
  }
  std::erase_if(rows, [&](const Row& row) {
    return !only.empty() && std::find(only.begin(), only.end(), row.planner) == only.end();
  });
  std::printf("%-28s %10s %10s %8s %12s %8s\n", "float", "median ms", "bound ms", "ratio",
              "transitions", "nodes");
  Subject in_float("float", kObservations, kActions);
  for (const Row& row : rows) {
    const Measured m = Measure(&in_float, row, decisions);
    // The larger of the two: no search can be faster than either.
    const double bound = std::max(m.macs / product_rate, 4 * m.weights / stream_rate);
    std::printf("%-28s %10.3f %10.3f %8.2f %12llu %8u\n", row.label, 1e3 * m.seconds, 1e3 * bound,
                m.seconds / bound, static_cast<unsigned long long>(m.transitions), m.nodes);
  }
  std::printf("%-28s %10s\n", "bfloat16", "median ms");
  Subject in_bfloat16("bfloat16", kObservations, kActions);
  for (const Row& row : rows) {
    const Measured m = Measure(&in_bfloat16, row, decisions);
    std::printf("%-28s %10.3f\n", row.label, 1e3 * m.seconds);
  }
}

void RunTasks(int decisions) {
  const std::vector<const char*> planners = {"dreamer",    "rollout",     "mcts_pw",
                                             "mcts_fixed", "mcts_gumbel", "hoot"};
  std::printf("median ms of a decision, planning_precision=bfloat16\n%-24s %9s %3s %3s", "task",
              "interval", "O", "A");
  for (const char* planner : planners) std::printf(" %11s", planner);
  std::printf("\n");
  for (const ComponentDescriptor& task : LoadPlugin("env_dmc").components) {
    const auto same = [&](const char* name) { return std::strcmp(name, task.name) == 0; };
    if (std::none_of(std::begin(kTwentyTasks), std::end(kTwentyTasks), same)) continue;
    const std::vector<ParameterValue> values = Resolve(task, {});
    EnvironmentContext context;
    context.parameters = {{values.data(), values.size()}};
    Environment* environment = nullptr;
    Subject::Check(task.create_environment(context, &environment));
    const EnvironmentSpec& spec = environment->spec();
    const double interval = 2e3 * spec.control_seconds;
    Subject subject("bfloat16", spec.observation_size, spec.action_size);
    std::printf("%-24s %9.0f %3d %3d", task.name, interval, static_cast<int>(spec.observation_size),
                static_cast<int>(spec.action_size));
    for (const char* planner : planners) {
      const double ms = 1e3 * Measure(&subject, {planner, planner, {}}, decisions).seconds;
      std::printf(" %10.3f%c", ms, ms > interval ? '!' : ' ');
    }
    std::printf("\n");
    environment->Destroy();
  }
}

// Seconds a node with that many roots, which differ, planned together; the median.
double SecondsANode(Subject* subject, const char* name, std::size_t roots, int decisions) {
  JointModel joint(subject->model(), roots);
  std::vector<std::unique_ptr<LoadedPlanner>> planners;
  LatentBuffer latents(roots, subject->model()->latent_bytes());
  std::vector<double> observation(kObservations), action(kActions);
  for (std::size_t i = 0; i < roots; ++i) {
    planners.push_back(std::make_unique<LoadedPlanner>(name, joint.seat(i)));
    std::fill(observation.begin(), observation.end(), 0.01 * static_cast<double>(i));
    const std::uint64_t seed = i;
    Subject::Check(
        subject->model()->Observe({.previous = subject->root(),
                                   .actions = {action.data(), 1, kActions},
                                   .observations = {observation.data(), 1, kObservations},
                                   .seeds = {&seed, 1}},
                                  latents.row(i)));
  }
  std::vector<std::optional<Decision>> made(roots);
  PlanOptions options{.explore = true, .tree = false, .policy = 8};
  const auto plan = [&] {
    ++options.seed;
    joint.Run([&](std::size_t i) { made[i].emplace(planners[i]->Plan(latents.row(i), options)); });
  };
  plan();
  double nodes = 0;
  for (const std::optional<Decision>& decision : made) {
    Subject::Check(decision->status);
    nodes += decision->result.nodes;
  }
  return MedianSeconds(decisions, plan) / nodes;
}

void RunRoots(int decisions) {
  std::printf("%-12s %-9s %16s %16s %8s\n", "us a node", "", "1 root", "64 roots", "ratio");
  for (const char* precision : {"float", "bfloat16"}) {
    Subject subject(precision, kObservations, kActions);
    for (const char* planner : {"mcts_pw", "mcts_fixed", "mcts_gumbel", "hoot"}) {
      const double one = SecondsANode(&subject, planner, 1, 8 * decisions);
      const double many = SecondsANode(&subject, planner, 64, decisions);
      std::printf("%-12s %-9s %16.1f %16.1f %8.2f\n", planner, precision, 1e6 * one, 1e6 * many,
                  many / one);
    }
  }
}

}  // namespace
}  // namespace dreamsearch

int main(int argc, char** argv) {
  dreamsearch::LibraryProducts(argv);
  std::vector<std::string> arguments(argv + 1, argv + argc);
  bool tasks = false, roots = false;
  std::vector<std::string> only;
  if (!arguments.empty() && (arguments[0] == "--tasks" || arguments[0] == "--roots")) {
    tasks = arguments[0] == "--tasks";
    roots = !tasks;
    arguments.erase(arguments.begin());
  } else if (arguments.size() > 1 && arguments[0] == "--planner") {
    std::istringstream names(arguments[1]);
    for (std::string name; std::getline(names, name, ',');) only.push_back(name);
    arguments.erase(arguments.begin(), arguments.begin() + 2);
  }
  const int decisions =
      arguments.empty() ? (tasks || roots ? 20 : 100) : std::atoi(arguments[0].c_str());
  if (decisions < 1 || arguments.size() > 1) {
    std::fprintf(stderr,
                 "usage: planner_latency [--tasks | --roots | --planner NAME[,NAME...]] "
                 "[decisions]\n");
    return 64;
  }
  if (tasks) {
    dreamsearch::RunTasks(decisions);
  } else if (roots) {
    dreamsearch::RunRoots(decisions);
  } else {
    dreamsearch::Run(only, decisions);
  }
  return 0;
}
