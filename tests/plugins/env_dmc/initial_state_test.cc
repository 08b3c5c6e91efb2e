// The distribution of initial states against quantiles of 2000 recorded resets.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/plugins/env_dmc/kolmogorov_smirnov.h"
#include "tests/plugins/env_dmc/reference_data.h"

namespace dreamsearch::dmc {
namespace {

constexpr std::uint32_t kResets = 300;
constexpr std::uint32_t kFirstSeed = 10000;  // none of the recorder's
constexpr double kLeastP = 0.001;

struct Figure {
  std::string what;
  const Json* recorded;
  std::vector<double> values;
};

// The largest difference between the share of `values` below a recorded quantile
// and the share recorded there. Seen at seven points only, it is no larger than
// the Kolmogorov-Smirnov distance, so the test errs on the side of silence. At a
// value that is taken often, any share between "below" and "at most" fits.
double QuantileDistance(const std::vector<double>& values, const Json& shares,
                        const Json& quantiles) {
  double largest = 0;
  const double n = static_cast<double>(values.size());
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const double share = shares[i], quantile = quantiles[i];
    // A quantile of a value that is taken often may be off in its last bit.
    const double width = 1e-12 * std::max(1.0, std::abs(quantile));
    double below = 0, at_most = 0;
    for (const double value : values) {
      below += value < quantile - width;
      at_most += value <= quantile + width;
    }
    largest = std::max({largest, share - at_most / n, below / n - share});
  }
  return largest;
}

TEST(InitialState, HasTheRecordedDistribution) {
  const Json reference = ReadJson(ReferenceFile("initial_states.json"));
  const Json& shares = reference.at("quantiles");
  int tasks = 0;
  int tests = 0;
  for (const auto& [name, recorded] : reference.items()) {
    if (!recorded.is_object() || !HasTask(name)) continue;
    ++tasks;
    SCOPED_TRACE(name);
    const TaskPtr task = MakeTask(name);
    std::vector<Figure> figures;
    for (const char* part : {"qpos", "qvel", "model"}) {
      for (const Json& row : recorded.at(part)) {
        const std::string what = std::string(part) + " " +
                                 (row.contains("element") ? row.at("element").dump() : row.dump());
        figures.push_back({what.substr(0, 60), &row, {}});
      }
    }
    figures.push_back({"ncon", &recorded.at("ncon"), {}});
    figures.push_back({"reward", &recorded.at("reward"), {}});

    std::vector<double> observation(task->spec().observation_size);
    const mjModel* model = task->model();
    const mjData* data = task->data();
    for (std::uint32_t i = 0; i < kResets; ++i) {
      const View<double> view{observation.data(), observation.size()};
      ASSERT_TRUE(task->Reset(kFirstSeed + i, view).ok());
      auto figure = figures.begin();
      for (int j = 0; j < model->nq; ++j) (figure++)->values.push_back(data->qpos[j]);
      for (int j = 0; j < model->nv; ++j) (figure++)->values.push_back(data->qvel[j]);
      for (const Json& row : recorded.at("model")) {
        (figure++)->values.push_back(
            ModelField(row.at("field"), row.at("name"), row.value("index", 0), task->model()));
      }
      (figure++)->values.push_back(data->ncon);
      (figure++)->values.push_back(task->Reward());
      ASSERT_TRUE(figure == figures.end());
    }

    for (const Figure& figure : figures) {
      SCOPED_TRACE(figure.what);
      const double low = figure.recorded->at("min"), high = figure.recorded->at("max");
      if (high - low <= 1e-12 * std::max(1.0, std::abs(high))) {
        for (const double value : figure.values) ASSERT_NEAR(value, high, 1e-12);
        continue;
      }
      const double distance =
          QuantileDistance(figure.values, shares, figure.recorded->at("quantiles"));
      const double p = KolmogorovSmirnovP(distance, kResets, recorded.at("resets"));
      EXPECT_GT(p, kLeastP) << "distance " << distance;
      ++tests;
    }
  }
  EXPECT_EQ(tasks, static_cast<int>(std::size(kTasks)));
  EXPECT_GT(tests, 100);
}

}  // namespace
}  // namespace dreamsearch::dmc
