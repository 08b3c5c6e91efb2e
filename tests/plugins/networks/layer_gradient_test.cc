// Every layer's gradient against central differences, in double.
//
// A layer is a row of Layers(): its inputs (parameters among them) as one array, its
// outputs, and the way back. A new layer adds a row.
#include "tests/plugins/networks/central_difference.h"

namespace dreamsearch::networks {
namespace {

constexpr Index kN = 5;   // columns
constexpr Index kR = 19;  // rows: more than one vector lane, and a rest

using Hidden = std::vector<HiddenLayer>;
const Hidden kElu = {{kR, Nonlinearity::kElu}, {kR, Nonlinearity::kElu}};
const Hidden kNormElu = {{kR, Nonlinearity::kNormElu}, {kR, Nonlinearity::kNormElu}};
// Widths that differ, and the last of them the output.
const Hidden kToSimNorm = {{kR, Nonlinearity::kNormMish},
                           {kR + 4, Nonlinearity::kNormMish},
                           {kSimplex, Nonlinearity::kNormSimNorm}};

std::size_t MlpInputs(const Hidden& hidden, Index out = 3) {
  ParameterGroup<double> group("g");
  const Mlp mlp(&group, "mlp", 4, hidden, out, Initial::kGlorot, Initial::kGlorot);
  return static_cast<std::size_t>(group.size()) + 4 * kN;
}

void RunMlp(const Hidden& hidden, Index outputs, Values* in, Values* out, Values* cotangent,
            Values* d) {
  ParameterGroup<double> group("g");
  const Mlp mlp(&group, "mlp", 4, hidden, outputs, Initial::kGlorot, Initial::kGlorot);
  group.Allocate(1);
  const auto parameters = static_cast<std::size_t>(group.size());
  ASSERT_EQ(in->size(), parameters + 4 * kN);
  std::copy(in->begin(), in->begin() + group.size(), group.values());
  group.Pack();
  const M x(in->data() + parameters, 4, kN);
  MlpTape<double> tape;
  MlpScratch<double> scratch;
  mlp.Reserve(kN, &tape);
  const Index rows = outputs > 0 ? outputs : hidden.back().width;
  const M y(out->data(), rows, kN);
  mlp.Forward(group.exact(), In<double>(x), 0, &tape, y);
  if (outputs == 0) Copy<double>(mlp.Last(tape), y);
  if (d == nullptr) return;
  mlp.Backward(group.exact(), In<double>(x), 0, tape, M(cotangent->data(), rows, kN), &scratch,
               group.gradient(), M(d->data() + parameters, 4, kN));
  std::copy(group.gradient(), group.gradient() + group.size(), d->begin());
}

constexpr std::size_t kNormInputs = 2 * kR + kR * kN;

void RunNorm(AfterNorm after, Values* in, Values* out, Values* ct, Values* d) {
  Values unit(kR * kN), inverse(kN);
  const double *scale = in->data(), *shift = in->data() + kR;
  std::copy(in->begin() + 2 * kR, in->end(), out->begin());
  LayerNorm<double>(after, scale, shift, M(out->data(), kR, kN), M(unit.data(), kR, kN),
                    M(inverse.data(), 1, kN));
  if (d == nullptr) return;
  std::copy(ct->begin(), ct->end(), d->begin() + 2 * kR);
  LayerNormBackward<double>(after, scale, shift, M(unit.data(), kR, kN), M(inverse.data(), 1, kN),
                            M(out->data(), kR, kN), M(d->data() + 2 * kR, kR, kN), d->data(),
                            d->data() + kR);
}

void RunActor(const ActorShape& shape, Values* in, Values* out, Values* ct, Values* d) {
  Values noise = Draws(3 * kN, 9), memory(2 * 3 * kN);
  Slices t(memory.data()), o(out->data());
  const M squashed = t.Take(3, kN), std = t.Take(3, kN), eps(noise.data(), 3, kN);
  const M action = o.Take(3, kN), entropy = o.Take(1, kN);
  ActorForward<double>(M(in->data(), 6, kN), eps, shape, squashed, std, action, entropy);
  if (d == nullptr) return;
  Slices c(ct->data());
  const M d_action = c.Take(3, kN), d_entropy = c.Take(1, kN);
  ActorBackward<double>(squashed, std, action, eps, shape, d_action, d_entropy, M(),
                        M(d->data(), 6, kN));
}

// More than one vector lane, and a rest.
constexpr Bins kBins{.count = 21, .low = -4, .high = 4};

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
      {"layer_norm", kNormInputs, kR * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         RunNorm(AfterNorm::kNothing, in, out, ct, d);
       }},
      {"layer_norm_elu", kNormInputs, kR * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         RunNorm(AfterNorm::kElu, in, out, ct, d);
       }},
      {"layer_norm_mish", kNormInputs, kR * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         RunNorm(AfterNorm::kMish, in, out, ct, d);
       }},
      {"sim_norm", 3 * kSimplex * kN, 3 * kSimplex * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         *out = *in;
         const M y(out->data(), 3 * kSimplex, kN);
         SimNorm(y);
         if (d == nullptr) return;
         *d = *ct;
         SimNormBackward<double>(y, M(d->data(), 3 * kSimplex, kN));
       }},
      {"two_hot_error", kBins.count * kN, 1,
       [](Values* in, Values* out, Values* ct, Values* d) {
         // Inside, on a bin, at and beyond an end of the range, negative.
         Values targets = {0.7, 0, std::expm1(3), 500, -2.5};
         Values weights = Draws(kN, 5), gradient(in->size());
         const double factor = ct == nullptr ? 1 : (*ct)[0];
         (*out)[0] = TwoHotError<double>(M(in->data(), kBins.count, kN), M(targets.data(), 1, kN),
                                         M(weights.data(), 1, kN), kBins,
                                         M(gradient.data(), kBins.count, kN));
         if (d == nullptr) return;
         for (std::size_t i = 0; i < d->size(); ++i) (*d)[i] = factor * gradient[i];
       }},
      {"two_hot_value", kBins.count * kN, kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         Values probabilities(in->size());
         const M p(probabilities.data(), kBins.count, kN), values(out->data(), 1, kN);
         TwoHotValue<double>(M(in->data(), kBins.count, kN), kBins, p, values);
         if (d == nullptr) return;
         TwoHotValueBackward<double>(p, values, M(ct->data(), 1, kN), kBins,
                                     M(d->data(), kBins.count, kN));
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
         RunActor({.mean_limit = 2, .std_offset = 0.3, .min_std = 0.05}, in, out, ct, d);
       }},
      {"actor_distribution_of_bounded_log_std", 2 * 3 * kN, 3 * kN + kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         RunActor({.min_log_std = -3, .max_log_std = 1}, in, out, ct, d);
       }},
      {"mlp", MlpInputs(kElu), 3 * kN,
       [](Values* in, Values* out, Values* ct, Values* d) { RunMlp(kElu, 3, in, out, ct, d); }},
      {"mlp_layer_norm", MlpInputs(kNormElu), 3 * kN,
       [](Values* in, Values* out, Values* ct, Values* d) { RunMlp(kNormElu, 3, in, out, ct, d); }},
      {"mlp_to_sim_norm", MlpInputs(kToSimNorm, 0), kSimplex * kN,
       [](Values* in, Values* out, Values* ct, Values* d) {
         RunMlp(kToSimNorm, 0, in, out, ct, d);
       }},
  };
  return layers;
}

class LayerGradient : public testing::TestWithParam<std::size_t> {};

TEST_P(LayerGradient, EqualsCentralDifference) {
  ExpectCentralDifferences(Layers()[GetParam()], GetParam());
}

INSTANTIATE_TEST_SUITE_P(Layers, LayerGradient, testing::Range<std::size_t>(0, Layers().size()),
                         [](const auto& row) { return std::string(Layers()[row.param].name); });

}  // namespace
}  // namespace dreamsearch::networks
