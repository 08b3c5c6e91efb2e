// gradient.cc - a few action sequences of the actor, each moved along the gradient of its imagined
// return (Spieler and Behnke 2026, "Dream-MPC", arXiv 2605.04568), `gradient`.
//
// The return of a sequence is what ReturnGradient says (dreamsearch/model.h): discounted rewards
// and the discounted value of the last latent. After `iterations` steps
//
//     a_t <- clip(a_t + step_size * d return / d a_t, -1, 1)
//
// the sequences are imagined once more, with the same seeds; the first action of the one with the
// largest return is played. The value it reports is that return, the improved policy that action
// alone: a sequence is imagined as it stands, so nothing says how far the others' are to be
// trusted.
#include <limits>
#include <numeric>
#include <string>

#include "dreamsearch/planning.h"

namespace dreamsearch {
namespace {

struct GradientSettings : ValueUse {
  std::uint64_t sequences;
  std::uint64_t horizon;
  std::uint64_t iterations;
  double step_size;
  double noise_std;
};
constexpr auto kSettings = BindSettings<GradientSettings>(
    Bind<&GradientSettings::sequences>(
        IntParameter("sequences", 5, 1, 100000, "sequences",
                     "Sequences that the actor is followed for (Dream-MPC).")),
    Bind<&GradientSettings::horizon>(
        IntParameter("horizon", 3, 1, 1000, "transitions", "Actions in a sequence (Dream-MPC).")),
    Bind<&GradientSettings::iterations>(
        IntParameter("iterations", 1, 0, 1000, "steps",
                     "Steps that every sequence makes along its gradient (Dream-MPC).")),
    Bind<&GradientSettings::step_size>(
        RealParameter("step_size", 0.1, 0, 1000, "",
                      "What the gradient is multiplied by in a step (Dream-MPC).")),
    Bind<&GradientSettings::noise_std>(
        RealParameter("noise_std", 0.3, 0, 10, "",
                      "Standard deviation of the Gaussian noise on the played action while "
                      "exploring (Hafner et al. 2019).")),
    kValueBonusParameter, kValueInEvaluationParameter);

enum Metric { kModeDistance, kReturnGain, kGradientNorm, kMetricCount };
constexpr MetricSpec kMetrics[] = {
    {"mode_distance", "", "Euclidean distance of the played action from the actor's mode action."},
    {"return_gain", "",
     "The best return after the steps above the best one before them, both imagined."},
    {"gradient_norm", "",
     "Euclidean norm of the first gradient with respect to a sequence's actions, mean over the "
     "sequences; 0 without steps."},
};
static_assert(std::size(kMetrics) == kMetricCount);

// Streams of a decision's seed.
enum Stream : std::uint64_t { kActions = 1, kImagine = 2, kNoise = 3 };

class GradientPlanner final : public Offers<MemorylessPlanner, TreeReporting, PolicyReporting> {
 public:
  explicit GradientPlanner(const PlannerContext& context)
      : GradientPlanner(context, kSettings.Read(context.parameters)) {}

  Status BeginEpisode(LatentModel* model) noexcept override {
    if (Status status = CheckModel(sizes_, model); !status.ok()) return status;
    auto* gradient = ExtensionOf<ReturnGradient>(model);
    if (gradient == nullptr) {
      return Error(StatusCode::kFailedPrecondition,
                   "the planner needs gradients of imagined returns ('%s'), which the model does "
                   "not offer",
                   ReturnGradient::kName);
    }
    gradient_ = gradient;
    return MemorylessPlanner::BeginEpisode(model);
  }

  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    if (Status status = CheckPlan(sizes_, model_, request, result); !status.ok()) return status;
    Status status = model_->ProposeMode(request.root, {mode_.data(), 1, mode_.size()});
    if (!status.ok()) return status;
    status = CheckFinite("action component", {mode_.data(), mode_.size()});
    if (!status.ok()) return status;
    if (status = FollowActor(request); !status.ok()) return status;
    double first_best = 0;
    for (std::uint64_t step = 0; step < settings_.iterations; ++step) {
      if (status = AskGradient(request); !status.ok()) return status;
      if (step == 0) {
        first_best = *std::max_element(returns_.begin(), returns_.end());
        gradient_norm_ = MeanNorm();
      }
      for (std::size_t i = 0; i < actions_.size(); ++i) {
        actions_[i] = std::clamp(actions_[i] + settings_.step_size * gradients_[i], -1.0, 1.0);
      }
    }
    if (status = Imagine(request); !status.ok()) return status;

    best_ = static_cast<std::uint64_t>(std::max_element(returns_.begin(), returns_.end()) -
                                       returns_.begin());
    const double best = returns_[best_];
    std::copy_n(Action(best_, 0).data, played_.size(), played_.data());
    const View<double> played{played_.data(), played_.size()};
    if (request.explore) {
      AddExplorationNoise(settings_.noise_std, DeriveSeed(request.seed, kNoise),
                          {played.data, 1, played.size});
    }
    std::copy(played_.begin(), played_.end(), result->action.data);
    result->metrics[kModeDistance] = ActionDistance(played, {mode_.data(), mode_.size()});
    result->metrics[kReturnGain] = settings_.iterations > 0 ? best - first_best : 0;
    // Gradients of 1e200 are finite, their squares are not.
    result->metrics[kGradientNorm] =
        settings_.iterations > 0 ? std::min(gradient_norm_, std::numeric_limits<double>::max()) : 0;
    result->value = best;
    result->simulations = static_cast<std::uint32_t>(n_);
    result->nodes = static_cast<std::uint32_t>(n_ * horizon_ + 1);
    result->depth = static_cast<std::uint32_t>(horizon_);
    return OkStatus();
  }

  // Every sequence as a chain of edges, transition by transition; q is the return from that edge
  // on.
  void ReportTree(TreeSink* sink) noexcept override {
    for (std::uint64_t t = 0; t < horizon_; ++t) {
      for (std::uint64_t i = 0; i < n_; ++i) {
        const std::uint64_t edge = t * n_ + i;
        sink->Edge({.parent = t == 0 ? -1 : static_cast<std::int64_t>(edge - n_),
                    .action = Action(i, t),
                    .visits = 1,
                    .q = suffixes_[edge],
                    .prior = t == 0 ? 1.0 / static_cast<double>(n_) : 1,
                    .reward = rewards_[edge],
                    .discount = discounts_[edge],
                    .value = t + 1 == horizon_ ? values_[i] : 0,
                    .expanded = true});
      }
    }
  }

  Status ReportPolicy(MatrixView<double> policy, View<double> weights) noexcept override {
    return FillPolicy(
        sizes_, [this](auto visit) { visit(1.0, Action(best_, 0)); }, policy, weights);
  }

 private:
  GradientPlanner(const PlannerContext& context, const GradientSettings& settings)
      : Offers(context, kMetricCount),
        settings_(settings),
        n_(settings.sequences),
        horizon_(settings.horizon),
        search_values_(settings, n_),
        roots_(n_, context.latent_bytes),
        latents_{LatentBuffer(n_, context.latent_bytes), LatentBuffer(n_, context.latent_bytes)},
        actions_(n_ * horizon_ * context.action_size),
        gradients_(actions_.size()),
        batch_(n_ * context.action_size),
        seeds_(n_ * horizon_),
        batch_seeds_(n_),
        rewards_(n_ * horizon_),
        discounts_(n_ * horizon_),
        suffixes_(n_ * horizon_),
        values_(n_),
        returns_(n_),
        mode_(context.action_size),
        played_(context.action_size) {}

  // Action t of sequence i.
  View<double> Action(std::uint64_t i, std::uint64_t t) noexcept {
    return {actions_.data() + (i * horizon_ + t) * sizes_.action_size, sizes_.action_size};
  }
  // What transition t of all sequences asks of the model: [n, A], [n].
  MatrixView<double> Batch() noexcept { return {batch_.data(), n_, sizes_.action_size}; }
  View<const std::uint64_t> BatchSeeds(std::uint64_t t) noexcept {
    for (std::uint64_t i = 0; i < n_; ++i) batch_seeds_[i] = seeds_[i * horizon_ + t];
    return {batch_seeds_.data(), n_};
  }
  View<double> Column(std::vector<double>& values, std::uint64_t t) noexcept {
    return {values.data() + t * n_, n_};
  }
  Latents At(std::uint64_t t) noexcept { return latents_[t % 2].middle_rows(0, n_); }

  // Fills the actions by following samples of the actor from the root, and the decision's seeds.
  Status FollowActor(const PlanRequest& request) noexcept {
    FillSeeds(DeriveSeed(request.seed, kImagine), {seeds_.data(), seeds_.size()});
    for (std::uint64_t i = 0; i < n_; ++i) {
      roots_.Set(i, request.root);
      latents_[0].Set(i, request.root);
    }
    const std::uint64_t actor_seed = DeriveSeed(request.seed, kActions);
    for (std::uint64_t t = 0; t < horizon_; ++t) {
      const std::uint64_t seed = DeriveSeed(actor_seed, t);
      Status status;
      if (t == 0) {
        status = model_->ProposeSamples(request.root, {&seed, 1}, Batch());
      } else {
        FillSeeds(seed, {batch_seeds_.data(), n_});
        status = model_->ProposeSamples(At(t), {batch_seeds_.data(), n_}, Batch());
      }
      if (status.ok()) status = CheckFinite("action component", {batch_.data(), batch_.size()});
      if (!status.ok()) return status;
      for (std::uint64_t i = 0; i < n_; ++i) {
        std::copy_n(Batch().row(i).data, sizes_.action_size, Action(i, t).data);
      }
      if (t + 1 == horizon_) break;
      status = model_->Imagine({At(t), Batch(), BatchSeeds(t)},
                               {At(t + 1), Column(rewards_, t), Column(discounts_, t)});
      if (!status.ok()) return status;
    }
    return OkStatus();
  }

  // Fills returns and gradients.
  Status AskGradient(const PlanRequest& request) noexcept {
    GradientRequest asked;
    asked.latents = roots_.middle_rows(0, n_);
    asked.actions = {actions_.data(), n_ * horizon_, sizes_.action_size};
    asked.seeds = {seeds_.data(), seeds_.size()};
    asked.deviations = request.explore ? settings_.value_bonus : 0;
    asked.least = !request.explore && settings_.least_in_evaluation;
    GradientResult result;
    result.returns = {returns_.data(), n_};
    result.gradients = {gradients_.data(), n_ * horizon_, sizes_.action_size};
    Status status = gradient_->Gradient(asked, result);
    if (status.ok()) status = CheckFinite("return of sequence", {returns_.data(), n_});
    if (status.ok()) {
      status = CheckFinite("gradient component", {gradients_.data(), gradients_.size()});
    }
    return status;
  }

  // Imagines the sequences as they stand and computes their returns.
  Status Imagine(const PlanRequest& request) noexcept {
    for (std::uint64_t i = 0; i < n_; ++i) latents_[0].Set(i, request.root);
    for (std::uint64_t t = 0; t < horizon_; ++t) {
      for (std::uint64_t i = 0; i < n_; ++i) {
        std::copy_n(Action(i, t).data, sizes_.action_size, Batch().row(i).data);
      }
      Status status = model_->Imagine({At(t), Batch(), BatchSeeds(t)},
                                      {At(t + 1), Column(rewards_, t), Column(discounts_, t)});
      if (!status.ok()) return status;
    }
    const View<double> values{values_.data(), n_};
    Status status = search_values_.Ask(model_, At(horizon_), request.explore, values);
    if (!status.ok()) return status;
    for (std::uint64_t t = horizon_; t-- > 0;) {
      for (std::uint64_t i = 0; i < n_; ++i) {
        const std::uint64_t at = t * n_ + i;
        const double after = t + 1 < horizon_ ? suffixes_[at + n_] : values_[i];
        suffixes_[at] = rewards_[at] + discounts_[at] * after;
      }
    }
    std::copy_n(suffixes_.begin(), n_, returns_.begin());
    return CheckFinite("return of sequence", {returns_.data(), n_});
  }

  double MeanNorm() const noexcept {
    double sum = 0;
    const std::size_t size = gradients_.size() / n_;
    for (auto at = gradients_.begin(); at != gradients_.end();
         at += static_cast<std::ptrdiff_t>(size)) {
      const auto end = at + static_cast<std::ptrdiff_t>(size);
      sum += std::sqrt(std::inner_product(at, end, at, 0.0));
    }
    return sum / static_cast<double>(n_);
  }

  const GradientSettings settings_;
  const std::uint64_t n_;
  const std::uint64_t horizon_;
  SearchValues search_values_;
  ReturnGradient* gradient_ = nullptr;  // of model_
  std::uint64_t best_ = 0;              // the sequence with the largest return
  double gradient_norm_ = 0;
  LatentBuffer roots_;                                  // [n]: the root, over and over
  LatentBuffer latents_[2];                             // [n], transitions go from one to the other
  std::vector<double> actions_;                         // [n * horizon, A], a sequence at a time
  std::vector<double> gradients_;                       // likewise
  std::vector<double> batch_;                           // [n, A]
  std::vector<std::uint64_t> seeds_;                    // [n * horizon], of the transitions
  std::vector<std::uint64_t> batch_seeds_;              // [n]
  std::vector<double> rewards_, discounts_, suffixes_;  // [horizon, n]
  std::vector<double> values_, returns_;                // [n]
  std::vector<double> mode_, played_;                   // [A]
};

constexpr ComponentDescriptor kComponents[] = {{
    .kind = ComponentKind::kPlanner,
    .traits = kSearches | kReportsPolicy | kNeedsGradients,
    .name = "gradient",
    .version = "1.0.0",
    .summary = "Moves a few sequences of the actor along the gradient of their imagined returns",
    .parameters = kSettings.declared(),
    .metrics = ViewOf(kMetrics),
    .create_planner = CreatePlanner<GradientPlanner>,
}};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("planner_gradient", "1.0.0", dreamsearch::kComponents)
