#include "plugins/model_dreamer/learner.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "dreamsearch/random.h"
#include "plugins/networks/noise.h"

namespace dreamsearch::dreamer {
namespace {

// Streams of an update's seed and of the model's.
enum Stream : std::uint64_t {
  kPosteriorNoise = 1,
  kStarts = 2,
  kLatentNoise = 3,
  kActionNoise = 4,
  kModelParameters = 5,
  kActorParameters = 6,
  kValueParameters = 7,
};

constexpr std::uint64_t kSavedMagic = 0x32726d7264736400ull;

// A number for the names and shapes of all tensors (FNV-1a).
template <typename T>
std::uint64_t ArchitectureOf(std::initializer_list<const ParameterGroup<T>*> groups) {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  const auto add = [&hash](std::uint64_t value) { hash = (hash ^ value) * 0x100000001b3ull; };
  for (const ParameterGroup<T>* group : groups) {
    for (const Tensor& tensor : group->tensors()) {
      for (const char c : tensor.name) add(static_cast<unsigned char>(c));
      add(static_cast<std::uint64_t>(tensor.rows));
      add(static_cast<std::uint64_t>(tensor.cols));
    }
  }
  return hash;
}

// Of the observations standardised by `s`; the deviation has a floor.
double InverseDeviation(const ObservationStatistics& s, std::size_t i, double floor) {
  return 1.0 / std::max(std::sqrt(s.variance[i]), floor);
}

template <typename T, typename S>
void StandardiseBy(const ObservationStatistics& statistics, const Settings& settings,
                   const S* observations, Mat<T> x) {
  const bool active = settings.normalise_observations && statistics.batches > 0;
  for (Index i = 0; i < x.rows; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double mean = active ? statistics.mean[k] : 0;
    const double inverse = active ? InverseDeviation(statistics, k, settings.observation_floor) : 1;
    const double clip = settings.observation_clip;
    for (Index j = 0; j < x.cols; ++j) {
      double value = (static_cast<double>(observations[j * x.rows + i]) - mean) * inverse;
      // Comparisons that leave NaN as it is.
      if (active && value > clip) value = clip;
      if (active && value < -clip) value = -clip;
      x(i, j) = static_cast<T>(value);
    }
  }
}

// The value at the given fraction of the sorted order, between two linearly.
template <typename T>
double Percentile(std::vector<T>* values, double fraction) {
  const double position = fraction * static_cast<double>(values->size() - 1);
  const auto low = static_cast<std::ptrdiff_t>(position);
  std::nth_element(values->begin(), values->begin() + low, values->end());
  const auto below = static_cast<double>((*values)[static_cast<std::size_t>(low)]);
  if (static_cast<std::size_t>(low) + 1 >= values->size()) return below;
  const auto above =
      static_cast<double>(*std::min_element(values->begin() + low + 1, values->end()));
  return below + (position - static_cast<double>(low)) * (above - below);
}

template <typename T>
double Norm(const ParameterGroup<T>& group) {
  return std::sqrt(SumOfSquares(group.gradient(), group.size()));
}

template <typename T>
Status WriteArray(ByteSink* sink, const T* values, Index count) {
  return sink->Write(values, static_cast<std::uint64_t>(count) * sizeof(T));
}
template <typename T>
Status ReadArray(ByteSource* source, T* values, Index count) {
  return source->Read(values, static_cast<std::uint64_t>(count) * sizeof(T));
}

}  // namespace

template <typename T>
Learner<T>::Learner(const Settings& settings, Index observation_size, Index action_size,
                    std::uint64_t seed)
    : settings_(settings),
      o_(observation_size),
      a_(action_size),
      world_(settings, observation_size, action_size),
      behaviour_(settings, action_size) {
  Rounding rounding;
  if (std::is_same_v<T, float> && Bfloat16Available()) {
    rounding = {settings.bfloat16, settings.bfloat16_planning};
  }
  world_.group().Allocate(DeriveSeed(seed, kModelParameters), rounding);
  behaviour_.Allocate(DeriveSeed(seed, kActorParameters), DeriveSeed(seed, kValueParameters),
                      rounding);
  PackWeights();
  statistics_.mean.assign(static_cast<std::size_t>(o_), 0.0);
  statistics_.variance.assign(static_cast<std::size_t>(o_), 1.0);
  next_statistics_ = statistics_;
}

template <typename T>
void Learner<T>::SetThreads(Index threads) noexcept {
  // No more than an update has tasks: the fit, two a lane, and two sums.
  threads_.Resize(std::min<Index>(threads, 1 + 2 * kMaxLanes + 2));
}

template <typename T>
template <typename S>
void Learner<T>::Standardise(const S* observations, Mat<T> x) const {
  StandardiseBy(statistics_, settings_, observations, x);
}

template <typename T>
Status Learner<T>::Read(const SequenceBatch& batch, std::uint64_t seed) {
  const std::uint64_t rows = batch.sequences * batch.length;
  const auto o = static_cast<std::uint64_t>(o_);
  const auto a = static_cast<std::uint64_t>(a_);
  if (rows == 0 || batch.observations.rows != rows || batch.observations.cols != o ||
      batch.actions.rows != rows || batch.actions.cols != a || batch.rewards.size != rows ||
      batch.discounts.size != rows || batch.is_first.size != rows) {
    return Error(StatusCode::kInvalidArgument,
                 "a batch of %llu sequences of %llu steps with %llu observations and %llu actions "
                 "expected; found views of %llu x %llu, %llu x %llu, %llu, %llu and %llu",
                 static_cast<unsigned long long>(batch.sequences),
                 static_cast<unsigned long long>(batch.length), static_cast<unsigned long long>(o),
                 static_cast<unsigned long long>(a),
                 static_cast<unsigned long long>(batch.observations.rows),
                 static_cast<unsigned long long>(batch.observations.cols),
                 static_cast<unsigned long long>(batch.actions.rows),
                 static_cast<unsigned long long>(batch.actions.cols),
                 static_cast<unsigned long long>(batch.rewards.size),
                 static_cast<unsigned long long>(batch.discounts.size),
                 static_cast<unsigned long long>(batch.is_first.size));
  }
  const auto count = static_cast<Index>(batch.sequences);
  const auto length = static_cast<Index>(batch.length);
  const Index n = count * length;
  firsts_.clear();
  for (Index t = 1; t < length; ++t) {
    for (Index b = 0; b < count; ++b) {
      if (batch.is_first[static_cast<std::uint64_t>(b * length + t)] != 0) {
        firsts_.push_back(t * count + b);
      }
    }
  }

  // The statistics with this batch; they become the current ones in Apply.
  next_statistics_.batches = statistics_.batches + 1;
  const double rate = 1.0 / static_cast<double>(next_statistics_.batches);
  for (Index i = 0; i < o_; ++i) {
    const auto k = static_cast<std::size_t>(i);
    double sum = 0;
    for (Index j = 0; j < n; ++j) sum += static_cast<double>(batch.observations.data[j * o_ + i]);
    const double mean = sum / static_cast<double>(n);
    double squares = 0;
    for (Index j = 0; j < n; ++j) {
      const double d = static_cast<double>(batch.observations.data[j * o_ + i]) - mean;
      squares += d * d;
    }
    const double shift = mean - statistics_.mean[k];
    next_statistics_.mean[k] = statistics_.mean[k] + rate * shift;
    next_statistics_.variance[k] = (1 - rate) * (statistics_.variance[k] + rate * shift * shift) +
                                   rate * squares / static_cast<double>(n);
  }

  // Batch-major rows become time-major columns.
  const Mat<T> observations = observations_.Shape(o_, n);
  const Mat<T> actions = actions_.Shape(a_, n);
  const Mat<T> rewards = rewards_.Shape(1, n);
  const Mat<T> continues = continues_.Shape(1, n);
  for (Index b = 0; b < count; ++b) {
    for (Index t = 0; t < length; ++t) {
      const Index row = b * length + t;
      const Index column = t * count + b;
      StandardiseBy(next_statistics_, settings_, batch.observations.data + row * o_,
                    observations.Cols(column, 1));
      for (Index i = 0; i < a_; ++i) {
        actions(i, column) = static_cast<T>(batch.actions.data[row * a_ + i]);
      }
      rewards(0, column) = static_cast<T>(batch.rewards.data[row]);
      continues(0, column) =
          static_cast<T>(settings_.discount * static_cast<double>(batch.discounts.data[row]));
    }
  }
  const Mat<T> noise = noise_.Shape(settings_.stochastic, n);
  FillNormal(DeriveSeed(seed, kPosteriorNoise), noise.data, noise.size());
  batch_ = {count,   length,    observations, actions,
            rewards, continues, noise,        {firsts_.data(), firsts_.size()}};

  // The dreams' starts, without replacement.
  const Index skip = std::min(settings_.start_skip, length - 1);
  const Index eligible = n - skip * count;
  const Index wanted = settings_.imagination_starts == 0
                           ? eligible
                           : std::min(settings_.imagination_starts, eligible);
  starts_.resize(static_cast<std::size_t>(wanted));
  candidates_.resize(static_cast<std::size_t>(eligible));
  for (Index j = 0; j < eligible; ++j) candidates_[static_cast<std::size_t>(j)] = skip * count + j;
  Random random(DeriveSeed(seed, kStarts));
  for (std::size_t j = 0; j < starts_.size(); ++j) {
    if (wanted < eligible) {
      std::swap(candidates_[j], candidates_[j + random.Below(candidates_.size() - j)]);
    }
    starts_[j] = candidates_[j];
  }
  // In the order of time, so that the first can dream while the posterior unrolls.
  std::sort(starts_.begin(), starts_.end());
  const Mat<T> latent = latent_noise_.Shape(settings_.stochastic, wanted * settings_.horizon);
  FillNormal(DeriveSeed(seed, kLatentNoise), latent.data, latent.size());
  const Mat<T> action = action_noise_.Shape(a_, wanted * settings_.horizon);
  FillNormal(DeriveSeed(seed, kActionNoise), action.data, action.size());
  return OkStatus();
}

template <typename T>
void Learner<T>::Gradients(UpdateLosses* losses) {
  states_known_.Reset();
  const Index tasks = BeginDream(nullptr);
  threads_.Run(1 + tasks, [&](Index task) {
    if (task == 0) {
      FitGradients(losses);
    } else {
      DreamTask(task - 1, losses);
    }
  });
  behaviour_.EndDream(&losses->dream);
}

template <typename T>
void Learner<T>::FitGradients(UpdateLosses* losses) {
  world_.group().ClearGradient();
  world_.Unroll(batch_, &states_known_);
  world_.Fit(batch_, &losses->fit);
  losses->model_gradient_norm = Norm(world_.group());
}

template <typename T>
void Learner<T>::DreamGradients(UpdateLosses* losses, const DreamStops<T>* stops) {
  const Index tasks = BeginDream(stops);
  threads_.Run(tasks, [&](Index task) { DreamTask(task, losses); });
  behaviour_.EndDream(&losses->dream);
}

template <typename T>
Index Learner<T>::BeginDream(const DreamStops<T>* stops) {
  const auto count = static_cast<Index>(starts_.size());
  DreamInput<T> input;
  input.states = world_.ReserveStates(batch_);
  input.starts = {starts_.data(), starts_.size()};
  input.known = &states_known_;
  input.latent_noise = latent_noise_.Shape(settings_.stochastic, count * settings_.horizon);
  input.action_noise = action_noise_.Shape(a_, count * settings_.horizon);
  input.return_scale = settings_.percentile_return_scale ? std::max(1.0, return_scale_) : 1.0;
  input.stops = stops;
  lanes_ = behaviour_.BeginDream(input);
  return 2 * lanes_ + 2;
}

template <typename T>
void Learner<T>::DreamTask(Index task, UpdateLosses* losses) {
  if (task < lanes_) {
    behaviour_.DreamIn(task, world_);
  } else if (task < 2 * lanes_) {
    behaviour_.LearnIn(task - lanes_);
  } else if (task == 2 * lanes_) {
    behaviour_.actor().ClearGradient();
    behaviour_.AddActorGradients();
    losses->actor_gradient_norm = Norm(behaviour_.actor());
  } else {
    behaviour_.value().ClearGradient();
    behaviour_.AddValueGradients();
    losses->value_gradient_norm = Norm(behaviour_.value());
  }
}

template <typename T>
Status Learner<T>::CheckFinite(const UpdateLosses& losses, std::uint64_t update) const {
  const struct {
    const char* name;
    double value;
  } found[] = {
      {"observation loss", losses.fit.observation},
      {"reward loss", losses.fit.reward},
      {"continuation loss", losses.fit.continuation},
      {"KL divergence", losses.fit.kl},
      {"actor loss", losses.dream.actor},
      {"value loss", losses.dream.value},
      {"world model's gradient norm", losses.model_gradient_norm},
      {"actor's gradient norm", losses.actor_gradient_norm},
      {"value's gradient norm", losses.value_gradient_norm},
  };
  for (const auto& item : found) {
    if (std::isfinite(item.value)) continue;
    return Error(StatusCode::kNotFinite, "finite losses expected at update %llu; the %s is %g",
                 static_cast<unsigned long long>(update), item.name, item.value);
  }
  return OkStatus();
}

template <typename T>
void Learner<T>::Apply(const UpdateLosses& losses) {
  ++updates_;
  const auto step = [&](ParameterGroup<T>& group, double rate, double norm) {
    AdamStep adam;
    adam.learning_rate = rate;
    adam.beta1 = settings_.adam_beta1;
    adam.beta2 = settings_.adam_beta2;
    adam.epsilon = settings_.adam_epsilon;
    adam.factor = norm > settings_.gradient_clip ? settings_.gradient_clip / norm : 1.0;
    adam.rate1 = 1 / (1 - std::pow(adam.beta1, static_cast<double>(updates_)));
    adam.rate2 = 1 / (1 - std::pow(adam.beta2, static_cast<double>(updates_)));
    ApplyAdam(adam, group.size(), group.gradient(), group.first(), group.second(), group.values());
  };
  threads_.Run(2, [&](Index task) {
    if (task == 0) {
      step(world_.group(), settings_.model_learning_rate, losses.model_gradient_norm);
      world_.group().Pack();
    } else {
      step(behaviour_.actor(), settings_.actor_learning_rate, losses.actor_gradient_norm);
      step(behaviour_.value(), settings_.value_learning_rate, losses.value_gradient_norm);
      if (settings_.slow_critic_weight > 0) behaviour_.UpdateSlow();
      behaviour_.Pack();
    }
  });
  if (settings_.percentile_return_scale) {
    returns_copy_.assign(behaviour_.returns().begin(), behaviour_.returns().end());
    const double low = Percentile(&returns_copy_, 0.05);
    const double range = Percentile(&returns_copy_, 0.95) - low;
    return_scale_ = updates_ == 1
                        ? range
                        : return_scale_ + settings_.return_scale_rate * (range - return_scale_);
  }
  std::swap(statistics_, next_statistics_);
}

template <typename T>
void Learner<T>::PackWeights() {
  world_.group().Pack();
  behaviour_.Pack();
}

template <typename T>
Status Learner<T>::Update(const TrainRequest& request, UpdateLosses* losses) {
  Status status = Read(request.batch, request.seed);
  if (!status.ok()) return status;
  Gradients(losses);
  status = CheckFinite(*losses, request.update);
  if (!status.ok()) return status;
  Apply(*losses);
  return OkStatus();
}

template <typename T>
std::uint64_t Learner<T>::Architecture() const {
  return ArchitectureOf<T>({&world_.group(), &behaviour_.actor(), &behaviour_.value()});
}

template <typename T>
Status Learner<T>::Save(ByteSink* sink) const {
  const std::uint64_t header[] = {kSavedMagic,
                                  sizeof(T),
                                  static_cast<std::uint64_t>(o_),
                                  static_cast<std::uint64_t>(a_),
                                  static_cast<std::uint64_t>(world_.group().size()),
                                  static_cast<std::uint64_t>(behaviour_.actor().size()),
                                  static_cast<std::uint64_t>(behaviour_.value().size()),
                                  Architecture(),
                                  updates_,
                                  statistics_.batches};
  Status status = sink->Write(header, sizeof header);
  if (status.ok()) status = WriteValue(sink, return_scale_);
  if (status.ok()) status = WriteArray(sink, statistics_.mean.data(), o_);
  if (status.ok()) status = WriteArray(sink, statistics_.variance.data(), o_);
  for (const ParameterGroup<T>* group :
       {&world_.group(), &behaviour_.actor(), &behaviour_.value()}) {
    if (status.ok()) status = WriteArray(sink, group->values(), group->size());
    if (status.ok()) status = WriteArray(sink, group->first(), group->size());
    if (status.ok()) status = WriteArray(sink, group->second(), group->size());
  }
  if (status.ok()) {
    status = WriteArray(sink, behaviour_.slow().data(), behaviour_.value().size());
  }
  return status;
}

template <typename T>
Status Learner<T>::Load(ByteSource* source) {
  std::uint64_t header[10] = {};
  Status status = source->Read(header, sizeof header);
  if (!status.ok()) return status;
  const std::uint64_t expected[] = {kSavedMagic,
                                    sizeof(T),
                                    static_cast<std::uint64_t>(o_),
                                    static_cast<std::uint64_t>(a_),
                                    static_cast<std::uint64_t>(world_.group().size()),
                                    static_cast<std::uint64_t>(behaviour_.actor().size()),
                                    static_cast<std::uint64_t>(behaviour_.value().size()),
                                    Architecture()};
  const char* const names[] = {"mark",        "bytes a number",   "observation size",
                               "action size", "world model size", "actor size",
                               "value size",  "architecture"};
  for (std::size_t i = 0; i < sizeof expected / sizeof *expected; ++i) {
    if (header[i] == expected[i]) continue;
    return Error(StatusCode::kDataLoss, "saved dreamer: %s %llu expected, %llu found", names[i],
                 static_cast<unsigned long long>(expected[i]),
                 static_cast<unsigned long long>(header[i]));
  }
  updates_ = header[8];
  statistics_.batches = header[9];
  status = ReadValue(source, &return_scale_);
  if (status.ok()) status = ReadArray(source, statistics_.mean.data(), o_);
  if (status.ok()) status = ReadArray(source, statistics_.variance.data(), o_);
  for (ParameterGroup<T>* group : {&world_.group(), &behaviour_.actor(), &behaviour_.value()}) {
    if (status.ok()) status = ReadArray(source, group->values(), group->size());
    if (status.ok()) status = ReadArray(source, group->first(), group->size());
    if (status.ok()) status = ReadArray(source, group->second(), group->size());
  }
  if (status.ok()) {
    status = ReadArray(source, behaviour_.slow().data(), behaviour_.value().size());
  }
  PackWeights();
  return status;
}

template <typename T>
Status Learner<T>::Export(TensorSink* sink) const {
  std::vector<float> rows;
  for (const ParameterGroup<T>* group :
       {&world_.group(), &behaviour_.actor(), &behaviour_.value()}) {
    for (const Tensor& tensor : group->tensors()) {
      rows.resize(static_cast<std::size_t>(tensor.rows * tensor.cols));
      const Mat<const T> values(group->values() + tensor.offset, tensor.rows, tensor.cols);
      for (Index i = 0; i < tensor.rows; ++i) {
        for (Index j = 0; j < tensor.cols; ++j) {
          rows[static_cast<std::size_t>(i * tensor.cols + j)] = static_cast<float>(values(i, j));
        }
      }
      const std::uint64_t shape[] = {static_cast<std::uint64_t>(tensor.rows),
                                     static_cast<std::uint64_t>(tensor.cols)};
      const bool vector = tensor.cols == 1 && !tensor.name.ends_with(".weight");
      const Status status =
          sink->Tensor(tensor.name.c_str(), {shape, vector ? 1u : 2u}, {rows.data(), rows.size()});
      if (!status.ok()) return status;
    }
  }
  std::vector<float> statistics(static_cast<std::size_t>(o_));
  const std::uint64_t shape[] = {static_cast<std::uint64_t>(o_)};
  std::copy(statistics_.mean.begin(), statistics_.mean.end(), statistics.begin());
  Status status = sink->Tensor("observation_statistics.mean", {shape, 1},
                               {statistics.data(), statistics.size()});
  if (!status.ok()) return status;
  std::copy(statistics_.variance.begin(), statistics_.variance.end(), statistics.begin());
  return sink->Tensor("observation_statistics.variance", {shape, 1},
                      {statistics.data(), statistics.size()});
}

#define DREAMER_INSTANTIATE(T) \
  template class Learner<T>;   \
  template void Learner<T>::Standardise<double>(const double*, Mat<T>) const;
DREAMER_INSTANTIATE(float)
DREAMER_INSTANTIATE(double)
#undef DREAMER_INSTANTIATE

}  // namespace dreamsearch::dreamer
