// recording.h - runs to write into a database in a temporary folder.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <memory>
#include <string>

#include "results/database/database.h"
#include "results/database/run_writer.h"
#include "results/system/temporary_folder.h"

namespace dreamsearch::results {

struct RunSettings {
  std::string study = "default";
  std::string task = "walker_walk";
  std::string planner = "mcts_pw";
  std::string model = "dreamer";
  std::string config = R"({"run":{"steps":100000}})";
  std::int64_t seed = 0;
  std::int64_t env_steps_target = 100000;
  std::optional<std::int64_t> parent_run_id;
  std::string planner_version;  // of its plugin; empty: not recorded
  std::string planner_sha256 = "11";
};

inline NewRun MakeNewRun(Database* db, const RunSettings& settings = {}) {
  NewRun run;
  run.study_id = db->Study(settings.study);
  run.task_id = db->Task({.name = settings.task,
                          .domain = "walker",
                          .observation_size = 24,
                          .action_size = 6,
                          .control_seconds = 0.025,
                          .substeps = 10,
                          .episode_steps = 1000,
                          .return_low = 0,
                          .return_high = 1000});
  run.planner = settings.planner;
  run.model = settings.model;
  run.env_plugin = db->Plugin({"env_dmc", "0.1.0", "1.0", "/plugins/env_dmc.so", "ab"});
  if (!settings.planner_version.empty()) {
    run.planner_plugin = db->Plugin(
        {"planners", settings.planner_version, "1.0", "/plugins/p.so", settings.planner_sha256});
  }
  run.config_id = db->Config(settings.config);
  run.preset = "fast";
  run.seed = settings.seed;
  run.action_repeat = 2;
  run.env_steps_target = settings.env_steps_target;
  run.parent_run_id = settings.parent_run_id;
  run.argv = R"(["runner"])";
  run.build_id = db->Build({.version = "0.1.0", .compiler = "g++", .libraries = "{}"});
  return run;
}

inline std::int64_t MakeRun(Database* db, const RunSettings& settings = {}) {
  return db->CreateRun(MakeNewRun(db, settings)).run_id;
}

inline SegmentInfo MakeSegment(Database* db) {
  return {.pid = getpid(),
          .host_id = db->Host(
              {.hostname = "h", .cpu = "c", .cores = 2, .memory_bytes = 1, .os = "Debian 12"}),
          .instruction_set = "avx2"};
}

inline std::int64_t Count(Database* db, const std::string& sql) {
  return db->connection().QueryInt(sql).value_or(-1);
}

}  // namespace dreamsearch::results
