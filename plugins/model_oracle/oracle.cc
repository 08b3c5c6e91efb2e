// oracle.cc (over 400 lines: one class, every call of which reads and writes the latent below) -
// the simulator itself as a model, so that a planner's error can be told
// from a model's (Koul et al. 2020, "oracle dynamics"; Moerland et al. 2018 searched
// with true dynamics).
//
// Latent      one word that says whether the episode is over, the environment's saved
//             state, then, if a trained run was given (the *trained model*), that run's
//             latent; both parts begin at multiples of kLatentAlignment.
// Transition  restore the state into an environment of its own, map the action to its
//             bounds, step it once for every action repeat, sum the rewards. The
//             trained model's latent follows by observing what the simulator shows.
// Proposal    the trained model's actor, or uniform or Gaussian actions whose mode is 0.
// Value       the trained model's critic, or 0.
//
// After the time limit or a terminal state nothing moves, the trained model's latent
// included, and nothing pays: reward 0, discount 0. A transition in which the simulator
// warned is the end too: it pays what was earned before the warning.
//
// It learns nothing: Train is kUnimplemented, Save writes nothing; a trained model is
// saved by whoever trained it.
#include <exception>
#include <string>
#include <vector>

#include "dreamsearch/planning.h"

namespace dreamsearch {
namespace {

enum class Proposal { kAuto, kUniform, kGaussian, kActor };
enum class ValueOf { kAuto, kZero, kCritic };
struct OracleSettings {
  double discount;
  Proposal proposal;
  double proposal_std;
  ValueOf value;
};
constexpr auto kSettings = BindSettings<OracleSettings>(
    Bind<&OracleSettings::discount>(
        RealParameter("discount", 0.99, 0, 1, "",
                      "Discount of a decision that does not end in a terminal state (Koul et al. "
                      "2020).")),
    Bind<&OracleSettings::proposal>(
        ChoiceParameter("proposal", "auto", "auto,uniform,gaussian,actor",
                        "Actions proposed: uniform in [-1, 1], Gaussian, or the given run's actor; "
                        "auto is the actor if a run is given, otherwise uniform.")),
    Bind<&OracleSettings::proposal_std>(
        RealParameter("proposal_std", 0.5, 0, 10, "",
                      "Standard deviation of the Gaussian proposal, which is clipped to [-1, 1].")),
    Bind<&OracleSettings::value>(ChoiceParameter(
        "value", "auto", "auto,zero,critic",
        "Value of a latent: 0 or the given run's critic; auto is the critic if a run "
        "is given, otherwise 0.")));

class Oracle final : public Offers<Model, ValueSpread> {
 public:
  explicit Oracle(const ModelContext& context)
      : Oracle(context, kSettings.Read(context.parameters)) {}

  std::uint64_t latent_bytes() const noexcept override { return trained_offset_ + trained_bytes_; }
  std::uint64_t action_size() const noexcept override { return action_size_; }

  Status InitialLatent(Latents latents) noexcept override {
    if (Status status = CheckLatents(latents); !status.ok()) return status;
    std::memset(latents.data, 0, latents.size());
    if (trained_ == nullptr) return OkStatus();
    const Latents initial = Staged(trained_before_, latents.rows);
    if (Status status = trained_->InitialLatent(initial); !status.ok()) return status;
    Scatter(initial, latents);
    return OkStatus();
  }

  Status Observe(const ObserveRequest& request, Latents latents) noexcept override {
    if (Status status = CheckLatents(request.previous); !status.ok()) return status;
    if (Status status = CheckLatents(latents); !status.ok()) return status;
    const MatrixView<const std::byte> states = request.environment_states;
    if (latents.rows != request.previous.rows || states.rows != latents.rows ||
        states.cols != state_bytes_) {
      return Error(StatusCode::kInvalidArgument,
                   "Observe: expected [%llu, %llu] bytes of environment state, got [%llu, %llu]",
                   static_cast<unsigned long long>(request.previous.rows),
                   static_cast<unsigned long long>(state_bytes_),
                   static_cast<unsigned long long>(states.rows),
                   static_cast<unsigned long long>(states.cols));
    }
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      std::memset(latents.row(i).data, 0, trained_offset_);
      std::memcpy(latents.row(i).data + kStateOffset, states.row(i).data, state_bytes_);
    }
    if (trained_ == nullptr) return OkStatus();
    return FollowTrainedModel(request.previous, request.actions, request.observations,
                              request.seeds, latents);
  }

  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override {
    if (Status status = CheckLatents(request.latents); !status.ok()) return status;
    if (Status status = CheckLatents(result.latents); !status.ok()) return status;
    const std::uint64_t rows = request.latents.rows;
    if (Status status = CheckActions(request.actions, rows); !status.ok()) return status;
    if (result.latents.rows != rows || result.rewards.size != rows ||
        result.discounts.size != rows) {
      return Error(StatusCode::kInvalidArgument,
                   "Imagine: %llu latents, but room for %llu latents, %llu rewards and %llu "
                   "discounts",
                   static_cast<unsigned long long>(rows),
                   static_cast<unsigned long long>(result.latents.rows),
                   static_cast<unsigned long long>(result.rewards.size),
                   static_cast<unsigned long long>(result.discounts.size));
    }
    if (trained_ != nullptr && observations_.size() < rows * observation_size_) {
      observations_.resize(rows * observation_size_);
    }
    ended_.clear();
    for (std::uint64_t i = 0; i < rows; ++i) {
      Status status =
          Step(request.latents.middle_rows(i, 1), request.actions.row(i),
               result.latents.middle_rows(i, 1), &result.rewards[i], &result.discounts[i]);
      if (!status.ok()) return status;
      if (trained_ != nullptr) {
        if (!observed_) ended_.push_back(i);
        std::copy(observation_.begin(), observation_.end(),
                  observations_.begin() + static_cast<std::ptrdiff_t>(i * observation_size_));
      }
    }
    if (trained_ == nullptr) return OkStatus();
    Status status = FollowTrainedModel(request.latents, request.actions,
                                       {observations_.data(), rows, observation_size_},
                                       request.seeds, result.latents);
    if (!status.ok()) return status;
    for (const std::uint64_t i : ended_) {
      std::memcpy(result.latents.row(i).data + trained_offset_,
                  request.latents.row(i).data + trained_offset_, trained_bytes_);
    }
    return OkStatus();
  }

  Status Value(ConstLatents latents, View<double> values) noexcept override {
    if (Status status = CheckLatents(latents); !status.ok()) return status;
    if (values.size != latents.rows) {
      return Error(StatusCode::kInvalidArgument, "Value: %llu latents, but room for %llu values",
                   static_cast<unsigned long long>(latents.rows),
                   static_cast<unsigned long long>(values.size));
    }
    if (critic_) return trained_->Value(Gather(latents), values);
    std::fill(values.begin(), values.end(), 0.0);
    return OkStatus();
  }

  // Where the value is the trained run's, so is its spread.
  Status Spread(ConstLatents latents, const SpreadResult& result) noexcept override {
    if (Status status = CheckLatents(latents); !status.ok()) return status;
    return trained_spread_->Spread(Gather(latents), result);
  }
  void* Extension(const char* name) noexcept override {
    return trained_spread_ != nullptr ? Offers::Extension(name) : nullptr;
  }

  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override {
    if (Status status = CheckLatents(latents); !status.ok()) return status;
    if (Status status = CheckActions(actions, latents.rows); !status.ok()) return status;
    if (actor_) return trained_->ProposeMode(Gather(latents), actions);
    std::fill_n(actions.data, actions.size(), 0.0);
    return OkStatus();
  }

  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept override {
    if (Status status = CheckLatents(latents); !status.ok()) return status;
    if (latents.rows == 0 || actions.rows % latents.rows != 0 || actions.cols != action_size_ ||
        seeds.size != latents.rows) {
      return Error(StatusCode::kInvalidArgument,
                   "ProposeSamples: %llu seeds and actions of [%llu, %llu], expected [%llu * n, "
                   "%llu] and a seed a latent",
                   static_cast<unsigned long long>(seeds.size),
                   static_cast<unsigned long long>(actions.rows),
                   static_cast<unsigned long long>(actions.cols),
                   static_cast<unsigned long long>(latents.rows),
                   static_cast<unsigned long long>(action_size_));
    }
    if (actor_) return trained_->ProposeSamples(Gather(latents), seeds, actions);
    const std::uint64_t each = actions.rows / latents.rows;
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      Random random(seeds[i]);
      const MatrixView<double> own = actions.middle_rows(i * each, each);
      for (std::uint64_t j = 0; j < own.size(); ++j) {
        own.data[j] = uniform_ ? random.Uniform(-1, 1)
                               : std::clamp(proposal_std_ * random.Normal(), -1.0, 1.0);
      }
    }
    return OkStatus();
  }

  Status Train(const TrainRequest&, View<double>) noexcept override {
    return Error(StatusCode::kUnimplemented, "the oracle is the simulator: nothing to learn");
  }
  void SetThreads(std::uint32_t threads) noexcept override {
    if (trained_ != nullptr) trained_->SetThreads(threads);
  }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override { delete this; }

 private:
  Oracle(const ModelContext& context, const OracleSettings& settings)
      : environment_(*context.environment),
        saving_(ExtensionOf<StateSaving>(context.environment)),
        trained_(context.trained_model),
        action_size_(context.action_size),
        observation_size_(context.observation_size),
        action_repeat_(context.action_repeat),
        discount_(settings.discount),
        uniform_(settings.proposal == Proposal::kUniform ||
                 (settings.proposal == Proposal::kAuto && trained_ == nullptr)),
        actor_(settings.proposal == Proposal::kActor ||
               (settings.proposal == Proposal::kAuto && trained_ != nullptr)),
        critic_(settings.value == ValueOf::kCritic ||
                (settings.value == ValueOf::kAuto && trained_ != nullptr)),
        trained_spread_(critic_ && trained_ != nullptr ? ExtensionOf<ValueSpread>(trained_)
                                                       : nullptr),
        proposal_std_(settings.proposal_std),
        state_bytes_(saving_ != nullptr ? saving_->state_bytes() : 0),
        trained_offset_(Padded(kStateOffset + state_bytes_)),
        trained_bytes_(trained_ != nullptr ? trained_->latent_bytes() : 0),
        current_(state_bytes_),
        bounded_(action_size_),
        observation_(observation_size_) {
    if (trained_ == nullptr && (actor_ || critic_)) {
      throw std::invalid_argument(
          "proposal=actor and value=critic need a trained run, and none was given");
    }
    if (state_bytes_ == 0) {
      throw std::invalid_argument("the environment cannot save its state, which is the latent");
    }
    const EnvironmentSpec& spec = environment_.spec();
    if (spec.action_size != action_size_ || spec.observation_size != observation_size_) {
      throw std::invalid_argument(
          "the model is for " + std::to_string(action_size_) + " action and " +
          std::to_string(observation_size_) + " observation components, its environment has " +
          std::to_string(spec.action_size) + " and " + std::to_string(spec.observation_size));
    }
  }
  ~Oracle() = default;

  // What the first bytes of a latent say.
  using Over = std::uint64_t;
  static constexpr std::uint64_t kStateOffset = sizeof(Over);

  static std::uint64_t Padded(std::uint64_t bytes) noexcept {
    return (bytes + kLatentAlignment - 1) / kLatentAlignment * kLatentAlignment;
  }

  Status CheckLatents(ConstLatents latents) const noexcept {
    if (latents.cols == latent_bytes()) return OkStatus();
    return Error(StatusCode::kInvalidArgument, "latents of %llu bytes, expected %llu",
                 static_cast<unsigned long long>(latents.cols),
                 static_cast<unsigned long long>(latent_bytes()));
  }
  Status CheckActions(MatrixView<const double> actions, std::uint64_t rows) const noexcept {
    if (actions.rows == rows && actions.cols == action_size_) return OkStatus();
    return Error(StatusCode::kInvalidArgument, "actions are [%llu, %llu], expected [%llu, %llu]",
                 static_cast<unsigned long long>(actions.rows),
                 static_cast<unsigned long long>(actions.cols),
                 static_cast<unsigned long long>(rows),
                 static_cast<unsigned long long>(action_size_));
  }

  // One transition of the simulator; leaves what it showed in observation_, zeros where
  // it showed nothing: then observed_ is false.
  Status Step(ConstLatents from, View<const double> action, Latents to, double* reward,
              double* discount) noexcept {
    std::memcpy(to.data, from.data, trained_offset_);
    *reward = 0;
    *discount = 0;
    observed_ = false;
    std::fill(observation_.begin(), observation_.end(), 0.0);
    Over over = 0;
    std::memcpy(&over, from.data, sizeof over);
    if (over != 0) return OkStatus();

    // The simulator often stands where the last transition ended: along a trajectory.
    const View<const std::byte> state{from.data + kStateOffset, state_bytes_};
    if (!current_valid_ || std::memcmp(current_.data(), state.data, state.size) != 0) {
      current_valid_ = false;
      if (Status status = saving_->RestoreState(state); !status.ok()) return status;
    }
    current_valid_ = false;
    ToEnvironmentBounds(environment_.spec(), action, {bounded_.data(), action_size_});
    StepResult step;
    for (std::uint32_t i = 0; i < action_repeat_ && !step.last; ++i) {
      Status status = environment_.Step({bounded_.data(), action_size_},
                                        {observation_.data(), observation_size_}, &step);
      if (status.code == StatusCode::kDiverged) {
        over = 1;
        std::memcpy(to.data, &over, sizeof over);
        *discount = 0;
        std::fill(observation_.begin(), observation_.end(), 0.0);
        return OkStatus();
      }
      if (!status.ok()) return status;
      *reward += step.reward;
      *discount = discount_ * step.discount;
    }
    const View<std::byte> after{to.data + kStateOffset, state_bytes_};
    if (Status status = saving_->SaveState(after); !status.ok()) return status;
    std::memcpy(current_.data(), after.data, after.size);
    current_valid_ = true;
    observed_ = true;
    over = step.last ? 1 : 0;
    std::memcpy(to.data, &over, sizeof over);
    return OkStatus();
  }

  // The trained model's latents of `to`, after `actions` from those of `from`.
  Status FollowTrainedModel(ConstLatents from, MatrixView<const double> actions,
                            MatrixView<const double> observations, View<const std::uint64_t> seeds,
                            Latents to) noexcept {
    const ConstLatents before = Gather(from);
    const Latents after = Staged(trained_after_, to.rows);
    ObserveRequest request;
    request.previous = before;
    request.actions = actions;
    request.observations = observations;
    request.seeds = seeds;
    if (Status status = trained_->Observe(request, after); !status.ok()) return status;
    Scatter(after, to);
    return OkStatus();
  }

  // The trained model's latents among ours, row by row without gaps.
  ConstLatents Gather(ConstLatents latents) noexcept {
    const Latents staged = Staged(trained_before_, latents.rows);
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      std::memcpy(staged.row(i).data, latents.row(i).data + trained_offset_, trained_bytes_);
    }
    return staged;
  }
  void Scatter(ConstLatents staged, Latents latents) const noexcept {
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      std::memcpy(latents.row(i).data + trained_offset_, staged.row(i).data, trained_bytes_);
    }
  }
  // Room for `rows` of the trained model's latents; grows to the largest batch seen.
  Latents Staged(LatentBuffer& buffer, std::uint64_t rows) const noexcept {
    if (buffer.rows() < rows) buffer = LatentBuffer(rows, trained_bytes_);
    return buffer.middle_rows(0, rows);
  }

  Environment& environment_;
  StateSaving* const saving_;
  Model* const trained_;
  const std::uint64_t action_size_;
  const std::uint64_t observation_size_;
  const std::uint32_t action_repeat_;
  const double discount_;
  const bool uniform_;
  const bool actor_;
  const bool critic_;
  ValueSpread* const trained_spread_;  // null: the value is not the trained run's, or has none
  const double proposal_std_;
  const std::uint64_t state_bytes_;
  const std::uint64_t trained_offset_;
  const std::uint64_t trained_bytes_;

  // The state the simulator is in, when known.
  std::vector<std::byte> current_;
  bool current_valid_ = false;

  std::vector<double> bounded_;      // [A]
  std::vector<double> observation_;  // [O]
  bool observed_ = false;
  std::vector<double> observations_;  // [largest batch, O]
  std::vector<std::uint64_t> ended_;  // rows in which nothing moved
  LatentBuffer trained_before_;
  LatentBuffer trained_after_;
};

Status CreateOracle(const ModelContext& context, Model** result) noexcept {
  *result = nullptr;
  if (context.environment == nullptr) {
    return Error(StatusCode::kInvalidArgument, "the oracle needs an environment, none was given");
  }
  try {
    *result = new Oracle(context);
    return OkStatus();
  } catch (const std::invalid_argument& error) {
    return Error(StatusCode::kInvalidArgument, "%s", error.what());
  } catch (const std::exception& error) {
    return Error(StatusCode::kInternal, "cannot make the oracle: %s", error.what());
  }
}

constexpr ComponentDescriptor kComponents[] = {{
    .kind = ComponentKind::kModel,
    .traits = kNeedsEnvironment | kDefault,
    .name = "oracle",
    .version = "1.0.0",
    .summary = "The simulator itself as the model; proposal and value from a trained run or none",
    .parameters = kSettings.declared(),
    .create_model = CreateOracle,
}};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("model_oracle", "1.0.0", dreamsearch::kComponents)
