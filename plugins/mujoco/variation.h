// variation.h - factors of variation: the same task in a changed world.
//
// Every task on MuJoCo takes them as parameters. With their defaults not a bit of an episode,
// of a saved state or of a configuration's digest differs from what it is without them.
#pragma once

#include <mujoco/mujoco.h>

#include <cstdint>

#include "dreamsearch/settings.h"

namespace dreamsearch::mujoco {

struct VariationSettings {
  double mass_scale;
  double friction_scale;
  double gravity_scale;
  double actuator_scale;
  double observation_noise;
  std::uint32_t action_delay;  // decisions
};
inline constexpr auto kVariationSettings = BindSettings<VariationSettings>(
    Bind<&VariationSettings::mass_scale>(
        RealParameter("mass_scale", 1, 0.01, 100, "",
                      "Every body's mass and inertia is multiplied by this.")
            .Variation()),
    Bind<&VariationSettings::friction_scale>(
        RealParameter("friction_scale", 1, 0, 100, "",
                      "The friction of every contact is multiplied by this; that in joints stays.")
            .Variation()),
    Bind<&VariationSettings::gravity_scale>(
        RealParameter("gravity_scale", 1, -10, 100, "", "Gravity is multiplied by this.")
            .Variation()),
    Bind<&VariationSettings::actuator_scale>(
        RealParameter("actuator_scale", 1, 0, 100, "",
                      "The force of every actuator, and its limit, is multiplied by this.")
            .Variation()),
    Bind<&VariationSettings::observation_noise>(
        RealParameter("observation_noise", 0, 0, 1000, "",
                      "Standard deviation of normal noise on every entry of the observation; the "
                      "reward does not see it.")
            .Variation()),
    Bind<&VariationSettings::action_delay>(
        IntParameter("action_delay", 0, 0, 100, "decisions",
                     "An action acts this many decisions late; before the first one the controls "
                     "are 0.")
            .Variation()));

struct Variation {
  double mass_scale = 1;
  double friction_scale = 1;
  double gravity_scale = 1;
  double actuator_scale = 1;
  double observation_noise = 0;
  std::uint32_t delay_steps = 0;  // environment steps, action repeat included

  // From the values of kVariationSettings.
  static Variation From(const Parameters& parameters, std::uint32_t action_repeat);
};

// Scales masses, friction, gravity and actuators of a compiled model. A factor of 1 touches
// nothing. What the compiler derived from masses is derived again.
//   EngineError  the engine refused.
void ChangeModel(const Variation& variation, mjModel* model);

}  // namespace dreamsearch::mujoco
