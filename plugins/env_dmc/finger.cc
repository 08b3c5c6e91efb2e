// finger.cc - finger_spin, finger_turn_easy, finger_turn_hard.
#include <cmath>
#include <numbers>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

constexpr double kSpinDamping = 0.03;
constexpr double kSpinVelocity = 15;  // rad/s, about the axis -y
constexpr int kMostTries = 1000;

class Finger : public ControlTask {
 protected:
  Finger(const char* name, std::vector<mujoco::Part> observation)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("finger", ModelText("finger.xml")),
                     .substeps = 2,
                     .observation = std::move(observation)}),
        proximal_(Sensor("proximal")),
        distal_(Sensor("distal")),
        proximal_velocity_(Sensor("proximal_velocity")),
        distal_velocity_(Sensor("distal_velocity")),
        hinge_velocity_(Sensor("hinge_velocity")),
        tip_(Sensor("tip")),
        spinner_(Sensor("spinner")),
        touchtop_(Sensor("touchtop")),
        touchbottom_(Sensor("touchbottom")) {}

  // Returns where the next part goes.
  double* ObserveFinger(double* out) const {
    *out++ = *proximal_;
    *out++ = *distal_;
    *out++ = tip_[0] - spinner_[0];
    *out++ = tip_[2] - spinner_[2];
    *out++ = *proximal_velocity_;
    *out++ = *distal_velocity_;
    *out++ = *hinge_velocity_;
    *out++ = std::log1p(*touchtop_);
    *out++ = std::log1p(*touchbottom_);
    return out;
  }

  void DrawCollisionFreePose(NumpyRandom& random) {
    for (int tries = 0; tries < kMostTries; ++tries) {
      RandomiseJoints(random);
      ForwardWithoutActuation();
      if (data()->ncon == 0) return;
    }
    throw EngineError("no pose without contacts in 1000 tries");
  }

  const mjtNum* proximal_;
  const mjtNum* distal_;
  const mjtNum* proximal_velocity_;
  const mjtNum* distal_velocity_;
  const mjtNum* hinge_velocity_;
  const mjtNum* tip_;
  const mjtNum* spinner_;
  const mjtNum* touchtop_;
  const mjtNum* touchbottom_;
};

class FingerSpin final : public Finger {
 public:
  explicit FingerSpin(const char* name)
      : Finger(name, {{"position", 4}, {"velocity", 3}, {"touch", 2}}),
        damping_(model()->dof_damping + DofAddress("hinge")) {
    DeclareWritten(damping_, 1);
  }

  void Observe(double* out) const override { ObserveFinger(out); }
  double Reward() const override { return *hinge_velocity_ <= -kSpinVelocity ? 1 : 0; }

 private:
  void DrawInitialState(NumpyRandom& random) override {
    for (const char* site : {"target", "tip"}) {
      model()->site_rgba[4 * Id(mjOBJ_SITE, site) + 3] = 0;  // no target in the picture
    }
    *damping_ = kSpinDamping;
    DrawCollisionFreePose(random);
  }

  mjtNum* damping_;
};

class FingerTurn final : public Finger {
 public:
  FingerTurn(const char* name, double target_radius)
      : Finger(name, {{"position", 4},
                      {"velocity", 3},
                      {"touch", 2},
                      {"target_position", 2},
                      {"dist_to_target", 1}}),
        target_radius_(target_radius),
        target_(Sensor("target")),
        target_pos_(model()->site_pos + 3 * Id(mjOBJ_SITE, "target")),
        target_size_(model()->site_size + 3 * Id(mjOBJ_SITE, "target")) {
    DeclareWritten(target_pos_, 3);
    DeclareWritten(target_size_, 1);
  }

  void Observe(double* out) const override {
    out = ObserveFinger(out);
    *out++ = target_[0] - spinner_[0];
    *out++ = target_[2] - spinner_[2];
    *out++ = DistanceToTarget();
  }

  double Reward() const override { return DistanceToTarget() <= 0 ? 1 : 0; }

 private:
  // Of the spinner's tip from the target's edge, both relative to the spinner.
  double DistanceToTarget() const {
    const double x = (target_[0] - spinner_[0]) - (tip_[0] - spinner_[0]);
    const double z = (target_[2] - spinner_[2]) - (tip_[2] - spinner_[2]);
    return std::sqrt(x * x + z * z) - target_size_[0];
  }

  void DrawInitialState(NumpyRandom& random) override {
    const double angle = random.Uniform(-std::numbers::pi, std::numbers::pi);
    const mjtNum* cap = model()->geom_size + 3 * Id(mjOBJ_GEOM, "cap1");
    const double radius = cap[0] + cap[1] + cap[2];
    const mjtNum* hinge = data()->xanchor + 3 * Id(mjOBJ_JOINT, "hinge");
    target_pos_[0] = hinge[0] + radius * std::sin(angle);
    target_pos_[2] = hinge[2] + radius * std::cos(angle);
    target_size_[0] = target_radius_;
    DrawCollisionFreePose(random);
  }

  double target_radius_;
  const mjtNum* target_;
  mjtNum* target_pos_;
  mjtNum* target_size_;
};

}  // namespace

ControlTask* MakeFingerSpin() { return new FingerSpin("finger_spin"); }
ControlTask* MakeFingerTurnEasy() { return new FingerTurn("finger_turn_easy", 0.07); }
ControlTask* MakeFingerTurnHard() { return new FingerTurn("finger_turn_hard", 0.03); }

}  // namespace dreamsearch::dmc
