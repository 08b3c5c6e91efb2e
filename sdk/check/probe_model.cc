#include "probe_model.h"

#include "dreamsearch/random.h"

namespace dreamsearch::check {
namespace {

constexpr double kDiscount = 0.97, kDeviation = 0.1;
constexpr std::uint64_t kMagic = 0x70726f6265206d6full;

std::uint64_t Checksum(const std::byte* data, std::uint64_t size) {
  std::uint64_t sum = 14695981039346656037ull;
  for (std::uint64_t i = 0; i < size; ++i) {
    sum = (sum ^ static_cast<std::uint64_t>(data[i])) * 1099511628211ull;
  }
  return sum;
}

template <typename T>
std::string Shape(const MatrixView<T>& matrix) {
  return "[" + std::to_string(matrix.rows) + ", " + std::to_string(matrix.cols) + "]";
}

}  // namespace

ProbeModel::ProbeModel(std::uint64_t action_size, std::uint64_t latent_bytes)
    : action_size_(action_size), latent_bytes_(latent_bytes) {}

void ProbeModel::Write(const State& state, View<std::byte> latent) const {
  std::memcpy(latent.data + kHeader, &state, sizeof state);
  // The rest depends on the state too, so that half a copy shows.
  for (std::uint64_t i = kHeader + sizeof state; i < latent.size; ++i) {
    latent[i] = latent[kHeader + i % sizeof state] ^ static_cast<std::byte>(i);
  }
  const std::uint64_t sum = Checksum(latent.data + kHeader, latent.size - kHeader);
  std::memcpy(latent.data, &kMagic, sizeof kMagic);
  std::memcpy(latent.data + 8, &sum, sizeof sum);
}

ProbeModel::State ProbeModel::Read(const char* call, ConstLatents latents, std::uint64_t row) {
  const View<const std::byte> latent = latents.row(row);
  std::uint64_t magic = 0, sum = 0;
  std::memcpy(&magic, latent.data, sizeof magic);
  std::memcpy(&sum, latent.data + 8, sizeof sum);
  if (magic != kMagic || sum != Checksum(latent.data + kHeader, latent.size - kHeader)) {
    if (expected_.empty())
      Blame(std::string(call) + " with latents of this model, as it gave them",
            "bytes in row " + std::to_string(row) + " that it never gave, or that were written to");
    return {};
  }
  State state;
  std::memcpy(&state, latent.data + kHeader, sizeof state);
  return state;
}

void ProbeModel::Blame(const std::string& expected, const std::string& found) {
  expected_ = expected;
  found_ = found;
}

void ProbeModel::CheckCalls() const { Expect(expected_.empty(), expected_, found_); }

template <typename Describe>
Status ProbeModel::Sizes(const char* call, bool fit, Describe describe) {
  if (fit) return OkStatus();
  const std::string given = describe();
  if (expected_.empty())
    Blame(std::string(call) + " with views of the sizes that model.h names", given);
  return Error(StatusCode::kInvalidArgument,
               "%s was given %s; latents of %llu bytes and actions of %llu components are the "
               "model's",
               call, given.c_str(), static_cast<unsigned long long>(latent_bytes_),
               static_cast<unsigned long long>(action_size_));
}

void ProbeModel::CheckActions(const char* call, MatrixView<const double> actions) {
  for (std::uint64_t i = 0; i < actions.size(); ++i) {
    const double a = actions.data[i];
    if (std::abs(a) <= 1) continue;
    if (expected_.empty())
      Blame(std::string(call) + " with actions in [-1, 1]", "an action of " + Number(a));
    return;
  }
}

Status ProbeModel::Begin() {
  ++calls;
  if (answers == Answers::kFails && calls > calls_until_failure) {
    return Error(StatusCode::kInternal, "the probe fails on purpose");
  }
  return OkStatus();
}

double ProbeModel::Told(double good) const {
  switch (answers) {
    case Answers::kNan:
      return std::numeric_limits<double>::quiet_NaN();
    case Answers::kInfinite:
      return std::numeric_limits<double>::infinity();
    case Answers::kHuge:
      return good < 0 ? -1e300 : 1e300;
    default:
      return good;
  }
}

double ProbeModel::Move(View<const double> action, State* state) {
  double effort = 0;
  for (std::uint64_t j = 0; j < action.size; ++j) {
    state->x[j % 4] += 0.3 * action[j];
    effort += action[j] * action[j];
  }
  for (double& x : state->x) x *= 0.9;
  return std::cos(state->x[0] + 0.5 * state->x[1]) - 0.02 * effort;
}

double ProbeModel::ValueOf(const State& state) { return 10 * std::cos(state.x[0]) + state.x[2]; }

Status ProbeModel::Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept {
  if (Status status = Begin(); !status.ok()) return status;
  const std::uint64_t rows = request.latents.rows;
  const bool fit = request.latents.cols == latent_bytes_ && request.actions.rows == rows &&
                   request.actions.cols == action_size_ && request.seeds.size == rows &&
                   result.latents.rows == rows && result.latents.cols == latent_bytes_ &&
                   result.rewards.size == rows && result.discounts.size == rows;
  const Status sizes = Sizes("Imagine", fit, [&] {
    return Shape(request.latents) + " latents, " + Shape(request.actions) + " actions, " +
           std::to_string(request.seeds.size) + " seeds, and room for " + Shape(result.latents) +
           " latents, " + std::to_string(result.rewards.size) + " rewards and " +
           std::to_string(result.discounts.size) + " discounts";
  });
  if (!sizes.ok()) return sizes;
  const std::byte* from = request.latents.data;
  const std::byte* to = result.latents.data;
  if (rows > 0 && from < to + result.latents.size() && to < from + request.latents.size()) {
    if (expected_.empty())
      Blame("Imagine with room for s' beside the latents of s",
            "room that overlaps them: a latent imagined in place");
  }
  CheckActions("Imagine", request.actions);
  imagined += rows;
  for (std::uint64_t i = 0; i < rows; ++i) {
    State state = Read("Imagine", request.latents, i);
    const double good = Move(request.actions.row(i), &state);
    result.rewards[i] = Told(good);
    result.discounts[i] =
        answers == Answers::kNan || answers == Answers::kInfinite ? Told(kDiscount) : kDiscount;
    Write(state, result.latents.row(i));
  }
  return OkStatus();
}

Status ProbeModel::Value(ConstLatents latents, View<double> values) noexcept {
  return Spread(latents, {.values = values});
}

Status ProbeModel::Spread(ConstLatents latents, const SpreadResult& result) noexcept {
  if (Status status = Begin(); !status.ok()) return status;
  const bool fit = latents.cols == latent_bytes_ && HasRoom(result, latents.rows);
  const Status sizes = Sizes("Value", fit, [&] {
    return Shape(latents) + " latents, and room for " + std::to_string(result.values.size) +
           " values, " + std::to_string(result.deviations.size) + " deviations and " +
           std::to_string(result.least.size) + " least values";
  });
  if (!sizes.ok()) return sizes;
  for (std::uint64_t i = 0; i < latents.rows; ++i) {
    const double good = ValueOf(Read("Value", latents, i));
    result.values[i] = Told(good);
    if (!result.deviations.empty()) result.deviations[i] = Told(kDeviation);
    if (!result.least.empty()) result.least[i] = Told(good - kDeviation);
  }
  return OkStatus();
}

// The state before transition t is x_t; x_{t+1} = 0.9 (x_t + 0.3 B a_t), where B adds action
// component j to entry j mod 4. The value's deviation is the same everywhere.
Status ProbeModel::Gradient(const GradientRequest& request, const GradientResult& result) noexcept {
  if (Status status = Begin(); !status.ok()) return status;
  const std::uint64_t rows = request.latents.rows;
  const bool fit = request.latents.cols == latent_bytes_ && rows > 0 &&
                   request.actions.rows % rows == 0 && request.actions.cols == action_size_ &&
                   request.seeds.size == request.actions.rows && result.returns.size == rows &&
                   result.gradients.rows == request.actions.rows &&
                   result.gradients.cols == action_size_;
  const Status sizes = Sizes("Gradient", fit, [&] {
    return Shape(request.latents) + " latents, " + Shape(request.actions) + " actions, " +
           std::to_string(request.seeds.size) + " seeds, and room for " +
           std::to_string(result.returns.size) + " returns and " + Shape(result.gradients) +
           " gradients";
  });
  if (!sizes.ok()) return sizes;
  CheckActions("Gradient", request.actions);
  const std::uint64_t horizon = request.actions.rows / rows;
  for (std::uint64_t b = 0; b < rows; ++b) {
    const State first = Read("Gradient", request.latents, b);
    State state = first;
    double discount = 1, sum = 0;
    for (std::uint64_t t = 0; t < horizon; ++t) {
      discount *= kDiscount;
      sum += discount * Move(request.actions.row(b * horizon + t), &state);
    }
    const double spread = request.least ? -kDeviation : request.deviations * kDeviation;
    result.returns[b] = Told(sum + discount * (ValueOf(state) + spread));
    // Backwards, from the value; the states again from the front, which is short.
    double of_state[4] = {-10 * std::sin(state.x[0]) * discount, 0, discount, 0};
    for (std::uint64_t t = horizon; t-- > 0;) {
      State after = first;
      for (std::uint64_t s = 0; s <= t; ++s) Move(request.actions.row(b * horizon + s), &after);
      const double slope = -discount * std::sin(after.x[0] + 0.5 * after.x[1]);
      of_state[0] += slope;
      of_state[1] += 0.5 * slope;
      const View<double> gradient = result.gradients.row(b * horizon + t);
      for (double& entry : of_state) entry *= 0.9;
      for (std::uint64_t j = 0; j < action_size_; ++j) {
        gradient[j] =
            Told(0.3 * of_state[j % 4] - 0.04 * discount * request.actions(b * horizon + t, j));
      }
      discount /= kDiscount;
    }
  }
  return OkStatus();
}

void ProbeModel::ModeOf(const State& state, View<double> action) const {
  for (std::uint64_t j = 0; j < action.size; ++j) action[j] = std::tanh(-state.x[j % 4]);
}

void ProbeModel::Sample(const State& state, std::uint64_t seed, View<double> action) const {
  Random random(seed);
  for (std::uint64_t j = 0; j < action.size; ++j) {
    action[j] = std::tanh(-state.x[j % 4] + 0.5 * random.Normal());
  }
}

Status ProbeModel::ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept {
  if (Status status = Begin(); !status.ok()) return status;
  const bool fit =
      latents.cols == latent_bytes_ && actions.rows == latents.rows && actions.cols == action_size_;
  const Status sizes = Sizes("ProposeMode", fit, [&] {
    return Shape(latents) + " latents, and room for " + Shape(actions) + " actions";
  });
  if (!sizes.ok()) return sizes;
  for (std::uint64_t i = 0; i < latents.rows; ++i) {
    ModeOf(Read("ProposeMode", latents, i), actions.row(i));
    if (answers == Answers::kNan || answers == Answers::kInfinite) actions(i, 0) = Told(0);
  }
  return OkStatus();
}

Status ProbeModel::ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                                  MatrixView<double> actions) noexcept {
  if (Status status = Begin(); !status.ok()) return status;
  const bool fit = latents.cols == latent_bytes_ && latents.rows > 0 &&
                   actions.rows % latents.rows == 0 && actions.cols == action_size_ &&
                   seeds.size == latents.rows;
  const Status sizes = Sizes("ProposeSamples", fit, [&] {
    return Shape(latents) + " latents, " + std::to_string(seeds.size) + " seeds, and room for " +
           Shape(actions) + " actions";
  });
  if (!sizes.ok()) return sizes;
  const std::uint64_t each = actions.rows / latents.rows;
  for (std::uint64_t i = 0; i < latents.rows; ++i) {
    const State state = Read("ProposeSamples", latents, i);
    for (std::uint64_t j = 0; j < each; ++j) {
      Sample(state, DeriveSeed(seeds[i], j), actions.row(i * each + j));
      if (answers == Answers::kNan || answers == Answers::kInfinite) {
        actions(i * each + j, 0) = Told(0);
      }
    }
  }
  return OkStatus();
}

void ProbeModel::MakeLatent(std::uint64_t seed, Latents latent) const {
  Random random(seed);
  State state;
  for (double& x : state.x) x = random.Uniform(-1, 1);
  Write(state, latent.row(0));
}

}  // namespace dreamsearch::check
