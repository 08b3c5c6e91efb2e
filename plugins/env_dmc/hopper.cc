// hopper.cc - hopper_hop, hopper_stand.
#include <cmath>
#include <limits>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

class Hopper final : public ControlTask {
 public:
  Hopper(const char* name, bool hop)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("hopper", ModelText("hopper.xml")),
                     .substeps = 4,
                     .observation = {{"position", 6}, {"velocity", 7}, {"touch", 2}}}),
        hop_(hop),
        torso_(Id(mjOBJ_BODY, "torso")),
        foot_(Id(mjOBJ_BODY, "foot")),
        velocity_(Sensor("torso_subtreelinvel")),
        touch_toe_(Sensor("touch_toe")),
        touch_heel_(Sensor("touch_heel")) {}

  void Observe(double* out) const override {
    mju_copy(out, data()->qpos + 1, model()->nq - 1);
    out += model()->nq - 1;
    mju_copy(out, data()->qvel, model()->nv);
    out += model()->nv;
    *out++ = std::log1p(*touch_toe_);
    *out++ = std::log1p(*touch_heel_);
  }

  double Reward() const override {
    // Heights of centres of mass, not of body frames.
    const double standing = standing_(data()->xipos[3 * torso_ + 2] - data()->xipos[3 * foot_ + 2]);
    if (hop_) return standing * hopping_(velocity_[0]);
    double small_control = 0;
    for (int i = 0; i < model()->nu; ++i) small_control += small_control_(data()->ctrl[i]);
    return standing * ((small_control / model()->nu + 4) / 5);
  }

 private:
  void DrawInitialState(NumpyRandom& random) override { RandomiseJoints(random); }

  bool hop_;
  int torso_;
  int foot_;
  const mjtNum* velocity_;  // of the centre of mass, world axes
  const mjtNum* touch_toe_;
  const mjtNum* touch_heel_;
  Tolerance standing_{0.6, 2};
  Tolerance hopping_{2, std::numeric_limits<double>::infinity(), 1, Falloff::kLinear, 0.5};
  Tolerance small_control_{0, 0, 1, Falloff::kQuadratic, 0};
};

}  // namespace

ControlTask* MakeHopperHop() { return new Hopper("hopper_hop", true); }
ControlTask* MakeHopperStand() { return new Hopper("hopper_stand", false); }

}  // namespace dreamsearch::dmc
