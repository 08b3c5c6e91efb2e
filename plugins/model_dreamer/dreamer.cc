#include "plugins/model_dreamer/dreamer.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <string>

#include "plugins/networks/noise.h"

namespace dreamsearch::dreamer {
namespace {

constexpr MetricSpec kMetrics[] = {
    {"observation_loss", "",
     "half the squared error of the predicted (standardised) observation, a step"},
    {"reward_loss", "", "half the squared error of the predicted reward, a step"},
    {"continuation_loss", "nats", "cross-entropy of the predicted continuation, a step"},
    {"kl", "nats", "divergence of the posterior from the prior, a step, before free nats"},
    {"model_loss", "", "weighted sum of the world model's losses"},
    {"actor_loss", "", "minus the weighted mean of scaled returns and entropy bonus"},
    {"value_loss", "",
     "weighted mean of half the squared error and the slow critic's part, in units of value_scale"},
    {"model_gradient_norm", "", "of the world model's gradient, before clipping"},
    {"actor_gradient_norm", "", "of the actor's gradient, before clipping"},
    {"value_gradient_norm", "", "of the value's gradient, before clipping"},
    {"imagined_return", "", "mean lambda-return of the dreams' first states"},
    {"value_mean", "", "mean value of the dreamt states"},
    {"actor_entropy", "nats", "mean of minus the log density of the dreamt actions"},
    {"actor_std", "", "mean deviation of the actor before tanh"},
    {"prior_std", "", "mean deviation of the prior"},
    {"posterior_std", "", "mean deviation of the posterior"},
};
constexpr std::size_t kMetricCount = sizeof kMetrics / sizeof *kMetrics;

bool Finite(Mat<const float> m) {
  // A sum of zeros is zero unless one of the terms was not finite.
  float total = 0;
  for (Index j = 0; j < m.cols; ++j) {
    for (Index i = 0; i < m.rows; ++i) total += 0.0f * m(i, j);
  }
  return total == 0.0f;
}

Status WrongSize(const char* call, const char* what, std::uint64_t expected_rows,
                 std::uint64_t expected_cols, std::uint64_t rows, std::uint64_t cols) {
  return Error(StatusCode::kInvalidArgument, "%s: %s of %llu x %llu expected, %llu x %llu found",
               call, what, static_cast<unsigned long long>(expected_rows),
               static_cast<unsigned long long>(expected_cols),
               static_cast<unsigned long long>(rows), static_cast<unsigned long long>(cols));
}

Status CheckSeeds(const char* call, View<const std::uint64_t> seeds, std::uint64_t rows) {
  if (seeds.size == rows) return OkStatus();
  return WrongSize(call, "seeds", rows, 1, seeds.size, 1);
}

// Runs a call that may throw (memory) behind the plugin boundary.
template <typename Call>
Status Guarded(const char* name, Call call) noexcept {
  try {
    return call();
  } catch (const std::exception& e) {
    return Error(StatusCode::kInternal, "%s: %s", name, e.what());
  }
}

// Latents taken through all layers together: their activations stay in the nearest
// caches on the way. Calls task(first, count) for each block. Blocks are of nearly equal
// size, because products with a few columns are slower.
template <typename Task>
void ForBlocks(Index rows, Task task) {
  constexpr Index kRowsAtOnce = 32;
  const Index blocks = (rows + kRowsAtOnce - 1) / kRowsAtOnce;
  for (Index i = 0; i < blocks; ++i) {
    const Index first = i * rows / blocks;
    task(first, (i + 1) * rows / blocks - first);
  }
}

void Convert(MatrixView<const double> from, Mat<float> to) {
  for (std::uint64_t i = 0; i < from.size(); ++i) to.data[i] = static_cast<float>(from.data[i]);
}

}  // namespace

View<const MetricSpec> DeclaredMetrics() { return {kMetrics, kMetricCount}; }

Dreamer::Dreamer(const Settings& settings, Index observation_size, Index action_size,
                 std::uint64_t seed)
    : learner_(settings, observation_size, action_size, seed) {
  const auto bytes = static_cast<std::uint64_t>(settings.state_size()) * sizeof(float);
  latent_bytes_ = (bytes + kLatentAlignment - 1) / kLatentAlignment * kLatentAlignment;
}

Mat<const float> Dreamer::StatesOf(ConstLatents latents) const {
  return {reinterpret_cast<const float*>(latents.data), learner_.settings().state_size(),
          static_cast<Index>(latents.rows), static_cast<Index>(latent_bytes_ / sizeof(float))};
}

Status Dreamer::CheckLatents(const char* call, std::uint64_t cols, std::uint64_t rows,
                             std::uint64_t expected_rows) const {
  if (cols == latent_bytes_ && rows == expected_rows && rows > 0) return OkStatus();
  return WrongSize(call, "latents", std::max<std::uint64_t>(expected_rows, 1), latent_bytes_, rows,
                   cols);
}

Status Dreamer::WriteLatents(const char* call, Mat<const float> states, Latents latents) const {
  if (!Finite(states)) {
    return Error(StatusCode::kNotFinite, "%s: finite latents expected, NaN or infinity found",
                 call);
  }
  const std::size_t used = static_cast<std::size_t>(states.rows) * sizeof(float);
  for (Index j = 0; j < states.cols; ++j) {
    std::byte* row = latents.data + static_cast<std::uint64_t>(j) * latent_bytes_;
    std::memcpy(row, states.col(j), used);
    std::memset(row + used, 0, latent_bytes_ - used);
  }
  return OkStatus();
}

Mat<float> Dreamer::Noise(View<const std::uint64_t> seeds, Index rows, Index each) {
  const auto count = static_cast<Index>(seeds.size);
  const Mat<float> noise = noise_.Shape(rows, count * each);
  for (Index i = 0; i < count; ++i) {
    FillNormal(seeds[static_cast<std::uint64_t>(i)], noise.col(i * each), rows * each);
  }
  return noise;
}

Status Dreamer::Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept {
  const std::uint64_t rows = request.latents.rows;
  const std::uint64_t a = action_size();
  Status status = CheckLatents("Imagine", request.latents.cols, rows, rows);
  if (status.ok()) status = CheckLatents("Imagine", result.latents.cols, result.latents.rows, rows);
  if (!status.ok()) return status;
  if (request.actions.rows != rows || request.actions.cols != a) {
    return WrongSize("Imagine", "actions", rows, a, request.actions.rows, request.actions.cols);
  }
  if (result.rewards.size != rows || result.discounts.size != rows) {
    return WrongSize("Imagine", "rewards and discounts", rows, rows, result.rewards.size,
                     result.discounts.size);
  }
  if (status = CheckSeeds("Imagine", request.seeds, rows); !status.ok()) return status;
  return Guarded("Imagine", [&] {
    const Settings& settings = learner_.settings();
    const auto n = static_cast<Index>(rows);
    const Mat<float> actions = actions_.Shape(learner_.action_size(), n);
    Convert(request.actions, actions);
    const Mat<const float> states = StatesOf(request.latents);
    const Mat<float> next = states_.Shape(settings.state_size(), n);
    Mat<const float> noise;
    if (settings.imagined_latent_sample) noise = Noise(request.seeds, settings.stochastic);
    const Mat<float> rewards = rewards_.Shape(1, n);
    const Mat<float> logits = logits_.Shape(1, settings.continuation ? n : 0);
    WorldModel<float>& world = learner_.world();
    const Weights<float> weights = world.group().planning(&rounded_scratch_);
    ForBlocks(n, [&](Index first, Index count) {
      const Mat<float> after = next.Cols(first, count);
      world.Reserve(count, &transitions_);
      world.Step(weights, states.Cols(first, count), actions.Cols(first, count),
                 noise ? noise.Cols(first, count) : noise, 0, &transitions_, after);
      world.Reward(weights, after, &head_tape_, rewards.Cols(first, count));
      if (!settings.continuation) return;
      world.Continuation(weights, after, &continuation_tape_, logits.Cols(first, count));
    });
    for (std::uint64_t i = 0; i < rows; ++i) {
      result.rewards[i] = static_cast<double>(rewards.data[i]);
      result.discounts[i] = settings.continuation
                                ? 1 / (1 + std::exp(-static_cast<double>(logits.data[i])))
                                : settings.discount;
    }
    return WriteLatents("Imagine", next, result.latents);
  });
}

Status Dreamer::Value(ConstLatents latents, const ValueResult& result) noexcept {
  const Status status = CheckLatents("Value", latents.cols, latents.rows, result.values.size);
  if (!status.ok()) return status;
  if (!HasRoom(result, latents.rows)) {
    return WrongSize("Value", "deviations and least values", latents.rows, latents.rows,
                     result.deviations.size, result.least.size);
  }
  return Guarded("Value", [&] {
    const auto n = static_cast<Index>(latents.rows);
    const Mat<float> outputs = values_.Shape(1, n);
    ForBlocks(n, [&](Index first, Index count) {
      learner_.behaviour().Value(StatesOf(latents).Cols(first, count), outputs.Cols(first, count));
    });
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      result.values[i] = static_cast<double>(outputs.data[i]);
    }
    // One critic: nothing is apart.
    std::fill(result.deviations.begin(), result.deviations.end(), 0.0);
    std::copy_n(result.values.data, result.least.size, result.least.data);
    return OkStatus();
  });
}

Status Dreamer::ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept {
  const Status status = CheckLatents("ProposeMode", latents.cols, latents.rows, actions.rows);
  if (!status.ok()) return status;
  if (actions.cols != action_size()) {
    return WrongSize("ProposeMode", "actions", latents.rows, action_size(), actions.rows,
                     actions.cols);
  }
  return Guarded("ProposeMode", [&] {
    const auto n = static_cast<Index>(actions.rows);
    const Mat<float> proposed = actions_.Shape(learner_.action_size(), n);
    ForBlocks(n, [&](Index first, Index count) {
      learner_.behaviour().Act(StatesOf(latents).Cols(first, count), Mat<float>(),
                               proposed.Cols(first, count));
    });
    for (std::uint64_t i = 0; i < actions.size(); ++i) {
      actions.data[i] = static_cast<double>(proposed.data[i]);
    }
    return OkStatus();
  });
}

Status Dreamer::ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                               MatrixView<double> actions) noexcept {
  Status status = CheckLatents("ProposeSamples", latents.cols, latents.rows, latents.rows);
  if (status.ok()) status = CheckSeeds("ProposeSamples", seeds, latents.rows);
  if (!status.ok()) return status;
  if (actions.cols != action_size() || actions.rows == 0 || actions.rows % latents.rows != 0) {
    return WrongSize("ProposeSamples", "actions (n a latent)", latents.rows, action_size(),
                     actions.rows, actions.cols);
  }
  return Guarded("ProposeSamples", [&] {
    const auto total = static_cast<Index>(actions.rows);
    const Index a = learner_.action_size();
    const Mat<float> proposed = actions_.Shape(a, total);
    const Index each = total / static_cast<Index>(latents.rows);
    const Mat<float> noise = Noise(seeds, a, each);
    ForBlocks(static_cast<Index>(latents.rows), [&](Index first, Index count) {
      learner_.behaviour().Sample(StatesOf(latents).Cols(first, count), each,
                                  noise.Cols(first * each, count * each),
                                  proposed.Cols(first * each, count * each));
    });
    for (std::uint64_t i = 0; i < actions.size(); ++i) {
      actions.data[i] = static_cast<double>(proposed.data[i]);
    }
    return OkStatus();
  });
}

Status Dreamer::InitialLatent(Latents latents) noexcept {
  const Status status = CheckLatents("InitialLatent", latents.cols, latents.rows, latents.rows);
  if (!status.ok()) return status;
  std::memset(latents.data, 0, latents.size());
  return OkStatus();
}

Status Dreamer::Observe(const ObserveRequest& request, Latents latents) noexcept {
  const std::uint64_t rows = request.previous.rows;
  const auto o = static_cast<std::uint64_t>(learner_.observation_size());
  Status status = CheckLatents("Observe", request.previous.cols, rows, rows);
  if (status.ok()) status = CheckLatents("Observe", latents.cols, latents.rows, rows);
  if (!status.ok()) return status;
  if (request.actions.rows != rows || request.actions.cols != action_size()) {
    return WrongSize("Observe", "actions", rows, action_size(), request.actions.rows,
                     request.actions.cols);
  }
  if (request.observations.rows != rows || request.observations.cols != o) {
    return WrongSize("Observe", "observations", rows, o, request.observations.rows,
                     request.observations.cols);
  }
  if (status = CheckSeeds("Observe", request.seeds, rows); !status.ok()) return status;
  return Guarded("Observe", [&] {
    const Settings& settings = learner_.settings();
    const auto n = static_cast<Index>(rows);
    const Mat<float> actions = actions_.Shape(learner_.action_size(), n);
    Convert(request.actions, actions);
    const Mat<float> observations = observations_.Shape(learner_.observation_size(), n);
    learner_.Standardise(request.observations.data, observations);
    const Mat<float> next = states_.Shape(settings.state_size(), n);
    Mat<const float> noise;
    if (settings.acting_latent_sample) noise = Noise(request.seeds, settings.stochastic);
    WorldModel<float>& world = learner_.world();
    ForBlocks(n, [&](Index first, Index count) {
      world.Observe(world.group().exact(), StatesOf(request.previous).Cols(first, count),
                    actions.Cols(first, count), observations.Cols(first, count),
                    noise ? noise.Cols(first, count) : noise, next.Cols(first, count));
    });
    return WriteLatents("Observe", next, latents);
  });
}

Status Dreamer::Train(const TrainRequest& request, View<double> metrics) noexcept {
  if (metrics.size != kMetricCount) {
    return WrongSize("Train", "metrics", 1, kMetricCount, 1, metrics.size);
  }
  return Guarded("Train", [&] {
    UpdateLosses losses;
    Status status = learner_.Update(request, &losses);
    if (!status.ok()) return status;
    const double values[kMetricCount] = {losses.fit.observation,
                                         losses.fit.reward,
                                         losses.fit.continuation,
                                         losses.fit.kl,
                                         losses.fit.total,
                                         losses.dream.actor,
                                         losses.dream.value,
                                         losses.model_gradient_norm,
                                         losses.actor_gradient_norm,
                                         losses.value_gradient_norm,
                                         losses.dream.imagined_return,
                                         losses.dream.value_mean,
                                         losses.dream.entropy,
                                         losses.dream.actor_std,
                                         losses.fit.prior_std,
                                         losses.fit.posterior_std};
    std::copy(values, values + kMetricCount, metrics.data);
    return status;
  });
}

Status Dreamer::Save(ByteSink* sink) const noexcept {
  return Guarded("Save", [&] { return learner_.Save(sink); });
}

Status Dreamer::Load(ByteSource* source) noexcept {
  return Guarded("Load", [&] { return learner_.Load(source); });
}

Status Dreamer::Export(TensorSink* sink) const noexcept {
  return Guarded("Export", [&] { return learner_.Export(sink); });
}

Status CreateDreamer(const ModelContext& context, Model** result) noexcept {
  *result = nullptr;
  if (context.observation_size == 0 || context.action_size == 0) {
    return Error(StatusCode::kInvalidArgument,
                 "dreamer: at least one observation and one action expected, %llu and %llu found",
                 static_cast<unsigned long long>(context.observation_size),
                 static_cast<unsigned long long>(context.action_size));
  }
  return Guarded("dreamer", [&] {
    *result = new Dreamer(SettingsFrom(context.parameters, context.terminates),
                          static_cast<Index>(context.observation_size),
                          static_cast<Index>(context.action_size), context.seed);
    return OkStatus();
  });
}

}  // namespace dreamsearch::dreamer
