#include "plugins/model_tdmpc/learner.h"

#include <algorithm>
#include <cmath>

#include "dreamsearch/random.h"
#include "plugins/networks/noise.h"

namespace dreamsearch::tdmpc {
namespace {

// Streams of an update's seed; those of the model's are the groups.
enum Stream : std::uint64_t { kTargetNoise = 1, kActorNoise = 2, kTargetCritics = 3 };

constexpr std::uint64_t kSavedMark = 0x31636d7064747364ull;

}  // namespace

template <typename T>
Learner<T>::Learner(const Settings& settings, Index observation_size, Index action_size,
                    std::uint64_t seed)
    : agent_(settings, observation_size, action_size, seed),
      settings_(agent_.settings),
      o_(agent_.o),
      a_(agent_.a),
      l_(agent_.l),
      statistics_(observation_size),
      next_statistics_(observation_size) {}

template <typename T>
Status Learner<T>::Read(const SequenceBatch& batch, std::uint64_t seed) {
  const Status status = CheckSequences(batch, o_, a_);
  if (!status.ok()) return status;
  if (batch.length < 2) {
    return Error(StatusCode::kInvalidArgument,
                 "expected sequences of at least 2 decisions (run.sequence_length), found 1");
  }
  step_.agent = &agent_;
  step_.batch = Received(batch);
  step_.horizon = static_cast<Index>(batch.length) - 1;
  step_.standardisation = standardisation();
  step_.statistics = &next_statistics_;
  step_.return_scale = return_scale_.divisor();
  step_.first_values = &first_values_;
  const Index horizon = step_.horizon;
  const auto sequences = static_cast<Index>(batch.sequences);
  // What is known with this batch; it becomes current in Apply.
  next_statistics_.Include(statistics_, batch.observations);
  const auto& goes_on = batch.discounts;
  step_.ends_seen = agent_.ends_seen != 0 || std::count(goes_on.begin(), goes_on.end(), 0.0f) > 0;

  step_.steps.assign(batch.sequences, horizon);
  for (Index j = sequences * (horizon + 1); j-- > 0;) {
    const Index t = j % (horizon + 1);
    if (t == 0 || batch.is_first[static_cast<std::uint64_t>(j)] == 0) continue;
    step_.steps[static_cast<std::size_t>(j / (horizon + 1))] = t - 1;
  }
  step_.all_steps = 0;
  for (const Index steps : step_.steps) step_.all_steps += static_cast<double>(steps);

  const auto draw = [&](Stream stream, Index columns, Buffer<T>* noise) {
    FillNormal(DeriveSeed(seed, stream), noise->Reserve(a_ * columns), a_ * columns);
  };
  draw(kTargetNoise, sequences * horizon, &step_.target_noise);
  draw(kActorNoise, sequences * (horizon + 1), &step_.actor_noise);
  step_.target_critics.resize(static_cast<std::size_t>(settings_.critics));
  for (std::size_t k = 0; k < step_.target_critics.size(); ++k) {
    step_.target_critics[k] = static_cast<Index>(k);
  }
  if (!settings_.target_of_all && step_.target_critics.size() > 2) {
    Random random(DeriveSeed(seed, kTargetCritics));
    for (std::size_t k = 0; k < 2; ++k) {
      std::swap(step_.target_critics[k],
                step_.target_critics[k + random.Below(step_.target_critics.size() - k)]);
    }
    step_.target_critics.resize(2);
  }

  first_values_.resize(batch.sequences);
  lanes_ = std::min((sequences + kSequencesPerLane - 1) / kSequencesPerLane, kMaxLanes);
  for (Index i = 0; i < lanes_; ++i) {
    Lane<T>& lane = lane_[static_cast<std::size_t>(i)];
    lane.first = i * sequences / lanes_;
    lane.count = (i + 1) * sequences / lanes_ - lane.first;
  }
  return status;
}

template <typename T>
void Learner<T>::Gradients(UpdateLosses* losses, const Stops<T>* stops) {
  threads_.Run(lanes_,
               [&](Index i) { LearnIn(step_, stops, &lane_[static_cast<std::size_t>(i)]); });
  double norms[kGroups];
  threads_.Run(kGroups, [&](Index g) {
    const auto which = static_cast<std::size_t>(g);
    ParameterGroup<T>& group = agent_.groups[which];
    group.ClearGradient();
    for (Index i = 0; i < lanes_; ++i) {
      const T* gradient = lane_[static_cast<std::size_t>(i)].gradients[which].data();
      Add<T>(Mat<const T>(gradient, group.size(), 1), Mat<T>(group.gradient(), group.size(), 1));
    }
    norms[which] = GradientNorm(group);
  });
  *losses = UpdateLosses();
  for (Index i = 0; i < lanes_; ++i) {
    const UpdateLosses& share = lane_[static_cast<std::size_t>(i)].losses;
    for (std::size_t k = 0; k < kLosses; ++k) (*losses)[k] += share[k];
  }
  (*losses)[kModelLoss] = settings_.consistency_weight * (*losses)[kConsistencyLoss] +
                          settings_.reward_weight * (*losses)[kRewardLoss] +
                          settings_.value_weight * (*losses)[kValueLoss] +
                          settings_.continuation_weight * (*losses)[kContinuationLoss];
  if ((*losses)[kSearched] > 0) (*losses)[kImitationLoss] /= (*losses)[kSearched];
  (*losses)[kModelNorm] = std::hypot(norms[kEncoder], std::hypot(norms[kModel], norms[kCritic]));
  (*losses)[kActorNorm] = norms[kActor];
}

template <typename T>
Stops<T> Learner<T>::stops() const {
  const Lane<T>& lane = lane_[0];
  const Index n = step_.horizon * lane.count;
  return {{lane.encoded.data(), lane.encoded.data() + l_ * (n + lane.count)},
          {lane.targets.data(), lane.targets.data() + n}};
}

template <typename T>
Status Learner<T>::CheckFinite(const UpdateLosses& losses, std::uint64_t update) const {
  for (std::size_t k = 0; k < kLosses; ++k) {
    if (std::isfinite(losses[k])) continue;
    return Error(StatusCode::kNotFinite, "update %llu: %s is %g, expected a finite number",
                 static_cast<unsigned long long>(update), kMetrics[k].name, losses[k]);
  }
  return OkStatus();
}

template <typename T>
void Learner<T>::Apply(const UpdateLosses& losses) {
  ++updates_;
  threads_.Run(kGroups, [&](Index g) {
    const bool actor = g == kActor;
    const double rate = actor           ? settings_.actor_learning_rate
                        : g == kEncoder ? settings_.learning_rate * settings_.encoder_rate_factor
                                        : settings_.learning_rate;
    const AdamSettings adam{
        .epsilon = actor ? settings_.actor_adam_epsilon : settings_.adam_epsilon,
        .gradient_clip = settings_.gradient_clip};
    ParameterGroup<T>& group = agent_.groups[static_cast<std::size_t>(g)];
    MoveGroup(adam, rate, actor ? losses[kActorNorm] : losses[kModelNorm], updates_, &group);
    group.Pack();
    if (g != kCritic) return;
    agent_.target.Follow(group, settings_.target_rate);
    agent_.target.Pack();
  });
  return_scale_.Include(&first_values_, settings_.return_scale_rate, updates_ == 1);
  std::swap(statistics_, next_statistics_);
  agent_.ends_seen = step_.ends_seen ? 1 : 0;
}

template <typename T>
Status Learner<T>::Update(const TrainRequest& request, UpdateLosses* losses) {
  Status status = Read(*request.batch, request.seed);
  if (!status.ok()) return status;
  Gradients(losses);
  status = CheckFinite(*losses, request.update);
  if (status.ok()) Apply(*losses);
  return status;
}

template <typename T>
LearnerState<T> Learner<T>::State() {
  LearnerState<T> state{kSavedMark, o_, a_, &return_scale_, &statistics_, &agent_.target.values()};
  for (ParameterGroup<T>& group : agent_.groups) state.groups.push_back(&group);
  state.counters = {&updates_, &agent_.ends_seen};
  return state;
}

template <typename T>
Status Learner<T>::Load(ByteSource* source) {
  const Status status = State().Load("tdmpc", source);
  agent_.Pack();
  return status;
}

template class Learner<float>;
template class Learner<double>;

}  // namespace dreamsearch::tdmpc
