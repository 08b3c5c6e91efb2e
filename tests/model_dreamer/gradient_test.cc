// Every gradient against central differences, in double.
//
// A layer is a row of kLayers: its inputs (parameters among them) as one array, its
// outputs, and the way back. A new layer adds a row. The whole update is checked
// below, for every setting that changes what is computed.
//
// Tolerance: with step h = 1e-5 a central difference of a smooth function errs by
// h^2 f'''/6 + eps f / h, about 1e-10 of f's scale; 1e-6 leaves room for sums of
// thousands of terms. DREAMSEARCH_SHOW_RESIDUALS=1 prints the largest found.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "batches.h"
#include "dreamsearch/random.h"
#include "plugins/model_dreamer/behaviour.h"
#include "plugins/model_dreamer/learner.h"
#include "plugins/networks/layers.h"

namespace dreamsearch::dreamer {
namespace {

using Values = std::vector<double>;
using M = Mat<double>;

constexpr double kStep = 1e-5;
constexpr double kTolerance = 1e-6;

// |a - b| relative to the larger, but absolute below `scale`.
double Residual(double a, double b, double scale) {
  return std::abs(a - b) / std::max({std::abs(a), std::abs(b), scale});
}

void Show(const std::string& name, double residual) {
  if (std::getenv("DREAMSEARCH_SHOW_RESIDUALS") != nullptr) {
    std::fprintf(stderr, "%-40s %.2e\n", name.c_str(), residual);
  }
}

Values Draws(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  Values values(count);
  for (double& v : values) v = random.Normal();
  return values;
}

// A walk over one array, so that a layer can take its inputs in turn.
class Slices {
 public:
  explicit Slices(double* data) : data_(data) {}
  M Take(Index rows, Index cols) {
    const M m(data_, rows, cols);
    data_ += rows * cols;
    return m;
  }

 private:
  double* data_;
};

struct Layer {
  const char* name;
  std::size_t inputs;
  std::size_t outputs;
  // Computes the outputs; then, if d_inputs is not null, the gradient of
  // sum(cotangent * output).
  std::function<void(Values* inputs, Values* outputs, Values* cotangent, Values* d_inputs)> run;
};

constexpr Index kN = 5;   // columns
constexpr Index kR = 19;  // rows: more than one vector lane, and a rest

void RunMlp(bool norm, Values* in, Values* out, Values* cotangent, Values* d) {
  ParameterGroup<double> group("g");
  const Mlp mlp(&group, "mlp", 4, kR, 2, 3, norm);
  group.Allocate(1);
  const auto parameters = static_cast<std::size_t>(group.size());
  ASSERT_EQ(in->size(), parameters + 4 * kN);
  std::copy(in->begin(), in->begin() + group.size(), group.values());
  group.Pack();
  const M x(in->data() + parameters, 4, kN);
  MlpTape<double> tape;
  MlpScratch<double> scratch;
  mlp.Reserve(kN, &tape);
  mlp.Forward(group.exact(), In<double>(x), 0, &tape, M(out->data(), 3, kN));
  if (d == nullptr) return;
  mlp.Backward(group.exact(), In<double>(x), 0, tape, M(cotangent->data(), 3, kN), &scratch,
               group.gradient(), M(d->data() + parameters, 4, kN));
  std::copy(group.gradient(), group.gradient() + group.size(), d->begin());
}

std::size_t MlpInputs(bool norm) {
  ParameterGroup<double> group("g");
  const Mlp mlp(&group, "mlp", 4, kR, 2, 3, norm);
  return static_cast<std::size_t>(group.size()) + 4 * kN;
}

const ActorShape kActorShape{.mean_limit = 2, .std_offset = 0.3, .min_std = 0.05};

const std::vector<Layer>& Layers() {
  static const std::vector<Layer> layers = {
      {"product", 3 * kR + kR * kN, 3 * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         Slices s(in->data());
         const M w = s.Take(3, kR), x = s.Take(kR, kN), y(out->data(), 3, kN);
         PackedWeights<double> packed({{0, 3, 0, kR}});
         packed.Pack(w.data);
         SetZero(y);
         packed.AddProduct(0, x, y);
         if (d == nullptr) return;
         Slices g(d->data());
         AddOuterProduct<double>(M(ct->data(), 3, kN), x, g.Take(3, kR));
         packed.AddTransposedProduct(0, M(ct->data(), 3, kN), g.Take(kR, kN));
       }},
      {"bias", kR, kR * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         FillColumns<double>(in->data(), M(out->data(), kR, kN));
         if (d != nullptr) AddColumnSums<double>(M(ct->data(), kR, kN), d->data());
       }},
      {"elu", kR * kN, kR * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         *out = *in;
         const M y(out->data(), kR, kN);
         Elu(y);
         if (d == nullptr) return;
         *d = *ct;
         EluBackward<double>(y, M(d->data(), kR, kN));
       }},
      {"layer_norm_elu", 2 * kR + kR * kN, kR * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         Values unit(kR * kN), inverse(kN);
         std::copy(in->begin() + 2 * kR, in->end(), out->begin());
         LayerNormElu<double>(in->data(), in->data() + kR, M(out->data(), kR, kN),
                              M(unit.data(), kR, kN), M(inverse.data(), 1, kN));
         if (d == nullptr) return;
         std::copy(ct->begin(), ct->end(), d->begin() + 2 * kR);
         LayerNormEluBackward<double>(in->data(), M(unit.data(), kR, kN), M(inverse.data(), 1, kN),
                                      M(out->data(), kR, kN), M(d->data() + 2 * kR, kR, kN),
                                      d->data(), d->data() + kR);
       }},
      {"gru", 7 * kR * kN, kR * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         Slices s(in->data());
         const M input = s.Take(3 * kR, kN), rec = s.Take(3 * kR, kN), h = s.Take(kR, kN);
         Values gates(4 * kR * kN);
         GruForward<double>(input, rec, h, M(gates.data(), 4 * kR, kN), M(out->data(), kR, kN));
         if (d == nullptr) return;
         Slices g(d->data());
         const M d_input = g.Take(3 * kR, kN), d_rec = g.Take(3 * kR, kN), dh = g.Take(kR, kN);
         GruBackward<double>(M(gates.data(), 4 * kR, kN), h, M(ct->data(), kR, kN), d_input, d_rec,
                             dh);
       }},
      {"gaussian_sample", 2 * kR * kN, kR * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         Values noise = Draws(kR * kN, 7), std(kR * kN);
         const M eps(noise.data(), kR, kN), deviation(std.data(), kR, kN);
         GaussianForward<double>(M(in->data(), 2 * kR, kN), eps, 0.1, deviation,
                                 M(out->data(), kR, kN));
         if (d == nullptr) return;
         GaussianBackward<double>(deviation, eps, 0.1, M(ct->data(), kR, kN),
                                  M(d->data(), 2 * kR, kN));
       }},
      {"gaussian_kl", 4 * kR * kN, kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         Slices s(in->data());
         const M q = s.Take(2 * kR, kN), p = s.Take(2 * kR, kN);
         Values memory(3 * kR * kN);
         Slices t(memory.data());
         const M q_std = t.Take(kR, kN), p_std = t.Take(kR, kN), sample = t.Take(kR, kN);
         GaussianForward<double>(q, M(), 0.1, q_std, sample);
         GaussianForward<double>(p, M(), 0.1, p_std, sample);
         GaussianKl<double>(q, q_std, p, p_std, M(out->data(), 1, kN));
         if (d == nullptr) return;
         Slices g(d->data());
         const M d_q = g.Take(2 * kR, kN), d_p = g.Take(2 * kR, kN);
         GaussianKlBackward<double>(q, q_std, p, p_std, 0.1, M(ct->data(), 1, kN), 1, 1, d_q, d_p);
         // d_q is that of (mean, std); the sample's way back turns std into c.
         Values none(kR * kN);
         GaussianBackward<double>(q_std, M(none.data(), kR, kN), 0.1, M(none.data(), kR, kN), d_q);
       }},
      {"squared_error", 3 * kN, 1,
       [](Values* in, Values* out, Values* ct, Values* d) {
         Values target = Draws(3 * kN, 5), gradient(3 * kN);
         (*out)[0] = SquaredError<double>(M(in->data(), 3, kN), M(target.data(), 3, kN),
                                          ct == nullptr ? 0 : (*ct)[0], M(gradient.data(), 3, kN));
         if (d != nullptr) *d = gradient;
       }},
      {"bernoulli_error", kN, 1,
       [](Values* in, Values* out, Values* ct, Values* d) {
         Values target = {0, 0.99, 0.99, 0, 0.5}, gradient(kN);
         (*out)[0] =
             BernoulliError<double>(M(in->data(), 1, kN), M(target.data(), 1, kN),
                                    ct == nullptr ? 0 : (*ct)[0], M(gradient.data(), 1, kN));
         if (d != nullptr) *d = gradient;
       }},
      {"actor_distribution", 2 * 3 * kN, 3 * kN + kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         Values noise = Draws(3 * kN, 9), memory(2 * 3 * kN);
         Slices t(memory.data()), o(out->data());
         const M squashed = t.Take(3, kN), std = t.Take(3, kN), eps(noise.data(), 3, kN);
         const M action = o.Take(3, kN), entropy = o.Take(1, kN);
         ActorForward<double>(M(in->data(), 6, kN), eps, kActorShape, squashed, std, action,
                              entropy);
         if (d == nullptr) return;
         Slices c(ct->data());
         const M d_action = c.Take(3, kN), d_entropy = c.Take(1, kN);
         ActorBackward<double>(squashed, std, action, eps, kActorShape, d_action, d_entropy,
                               M(d->data(), 6, kN));
       }},
      {"lambda_returns", 4 * kN * 2 + 5 * kN, 4 * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         const double* rewards = in->data();
         const double* discounts = rewards + 4 * kN;
         const double* values = discounts + 4 * kN;
         LambdaReturns<double>(4, kN, 0.9, rewards, discounts, values, out->data());
         if (d == nullptr) return;
         Values copy = *ct;
         LambdaReturnsBackward<double>(4, kN, 0.9, discounts, values, out->data(), copy.data(),
                                       d->data(), d->data() + 4 * kN, d->data() + 8 * kN);
       }},
      {"mlp", MlpInputs(false), 3 * kN,
       [](Values* in, Values* out, Values* ct, Values* d) { RunMlp(false, in, out, ct, d); }},
      {"mlp_layer_norm", MlpInputs(true), 3 * kN,
       [](Values* in, Values* out, Values* ct, Values* d) { RunMlp(true, in, out, ct, d); }},
  };
  return layers;
}

class LayerGradient : public testing::TestWithParam<std::size_t> {};

TEST_P(LayerGradient, EqualsCentralDifference) {
  const Layer& layer = Layers()[GetParam()];
  Values inputs = Draws(layer.inputs, 100 + GetParam());
  Values outputs(layer.outputs), gradient(layer.inputs);
  Values cotangent = Draws(layer.outputs, 200 + GetParam());
  layer.run(&inputs, &outputs, &cotangent, &gradient);
  const auto loss = [&](std::size_t i, double shift) {
    const double kept = inputs[i];
    inputs[i] = kept + shift;
    layer.run(&inputs, &outputs, nullptr, nullptr);
    inputs[i] = kept;
    double total = 0;
    for (std::size_t k = 0; k < outputs.size(); ++k) total += cotangent[k] * outputs[k];
    return total;
  };
  double worst = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const double difference = (loss(i, kStep) - loss(i, -kStep)) / (2 * kStep);
    worst = std::max(worst, Residual(gradient[i], difference, 1e-2));
    ASSERT_LT(Residual(gradient[i], difference, 1e-2), kTolerance)
        << layer.name << " input " << i << ": gradient " << gradient[i] << ", difference "
        << difference;
  }
  Show(layer.name, worst);
}

INSTANTIATE_TEST_SUITE_P(Layers, LayerGradient, testing::Range<std::size_t>(0, Layers().size()),
                         [](const auto& row) { return std::string(Layers()[row.param].name); });

// --- The whole update -------------------------------------------------------

struct Variant {
  const char* name;
  std::function<void(Settings*)> change;
  std::vector<std::size_t> firsts = {};  // rows inside sequences that begin an episode
};

const Variant kVariants[] = {
    {"paper", [](Settings*) {}},
    {"free_nats_reached", [](Settings* s) { s->free_nats = 10; }},
    {"free_nats_per_step",
     [](Settings* s) {
       s->free_nats_per_step = true;
       s->free_nats = 2;  // near the mean: some steps above, some below
     }},
    {"continuation", [](Settings* s) { s->continuation = true; }},
    {"layer_norm", [](Settings* s) { s->layer_norm = true; }},
    {"weights_and_scales",
     [](Settings* s) {
       s->normalise_observations = true;
       s->observation_weight = 3;
       s->reward_weight = 7;
       s->kl_scale = 0.5;
       s->value_scale = 20;
       s->entropy_scale = 0.1;
       s->slow_critic_weight = 0.5;
     }},
    {"everything",
     [](Settings* s) {
       s->continuation = true;
       s->layer_norm = true;
       s->normalise_observations = true;
       s->reward_weight = 7;
       s->value_scale = 20;
       s->entropy_scale = 0.1;
       s->slow_critic_weight = 0.5;
       s->imagination_starts = 5;
       s->start_skip = 1;
     }},
    {"episodes_end_inside", [](Settings* s) { s->continuation = true; }, {2, 5, 6, 11}},
};

Settings SmallSettings() {
  Settings s = PresetSettings("paper");
  s.deterministic = 6;
  s.stochastic = 4;
  s.hidden = 7;
  s.horizon = 4;
  s.free_nats = 0;
  s.actor_initial_std = 0.7;
  return s;
}

// Moves every parameter off its initial value, so that zero biases and heads hide
// nothing.
void Perturb(ParameterGroup<double>* group, std::uint64_t seed) {
  Random random(seed);
  for (Index i = 0; i < group->size(); ++i) group->values()[i] += 0.1 * random.Normal();
  group->Pack();
}

void MakeReady(Learner<double>* learner) {
  Perturb(&learner->world().group(), 11);
  Perturb(&learner->behaviour().actor(), 12);
  Perturb(&learner->behaviour().value(), 13);
  learner->behaviour().ResetSlow();
  Perturb(&learner->behaviour().value(), 14);
  learner->PackWeights();
}

class UpdateGradient : public testing::TestWithParam<std::size_t> {};

TEST_P(UpdateGradient, OfAllThreeGroupsEqualsCentralDifference) {
  const Variant& variant = kVariants[GetParam()];
  Settings settings = SmallSettings();
  variant.change(&settings);
  OwnedBatch batch = RandomBatch(3, 4, 3, 2, 21);
  for (const std::size_t row : variant.firsts) batch.is_first[row] = 1;
  Learner<double> learner(settings, 3, 2, 5);
  MakeReady(&learner);
  ASSERT_TRUE(learner.Read(batch.view(), 77).ok());
  UpdateLosses losses;
  learner.Gradients(&losses);
  const DreamStops<double> stops = learner.behaviour().Stops();
  // The model's parameters are differenced through the fit, the others through the
  // dream, from the posterior states of the fit above.
  const auto fit = [&] {
    learner.PackWeights();
    learner.FitGradients(&losses);
    return losses.fit.total;
  };
  const auto dream = [&](const double* loss) {
    learner.PackWeights();
    learner.DreamGradients(&losses, &stops);
    return *loss;
  };
  const struct {
    ParameterGroup<double>* group;
    std::function<double()> loss;
  } groups[] = {
      {&learner.behaviour().actor(), [&] { return dream(&losses.dream.actor); }},
      {&learner.behaviour().value(), [&] { return dream(&losses.dream.value); }},
      {&learner.world().group(), fit},
  };
  // Copies first: every call overwrites them.
  std::vector<Values> gradients;
  for (const auto& item : groups) {
    gradients.emplace_back(item.group->gradient(), item.group->gradient() + item.group->size());
  }
  double worst = 0;
  for (std::size_t g = 0; g < 3; ++g) {
    ParameterGroup<double>& group = *groups[g].group;
    double largest = 0;
    for (const double x : gradients[g]) largest = std::max(largest, std::abs(x));
    EXPECT_GT(largest, 1e-4) << group.name();
    for (const Tensor& tensor : group.tensors()) {
      for (Index k = 0; k < tensor.rows * tensor.cols; ++k) {
        const Index i = tensor.offset + k;
        double& value = group.values()[i];
        const double kept = value;
        value = kept + kStep;
        const double above = groups[g].loss();
        value = kept - kStep;
        const double below = groups[g].loss();
        value = kept;
        const double difference = (above - below) / (2 * kStep);
        const double gradient = gradients[g][static_cast<std::size_t>(i)];
        const double residual = Residual(gradient, difference, 1e-2 * largest);
        worst = std::max(worst, residual);
        ASSERT_LT(residual, kTolerance)
            << variant.name << ", " << tensor.name << " entry " << k << ": gradient " << gradient
            << ", difference " << difference;
      }
    }
  }
  Show(variant.name, worst);
}

INSTANTIATE_TEST_SUITE_P(Variants, UpdateGradient,
                         testing::Range<std::size_t>(0, std::size(kVariants)),
                         [](const auto& row) { return std::string(kVariants[row.param].name); });

TEST(Sequences, WhatCameBeforeAnEpisodeDoesNotReachIntoIt) {
  const Index length = 6, first = 2;
  Settings settings = SmallSettings();
  settings.normalise_observations = false;
  std::vector<Values> later;
  for (const float shift : {0.0f, 1.0f}) {
    OwnedBatch batch = RandomBatch(1, length, 3, 2, 21);
    for (Index i = 0; i < 3 * first; ++i) batch.observations[static_cast<std::size_t>(i)] += shift;
    for (Index i = 0; i < 2 * first; ++i) batch.actions[static_cast<std::size_t>(i)] += shift;
    for (const bool ends : {true, false}) {
      batch.is_first[static_cast<std::size_t>(first)] = ends ? 1 : 0;
      Learner<double> learner(settings, 3, 2, 5);
      MakeReady(&learner);
      ASSERT_TRUE(learner.Read(batch.view(), 77).ok());
      UpdateLosses losses;
      learner.FitGradients(&losses);
      const M states = learner.world().states();
      later.emplace_back(states.col(first), states.col(first) + states.rows * (length - first));
    }
  }
  EXPECT_EQ(later[0], later[2]);
  EXPECT_NE(later[1], later[3]);
}

// The factors of the divergence scale the gradient, not the loss, so they are
// checked by linearity: the halves add up, and the prior's own weights feel only
// the prior's half.
TEST(KlFactors, SplitTheDivergencesGradientIntoPriorAndPosterior) {
  const OwnedBatch batch = RandomBatch(3, 4, 3, 2, 21);
  const auto gradient = [&](double prior, double posterior) {
    Settings settings = SmallSettings();
    settings.observation_weight = settings.reward_weight = 0;
    settings.kl_prior_factor = prior;
    settings.kl_posterior_factor = posterior;
    Learner<double> learner(settings, 3, 2, 5);
    MakeReady(&learner);
    EXPECT_TRUE(learner.Read(batch.view(), 77).ok());
    UpdateLosses losses;
    learner.Gradients(&losses);
    ParameterGroup<double>& group = learner.world().group();
    Values values;
    std::vector<bool> of_prior;
    for (const Tensor& tensor : group.tensors()) {
      for (Index k = 0; k < tensor.rows * tensor.cols; ++k) {
        values.push_back(group.gradient()[tensor.offset + k]);
        of_prior.push_back(tensor.name.starts_with("prior."));
      }
    }
    return std::pair(values, of_prior);
  };
  const auto [both, of_prior] = gradient(1, 1);
  const Values prior = gradient(1, 0).first;
  const Values posterior = gradient(0, 1).first;
  const Values mixed = gradient(0.5, 0.25).first;
  for (std::size_t i = 0; i < both.size(); ++i) {
    EXPECT_NEAR(prior[i] + posterior[i], both[i], 1e-12);
    EXPECT_NEAR(0.5 * prior[i] + 0.25 * posterior[i], mixed[i], 1e-12);
    if (of_prior[i]) {
      EXPECT_DOUBLE_EQ(prior[i], both[i]);
      EXPECT_DOUBLE_EQ(posterior[i], 0);
    }
  }
}

// A whole update's gradient in bfloat16 points where the float gradient does.
TEST(Bfloat16, UpdateGradientFollowsTheFloatGradient) {
  if (!Bfloat16Available()) GTEST_SKIP() << "this processor has no tile unit";
  const OwnedBatch batch = PointBatch(8, 16, 1);
  std::vector<std::vector<double>> gradients[2];
  for (const bool bfloat16 : {false, true}) {
    Settings settings = PresetSettings("paper");
    settings.bfloat16 = bfloat16;
    settings.free_nats = 0;
    settings.horizon = 5;
    Learner<float> learner(settings, 2, 1, 5);
    ASSERT_TRUE(learner.Read(batch.view(), 77).ok());
    UpdateLosses losses;
    learner.Gradients(&losses);
    for (const ParameterGroup<float>* group :
         {&learner.world().group(), &learner.behaviour().actor(), &learner.behaviour().value()}) {
      gradients[bfloat16].emplace_back(group->gradient(), group->gradient() + group->size());
    }
  }
  for (std::size_t g = 0; g < 3; ++g) {
    double dot = 0, exact = 0, rounded = 0;
    for (std::size_t i = 0; i < gradients[0][g].size(); ++i) {
      dot += gradients[0][g][i] * gradients[1][g][i];
      exact += gradients[0][g][i] * gradients[0][g][i];
      rounded += gradients[1][g][i] * gradients[1][g][i];
    }
    const double cosine = dot / std::sqrt(exact * rounded);
    Show("bfloat16 1 - cosine", 1 - cosine);
    // Rounding errs by 2^-9 a factor; some tens of factors in a row, as angles add
    // up, stay within a few percent: cosine above 1 - 0.05^2 / 2.
    EXPECT_GT(cosine, 0.998) << "group " << g;
  }
}

// One step of dynamics, whose input gradients the actor's learning rests on.
TEST(Transition, BackwardEqualsCentralDifference) {
  for (const bool norm : {false, true}) {
    Settings settings = SmallSettings();
    settings.layer_norm = norm;
    WorldModel<double> world(settings, 3, 2);
    world.group().Allocate(3);
    Perturb(&world.group(), 4);
    const Index s = settings.state_size(), n = 3;
    Values inputs = Draws(static_cast<std::size_t>((s + 2) * n), 5);
    Values noise = Draws(static_cast<std::size_t>(settings.stochastic * n), 6);
    Values cotangent = Draws(static_cast<std::size_t>(s * n), 7), out(cotangent.size());
    const M state(inputs.data(), s, n), action(inputs.data() + s * n, 2, n);
    const M eps(noise.data(), settings.stochastic, n), next(out.data(), s, n);
    TransitionTape<double> tape;
    world.Reserve(n, &tape);
    const auto loss = [&] {
      world.Step(world.group().exact(), state, action, eps, 0, &tape, next);
      double total = 0;
      for (std::size_t i = 0; i < out.size(); ++i) total += cotangent[i] * out[i];
      return total;
    };
    loss();
    Values d_next = cotangent, gradient(inputs.size());
    world.StepBackward(world.group().exact(), state, next, eps, 0, &tape, M(d_next.data(), s, n),
                       M(gradient.data(), s, n), M(gradient.data() + s * n, 2, n));
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const double kept = inputs[i];
      inputs[i] = kept + kStep;
      const double above = loss();
      inputs[i] = kept - kStep;
      const double below = loss();
      inputs[i] = kept;
      EXPECT_LT(Residual(gradient[i], (above - below) / (2 * kStep), 1e-2), kTolerance)
          << "norm " << norm << " input " << i;
    }
  }
}

}  // namespace
}  // namespace dreamsearch::dreamer
