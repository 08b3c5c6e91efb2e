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

class ModelProxy final : public LatentModel {
 public:
  // `name` is the model's, for messages. The model must outlive the proxy. Imagine is a
  // fault unless the planner declares that it searches.
  ModelProxy(LatentModel* model, std::string name, bool searches);

  std::uint64_t latent_bytes() const noexcept override { return latent_bytes_; }
  std::uint64_t action_size() const noexcept override { return action_size_; }
  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override;
  Status Value(ConstLatents latents, const ValueResult& result) noexcept override;
  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override;
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept override;

  std::uint64_t transitions() const { return transitions_; }
  void set_transitions(std::uint64_t transitions) { transitions_ = transitions; }
  // ok, or the first fault since construction.
  const Status& fault() const { return fault_; }

 private:
  Status Keep(Status status) noexcept;
  // A call that the model itself refused, with its name.
  Status KeepFailure(const char* call, const Status& status) noexcept;

  LatentModel* model_;
  std::string name_;
  bool searches_;
  std::uint64_t latent_bytes_;
  std::uint64_t action_size_;
  std::uint64_t transitions_ = 0;
  Status fault_;
};

}  // namespace dreamsearch
