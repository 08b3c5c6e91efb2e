// acrobot.cc - acrobot_swingup and its sparse form.
#include <numbers>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

class Acrobot final : public ControlTask {
 public:
  Acrobot(const char* name, bool sparse)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("acrobot", ModelText("acrobot.xml")),
                     .substeps = 1,
                     .observation = {{"orientations", 4}, {"velocity", 2}}}),
        upper_(Id(mjOBJ_BODY, "upper_arm")),
        lower_(Id(mjOBJ_BODY, "lower_arm")),
        tip_(Id(mjOBJ_SITE, "tip")),
        target_(Id(mjOBJ_SITE, "target")),
        at_target_(0, model()->site_size[3 * target_], sparse ? 0 : 1) {}

  void Observe(double* out) const override {
    *out++ = data()->xmat[9 * upper_ + kXZ];
    *out++ = data()->xmat[9 * lower_ + kXZ];
    *out++ = data()->xmat[9 * upper_ + kZZ];
    *out++ = data()->xmat[9 * lower_ + kZZ];
    mju_copy(out, data()->qvel, model()->nv);
  }

  double Reward() const override {
    return at_target_(mju_dist3(data()->site_xpos + 3 * target_, data()->site_xpos + 3 * tip_));
  }

 private:
  void DrawInitialState(NumpyRandom& random) override {
    data()->qpos[QposAddress("shoulder")] = random.Uniform(-std::numbers::pi, std::numbers::pi);
    data()->qpos[QposAddress("elbow")] = random.Uniform(-std::numbers::pi, std::numbers::pi);
  }

  int upper_;
  int lower_;
  int tip_;
  int target_;
  Tolerance at_target_;
};

}  // namespace

ControlTask* MakeAcrobotSwingup() { return new Acrobot("acrobot_swingup", false); }
ControlTask* MakeAcrobotSwingupSparse() { return new Acrobot("acrobot_swingup_sparse", true); }

}  // namespace dreamsearch::dmc
