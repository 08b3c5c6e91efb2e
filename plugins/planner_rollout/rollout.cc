// rollout.cc - tries many first actions and follows the actor from each (Koul et
// al. 2020, section "Rollout").
//
// B candidates (samples of the actor, then uniform ones) start at the root. Each
// trajectory takes its candidate and then the actor's action, `depth` transitions
// in all, the candidate's included; all advance together as one batch. The worth
// of a candidate is the lambda-return of its trajectory,
//
//     V_t = r(s_{t+1}) + gamma * ((1 - lambda) v(s_{t+1}) + lambda V_{t+1}),
//     V_depth = v(s_depth),   Q = V_0,
//
// with gamma the model's discount of that transition. The candidate with the
// largest Q is played, the first of equals; its Q is the value reported, and the improved policy
// reported is that candidate alone (the target of EfficientZero V2, Wang et al. 2024).
#include <limits>
#include <numeric>
#include <vector>

#include "dreamsearch/planning.h"

namespace dreamsearch {
namespace {

struct RolloutSettings : ValueUse {
  std::uint64_t actor_candidates;
  std::uint64_t uniform_candidates;
  std::uint64_t depth;
  double lambda;
  bool sample_continuation;
  double noise_std;
};
constexpr auto kSettings = BindSettings<RolloutSettings>(
    Bind<&RolloutSettings::actor_candidates>(
        IntParameter("actor_candidates", 100, 0, 1000000, "actions",
                     "First actions sampled from the actor (Koul et al. 2020).")),
    Bind<&RolloutSettings::uniform_candidates>(
        IntParameter("uniform_candidates", 50, 0, 1000000, "actions",
                     "First actions drawn uniformly from [-1, 1]^A (Koul et al. 2020).")),
    Bind<&RolloutSettings::depth>(
        IntParameter("depth", 10, 1, 1000, "transitions",
                     "Transitions of a trajectory, the candidate's included (Koul et al. 2020).")),
    Bind<&RolloutSettings::lambda>(RealParameter(
        "lambda", 0.95, 0, 1, "",
        "Mix of the lambda-return: 0 trusts the critic after one transition, 1 only at "
        "the trajectory's end (Koul et al. 2020).")),
    Bind<&RolloutSettings::sample_continuation>(ChoiceParameter(
        "continuation", "mode", "mode,sample",
        "Actions after the first: the actor's mode (the paper's figure) or samples of "
        "it (the paper's text).")),
    Bind<&RolloutSettings::noise_std>(RealParameter(
        "noise_std", 0.3, 0, 10, "",
        "Standard deviation of the Gaussian noise on every candidate and on the played "
        "action while exploring (Koul et al. 2020).")),
    kValueBonusParameter, kValueInEvaluationParameter);

enum Metric { kModeDistance, kQSpread, kMetricCount };
constexpr MetricSpec kMetrics[] = {
    {"mode_distance", "", "Euclidean distance of the played action from the actor's mode action."},
    {"q_spread", "", "Standard deviation of Q over the candidates."},
};
static_assert(std::size(kMetrics) == kMetricCount);

// Streams of a decision's seed.
enum Stream : std::uint64_t {
  kActorCandidates = 1,
  kUniformCandidates = 2,
  kCandidateNoise = 3,
  kImagine = 4,
  kContinuation = 5,
  kPlayedNoise = 6
};

class Rollout final : public Offers<MemorylessPlanner, TreeReporting, PolicyReporting> {
 public:
  explicit Rollout(const PlannerContext& context)
      : Rollout(context, kSettings.Read(context.parameters)) {}

  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    if (Status status = CheckPlan(sizes_, model_, request, result); !status.ok()) return status;
    Status status = model_->ProposeMode(request.root, {mode_.data(), 1, sizes_.action_size});
    if (!status.ok()) return status;
    status = CheckFinite("action component", {mode_.data(), mode_.size()});
    if (!status.ok()) return status;
    if (status = DrawCandidates(request); !status.ok()) return status;
    if (status = Imagine(request); !status.ok()) return status;
    ComputeReturns();
    const View<const double> q{returns_.data(), batch_};
    if (status = CheckFinite("return of candidate", q); !status.ok()) return status;

    best_ = static_cast<std::uint64_t>(std::max_element(q.begin(), q.end()) - q.begin());
    const View<const double> candidate = actions(0).row(best_);
    std::copy_n(candidate.data, candidate.size, played_.data());
    if (request.explore) {
      AddExplorationNoise(settings_.noise_std, DeriveSeed(request.seed, kPlayedNoise),
                          {played_.data(), 1, sizes_.action_size});
    }

    std::copy(played_.begin(), played_.end(), result->action.data);
    result->metrics[kModeDistance] =
        ActionDistance({played_.data(), sizes_.action_size}, {mode_.data(), sizes_.action_size});
    result->metrics[kQSpread] = Spread(q);
    result->value = q[best_];
    result->simulations = static_cast<std::uint32_t>(batch_);
    result->nodes = static_cast<std::uint32_t>(batch_ * settings_.depth + 1);
    result->depth = static_cast<std::uint32_t>(settings_.depth);
    return OkStatus();
  }

  // The candidates, then what follows each of them, transition by transition.
  void ReportTree(TreeSink* tree) noexcept override {
    for (std::uint64_t t = 0; t < settings_.depth; ++t) {
      for (std::uint64_t i = 0; i < batch_; ++i) {
        const std::uint64_t edge = t * batch_ + i;
        tree->Edge({.parent = t == 0 ? -1 : static_cast<std::int64_t>(edge - batch_),
                    .action = actions(t).row(i),
                    .visits = 1,
                    .q = returns_[edge],
                    .prior = t == 0 ? 1.0 / static_cast<double>(batch_) : 1,
                    .reward = rewards_[edge],
                    .discount = discounts_[edge],
                    .value = settings_.lambda < 1 || t + 1 == settings_.depth ? values_[edge] : 0,
                    .expanded = true});
      }
    }
  }

  // The best candidate alone.
  Status ReportPolicy(MatrixView<double> policy, View<double> weights) noexcept override {
    return FillPolicy(
        sizes_, [this](auto visit) { visit(1.0, actions(0).row(best_)); }, policy, weights);
  }

 private:
  Rollout(const PlannerContext& context, const RolloutSettings& settings)
      : Offers(context, kMetricCount),
        settings_(settings),
        batch_(settings.actor_candidates + settings.uniform_candidates),
        search_values_(settings, batch_) {
    if (batch_ == 0) {
      throw std::invalid_argument(
          "actor_candidates and uniform_candidates are both 0, expected at least one candidate");
    }
    latents_[0] = LatentBuffer(batch_, sizes_.latent_bytes);
    latents_[1] = LatentBuffer(batch_, sizes_.latent_bytes);
    seeds_.resize(batch_);
    actions_.resize(settings_.depth * batch_ * sizes_.action_size);
    rewards_.resize(settings_.depth * batch_);
    discounts_.resize(settings_.depth * batch_);
    values_.resize(settings_.depth * batch_);
    returns_.resize(settings_.depth * batch_);
    mode_.resize(sizes_.action_size);
    played_.resize(sizes_.action_size);
  }
  // The actions of transition t. [B, A]
  MatrixView<double> actions(std::uint64_t t) noexcept {
    return {actions_.data() + t * batch_ * sizes_.action_size, batch_, sizes_.action_size};
  }
  // The entries of transition t. [B]
  View<double> Column(std::vector<double>& values, std::uint64_t t) noexcept {
    return {values.data() + t * batch_, batch_};
  }

  // A seed for each trajectory, valid until the next call. [B]
  View<const std::uint64_t> Seeds(std::uint64_t seed) noexcept {
    FillSeeds(seed, {seeds_.data(), batch_});
    return {seeds_.data(), batch_};
  }

  Status DrawCandidates(const PlanRequest& request) noexcept {
    const MatrixView<double> candidates = actions(0);
    if (settings_.actor_candidates > 0) {
      const std::uint64_t seed = DeriveSeed(request.seed, kActorCandidates);
      Status status = model_->ProposeSamples(request.root, {&seed, 1},
                                             candidates.middle_rows(0, settings_.actor_candidates));
      if (!status.ok()) return status;
    }
    const MatrixView<double> uniform =
        candidates.middle_rows(settings_.actor_candidates, settings_.uniform_candidates);
    Random random(DeriveSeed(request.seed, kUniformCandidates));
    for (std::uint64_t i = 0; i < uniform.size(); ++i) uniform.data[i] = random.Uniform(-1, 1);
    if (Status status = CheckFinite("action component", {candidates.data, candidates.size()});
        !status.ok()) {
      return status;
    }
    if (request.explore) {
      AddExplorationNoise(settings_.noise_std, DeriveSeed(request.seed, kCandidateNoise),
                          candidates);
    }
    return OkStatus();
  }

  // Advances all trajectories to their end; fills actions, rewards, discounts and
  // the values that ComputeReturns reads.
  Status Imagine(const PlanRequest& request) noexcept {
    for (std::uint64_t i = 0; i < batch_; ++i) latents_[0].Set(i, request.root);
    const std::uint64_t imagine_seed = DeriveSeed(request.seed, kImagine);
    const std::uint64_t continuation_seed = DeriveSeed(request.seed, kContinuation);
    for (std::uint64_t t = 0; t < settings_.depth; ++t) {
      const Latents from = latents_[t % 2].middle_rows(0, batch_);
      const Latents to = latents_[(t + 1) % 2].middle_rows(0, batch_);
      Status status;
      if (t > 0) {
        status =
            settings_.sample_continuation
                ? model_->ProposeSamples(from, Seeds(DeriveSeed(continuation_seed, t)), actions(t))
                : model_->ProposeMode(from, actions(t));
        if (!status.ok()) return status;
      }
      status = model_->Imagine({from, actions(t), Seeds(DeriveSeed(imagine_seed, t))},
                               {to, Column(rewards_, t), Column(discounts_, t)});
      if (!status.ok()) return status;
      // With lambda = 1 only the last value is in the return.
      if (settings_.lambda < 1 || t + 1 == settings_.depth) {
        status = search_values_.Ask(model_, to, request.explore, Column(values_, t));
        if (!status.ok()) return status;
      }
    }
    return OkStatus();
  }

  void ComputeReturns() noexcept {
    for (std::uint64_t t = settings_.depth; t-- > 0;) {
      for (std::uint64_t i = t * batch_; i < (t + 1) * batch_; ++i) {
        const double after = t + 1 == settings_.depth ? values_[i]
                             : settings_.lambda < 1   ? (1 - settings_.lambda) * values_[i] +
                                                          settings_.lambda * returns_[i + batch_]
                                                    : returns_[i + batch_];
        returns_[i] = rewards_[i] + discounts_[i] * after;
      }
    }
  }

  double Spread(View<const double> q) const noexcept {
    const double mean = std::accumulate(q.begin(), q.end(), 0.0) / static_cast<double>(q.size);
    double squares = 0;
    for (const double value : q) squares += (value - mean) * (value - mean);
    // Returns of 1e200 are finite, their squares are not.
    return std::min(std::sqrt(squares / static_cast<double>(q.size)),
                    std::numeric_limits<double>::max());
  }

  const RolloutSettings settings_;
  const std::uint64_t batch_;  // B
  SearchValues search_values_;
  std::uint64_t best_ = 0;            // the candidate with the largest return
  LatentBuffer latents_[2];           // [B], transitions go from one to the other
  std::vector<std::uint64_t> seeds_;  // [B]
  std::vector<double> actions_;       // [depth, B, A]
  std::vector<double> rewards_;       // [depth, B]
  std::vector<double> discounts_;     // [depth, B]
  std::vector<double> values_;        // [depth, B]: v of the state arrived at
  std::vector<double> returns_;       // [depth, B]: V_t
  std::vector<double> mode_;          // [A]
  std::vector<double> played_;        // [A]
};

constexpr ComponentDescriptor kComponents[] = {{
    .kind = ComponentKind::kPlanner,
    .traits = kSearches | kReportsPolicy,
    .name = "rollout",
    .version = "1.0.0",
    .summary = "Many first actions, each followed by the actor; plays the best lambda-return",
    .parameters = kSettings.declared(),
    .metrics = ViewOf(kMetrics),
    .create_planner = CreatePlanner<Rollout>,
}};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("planner_rollout", "1.0.0", dreamsearch::kComponents)
