#include "plugins/mujoco/variation.h"

#include "plugins/mujoco/engine.h"

namespace dreamsearch::mujoco {
namespace {

void Scale(double factor, mjtNum* values, int count) {
  for (int i = 0; i < count; ++i) values[i] *= factor;
}

// Of gain and bias the parameters that are forces. A muscle's third is its peak force, or its
// fourth what the peak is made of.
void ScaleForce(double factor, bool muscle, mjtNum* parameters) {
  if (muscle) {
    Scale(factor, parameters + 2, 2);
  } else {
    Scale(factor, parameters, 3);
  }
}

}  // namespace

Variation Variation::From(const Parameters& parameters, std::uint32_t action_repeat) {
  const VariationSettings settings = kVariationSettings.Read(parameters);
  return {.mass_scale = settings.mass_scale,
          .friction_scale = settings.friction_scale,
          .gravity_scale = settings.gravity_scale,
          .actuator_scale = settings.actuator_scale,
          .observation_noise = settings.observation_noise,
          .delay_steps = settings.action_delay * action_repeat};
}

void ChangeModel(const Variation& variation, mjModel* model) {
  if (variation.friction_scale != 1) {
    Scale(variation.friction_scale, model->geom_friction, 3 * model->ngeom);
    Scale(variation.friction_scale, model->pair_friction, 5 * model->npair);
  }
  if (variation.gravity_scale != 1) Scale(variation.gravity_scale, model->opt.gravity, 3);
  if (variation.actuator_scale != 1) {
    const double factor = variation.actuator_scale;
    for (int i = 0; i < model->nu; ++i) {
      ScaleForce(factor, model->actuator_gaintype[i] == mjGAIN_MUSCLE,
                 model->actuator_gainprm + mjNGAIN * i);
      ScaleForce(factor, model->actuator_biastype[i] == mjBIAS_MUSCLE,
                 model->actuator_biasprm + mjNBIAS * i);
    }
    Scale(factor, model->actuator_forcerange, 2 * model->nu);
  }
  if (variation.mass_scale != 1) {
    Scale(variation.mass_scale, model->body_mass, model->nbody);
    Scale(variation.mass_scale, model->body_inertia, 3 * model->nbody);
    const DataPtr data(mj_makeData(model));
    if (data == nullptr) throw EngineError("cannot allocate mjData");
    mj_setConst(model, data.get());
  }
}

}  // namespace dreamsearch::mujoco
