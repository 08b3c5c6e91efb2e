// cartpole.cc - cartpole_balance, cartpole_swingup and their sparse forms.
#include <numbers>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

class Cartpole final : public ControlTask {
 public:
  Cartpole(const char* name, bool swing_up, bool sparse)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("cartpole", ModelText("cartpole.xml")),
                     .substeps = 1,
                     .observation = {{"position", 3}, {"velocity", 2}}}),
        swing_up_(swing_up),
        sparse_(sparse),
        pole_(Id(mjOBJ_BODY, "pole_1")),
        slider_(QposAddress("slider")),
        hinge_(QposAddress("hinge_1")) {}

  void Observe(double* out) const override {
    *out++ = data()->qpos[slider_];
    *out++ = data()->xmat[9 * pole_ + kZZ];
    *out++ = data()->xmat[9 * pole_ + kXZ];
    mju_copy(out, data()->qvel, model()->nv);
  }

  double Reward() const override {
    const double position = data()->qpos[slider_];
    const double cosine = data()->xmat[9 * pole_ + kZZ];
    if (sparse_) return near_centre_(position) * near_upright_(cosine);
    const double upright = (cosine + 1) / 2;
    const double centred = (1 + centred_(position)) / 2;
    const double small_control = (4 + small_control_(data()->ctrl[0])) / 5;
    const double small_velocity = (1 + small_velocity_(data()->qvel[hinge_])) / 2;
    return upright * small_control * small_velocity * centred;
  }

 private:
  void DrawInitialState(NumpyRandom& random) override {
    if (swing_up_) {
      data()->qpos[slider_] = 0.01 * random.Normal();
      data()->qpos[hinge_] = std::numbers::pi + 0.01 * random.Normal();
    } else {
      data()->qpos[slider_] = random.Uniform(-0.1, 0.1);
      data()->qpos[hinge_] = random.Uniform(-0.034, 0.034);
    }
    for (int i = 0; i < model()->nv; ++i) data()->qvel[i] = 0.01 * random.Normal();
  }

  bool swing_up_;
  bool sparse_;
  int pole_;
  int slider_;  // qpos and qvel address
  int hinge_;   // qpos and qvel address
  Tolerance centred_{0, 0, 2};
  Tolerance small_control_{0, 0, 1, Falloff::kQuadratic, 0};
  Tolerance small_velocity_{0, 0, 5};
  Tolerance near_centre_{-0.25, 0.25};
  Tolerance near_upright_{0.995, 1};
};

}  // namespace

ControlTask* MakeCartpoleBalance() { return new Cartpole("cartpole_balance", false, false); }
ControlTask* MakeCartpoleBalanceSparse() {
  return new Cartpole("cartpole_balance_sparse", false, true);
}
ControlTask* MakeCartpoleSwingup() { return new Cartpole("cartpole_swingup", true, false); }
ControlTask* MakeCartpoleSwingupSparse() {
  return new Cartpole("cartpole_swingup_sparse", true, true);
}

}  // namespace dreamsearch::dmc
