#include "plugins/model_tdmpc/tdmpc.h"

#include <algorithm>

namespace dreamsearch::tdmpc {
Tdmpc::Tdmpc(const Settings& settings, Index observation_size, Index action_size,
             std::uint64_t seed)
    : FloatModel({.state = settings.latent,
                  .observation = observation_size,
                  .action = action_size,
                  .critics = settings.critics,
                  .metrics = kLosses}),
      learner_(settings, observation_size, action_size, seed) {}

Status Tdmpc::Update(const TrainRequest& request, double* metrics) {
  UpdateLosses losses{};
  const Status status = learner_.Update(request, &losses);
  if (!status.ok()) return status;
  std::copy(losses.begin(), losses.end(), metrics);
  return status;
}

Status CreateTdmpc(const ModelContext& context, Model** result) noexcept {
  *result = nullptr;
  if (Status status = CheckTask("tdmpc", context); !status.ok()) return status;
  return Guarded("tdmpc", [&] {
    *result =
        new Tdmpc(SettingsFrom(context.parameters), static_cast<Index>(context.observation_size),
                  static_cast<Index>(context.action_size), context.seed);
    return OkStatus();
  });
}

}  // namespace dreamsearch::tdmpc
