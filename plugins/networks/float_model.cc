#include "plugins/networks/float_model.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>

#include "plugins/networks/noise.h"

namespace dreamsearch::networks {
namespace {

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
  return Error(StatusCode::kInvalidArgument, "%s: expected %s of %llu x %llu, found %llu x %llu",
               call, what, static_cast<unsigned long long>(expected_rows),
               static_cast<unsigned long long>(expected_cols),
               static_cast<unsigned long long>(rows), static_cast<unsigned long long>(cols));
}

Status CheckSeeds(const char* call, View<const std::uint64_t> seeds, std::uint64_t rows) {
  if (seeds.size == rows) return OkStatus();
  return WrongSize(call, "seeds", rows, 1, seeds.size, 1);
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

Mat<const float> Part(Mat<const float> noise, Index first, Index count) {
  return noise ? noise.Cols(first, count) : noise;
}

// The value that a gradient's request asks of an ensemble's `count` values, and its gradient in
// them.
double ValueOf(const float* values, Index count, const GradientRequest& request, float* d_values) {
  if (request.least) {
    const Index least = std::min_element(values, values + count) - values;
    for (Index k = 0; k < count; ++k) d_values[k] = k == least ? 1 : 0;
    return static_cast<double>(values[least]);
  }
  double sum = 0, squares = 0;
  for (Index k = 0; k < count; ++k) sum += static_cast<double>(values[k]);
  const double mean = sum / static_cast<double>(count);
  for (Index k = 0; k < count; ++k) {
    const double offset = static_cast<double>(values[k]) - mean;
    squares += offset * offset;
  }
  const double deviation = std::sqrt(squares / static_cast<double>(count));
  for (Index k = 0; k < count; ++k) {
    const double offset = static_cast<double>(values[k]) - mean;
    const double slope = deviation > 0 ? 1 + request.deviations * offset / deviation : 1;
    d_values[k] = static_cast<float>(slope / static_cast<double>(count));
  }
  return mean + request.deviations * deviation;
}

void Widen(Mat<const float> from, MatrixView<double> to) {
  for (std::uint64_t i = 0; i < to.size(); ++i) to.data[i] = static_cast<double>(from.data[i]);
}

}  // namespace

Status Guarded(const char* name, Status (*call)(void* context), void* context) noexcept {
  try {
    return call(context);
  } catch (const std::exception& e) {
    return Error(StatusCode::kInternal, "%s: %s", name, e.what());
  }
}

Status CheckTask(const char* model, const ModelContext& context) {
  if (context.observation_size > 0 && context.action_size > 0) return OkStatus();
  return Error(StatusCode::kInvalidArgument,
               "%s: expected at least one observation and one action, found %llu and %llu", model,
               static_cast<unsigned long long>(context.observation_size),
               static_cast<unsigned long long>(context.action_size));
}

FloatModel::FloatModel(const Sizes& sizes)
    : sizes_(sizes),
      a_(sizes.action),
      latent_bytes_(
          (static_cast<std::uint64_t>(sizes.state) * sizeof(float) + kLatentAlignment - 1) /
          kLatentAlignment * kLatentAlignment) {}

Mat<const float> FloatModel::StatesOf(ConstLatents latents) const {
  return {reinterpret_cast<const float*>(latents.data), sizes_.state,
          static_cast<Index>(latents.rows), static_cast<Index>(latent_bytes_ / sizeof(float))};
}

Status FloatModel::CheckLatents(const char* call, std::uint64_t cols, std::uint64_t rows,
                                std::uint64_t expected_rows) const {
  if (cols == latent_bytes_ && rows == expected_rows && rows > 0) return OkStatus();
  return WrongSize(call, "latents", std::max<std::uint64_t>(expected_rows, 1), latent_bytes_, rows,
                   cols);
}

Status FloatModel::CheckActions(const char* call, MatrixView<const double> actions,
                                std::uint64_t rows) const {
  if (actions.rows == rows && actions.cols == action_size()) return OkStatus();
  return WrongSize(call, "actions", rows, action_size(), actions.rows, actions.cols);
}

Status FloatModel::WriteLatents(const char* call, Mat<const float> states, Latents latents) const {
  if (!Finite(states)) {
    return Error(StatusCode::kNotFinite, "%s: expected finite latents, found NaN or infinity",
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

Mat<float> FloatModel::Actions(MatrixView<const double> actions) {
  const Mat<float> converted = actions_.Shape(a_, static_cast<Index>(actions.rows));
  for (std::uint64_t i = 0; i < actions.size(); ++i) {
    converted.data[i] = static_cast<float>(actions.data[i]);
  }
  return converted;
}

Mat<float> FloatModel::Noise(View<const std::uint64_t> seeds, Index rows, Index each) {
  if (rows == 0) return {};
  const auto count = static_cast<Index>(seeds.size);
  const Mat<float> noise = noise_.Shape(rows, count * each);
  for (Index i = 0; i < count; ++i) {
    FillNormal(seeds[static_cast<std::uint64_t>(i)], noise.col(i * each), rows * each);
  }
  return noise;
}

Status FloatModel::Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept {
  const std::uint64_t rows = request.latents.rows;
  Status status = CheckLatents("Imagine", request.latents.cols, rows, rows);
  if (status.ok()) status = CheckLatents("Imagine", result.latents.cols, result.latents.rows, rows);
  if (status.ok()) status = CheckActions("Imagine", request.actions, rows);
  if (!status.ok()) return status;
  if (result.rewards.size != rows || result.discounts.size != rows) {
    return WrongSize("Imagine", "rewards and discounts", rows, rows, result.rewards.size,
                     result.discounts.size);
  }
  if (status = CheckSeeds("Imagine", request.seeds, rows); !status.ok()) return status;
  return Guarded("Imagine", [&] {
    const auto n = static_cast<Index>(rows);
    const Mat<float> actions = Actions(request.actions);
    const Mat<const float> states = StatesOf(request.latents);
    const Mat<float> next = states_.Shape(sizes_.state, n);
    const Mat<const float> noise = Noise(request.seeds, sizes_.step_noise);
    const Mat<float> rewards = rewards_.Shape(1, n);
    ForBlocks(n, [&](Index first, Index count) {
      Step(states.Cols(first, count), actions.Cols(first, count), Part(noise, first, count),
           next.Cols(first, count), rewards.Cols(first, count), result.discounts.data + first);
    });
    Widen(rewards, {result.rewards.data, rows, 1});
    return WriteLatents("Imagine", next, result.latents);
  });
}

void* FloatModel::Extension(const char* name) noexcept {
  if (sizes_.critics == 1 && std::strcmp(name, ValueSpread::kName) == 0) return nullptr;
  return Offers::Extension(name);
}

Status FloatModel::Value(ConstLatents latents, View<double> values) noexcept {
  return Spread(latents, {.values = values});
}

Status FloatModel::Spread(ConstLatents latents, const SpreadResult& result) noexcept {
  const Status status = CheckLatents("Value", latents.cols, latents.rows, result.values.size);
  if (!status.ok()) return status;
  if (!HasRoom(result, latents.rows)) {
    return WrongSize("Value", "deviations and least values", latents.rows, latents.rows,
                     result.deviations.size, result.least.size);
  }
  return Guarded("Value", [&] {
    const Mat<float> values = values_.Shape(sizes_.critics, static_cast<Index>(latents.rows));
    ForBlocks(values.cols, [&](Index first, Index count) {
      Values(StatesOf(latents).Cols(first, count), values.Cols(first, count));
    });
    for (Index j = 0; j < values.cols; ++j) {
      const auto row = static_cast<std::uint64_t>(j);
      double sum = 0, squares = 0;
      for (Index k = 0; k < values.rows; ++k) sum += static_cast<double>(values(k, j));
      const double mean = sum / static_cast<double>(values.rows);
      for (Index k = 0; k < values.rows; ++k) {
        const double offset = static_cast<double>(values(k, j)) - mean;
        squares += offset * offset;
      }
      result.values[row] = mean;
      if (!result.deviations.empty()) {
        result.deviations[row] = std::sqrt(squares / static_cast<double>(values.rows));
      }
      if (!result.least.empty()) {
        result.least[row] =
            static_cast<double>(*std::min_element(values.col(j), values.col(j) + values.rows));
      }
    }
    return OkStatus();
  });
}

Status FloatModel::Gradient(const GradientRequest& asked, const GradientResult& room) noexcept {
  const GradientRequest request = Received(asked);
  const GradientResult result = Received(room);
  const std::uint64_t rows = request.latents.rows, steps = request.actions.rows;
  Status status = CheckLatents("Gradient", request.latents.cols, rows, result.returns.size);
  if (!status.ok()) return status;
  if (steps == 0 || steps % rows != 0 || request.actions.cols != action_size()) {
    return WrongSize("Gradient", "actions (n a latent)", rows, action_size(), steps,
                     request.actions.cols);
  }
  if (status = CheckSeeds("Gradient", request.seeds, steps); !status.ok()) return status;
  if (result.gradients.rows != steps || result.gradients.cols != action_size()) {
    return WrongSize("Gradient", "gradients", steps, action_size(), result.gradients.rows,
                     result.gradients.cols);
  }
  return Guarded("Gradient", [&] {
    const Mat<const float> actions = Actions(request.actions);
    const Mat<const float> noise = Noise(request.seeds, sizes_.step_noise);
    const Index horizon = static_cast<Index>(steps / rows);
    ForBlocks(static_cast<Index>(rows), [&](Index first, Index count) {
      GradientOf(first, StatesOf(request.latents).Cols(first, count),
                 actions.Cols(first * horizon, count * horizon),
                 Part(noise, first * horizon, count * horizon), request, result);
    });
    for (const double value : result.returns) {
      if (!std::isfinite(value)) {
        return Error(StatusCode::kNotFinite, "Gradient: expected a finite return, found %g", value);
      }
    }
    return OkStatus();
  });
}

void FloatModel::GradientOf(Index first, Mat<const float> states, Mat<const float> actions,
                            Mat<const float> noise, const GradientRequest& request,
                            const GradientResult& result) {
  const Index n = states.cols, steps = actions.cols, horizon = steps / n;
  // Sequence after sequence becomes time-major.
  const auto time_major = [&](Mat<const float> from, Mat<float> to) {
    for (Index t = 0; t < horizon; ++t) {
      for (Index i = 0; i < n; ++i) {
        Copy<float>(from.Cols(i * horizon + t, 1), to.Cols(t * n + i, 1));
      }
    }
    return to;
  };
  const Mat<float> own_actions = time_major(actions, block_actions_.Shape(a_, steps));
  const Mat<float> own_noise =
      noise ? time_major(noise, block_noise_.Shape(noise.rows, steps)) : Mat<float>();
  const Mat<float> rewards = rewards_.Shape(1, steps);
  const Mat<double> discounts = discounts_.Shape(1, steps), after = after_.Shape(1, steps);
  const Mat<float> values = values_.Shape(sizes_.critics, n);
  Follow(states, own_actions, own_noise, rewards, discounts.data, values);

  const Mat<float> d_rewards = d_rewards_.Shape(1, steps);
  const Mat<float> d_discounts = d_discounts_.Shape(1, steps);
  const Mat<float> d_values = d_values_.Shape(sizes_.critics, n);
  for (Index i = 0; i < n; ++i) {
    const double value = ValueOf(values.col(i), sizes_.critics, request, d_values.col(i));
    double next = value;  // what counts after transition t
    for (Index t = horizon; t-- > 0;) {
      after(0, t * n + i) = next;
      next = static_cast<double>(rewards(0, t * n + i)) + discounts(0, t * n + i) * next;
    }
    result.returns[static_cast<std::uint64_t>(first + i)] = next;
    double reached = 1;  // the product of the discounts before transition t
    for (Index t = 0; t < horizon; ++t) {
      const Index column = t * n + i;
      d_rewards(0, column) = static_cast<float>(reached);
      d_discounts(0, column) = static_cast<float>(reached * after(0, column));
      reached *= discounts(0, column);
    }
    for (Index k = 0; k < sizes_.critics; ++k) d_values(k, i) *= static_cast<float>(reached);
  }
  const Mat<float> d_actions = d_actions_.Shape(a_, steps);
  FollowBackward(d_rewards, d_discounts, d_values, d_actions);
  for (Index t = 0; t < horizon; ++t) {
    for (Index i = 0; i < n; ++i) {
      const auto row = static_cast<std::uint64_t>((first + i) * horizon + t);
      for (Index j = 0; j < a_; ++j) {
        result.gradients(row, static_cast<std::uint64_t>(j)) =
            static_cast<double>(d_actions(j, t * n + i));
      }
    }
  }
}

Status FloatModel::ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept {
  Status status = CheckLatents("ProposeMode", latents.cols, latents.rows, actions.rows);
  if (status.ok()) status = CheckActions("ProposeMode", actions, latents.rows);
  if (!status.ok()) return status;
  return Guarded("ProposeMode", [&] {
    const Mat<float> proposed = actions_.Shape(a_, static_cast<Index>(actions.rows));
    ForBlocks(proposed.cols, [&](Index first, Index count) {
      Act(StatesOf(latents).Cols(first, count), 1, Mat<float>(), proposed.Cols(first, count));
    });
    Widen(proposed, actions);
    return OkStatus();
  });
}

Status FloatModel::ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                                  MatrixView<double> actions) noexcept {
  Status status = CheckLatents("ProposeSamples", latents.cols, latents.rows, latents.rows);
  if (status.ok()) status = CheckSeeds("ProposeSamples", seeds, latents.rows);
  if (!status.ok()) return status;
  if (actions.cols != action_size() || actions.rows == 0 || actions.rows % latents.rows != 0) {
    return WrongSize("ProposeSamples", "actions (n a latent)", latents.rows, action_size(),
                     actions.rows, actions.cols);
  }
  return Guarded("ProposeSamples", [&] {
    const Mat<float> proposed = actions_.Shape(a_, static_cast<Index>(actions.rows));
    const Index each = proposed.cols / static_cast<Index>(latents.rows);
    const Mat<float> noise = Noise(seeds, a_, each);
    ForBlocks(static_cast<Index>(latents.rows), [&](Index first, Index count) {
      Act(StatesOf(latents).Cols(first, count), each, noise.Cols(first * each, count * each),
          proposed.Cols(first * each, count * each));
    });
    Widen(proposed, actions);
    return OkStatus();
  });
}

Status FloatModel::InitialLatent(Latents latents) noexcept {
  const Status status = CheckLatents("InitialLatent", latents.cols, latents.rows, latents.rows);
  if (!status.ok()) return status;
  std::memset(latents.data, 0, latents.size());
  return OkStatus();
}

Status FloatModel::Observe(const ObserveRequest& request, Latents latents) noexcept {
  const std::uint64_t rows = request.previous.rows;
  const auto o = static_cast<std::uint64_t>(sizes_.observation);
  Status status = CheckLatents("Observe", request.previous.cols, rows, rows);
  if (status.ok()) status = CheckLatents("Observe", latents.cols, latents.rows, rows);
  if (status.ok()) status = CheckActions("Observe", request.actions, rows);
  if (!status.ok()) return status;
  if (request.observations.rows != rows || request.observations.cols != o) {
    return WrongSize("Observe", "observations", rows, o, request.observations.rows,
                     request.observations.cols);
  }
  if (status = CheckSeeds("Observe", request.seeds, rows); !status.ok()) return status;
  return Guarded("Observe", [&] {
    const auto n = static_cast<Index>(rows);
    const Mat<float> actions = Actions(request.actions);
    const Mat<float> next = states_.Shape(sizes_.state, n);
    const Mat<const float> noise = Noise(request.seeds, sizes_.belief_noise);
    ForBlocks(n, [&](Index first, Index count) {
      Believe(StatesOf(request.previous).Cols(first, count), actions.Cols(first, count),
              request.observations.data + first * sizes_.observation, Part(noise, first, count),
              next.Cols(first, count));
    });
    return WriteLatents("Observe", next, latents);
  });
}

Status FloatModel::Train(const TrainRequest& request, View<double> metrics) noexcept {
  const auto expected = static_cast<std::uint64_t>(sizes_.metrics);
  if (metrics.size != expected) return WrongSize("Train", "metrics", 1, expected, 1, metrics.size);
  return Guarded("Train", [&] { return Update(request, metrics.data); });
}

Status FloatModel::Save(ByteSink* sink) const noexcept {
  return Guarded("Save", [&] { return SaveTo(sink); });
}

Status FloatModel::Load(ByteSource* source) noexcept {
  return Guarded("Load", [&] { return LoadFrom(source); });
}

Status FloatModel::Export(TensorSink* sink) const noexcept {
  return Guarded("Export", [&] { return ExportTo(sink); });
}

}  // namespace dreamsearch::networks
