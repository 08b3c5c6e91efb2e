#include "plugins/model_dreamer/learner.h"

#include <algorithm>
#include <cmath>

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

}  // namespace

template <typename T>
Learner<T>::Learner(const Settings& settings, Index observation_size, Index action_size,
                    std::uint64_t seed)
    : settings_(settings),
      o_(observation_size),
      a_(action_size),
      world_(settings, observation_size, action_size),
      behaviour_(settings, action_size),
      statistics_(observation_size),
      next_statistics_(observation_size) {
  Rounding rounding;
  if (std::is_same_v<T, float> && Bfloat16Available()) {
    rounding = {settings.bfloat16, settings.bfloat16_planning};
  }
  world_.group().Allocate(DeriveSeed(seed, kModelParameters), rounding);
  behaviour_.Allocate(DeriveSeed(seed, kActorParameters), DeriveSeed(seed, kValueParameters),
                      rounding);
  PackWeights();
}

template <typename T>
void Learner<T>::SetThreads(Index threads) noexcept {
  // No more than an update has tasks: the fit, two a lane, and two sums.
  threads_.Resize(std::min<Index>(threads, 1 + 2 * kMaxLanes + 2));
}

template <typename T>
Status Learner<T>::Read(const SequenceBatch& batch, std::uint64_t seed) {
  const Status status = CheckSequences(batch, o_, a_);
  if (!status.ok()) return status;
  update_batch_ = Received(batch);
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
  next_statistics_.Include(statistics_, batch.observations);

  // Batch-major rows become time-major columns.
  const Mat<T> observations = observations_.Shape(o_, n);
  const Mat<T> actions = actions_.Shape(a_, n);
  const Mat<T> rewards = rewards_.Shape(1, n);
  const Mat<T> continues = continues_.Shape(1, n);
  for (Index b = 0; b < count; ++b) {
    for (Index t = 0; t < length; ++t) {
      const Index row = b * length + t;
      const Index column = t * count + b;
      Standardise(next_statistics_, standardisation(), batch.observations.data + row * o_,
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
  losses->model_gradient_norm = GradientNorm(world_.group());
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
  input.return_scale = settings_.percentile_return_scale ? return_scale_.divisor() : 1.0;
  input.stops = stops;
  input.batch = update_batch_;
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
    losses->actor_gradient_norm = GradientNorm(behaviour_.actor());
  } else {
    behaviour_.value().ClearGradient();
    behaviour_.AddValueGradients();
    losses->value_gradient_norm = GradientNorm(behaviour_.value());
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
    return Error(StatusCode::kNotFinite, "update %llu: the %s is %g, expected a finite number",
                 static_cast<unsigned long long>(update), item.name, item.value);
  }
  return OkStatus();
}

template <typename T>
void Learner<T>::Apply(const UpdateLosses& losses) {
  ++updates_;
  const AdamSettings adam{settings_.adam_beta1, settings_.adam_beta2, settings_.adam_epsilon,
                          settings_.gradient_clip};
  const auto step = [&](ParameterGroup<T>& group, double rate, double norm) {
    MoveGroup(adam, rate, norm, updates_, &group);
  };
  threads_.Run(2, [&](Index task) {
    if (task == 0) {
      step(world_.group(), settings_.model_learning_rate, losses.model_gradient_norm);
      world_.group().Pack();
    } else {
      step(behaviour_.actor(), settings_.actor_learning_rate, losses.actor_gradient_norm);
      step(behaviour_.value(), settings_.value_learning_rate, losses.value_gradient_norm);
      if (settings_.slow_critic_weight > 0) behaviour_.UpdateSlow();
      behaviour_.UpdateActing(updates_);
      behaviour_.Pack();
    }
  });
  if (settings_.percentile_return_scale) {
    returns_copy_.assign(behaviour_.returns().begin(), behaviour_.returns().end());
    return_scale_.Include(&returns_copy_, settings_.return_scale_rate, updates_ == 1);
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
  Status status = Read(*request.batch, request.seed);
  if (!status.ok()) return status;
  Gradients(losses);
  status = CheckFinite(*losses, request.update);
  if (!status.ok()) return status;
  Apply(*losses);
  return OkStatus();
}

template <typename T>
LearnerState<T> Learner<T>::State() {
  LearnerState<T> state{kSavedMagic, o_, a_, &return_scale_, &statistics_, &behaviour_.slow()};
  state.groups = {&world_.group(), &behaviour_.actor(), &behaviour_.value()};
  state.counters = {&updates_};
  state.acting_group = &behaviour_.actor();
  state.acting = behaviour_.acting();
  return state;
}

template <typename T>
Status Learner<T>::Load(ByteSource* source) {
  const Status status = State().Load("dreamer", source);
  PackWeights();
  return status;
}

template class Learner<float>;
template class Learner<double>;

}  // namespace dreamsearch::dreamer
