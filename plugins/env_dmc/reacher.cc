// reacher.cc - reacher_easy, reacher_hard.
#include <cmath>
#include <numbers>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

class Reacher final : public ControlTask {
 public:
  Reacher(const char* name, double target_radius)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("reacher", ModelText("reacher.xml")),
                     .substeps = 1,
                     .observation = {{"position", 2}, {"to_target", 2}, {"velocity", 2}}}),
        target_radius_(target_radius),
        target_(Id(mjOBJ_GEOM, "target")),
        finger_(Id(mjOBJ_GEOM, "finger")),
        target_pos_(model()->geom_pos + 3 * target_),
        target_size_(model()->geom_size + 3 * target_) {
    DeclareWritten(target_pos_, 3);
    DeclareWritten(target_size_, 1);
  }

  void Observe(double* out) const override {
    mju_copy(out, data()->qpos, model()->nq);
    out += model()->nq;
    *out++ = ToTarget(0);
    *out++ = ToTarget(1);
    mju_copy(out, data()->qvel, model()->nv);
  }

  // 1 while finger and target overlap.
  double Reward() const override {
    const double x = ToTarget(0);
    const double y = ToTarget(1);
    const double radii = model()->geom_size[3 * target_] + model()->geom_size[3 * finger_];
    return std::sqrt(x * x + y * y) <= radii ? 1 : 0;
  }

 private:
  double ToTarget(int axis) const {
    return data()->geom_xpos[3 * target_ + axis] - data()->geom_xpos[3 * finger_ + axis];
  }

  void DrawInitialState(NumpyRandom& random) override {
    target_size_[0] = target_radius_;
    RandomiseJoints(random);
    const double angle = random.Uniform(0, 2 * std::numbers::pi);
    const double radius = random.Uniform(0.05, 0.20);
    target_pos_[0] = radius * std::sin(angle);
    target_pos_[1] = radius * std::cos(angle);
  }

  double target_radius_;
  int target_;
  int finger_;
  mjtNum* target_pos_;
  mjtNum* target_size_;
};

}  // namespace

ControlTask* MakeReacherEasy() { return new Reacher("reacher_easy", 0.05); }
ControlTask* MakeReacherHard() { return new Reacher("reacher_hard", 0.015); }

}  // namespace dreamsearch::dmc
