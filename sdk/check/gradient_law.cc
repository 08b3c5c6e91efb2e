#include "gradient_law.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dreamsearch/random.h"
#include "model_bench.h"

namespace dreamsearch::check {
namespace {

// Sequences of actions from latents that were observed.
class Sequences {
 public:
  static constexpr std::uint64_t kCount = 3, kHorizon = 3;  // B, H

  Sequences(ModelBench* bench, Model* model)
      : action_size_(bench->sizes().action),
        latent_bytes_(model->latent_bytes()),
        latents_("the latents", kCount * latent_bytes_),
        actions_(kCount * kHorizon * action_size_),
        seeds_(kCount * kHorizon) {
    const std::vector<std::byte> observed = bench->Observed(model, bench->Rows(kCount, 6));
    std::copy(observed.begin(), observed.end(), latents_.data());
    Random random(11);
    for (double& action : actions_) action = random.Uniform(-0.7, 0.7);
    FillSeeds(12, {seeds_.data(), seeds_.size()});
  }

  // Of sequences `first` ... `first` + count - 1; the value as `how` says.
  GradientRequest Request(std::uint64_t first, std::uint64_t count,
                          const GradientRequest& how) const {
    GradientRequest request;
    request.latents = {latents_.data() + first * latent_bytes_, count, latent_bytes_};
    request.actions = {actions_.data() + first * kHorizon * action_size_, count * kHorizon,
                       action_size_};
    request.seeds = {seeds_.data() + first * kHorizon, count * kHorizon};
    request.deviations = how.deviations;
    request.least = how.least;
    return request;
  }

  // The returns by the calls that a planner without gradients makes.
  std::vector<double> Imagined(Model* model, const GradientRequest& how) const {
    Guarded<std::byte> from("the latents", kCount * latent_bytes_),
        to("the imagined latents", kCount * latent_bytes_);
    std::copy_n(latents_.data(), latents_.size(), from.data());
    std::vector<double> returns(kCount), left(kCount, 1.0), rewards(kCount), discounts(kCount);
    std::vector<double> actions(kCount * action_size_), deviations(kCount), least(kCount);
    std::vector<std::uint64_t> seeds(kCount);
    for (std::uint64_t t = 0; t < kHorizon; ++t) {
      for (std::uint64_t b = 0; b < kCount; ++b) {
        const std::uint64_t row = b * kHorizon + t;
        std::copy_n(&actions_[row * action_size_], action_size_, &actions[b * action_size_]);
        seeds[b] = seeds_[row];
      }
      NoteCall("Imagine");
      ExpectOk(model->Imagine({{from.data(), kCount, latent_bytes_},
                               {actions.data(), kCount, action_size_},
                               {seeds.data(), kCount}},
                              {{to.data(), kCount, latent_bytes_},
                               {rewards.data(), kCount},
                               {discounts.data(), kCount}}),
               "Imagine");
      for (std::uint64_t b = 0; b < kCount; ++b) {
        returns[b] += left[b] * rewards[b];
        left[b] *= discounts[b];
      }
      std::copy_n(to.data(), to.size(), from.data());
    }
    const ConstLatents last{from.data(), kCount, latent_bytes_};
    std::vector<double>& values = rewards;
    if (auto* spread = ExtensionOf<ValueSpread>(model)) {
      NoteCall("Spread");
      ExpectOk(
          spread->Spread(
              last, {{values.data(), kCount}, {deviations.data(), kCount}, {least.data(), kCount}}),
          "Spread");
      for (std::uint64_t b = 0; b < kCount; ++b) {
        values[b] = how.least ? least[b] : values[b] + how.deviations * deviations[b];
      }
    } else {
      NoteCall("Value");
      ExpectOk(model->Value(last, {values.data(), kCount}), "Value");
    }
    for (std::uint64_t b = 0; b < kCount; ++b) returns[b] += left[b] * values[b];
    return returns;
  }

  double& action(std::uint64_t sequence, std::uint64_t i) {
    return actions_[sequence * kHorizon * action_size_ + i];
  }

 private:
  const std::uint64_t action_size_, latent_bytes_;
  Guarded<std::byte> latents_;
  std::vector<double> actions_;
  std::vector<std::uint64_t> seeds_;
};

}  // namespace

// A central difference with step h is h^2 / 6 times a third derivative from the slope, and the
// rounding of two returns / 2 h: a slope is right if it is by one of several steps. kRounding is
// the latter for floats of 1 and the largest step, ten times. A model may round more, as one whose
// values are sums over bins far from 0; how much shows at the smallest step, where it is nearly all
// that parts difference and slope. (A slope that is wrong by e adds 0.01 e to what it is allowed.)
void GivesTheGradientOfItsReturns(const Trial& trial) {
  constexpr double kLargest = 0.2, kSmallest = 1e-3, kSteps[] = {kLargest, 0.05, 0.01, kSmallest};
  constexpr double kOfTheLargest = 0.05, kOfTheReturn = 1e-4, kRounding = 3e-6;
  constexpr std::uint64_t kCount = Sequences::kCount;
  ModelBench bench(trial);
  const Owned<Model> model = bench.Make();
  auto* differentiable = ExtensionOf<ReturnGradient>(model.get());
  const bool declared = trial.Has(kGivesGradients);
  if (differentiable == nullptr && !declared) Skip("it does not offer ReturnGradient");
  Expect((differentiable != nullptr) == declared,
         "ReturnGradient offered where the trait kGivesGradients is declared, and nowhere else",
         declared ? "the trait alone" : "the extension alone");
  bench.Learn(model.get(), 0, 3);
  Sequences sequences(&bench, model.get());
  const std::uint64_t width = Sequences::kHorizon * bench.sizes().action;
  Guarded<double> returns("the returns", kCount), gradients("the gradients", kCount * width);
  const auto ask = [&](std::uint64_t first, std::uint64_t count, const GradientRequest& how) {
    returns.Unset();
    gradients.Unset();
    NoteCall("Gradient");
    return differentiable->Gradient(
        sequences.Request(first, count, how),
        {{returns.data(), count},
         {gradients.data(), count * Sequences::kHorizon, bench.sizes().action}});
  };
  const auto deviate = [](double deviations, bool least) {
    GradientRequest how;
    how.deviations = deviations;
    how.least = least;
    return how;
  };
  std::vector<GradientRequest> ways = {deviate(0, false)};
  if (ExtensionOf<ValueSpread>(model.get()) != nullptr) {
    ways.push_back(deviate(0.5, false));
    ways.push_back(deviate(0, true));
  }
  for (const GradientRequest& how : ways) {
    ExpectOk(ask(0, kCount, how), "Gradient");
    for (const Guarded<double>* room : {&returns, &gradients}) {
      room->CheckGuards();
      room->CheckSet();
    }
    const std::vector<double> reported(returns.data(), returns.data() + kCount);
    const std::vector<double> slopes(gradients.data(), gradients.data() + gradients.size());
    const std::vector<double> imagined = sequences.Imagined(model.get(), how);
    for (std::uint64_t b = 0; b < kCount; ++b) {
      Expect(std::abs(reported[b] - imagined[b]) <=
                 kOfTheReturn * std::max(1.0, std::abs(imagined[b])),
             "the return of sequence " + std::to_string(b) +
                 " by Imagine and the value of the last latent, " + Number(imagined[b]),
             Number(reported[b]));
    }
    // The return that Gradient reports when entry i of every sequence is moved by `step`.
    const auto moved = [&](std::uint64_t i, double step) {
      for (std::uint64_t b = 0; b < kCount; ++b) sequences.action(b, i) += step;
      ExpectOk(ask(0, kCount, how), "Gradient");
      for (std::uint64_t b = 0; b < kCount; ++b) sequences.action(b, i) -= step;
      return std::vector<double>(returns.data(), returns.data() + kCount);
    };
    std::vector<double> nearest(kCount * width, std::numeric_limits<double>::infinity());
    double largest[kCount] = {}, rounded[kCount] = {};
    for (std::uint64_t i = 0; i < width; ++i) {
      for (const double step : kSteps) {
        const std::vector<double> above = moved(i, step), below = moved(i, -step);
        for (std::uint64_t b = 0; b < kCount; ++b) {
          const double slope = slopes[b * width + i];
          const double difference = (above[b] - below[b]) / (2 * step);
          double* best = &nearest[b * width + i];
          if (std::abs(difference - slope) < std::abs(*best - slope)) *best = difference;
          if (step == kSmallest) {
            rounded[b] = std::max(rounded[b], 2 * step * std::abs(difference - slope));
          }
        }
      }
      for (std::uint64_t b = 0; b < kCount; ++b) {
        largest[b] = std::max(largest[b], std::abs(slopes[b * width + i]));
      }
    }
    for (std::uint64_t row = 0; row < kCount * width; ++row) {
      const std::uint64_t b = row / width, i = row % width;
      const double rounding =
          std::max(kRounding * (1 + std::abs(reported[b])), rounded[b] / kLargest);
      Expect(std::abs(nearest[row] - slopes[row]) <= kOfTheLargest * largest[b] + rounding,
             Format("the central difference of return %llu for action %llu, entry %llu: ",
                    static_cast<unsigned long long>(b),
                    static_cast<unsigned long long>(i / bench.sizes().action),
                    static_cast<unsigned long long>(i % bench.sizes().action)) +
                 Number(nearest[row]),
             "a gradient of " + Number(slopes[row]));
    }
    // Alone as among others.
    for (std::uint64_t b = 0; b < kCount; ++b) {
      ExpectOk(ask(b, 1, how), "Gradient");
      Transcript alone, among;
      alone.Add("return", returns[0]);
      among.Add("return", reported[b]);
      alone.Add("gradient", {gradients.data(), width});
      among.Add("gradient", {&slopes[b * width], width});
      alone.CheckEquals(among, "a sequence answered alone as among " + std::to_string(kCount),
                        trial.subject().exact_rows ? 0 : 1e-5);
    }
  }
  GradientRequest fewer = sequences.Request(0, kCount, {});
  fewer.seeds.size -= 1;
  NoteCall("Gradient with views of other sizes");
  ExpectRefusal(differentiable->Gradient(
                    fewer, {returns.view(), gradients.rows(kCount * Sequences::kHorizon)}),
                StatusCode::kInvalidArgument, "Gradient with fewer seeds than actions");
}

}  // namespace dreamsearch::check
