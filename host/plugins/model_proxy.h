// model_proxy.h - the model as a planner sees it, watched by the host.
//
// Checks sizes before a call reaches the model and finiteness before its answer
// reaches the planner, and counts imagined transitions. The first fault is kept:
// a planner that swallows a status cannot hide it.
#pragma once

#include <cstdint>
#include <string>

#include "dreamsearch/model.h"

namespace dreamsearch {

class ModelProxy final : public Offers<LatentModel, ValueSpread, ReturnGradient> {
 public:
  // `name` is the model's, for messages. The model must outlive the proxy. Imagine and Gradient
  // are faults unless the planner declares that it searches.
  ModelProxy(LatentModel* model, std::string name, bool searches);

  std::uint64_t latent_bytes() const noexcept override { return latent_bytes_; }
  std::uint64_t action_size() const noexcept override { return action_size_; }
  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override;
  Status Value(ConstLatents latents, View<double> values) noexcept override;
  // Offered where the model offers them.
  Status Spread(ConstLatents latents, const SpreadResult& result) noexcept override;
  Status Gradient(const GradientRequest& request, const GradientResult& result) noexcept override;
  void* Extension(const char* name) noexcept override;
  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override;
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept override;

  std::uint64_t transitions() const { return transitions_; }
  void set_transitions(std::uint64_t transitions) { transitions_ = transitions; }
  // ok, or the first fault since construction.
  const Status& fault() const { return fault_; }

 private:
  Status Keep(Status status) noexcept;
  Status CheckProposals(MatrixView<const double> actions) noexcept;
  // A call that the model itself refused, with its name.
  Status KeepFailure(const char* call, const Status& status) noexcept;

  Status NotDeclared(const char* call) const noexcept;
  Status KeepUnlessFinite(const char* what, View<const double> values) noexcept;

  LatentModel* model_;
  ValueSpread* spread_;       // of the model, or null
  ReturnGradient* gradient_;  // likewise
  std::string name_;
  bool searches_;
  std::uint64_t latent_bytes_;
  std::uint64_t action_size_;
  std::uint64_t transitions_ = 0;
  Status fault_;
};

}  // namespace dreamsearch
