// walker.cc - walker_stand, walker_walk, walker_run.
#include <limits>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

class Walker final : public ControlTask {
 public:
  // speed: to be reached, in m/s; 0 asks for standing only.
  Walker(const char* name, double speed)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("walker", ModelText("walker.xml")),
                     .substeps = 10,
                     .observation = {{"orientations", 14}, {"height", 1}, {"velocity", 9}}}),
        must_move_(speed > 0),
        torso_(Id(mjOBJ_BODY, "torso")),
        velocity_(Sensor("torso_subtreelinvel")),
        standing_(1.2, kInfinity, 0.6),
        moving_(speed, kInfinity, speed / 2, Falloff::kLinear, 0.5) {}

  void Observe(double* out) const override {
    for (int body = 1; body < model()->nbody; ++body) {
      *out++ = data()->xmat[9 * body + kXX];
      *out++ = data()->xmat[9 * body + kXZ];
    }
    *out++ = data()->xpos[3 * torso_ + 2];
    mju_copy(out, data()->qvel, model()->nv);
  }

  double Reward() const override {
    const double standing = standing_(data()->xpos[3 * torso_ + 2]);
    const double upright = (1 + data()->xmat[9 * torso_ + kZZ]) / 2;
    const double stand_reward = (3 * standing + upright) / 4;
    if (!must_move_) return stand_reward;
    return stand_reward * (5 * moving_(velocity_[0]) + 1) / 6;
  }

 private:
  void DrawInitialState(NumpyRandom& random) override { RandomiseJoints(random); }

  bool must_move_;
  int torso_;
  const mjtNum* velocity_;  // of the centre of mass, world axes
  Tolerance standing_;
  Tolerance moving_;
};

}  // namespace

ControlTask* MakeWalkerStand() { return new Walker("walker_stand", 0); }
ControlTask* MakeWalkerWalk() { return new Walker("walker_walk", 1); }
ControlTask* MakeWalkerRun() { return new Walker("walker_run", 8); }

}  // namespace dreamsearch::dmc
