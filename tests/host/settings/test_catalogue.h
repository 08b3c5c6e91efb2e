// test_catalogue.h - the components of settings_plugin.cc, and what to resolve with them.
#pragma once

#include <chrono>
#include <string>

#include "host/plugins/catalogue.h"
#include "host/settings/run_options.h"
#include "host/settings/settings.h"

namespace dreamsearch {

inline const Catalogue& TestCatalogue() {
  static const Catalogue catalogue = [] {
    ScanOptions patient;
    patient.timeout = std::chrono::seconds(60);
    return Catalogue::Scan({DREAMSEARCH_SETTINGS_PLUGIN_DIR}, patient);
  }();
  return catalogue;
}

inline RunOptions Base() {
  RunOptions options;
  options.environments = {"walker_walk"};
  options.planners = {"mcts_pw"};
  options.models = {"dreamer"};
  options.seeds = {0};
  return options;
}

// As --set gives it.
inline Setting CommandLine(const std::string& key, const std::string& value) {
  return {key, value, false, "runner: --set", {}};
}

inline RunSpec Resolve(const RunOptions& options) {
  return ResolveMatrix(options, TestCatalogue()).at(0);
}

}  // namespace dreamsearch
