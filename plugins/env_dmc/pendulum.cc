// pendulum.cc - pendulum_swingup.
#include <cmath>
#include <numbers>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

class Pendulum final : public ControlTask {
 public:
  explicit Pendulum(const char* name)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("pendulum", ModelText("pendulum.xml")),
                     .substeps = 1,
                     .observation = {{"orientation", 2}, {"velocity", 1}}}),
        pole_(Id(mjOBJ_BODY, "pole")) {}

  void Observe(double* out) const override {
    *out++ = data()->xmat[9 * pole_ + kZZ];
    *out++ = data()->xmat[9 * pole_ + kXZ];
    *out++ = data()->qvel[0];
  }

  double Reward() const override { return upright_(data()->xmat[9 * pole_ + kZZ]); }

 private:
  void DrawInitialState(NumpyRandom& random) override {
    data()->qpos[0] = random.Uniform(-std::numbers::pi, std::numbers::pi);
  }

  int pole_;
  Tolerance upright_{std::cos(8 * std::numbers::pi / 180), 1};
};

}  // namespace

ControlTask* MakePendulumSwingup() { return new Pendulum("pendulum_swingup"); }

}  // namespace dreamsearch::dmc
