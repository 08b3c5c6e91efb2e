// probe_model.h - a model that watches its planner.
//
// A state of four numbers that drifts with the action and pays a smooth reward: nothing is
// degenerate, and a search finds something. Its latents carry a checksum, so that one which was
// written to, or which the model never gave, is noticed. What the planner does wrong is kept until
// CheckCalls, because a planner may swallow the Status of a refused call.
#pragma once

#include <cstdint>
#include <string>

#include "dreamsearch/model.h"
#include "tools.h"

namespace dreamsearch::check {

class ProbeModel final : public Offers<LatentModel, ValueSpread, ReturnGradient> {
 public:
  // What it answers from now on.
  enum class Answers {
    kGood,
    kNan,       // NaN for rewards, values and proposals
    kInfinite,  // the same with infinity
    kHuge,      // rewards and values of 1e300
    kFails,     // every call fails after `calls_until_failure`
  };

  ProbeModel(std::uint64_t action_size, std::uint64_t latent_bytes);

  std::uint64_t latent_bytes() const noexcept override { return latent_bytes_; }
  std::uint64_t action_size() const noexcept override { return action_size_; }
  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override;
  Status Value(ConstLatents latents, View<double> values) noexcept override;
  Status Spread(ConstLatents latents, const SpreadResult& result) noexcept override;
  Status Gradient(const GradientRequest& request, const GradientResult& result) noexcept override;
  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override;
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept override;

  // A latent that an observation might have led to.
  void MakeLatent(std::uint64_t seed, Latents latent) const;

  // Breaks the law if a call was not as model.h wants it.
  void CheckCalls() const;

  Answers answers = Answers::kGood;
  std::uint64_t calls_until_failure = 0;
  std::uint64_t calls = 0;
  std::uint64_t imagined = 0;  // transitions

 private:
  struct State {
    double x[4];
  };
  static constexpr std::uint64_t kHeader = 16;  // magic and checksum

  // Moves on; returns the reward.
  static double Move(View<const double> action, State* state);
  static double ValueOf(const State& state);

  State Read(const char* call, ConstLatents latents, std::uint64_t row);
  void Write(const State& state, View<std::byte> latent) const;
  void Blame(const std::string& expected, const std::string& found);
  // Fails unless `fit`. `describe` makes the text of what was given: calls that are right make
  // none, and do not allocate.
  template <typename Describe>
  Status Sizes(const char* call, bool fit, Describe describe);
  void CheckActions(const char* call, MatrixView<const double> actions);
  Status Begin();
  double Told(double good) const;
  void Sample(const State& state, std::uint64_t seed, View<double> action) const;
  void ModeOf(const State& state, View<double> action) const;

  const std::uint64_t action_size_;
  const std::uint64_t latent_bytes_;
  std::string expected_, found_;
};

}  // namespace dreamsearch::check
