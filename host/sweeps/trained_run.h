// trained_run.h - a run of a database as an agent that can be looked at again.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "host/plugins/catalogue.h"
#include "host/settings/settings.h"
#include "results/database/database.h"

namespace dreamsearch {

struct TrainedRun {
  results::RunInfo info;
  // What it was trained with; of each plugin the file that is there now.
  RunSpec spec;
  // Its environment's ingredients then; `spec` has none, so that it plays with what is there now.
  std::map<std::string, std::string> ingredients;
  std::filesystem::path checkpoint;  // its newest whole one
  std::uint64_t env_step = 0;        // environment steps of training in it
  std::string agent_sha256;          // of the saved model
  // Damaged checkpoints that were passed over, plugins that have changed since.
  std::vector<std::string> warnings;
  Catalogue catalogue;
};

// Finds a run by number or the beginning of its UUID. Its components are looked for
// in the trusted folders, then where plugins usually are: never where its folder says.
//   kNotFound  no such run, its files are gone, or it has no checkpoint yet.
//   kPluginRefused  see TrustRecordedCode.
//   kUsage     the run is itself an evaluation; the message names the trained one.
TrainedRun FindTrainedRun(results::Database* database, const std::string& run,
                          const TrustedCode& trusted);

// "run 3 (walker_walk mcts_pw seed 0)".
std::string RunName(const TrainedRun& run);

}  // namespace dreamsearch
