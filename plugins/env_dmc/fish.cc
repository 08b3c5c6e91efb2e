// fish.cc - fish_upright, fish_swim.
#include <cmath>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

constexpr int kRootQpos = 7;  // position and quaternion; the seven hinges follow

class Fish : public ControlTask {
 protected:
  Fish(const char* name, std::vector<mujoco::Part> observation)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("fish", ModelText("fish.xml")),
                     .substeps = 10,
                     .observation = std::move(observation)}),
        torso_(Id(mjOBJ_BODY, "torso")),
        target_(Id(mjOBJ_GEOM, "target")) {}

  double* ObserveJointsAndUpright(double* out) const {
    const int hinges = model()->nq - kRootQpos;
    mju_copy(out, data()->qpos + kRootQpos, hinges);
    out += hinges;
    *out++ = Upright();
    return out;
  }
  void ObserveVelocity(double* out) const { mju_copy(out, data()->qvel, model()->nv); }

  double Upright() const { return data()->xmat[9 * torso_ + kZZ]; }

  void DrawPose(NumpyRandom& random) {
    double q[4];
    for (double& x : q) x = random.Normal();
    const double norm = QuaternionNorm(q);
    for (int i = 0; i < 4; ++i) data()->qpos[3 + i] = q[i] / norm;
    for (int i = kRootQpos; i < model()->nq; ++i) data()->qpos[i] = random.Uniform(-0.2, 0.2);
  }

  int torso_;
  int target_;
};

class FishUpright final : public Fish {
 public:
  explicit FishUpright(const char* name)
      : Fish(name, {{"joint_angles", 7}, {"upright", 1}, {"velocity", 13}}) {}

  void Observe(double* out) const override { ObserveVelocity(ObserveJointsAndUpright(out)); }
  double Reward() const override { return upright_(Upright()); }

 private:
  void DrawInitialState(NumpyRandom& random) override {
    DrawPose(random);
    model()->geom_rgba[4 * target_ + 3] = 0;  // no target in the picture
  }

  Tolerance upright_{1, 1, 1};
};

class FishSwim final : public Fish {
 public:
  explicit FishSwim(const char* name)
      : Fish(name, {{"joint_angles", 7}, {"upright", 1}, {"target", 3}, {"velocity", 13}}),
        mouth_(Id(mjOBJ_GEOM, "mouth")),
        near_(0, Radii(), 2 * Radii()),
        target_pos_(model()->geom_pos + 3 * target_) {
    DeclareWritten(target_pos_, 3);
  }

  void Observe(double* out) const override {
    out = ObserveJointsAndUpright(out);
    ToTarget(out);
    ObserveVelocity(out + 3);
  }

  double Reward() const override {
    mjtNum to_target[3];
    ToTarget(to_target);
    return (7 * near_(mju_norm3(to_target)) + 0.5 * (Upright() + 1)) / 8;
  }

 private:
  double Radii() const { return model()->geom_size[3 * mouth_] + model()->geom_size[3 * target_]; }

  // From the mouth, in the mouth's frame.
  void ToTarget(mjtNum* result) const {
    mjtNum difference[3];
    mju_sub3(difference, data()->geom_xpos + 3 * target_, data()->geom_xpos + 3 * mouth_);
    mju_rotVecMatT(result, difference, data()->geom_xmat + 9 * mouth_);
  }

  void DrawInitialState(NumpyRandom& random) override {
    DrawPose(random);
    target_pos_[0] = random.Uniform(-0.4, 0.4);
    target_pos_[1] = random.Uniform(-0.4, 0.4);
    target_pos_[2] = random.Uniform(0.1, 0.3);
  }

  int mouth_;
  Tolerance near_;
  mjtNum* target_pos_;
};

}  // namespace

ControlTask* MakeFishUpright() { return new FishUpright("fish_upright"); }
ControlTask* MakeFishSwim() { return new FishSwim("fish_swim"); }

}  // namespace dreamsearch::dmc
