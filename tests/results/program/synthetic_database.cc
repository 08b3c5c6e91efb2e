// synthetic_database - writes a database of made-up runs, for timings and pictures.
//
//   synthetic_database FILE TASKS PLANNERS SEEDS STEPS [decisions]
//
// The first so many of the suite's twenty tasks, four planners and seeds, each run
// of STEPS environment steps: training episodes, evaluations every
// min(10,000, STEPS / 10) steps, scalars, times, and with the word `decisions`
// also a row a decision. Returns rise and saturate with noise; every number
// follows from the arguments. One run in 40 is left crashed.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "dreamsearch/random.h"
#include "results/database/database.h"
#include "results/database/run_writer.h"
#include "results/system/error.h"
#include "tests/twenty_tasks.h"

namespace dreamsearch::results {
namespace {

constexpr const char* kPlanners[] = {"dreamer", "rollout", "mcts_pw", "mcts_fixed"};

void WriteRun(Database* db, int task, int planner, int seed, std::int64_t steps, bool decisions) {
  NewRun run;
  run.study_id = db->Study("default");
  run.task_id = db->Task({.name = kTwentyTasks[task],
                          .domain = std::string(kTwentyTasks[task]).substr(0, 6),
                          .observation_size = 24,
                          .action_size = 6,
                          .control_seconds = 0.02,
                          .substeps = 2,
                          .episode_steps = 1000,
                          .return_low = 0,
                          .return_high = 1000});
  run.planner = kPlanners[planner];
  run.model = "dreamer";
  run.config_id = db->Config(R"({"planner":{"name":")" + run.planner + R"("},"run":{"steps":)" +
                             std::to_string(steps) + "}}");
  run.preset = "fast";
  run.seed = seed;
  run.action_repeat = 2;
  run.env_steps_target = steps;
  run.argv = R"(["synthetic_database"])";
  run.build_id = db->Build({.version = "0.0.0", .compiler = "none", .libraries = "{}"});
  const std::int64_t run_id = db->CreateRun(run).run_id;

  const int stream = (task * 10 + planner) * 1000 + seed;
  Random random(DeriveSeed(1, static_cast<std::uint64_t>(stream)));
  const bool crashes = (task * 7 + planner * 3 + seed) % 40 == 7;
  const std::int64_t done = crashes ? steps * 6 / 10 / 1000 * 1000 : steps;
  const double level = 150 + 40.0 * task + 30 * planner + 25 * random.Normal();
  const double rate =
      (4 + planner + random.Uniform()) / static_cast<double>(steps) * (0.4 + 0.03 * task);
  const auto score = [&](std::int64_t step) {
    const double mean = level * (1 - std::exp(-rate * static_cast<double>(step)));
    return std::clamp(mean + 40 * random.Normal(), 0.0, 1000.0);
  };
  const std::int64_t every = std::min<std::int64_t>(10000, steps / 10);
  const double plan_seconds = planner == 0 ? 0 : 0.004 * planner;

  RunWriter writer(db, run_id);
  writer.BeginSegment(
      {.pid = 1,
       .host_id = db->Host(
           {.hostname = "synthetic", .cpu = "none", .cores = 1, .memory_bytes = 1, .os = "none"}),
       .instruction_set = "none"});
  const std::int64_t loss = writer.Metric("model_loss", "nats", "made up");
  std::int64_t evaluated = 0;
  const auto evaluate = [&](std::int64_t step) {
    for (std::int64_t i = 0; i < 5; ++i) {
      for (const Phase phase : {Phase::kSearchEvaluation, Phase::kActorEvaluation}) {
        if (planner == 0 && phase == Phase::kSearchEvaluation) continue;
        const double penalty = phase == Phase::kActorEvaluation ? 0.95 : 1.0;
        writer.AddEpisode({.phase = phase,
                           .episode = evaluated + i,
                           .env_step = step,
                           .length = 1000,
                           .episode_return = penalty * score(step),
                           .digest = random.Next()});
      }
    }
    evaluated += 5;
  };
  evaluate(0);
  for (std::int64_t step = 1000; step <= done; step += 1000) {
    if (decisions) {
      for (std::int64_t t = 0; t < 500; ++t) {
        writer.AddStep({.env_step = step - 1000 + 2 * (t + 1),
                        .episode = step / 1000 - 1,
                        .t = t,
                        .reward = random.Uniform(),
                        .value = 100 * random.Uniform(),
                        .plan_us = static_cast<std::int64_t>(1e6 * plan_seconds),
                        .simulations = 50,
                        .nodes = 51,
                        .depth = 6});
      }
    }
    writer.AddEpisode({.phase = Phase::kTraining,
                       .episode = step / 1000 - 1,
                       .env_step = step,
                       .length = 1000,
                       .episode_return = 0.9 * score(step),
                       .wall_seconds = 4,
                       .plan_us_mean = 1e6 * plan_seconds,
                       .plan_us_p95 = 1.3e6 * plan_seconds,
                       .model_transitions = planner == 0 ? 0 : 500 * 50,
                       .digest = random.Next()});
    writer.AddScalar(step, loss, 3 + std::exp(-rate * static_cast<double>(step)));
    const double episodes = static_cast<double>(step) / 1000;
    if (step % every == 0) {
      writer.AddTimeUse({step, "environment", 0.5 * episodes});
      writer.AddTimeUse({step, "planning", 500 * plan_seconds * episodes});
      writer.AddTimeUse({step, "learning", 3 * episodes});
      writer.AddTimeUse({step, "evaluation", 0.3 * episodes});
      writer.AddTimeUse({step, "recording", 0.01 * episodes});
      writer.AddTimeUse({step, "other", 0.02 * episodes});
      evaluate(step);
    }
    writer.SetProgress(step);
  }
  if (crashes) {
    writer.EndSegment("crashed", done);
    db->SetRunStatus(run_id, RunStatus::kCrashed, 71, "made up: signal 11");
  } else {
    writer.Finish();
    db->SetRunStatus(run_id, RunStatus::kFinished, 0);
  }
}

int Main(int argc, char** argv) {
  if (argc < 6) {
    std::fprintf(stderr, "usage: synthetic_database FILE TASKS PLANNERS SEEDS STEPS [decisions]\n");
    return static_cast<int>(ExitCode::kUsage);
  }
  try {
    const auto db = Database::OpenOrCreate(argv[1]);
    // Made-up data need not survive a power cut.
    db->connection().Execute("PRAGMA synchronous = OFF");
    for (int task = 0; task < std::min(20, std::atoi(argv[2])); ++task) {
      for (int planner = 0; planner < std::min(4, std::atoi(argv[3])); ++planner) {
        for (int seed = 0; seed < std::atoi(argv[4]); ++seed) {
          WriteRun(db.get(), 19 - task, planner, seed, std::atoll(argv[5]), argc > 6);
        }
      }
    }
  } catch (const Failure& error) {
    std::fprintf(stderr, "synthetic_database: %s\n", error.what());
    return error.exit_status();
  }
  return 0;
}

}  // namespace
}  // namespace dreamsearch::results

int main(int argc, char** argv) { return dreamsearch::results::Main(argc, argv); }
