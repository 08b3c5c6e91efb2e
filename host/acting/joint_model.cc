// Over 400 lines: every call of a model is put, joined and handed back, one after the other.
#include "host/acting/joint_model.h"

#include <algorithm>
#include <cassert>
#include <cstring>

#include "host/acting/activity_clock.h"
#include "host/acting/fiber.h"

namespace dreamsearch {
namespace {

// Memory for `size` values, which are lost when it grows.
template <typename T>
T* Room(std::vector<T>* values, std::uint64_t size) {
  if (values->size() < size) values->resize(size);
  return values->data();
}

Latents Room(LatentBuffer* buffer, std::uint64_t rows, std::uint64_t bytes) {
  if (buffer->rows() < rows) *buffer = LatentBuffer(std::max(rows, 2 * buffer->rows()), bytes);
  return buffer->middle_rows(0, rows);
}

template <typename T>
void CopyIn(const T* from, std::uint64_t count, T** to) {
  if (count != 0) std::memcpy(*to, from, count * sizeof(T));
  *to += count;
}

template <typename T>
void CopyOut(const T** from, std::uint64_t count, T* to) {
  if (count != 0) std::memcpy(to, *from, count * sizeof(T));
  *from += count;
}

}  // namespace

// A call of a seat that waits for its answer, with views of the caller's memory.
struct JointModel::PendingCall {
  // What can be called, in the order in which it is answered: a tree search proposes
  // actions, imagines where they lead and values what it found; a decision begins with an
  // observation.
  enum class Kind { kProposeMode, kProposeSamples, kImagine, kGradient, kValue, kSpread, kObserve };

  Kind kind = Kind::kProposeMode;
  ConstLatents latents;                   // every kind's
  MatrixView<const double> actions;       // kImagine, kGradient, kObserve
  MatrixView<const double> observations;  // kObserve
  MatrixView<const std::byte> states;     // kObserve
  View<const std::uint64_t> seeds;        // all but kProposeMode, kValue, kSpread
  Latents next;                           // kObserve
  ImagineResult imagined;
  View<double> values;  // kValue
  SpreadResult spread;
  double deviations = 0;  // kGradient, as `least`
  bool least = false;
  GradientResult gradient;
  MatrixView<double> proposed;  // kProposeMode, kProposeSamples

  std::uint64_t rows() const { return latents.rows; }
  std::uint64_t samples() const { return rows() == 0 ? 0 : proposed.rows / rows(); }
  // Actions a row: of kGradient a sequence's.
  std::uint64_t steps() const { return rows() == 0 ? 0 : actions.rows / rows(); }

  // Calls that one request can make.
  bool JoinsWith(const PendingCall& other) const {
    return kind == other.kind && rows() != 0 && other.rows() != 0 && samples() == other.samples() &&
           steps() == other.steps() && states.cols == other.states.cols &&
           spread.deviations.empty() == other.spread.deviations.empty() &&
           spread.least.empty() == other.spread.least.empty() && deviations == other.deviations &&
           least == other.least;
  }

  Status Ask(Model* model) const noexcept {
    switch (kind) {
      case Kind::kProposeMode:
        return model->ProposeMode(latents, proposed);
      case Kind::kProposeSamples:
        return model->ProposeSamples(latents, seeds, proposed);
      case Kind::kImagine:
        return model->Imagine({latents, actions, seeds}, imagined);
      case Kind::kGradient:
        return ExtensionOf<ReturnGradient>(model)->Gradient(
            {latents, actions, seeds, deviations, least}, gradient);
      case Kind::kValue:
        return model->Value(latents, values);
      case Kind::kSpread:
        return ExtensionOf<ValueSpread>(model)->Spread(latents, spread);
      case Kind::kObserve:
        return model->Observe({latents, actions, observations, states, seeds}, next);
    }
    return OkStatus();
  }
};

class JointModel::Seat final : public Offers<Model, ValueSpread, ReturnGradient> {
 public:
  Seat(JointModel* joint, std::size_t index) : joint_(joint), index_(index) {}
  ~Seat() = default;

  std::uint64_t latent_bytes() const noexcept override { return joint_->model_->latent_bytes(); }
  std::uint64_t action_size() const noexcept override { return joint_->model_->action_size(); }

  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override {
    PendingCall pending;
    pending.kind = PendingCall::Kind::kImagine;
    pending.latents = request.latents;
    pending.actions = request.actions;
    pending.seeds = request.seeds;
    pending.imagined = result;
    return Put(pending);
  }
  Status Value(ConstLatents latents, View<double> values) noexcept override {
    PendingCall pending;
    pending.kind = PendingCall::Kind::kValue;
    pending.latents = latents;
    pending.values = values;
    return Put(pending);
  }
  Status Spread(ConstLatents latents, const SpreadResult& result) noexcept override {
    PendingCall pending;
    pending.kind = PendingCall::Kind::kSpread;
    pending.latents = latents;
    pending.spread = result;
    return Put(pending);
  }
  Status Gradient(const GradientRequest& request, const GradientResult& result) noexcept override {
    PendingCall pending;
    pending.kind = PendingCall::Kind::kGradient;
    pending.latents = request.latents;
    pending.actions = request.actions;
    pending.seeds = request.seeds;
    pending.deviations = request.deviations;
    pending.least = request.least;
    pending.gradient = result;
    return Put(pending);
  }
  // Those of the model that can be joined.
  void* Extension(const char* name) noexcept override {
    return joint_->model_->Extension(name) != nullptr ? Offers::Extension(name) : nullptr;
  }
  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override {
    PendingCall pending;
    pending.kind = PendingCall::Kind::kProposeMode;
    pending.latents = latents;
    pending.proposed = actions;
    return Put(pending);
  }
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept override {
    PendingCall pending;
    pending.kind = PendingCall::Kind::kProposeSamples;
    pending.latents = latents;
    pending.seeds = seeds;
    pending.proposed = actions;
    return Put(pending);
  }
  Status Observe(const ObserveRequest& request, Latents latents) noexcept override {
    PendingCall pending;
    pending.kind = PendingCall::Kind::kObserve;
    pending.latents = request.previous;
    pending.actions = request.actions;
    pending.observations = request.observations;
    pending.states = request.environment_states;
    pending.seeds = request.seeds;
    pending.next = latents;
    return Put(pending);
  }

  // Nothing to join.
  Status InitialLatent(Latents latents) noexcept override {
    return joint_->model_->InitialLatent(latents);
  }
  Status Train(const TrainRequest& request, View<double> metrics) noexcept override {
    return joint_->model_->Train(request, metrics);
  }
  void SetThreads(std::uint32_t threads) noexcept override { joint_->model_->SetThreads(threads); }
  Status Save(ByteSink* sink) const noexcept override { return joint_->model_->Save(sink); }
  Status Load(ByteSource* source) noexcept override { return joint_->model_->Load(source); }
  void Destroy() noexcept override {}

  Fiber fiber;
  const PendingCall* asked = nullptr;  // set while its work waits for an answer
  Status answer;
  double seconds = 0;

 private:
  Status Put(const PendingCall& pending) noexcept {
    if (joint_->running_ != index_) return pending.Ask(joint_->model_);
    asked = &pending;
    fiber.Pause();
    return answer;
  }

  friend class JointModel;
  JointModel* const joint_;
  const std::size_t index_;
};

JointModel::JointModel(Model* model, std::size_t seats) : model_(model), running_(seats) {
  for (std::size_t i = 0; i < seats; ++i) seats_.push_back(std::make_unique<Seat>(this, i));
  asking_.reserve(seats);
}

JointModel::~JointModel() = default;

Model* JointModel::seat(std::size_t i) { return seats_[i].get(); }

double JointModel::Seconds(std::size_t i) const {
  return seats_[i]->seconds + (running_ == i ? ActivityClock::Now() - slice_began_ : 0);
}

void JointModel::RunAll(Call call, void* context) {
  call_ = call;
  context_ = context;
  for (std::size_t i = 0; i < seats(); ++i) Continue(i, true);
  while (std::any_of(seats_.begin(), seats_.end(),
                     [](const auto& seat) { return seat->asked != nullptr; })) {
    Answer();
  }
}

void JointModel::Continue(std::size_t i, bool begin) {
  Seat* seat = seats_[i].get();
  running_ = i;
  slice_began_ = ActivityClock::Now();
  if (begin) {
    seat->fiber.Start(
        [](void* context) noexcept {
          auto* self = static_cast<Seat*>(context);
          self->joint_->call_(self->joint_->context_, self->index_);
        },
        seat);
  } else {
    seat->asked = nullptr;
    seat->fiber.Resume();
  }
  seat->seconds += ActivityClock::Now() - slice_began_;
  running_ = seats();
}

void JointModel::Answer() {
  const double began = ActivityClock::Now();
  const PendingCall* first = nullptr;
  for (const auto& seat : seats_) {
    if (seat->asked == nullptr) continue;
    if (first == nullptr || seat->asked->kind < first->kind) first = seat->asked;
  }
  asking_.clear();
  std::uint64_t rows = 0;
  for (std::size_t i = 0; i < seats(); ++i) {
    const PendingCall* pending = seats_[i]->asked;
    if (pending == nullptr) continue;
    if (pending != first && (!pending->JoinsWith(*first) || rows + pending->rows() > kMostRows)) {
      continue;
    }
    asking_.push_back(i);
    rows += pending->rows();
  }
  if (asking_.size() == 1 || !AskJointly()) {
    for (const std::size_t i : asking_) seats_[i]->answer = seats_[i]->asked->Ask(model_);
  }
  const double share = (ActivityClock::Now() - began) / static_cast<double>(asking_.size());
  for (const std::size_t i : asking_) seats_[i]->seconds += share;
  for (const std::size_t i : asking_) Continue(i, false);
}

bool JointModel::AskJointly() {
  const std::uint64_t latent_bytes = model_->latent_bytes();
  const PendingCall& first = *seats_[asking_.front()]->asked;
  std::uint64_t rows = 0;
  for (const std::size_t i : asking_) rows += seats_[i]->asked->rows();

  PendingCall all;
  all.kind = first.kind;
  std::byte* latents = Room(&latents_, rows, latent_bytes).data;
  const std::uint64_t steps = rows * first.steps();
  double* actions =
      Room(&actions_, std::max(steps, rows * first.samples()) * model_->action_size());
  double* observations = Room(&observations_, rows * first.observations.cols);
  std::byte* states = Room(&states_, rows * first.states.cols);
  const std::uint64_t seed_count = all.kind == PendingCall::Kind::kGradient ? steps : rows;
  std::uint64_t* seeds = Room(&seeds_, seed_count);
  all.latents = {latents, rows, latent_bytes};
  all.seeds = {seeds, seed_count};
  all.observations = {observations, rows, first.observations.cols};
  if (first.states.cols != 0) all.states = {states, rows, first.states.cols};
  for (const std::size_t i : asking_) {
    const PendingCall& pending = *seats_[i]->asked;
    CopyIn(pending.latents.data, pending.latents.size(), &latents);
    CopyIn(pending.actions.data, pending.actions.size(), &actions);
    CopyIn(pending.observations.data, pending.observations.size(), &observations);
    CopyIn(pending.states.data, pending.states.size(), &states);
    CopyIn(pending.seeds.data, pending.seeds.size, &seeds);
  }
  switch (all.kind) {
    case PendingCall::Kind::kProposeMode:
    case PendingCall::Kind::kProposeSamples:
      all.proposed = {actions_.data(), rows * first.samples(), model_->action_size()};
      break;
    case PendingCall::Kind::kImagine:
      all.actions = {actions_.data(), steps, model_->action_size()};
      all.imagined = {Room(&next_, rows, latent_bytes),
                      {Room(&rewards_, rows), rows},
                      {Room(&discounts_, rows), rows}};
      break;
    case PendingCall::Kind::kGradient:
      all.actions = {actions_.data(), steps, model_->action_size()};
      all.deviations = first.deviations;
      all.least = first.least;
      all.gradient = {
          {Room(&values_, rows), rows},
          {Room(&gradients_, steps * model_->action_size()), steps, model_->action_size()}};
      break;
    case PendingCall::Kind::kValue:
      all.values = {Room(&values_, rows), rows};
      break;
    case PendingCall::Kind::kSpread: {
      double* values = Room(&values_, 3 * rows);
      all.spread.values = {values, rows};
      if (!first.spread.deviations.empty()) all.spread.deviations = {values + rows, rows};
      if (!first.spread.least.empty()) all.spread.least = {values + 2 * rows, rows};
      break;
    }
    case PendingCall::Kind::kObserve:
      all.actions = {actions_.data(), rows, model_->action_size()};
      all.next = Room(&next_, rows, latent_bytes);
      break;
  }
  if (!all.Ask(model_).ok()) return false;

  const std::byte* next =
      all.kind == PendingCall::Kind::kObserve ? all.next.data : all.imagined.latents.data;
  const double* rewards = all.imagined.rewards.data;
  const double* discounts = all.imagined.discounts.data;
  const double* values = all.values.data;
  const double* means = all.spread.values.data;
  const double* deviations = all.spread.deviations.data;
  const double* least = all.spread.least.data;
  const double* returns = all.gradient.returns.data;
  const double* gradients = all.gradient.gradients.data;
  const double* proposed = all.proposed.data;
  for (const std::size_t i : asking_) {
    const PendingCall& pending = *seats_[i]->asked;
    CopyOut(&next, pending.next.size(), pending.next.data);
    CopyOut(&next, pending.imagined.latents.size(), pending.imagined.latents.data);
    CopyOut(&rewards, pending.imagined.rewards.size, pending.imagined.rewards.data);
    CopyOut(&discounts, pending.imagined.discounts.size, pending.imagined.discounts.data);
    CopyOut(&values, pending.values.size, pending.values.data);
    CopyOut(&means, pending.spread.values.size, pending.spread.values.data);
    CopyOut(&deviations, pending.spread.deviations.size, pending.spread.deviations.data);
    CopyOut(&least, pending.spread.least.size, pending.spread.least.data);
    CopyOut(&returns, pending.gradient.returns.size, pending.gradient.returns.data);
    CopyOut(&gradients, pending.gradient.gradients.size(), pending.gradient.gradients.data);
    CopyOut(&proposed, pending.proposed.size(), pending.proposed.data);
    seats_[i]->answer = OkStatus();
  }
  return true;
}

}  // namespace dreamsearch
