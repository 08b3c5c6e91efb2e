// published.h - learning curves in the formats that other projects publish: into
// the table `published`, and out of our runs.
//
// scores  CSV with a header; columns source, method, obs, task, env_steps, seed
//         ("mean" for a mean over n_seeds seeds) and return, others ignored but
//         n_seeds and seed_sd.
// dreamer JSON list of {task, method, seed, xs, ys}: a learning curve each.
// tdmpc2  CSV step,reward,seed, one file a task; the file name is the task, the
//         folder's the method.
// Tasks are stored under the suite's first names: a prefix "dmc_" goes, "-" is "_",
// ball_in_cup is cup. What a method observes is told by the file's or the method's name
// ("dmc_proprio-dreamerv3", "tdmpc2-pixels"), else it is kUnknownObs. Points of one seed at one
// step are episodes of one evaluation: their mean is one point.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "results/analysis/curves.h"

namespace dreamsearch::results {

inline constexpr char kUnknownObs[] = "unknown";

struct PublishedPoint {
  std::string source, method, obs, task;
  std::int64_t env_steps = 0;
  std::optional<std::int64_t> seed;
  double episode_return = 0;
  std::optional<std::int64_t> n_seeds;
  std::optional<double> seed_sd;
};

// What a file does not say of itself; empty: what the file says.
struct ImportSettings {
  std::string format;  // scores, dreamer or tdmpc2; empty: by the content
  std::string source, method, obs, task;
  std::int64_t steps_per_unit = 1;  // environment steps in one unit of the file's steps
};

// Failure 65 with file and line (or place) for anything that is not as expected. `bytes` may be
// compressed (Unpacked).
std::vector<PublishedPoint> ParsePublished(const std::string& path, const std::string& bytes,
                                           const ImportSettings& settings);
// Adds the points; one that is there already is replaced, also if what it observes was not known.
// Returns how many.
std::int64_t StorePublished(Database* database, const std::vector<PublishedPoint>& points);

// Our runs in those formats; published lines are left out.
std::string DreamerScores(const std::vector<Line>& lines);
// The CSV of one line.
std::string TdmpcScores(const Line& line);

std::string SuiteTaskName(const std::string& name);

}  // namespace dreamsearch::results
