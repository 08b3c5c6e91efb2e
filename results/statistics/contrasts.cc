// Spreads over seeds, and one algorithm against another.
#include <cmath>

#include "results/statistics/bootstrap.h"
#include "results/statistics/statistics.h"

namespace dreamsearch::results {

double Spread(const Scores& scores) {
  double sum = 0;
  for (const std::vector<double>& runs : scores) {
    const double mean = MeanScore({runs});
    double squares = 0;
    for (const double score : runs) squares += (score - mean) * (score - mean);
    sum += std::sqrt(squares / (static_cast<double>(runs.size()) - 1));
  }
  return sum / static_cast<double>(scores.size());
}

double MeanDifference(const Scores& x, const Scores& y) { return MeanScore(x) - MeanScore(y); }

double MeanRatio(const Scores& x, const Scores& y) {
  double sum = 0;
  for (std::size_t task = 0; task < x.size(); ++task) {
    sum += std::log(MeanScore({x[task]}) / MeanScore({y[task]}));
  }
  return std::exp(sum / static_cast<double>(x.size()));
}

namespace {

// The scores of one repetition.
Scores Drawn(const Scores& scores, Generator* generator) {
  Scores drawn = scores;
  for (std::size_t task = 0; task < scores.size(); ++task) {
    const auto n = static_cast<std::uint32_t>(scores[task].size());
    for (double& score : drawn[task]) score = scores[task][generator->Below(n)];
  }
  return drawn;
}

// Spreads of resamples, scaled until their mean is the spread of the scores: a resample has
// repeated runs, so it is narrower than what it was drawn from.
std::vector<double> SpreadDraws(const Scores& scores, int repetitions, Generator* generator) {
  std::vector<double> spreads;
  double sum = 0;
  for (int i = 0; i < repetitions; ++i) {
    spreads.push_back(Spread(Drawn(scores, generator)));
    sum += spreads.back();
  }
  if (sum == 0) return spreads;  // equal scores
  const double scale = Spread(scores) * static_cast<double>(repetitions) / sum;
  for (double& spread : spreads) spread *= scale;
  return spreads;
}

}  // namespace

Estimate SpreadEstimate(const Scores& scores, int repetitions, std::uint64_t seed) {
  Estimate estimate = {Spread(scores), std::nullopt};
  if (!HasInterval(scores)) return estimate;
  Generator generator(seed);
  std::vector<double> values = SpreadDraws(scores, repetitions, &generator);
  estimate.interval = PercentileInterval(&values);
  return estimate;
}

Estimate SpreadDifference(const Scores& x, const Scores& y, int repetitions, std::uint64_t seed) {
  Estimate estimate = {Spread(x) - Spread(y), std::nullopt};
  if (!HasInterval(x) || !HasInterval(y)) return estimate;
  Generator generator(seed);
  std::vector<double> values = SpreadDraws(x, repetitions, &generator);
  const std::vector<double> of_y = SpreadDraws(y, repetitions, &generator);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] -= of_y[i];
  estimate.interval = PercentileInterval(&values);
  return estimate;
}

Estimate ContrastEstimate(Contrast contrast, const Scores& x, const Scores& y, int repetitions,
                          std::uint64_t seed) {
  Estimate estimate = {contrast(x, y), std::nullopt};
  if (!HasInterval(x) || !HasInterval(y)) return estimate;
  Generator generator(seed);
  std::vector<double> values;
  for (int i = 0; i < repetitions; ++i) {
    const Scores drawn_x = Drawn(x, &generator);
    values.push_back(contrast(drawn_x, Drawn(y, &generator)));
  }
  estimate.interval = PercentileInterval(&values);
  return estimate;
}

}  // namespace dreamsearch::results
