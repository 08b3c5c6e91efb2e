// ball_in_cup.cc - cup_catch, which the suite calls ball_in_cup_catch.
#include <cmath>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

class BallInCup final : public ControlTask {
 public:
  explicit BallInCup(const char* name)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("ball_in_cup", ModelText("ball_in_cup.xml")),
                     .substeps = 10,
                     .observation = {{"position", 4}, {"velocity", 4}}}),
        ball_(Id(mjOBJ_BODY, "ball")),
        target_(Id(mjOBJ_SITE, "target")),
        ball_radius_(model()->geom_size[3 * Id(mjOBJ_GEOM, "ball")]) {}

  void Observe(double* out) const override {
    mju_copy(out, data()->qpos, model()->nq);
    mju_copy(out + model()->nq, data()->qvel, model()->nv);
  }

  // 1 while the whole ball is inside the target box, seen from the side.
  double Reward() const override {
    const mjtNum* target = data()->site_xpos + 3 * target_;
    const mjtNum* half_size = model()->site_size + 3 * target_;
    const mjtNum* ball = data()->xpos + 3 * ball_;
    const auto inside = [&](int axis) {
      return std::abs(target[axis] - ball[axis]) < half_size[axis] - ball_radius_;
    };
    return inside(0) && inside(2) ? 1 : 0;
  }

 private:
  void DrawInitialState(NumpyRandom& random) override {
    do {
      data()->qpos[QposAddress("ball_x")] = random.Uniform(-0.2, 0.2);
      data()->qpos[QposAddress("ball_z")] = random.Uniform(0.2, 0.5);
      ForwardWithoutActuation();
    } while (data()->ncon > 0);
  }

  int ball_;
  int target_;
  double ball_radius_;
};

}  // namespace

ControlTask* MakeBallInCupCatch() { return new BallInCup("cup_catch"); }

}  // namespace dreamsearch::dmc
