#include "model_files.h"

// Every NAME.xml of models/; dreamsearch_embed makes NAME_xml() of each.
#define DREAMSEARCH_FOR_EACH_MODEL(DO) \
  DO(acrobot)                          \
  DO(ball_in_cup)                      \
  DO(cartpole)                         \
  DO(cheetah)                          \
  DO(finger)                           \
  DO(fish)                             \
  DO(hopper)                           \
  DO(humanoid)                         \
  DO(manipulator)                      \
  DO(pendulum)                         \
  DO(point_mass)                       \
  DO(quadruped)                        \
  DO(quadruped_run)                    \
  DO(quadruped_walk)                   \
  DO(reacher)                          \
  DO(scene)                            \
  DO(swimmer)                          \
  DO(walker)

namespace dreamsearch {

#define DREAMSEARCH_DECLARE(name) std::string_view name##_xml();
DREAMSEARCH_FOR_EACH_MODEL(DREAMSEARCH_DECLARE)
#undef DREAMSEARCH_DECLARE

namespace dmc {

std::span<const mujoco::ModelFile> ModelFiles() {
#define DREAMSEARCH_ENTRY(name) {#name ".xml", name##_xml()},
  static const mujoco::ModelFile files[] = {DREAMSEARCH_FOR_EACH_MODEL(DREAMSEARCH_ENTRY)};
#undef DREAMSEARCH_ENTRY
  return files;
}

std::string ModelText(const std::string& file) {
  for (const mujoco::ModelFile& known : ModelFiles()) {
    if (file == known.name) return std::string(known.bytes);
  }
  throw mujoco::EngineError("no model file '" + file + "'");
}

mujoco::ModelPtr CopyOfCompiled(const std::string& name, const std::string& mjcf) {
  return mujoco::CopyOfCompiled(name, mjcf, ModelFiles());
}

}  // namespace dmc
}  // namespace dreamsearch
