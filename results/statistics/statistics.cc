#include "results/statistics/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "results/statistics/bootstrap.h"

namespace dreamsearch::results {
namespace {

std::size_t CountRuns(const Scores& scores) {
  return std::accumulate(scores.begin(), scores.end(), std::size_t{0},
                         [](std::size_t n, const auto& runs) { return n + runs.size(); });
}

// All runs of all tasks side by side, with the task's place and the rank of each
// score, so that a resample needs no sorting.
struct Flat {
  explicit Flat(const Scores& scores) {
    for (const std::vector<double>& runs : scores) {
      first.push_back(static_cast<std::uint32_t>(value.size()));
      size.push_back(static_cast<std::uint32_t>(runs.size()));
      value.insert(value.end(), runs.begin(), runs.end());
    }
    std::vector<std::uint32_t> order(value.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [this](std::uint32_t a, std::uint32_t b) { return value[a] < value[b]; });
    rank.resize(value.size());
    sorted.resize(value.size());
    for (std::uint32_t r = 0; r < order.size(); ++r) {
      rank[order[r]] = r;
      sorted[r] = value[order[r]];
    }
  }

  std::vector<double> value, sorted;
  std::vector<std::uint32_t> rank, first, size;
};

// The interquartile mean of a resample that has counts[r] copies of sorted[r].
double InterquartileMeanOf(const std::vector<double>& sorted,
                           const std::vector<std::uint32_t>& counts) {
  const auto n = static_cast<std::int64_t>(sorted.size());
  const std::int64_t cut = n / 4;
  std::int64_t seen = 0;
  double sum = 0;
  for (std::size_t r = 0; r < sorted.size(); ++r) {
    const std::int64_t from = std::max(seen, cut);
    seen += counts[r];
    const std::int64_t to = std::min(seen, n - cut);
    if (to > from) sum += static_cast<double>(to - from) * sorted[r];
  }
  return sum / static_cast<double>(n - 2 * cut);
}

double MedianOf(std::vector<double>* values) {
  const std::size_t middle = values->size() / 2;
  const auto at = values->begin() + static_cast<std::ptrdiff_t>(middle);
  std::nth_element(values->begin(), at, values->end());
  if (values->size() % 2 == 1) return *at;
  return (*at + *std::max_element(values->begin(), at)) / 2;
}

// Calls use(index) for each of the runs drawn in a repetition, index into
// Flat::value, task by task, and end_task(task) after each task.
template <typename Use, typename EndTask>
void Resample(const Flat& flat, Generator* generator, const Use& use, const EndTask& end_task) {
  for (std::size_t task = 0; task < flat.first.size(); ++task) {
    for (std::uint32_t i = 0; i < flat.size[task]; ++i) {
      use(flat.first[task] + generator->Below(flat.size[task]));
    }
    end_task(task);
  }
}

// How often a repetition draws each of the sorted scores.
void DrawCounts(const Flat& flat, Generator* generator, std::vector<std::uint32_t>* counts) {
  std::fill(counts->begin(), counts->end(), 0u);
  Resample(
      flat, generator, [&](std::uint32_t index) { ++(*counts)[flat.rank[index]]; },
      [](std::size_t) {});
}

}  // namespace

void Sample::Add(double x) {
  const double distance = x - mean;
  mean += distance / static_cast<double>(++n);
  squares += distance * (x - mean);
}

std::optional<double> Sample::StandardError() const {
  if (n < 2) return std::nullopt;
  const auto count = static_cast<double>(n);
  return std::sqrt(squares / (count * (count - 1)));
}

Sample SampleOf(const std::vector<double>& values) {
  Sample sample;
  for (const double value : values) sample.Add(value);
  return sample;
}

double Quantile(std::vector<double>* values, double q) {
  const double place = q * static_cast<double>(values->size() - 1);
  const auto below = static_cast<std::ptrdiff_t>(std::floor(place));
  const auto at = values->begin() + below;
  std::nth_element(values->begin(), at, values->end());
  const double share = place - std::floor(place);
  if (share == 0) return *at;
  return *at + share * (*std::min_element(at + 1, values->end()) - *at);
}

double MeanScore(const Scores& scores) {
  double sum = 0;
  for (const std::vector<double>& runs : scores) {
    sum += std::accumulate(runs.begin(), runs.end(), 0.0) / static_cast<double>(runs.size());
  }
  return sum / static_cast<double>(scores.size());
}

double MedianScore(const Scores& scores) {
  std::vector<double> means;
  for (const std::vector<double>& runs : scores) {
    means.push_back(std::accumulate(runs.begin(), runs.end(), 0.0) /
                    static_cast<double>(runs.size()));
  }
  return MedianOf(&means);
}

double InterquartileMean(const Scores& scores) {
  const Flat flat(scores);
  return InterquartileMeanOf(flat.sorted, std::vector<std::uint32_t>(flat.sorted.size(), 1));
}

double OptimalityGap(const Scores& scores) {
  double sum = 0;
  for (const std::vector<double>& runs : scores) {
    for (const double score : runs) sum += 1 - std::min(score, 1.0);
  }
  return sum / static_cast<double>(CountRuns(scores));
}

double ImprovementProbability(const Scores& x, const Scores& y) {
  double sum = 0;
  for (std::size_t task = 0; task < x.size(); ++task) {
    double wins = 0;
    for (const double a : x[task]) {
      for (const double b : y[task]) wins += a > b ? 1 : a == b ? 0.5 : 0;
    }
    sum += wins / static_cast<double>(x[task].size() * y[task].size());
  }
  return sum / static_cast<double>(x.size());
}

double PerformanceProfile(const Scores& scores, double tau) {
  std::size_t above = 0;
  for (const std::vector<double>& runs : scores) {
    above += static_cast<std::size_t>(
        std::count_if(runs.begin(), runs.end(), [tau](double score) { return score > tau; }));
  }
  return static_cast<double>(above) / static_cast<double>(CountRuns(scores));
}

Aggregates Aggregate(const Scores& scores, int repetitions, std::uint64_t seed) {
  Aggregates result;
  result.mean.value = MeanScore(scores);
  result.median.value = MedianScore(scores);
  result.interquartile_mean.value = InterquartileMean(scores);
  result.optimality_gap.value = OptimalityGap(scores);
  if (!HasInterval(scores)) return result;

  const Flat flat(scores);
  const auto runs = static_cast<double>(flat.value.size());
  std::vector<double> means, medians, iqms, gaps;
  for (auto* values : {&means, &medians, &iqms, &gaps}) {
    values->reserve(static_cast<std::size_t>(repetitions));
  }
  std::vector<std::uint32_t> counts(flat.value.size());
  std::vector<double> task_means(scores.size());
  Generator generator(seed);
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    std::fill(counts.begin(), counts.end(), 0u);
    double task_sum = 0, gap = 0;
    Resample(
        flat, &generator,
        [&](std::uint32_t index) {
          ++counts[flat.rank[index]];
          task_sum += flat.value[index];
          gap += 1 - std::min(flat.value[index], 1.0);
        },
        [&](std::size_t task) {
          task_means[task] = task_sum / flat.size[task];
          task_sum = 0;
        });
    means.push_back(std::accumulate(task_means.begin(), task_means.end(), 0.0) /
                    static_cast<double>(task_means.size()));
    medians.push_back(MedianOf(&task_means));
    iqms.push_back(InterquartileMeanOf(flat.sorted, counts));
    gaps.push_back(gap / runs);
  }
  result.mean.interval = PercentileInterval(&means);
  result.median.interval = PercentileInterval(&medians);
  result.interquartile_mean.interval = PercentileInterval(&iqms);
  result.optimality_gap.interval = PercentileInterval(&gaps);
  return result;
}

Estimate InterquartileMeanEstimate(const Scores& scores, int repetitions, std::uint64_t seed) {
  Estimate estimate = {InterquartileMean(scores), std::nullopt};
  if (!HasInterval(scores)) return estimate;
  const Flat flat(scores);
  std::vector<std::uint32_t> counts(flat.value.size());
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(repetitions));
  Generator generator(seed);
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    DrawCounts(flat, &generator, &counts);
    values.push_back(InterquartileMeanOf(flat.sorted, counts));
  }
  estimate.interval = PercentileInterval(&values);
  return estimate;
}

Estimate Improvement(const Scores& x, const Scores& y, int repetitions, std::uint64_t seed) {
  Estimate estimate = {ImprovementProbability(x, y), std::nullopt};
  if (!HasInterval(x) || !HasInterval(y)) return estimate;
  // wins[task][i * n_y + j]: run i of x against run j of y.
  std::vector<std::vector<double>> wins(x.size());
  for (std::size_t task = 0; task < x.size(); ++task) {
    for (const double a : x[task]) {
      for (const double b : y[task]) wins[task].push_back(a > b ? 1 : a == b ? 0.5 : 0);
    }
  }
  Generator generator(seed);
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(repetitions));
  std::vector<std::uint32_t> drawn;
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    double sum = 0;
    for (std::size_t task = 0; task < x.size(); ++task) {
      const auto n_x = static_cast<std::uint32_t>(x[task].size());
      const auto n_y = static_cast<std::uint32_t>(y[task].size());
      drawn.clear();
      for (std::uint32_t j = 0; j < n_y; ++j) drawn.push_back(generator.Below(n_y));
      double task_wins = 0;
      for (std::uint32_t i = 0; i < n_x; ++i) {
        const double* row = wins[task].data() + std::size_t{generator.Below(n_x)} * n_y;
        for (const std::uint32_t j : drawn) task_wins += row[j];
      }
      sum += task_wins / (static_cast<double>(n_x) * n_y);
    }
    values.push_back(sum / static_cast<double>(x.size()));
  }
  estimate.interval = PercentileInterval(&values);
  return estimate;
}

std::vector<Estimate> Profile(const Scores& scores, const std::vector<double>& taus,
                              int repetitions, std::uint64_t seed) {
  std::vector<Estimate> estimates;
  for (const double tau : taus) estimates.push_back({PerformanceProfile(scores, tau), {}});
  if (!HasInterval(scores)) return estimates;
  const Flat flat(scores);
  // first_above[k]: rank of the first sorted score above tau k.
  std::vector<std::size_t> first_above;
  for (const double tau : taus) {
    first_above.push_back(static_cast<std::size_t>(
        std::upper_bound(flat.sorted.begin(), flat.sorted.end(), tau) - flat.sorted.begin()));
  }
  std::vector<std::vector<double>> shares(taus.size());
  std::vector<std::uint32_t> counts(flat.value.size());
  std::vector<std::uint32_t> at_or_above(flat.value.size() + 1);
  Generator generator(seed);
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    DrawCounts(flat, &generator, &counts);
    for (std::size_t r = counts.size(); r-- > 0;) at_or_above[r] = at_or_above[r + 1] + counts[r];
    for (std::size_t k = 0; k < taus.size(); ++k) {
      shares[k].push_back(at_or_above[first_above[k]] / static_cast<double>(flat.value.size()));
    }
  }
  for (std::size_t k = 0; k < taus.size(); ++k) {
    estimates[k].interval = PercentileInterval(&shares[k]);
  }
  return estimates;
}

double DistinctResamples(const Scores& scores) {
  double product = 1;
  for (const std::vector<double>& runs : scores) {
    const auto n = static_cast<double>(runs.size());
    double choose = 1;
    for (double k = 1; k <= n; ++k) choose = choose * (n - 1 + k) / k;
    product *= choose;
    if (product > 1e15) return std::numeric_limits<double>::infinity();
  }
  return std::round(product);
}

}  // namespace dreamsearch::results
