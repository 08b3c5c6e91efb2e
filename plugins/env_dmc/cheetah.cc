// cheetah.cc - cheetah_run.
#include <limits>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

constexpr int kSettlingSteps = 200;

class Cheetah final : public ControlTask {
 public:
  explicit Cheetah(const char* name)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("cheetah", ModelText("cheetah.xml")),
                     .substeps = 1,
                     .observation = {{"position", 8}, {"velocity", 9}}}),
        velocity_(Sensor("torso_subtreelinvel")) {}

  void Observe(double* out) const override {
    mju_copy(out, data()->qpos + 1, model()->nq - 1);
    mju_copy(out + model()->nq - 1, data()->qvel, model()->nv);
  }

  double Reward() const override { return running_(velocity_[0]); }

 private:
  // No forward pass between drawing the pose and settling: the first physics step
  // moves the drawn pose by the forces of the default one, as the suite does it.
  void DrawInitialState(NumpyRandom& random) override {
    for (int j = 0; j < model()->njnt; ++j) {
      if (!model()->jnt_limited[j]) continue;
      data()->qpos[model()->jnt_qposadr[j]] =
          random.Uniform(model()->jnt_range[2 * j], model()->jnt_range[2 * j + 1]);
    }
    Advance(kSettlingSteps);
    data()->time = 0;
  }

  const mjtNum* velocity_;  // of the centre of mass, world axes
  Tolerance running_{10, std::numeric_limits<double>::infinity(), 10, Falloff::kLinear, 0};
};

}  // namespace

ControlTask* MakeCheetahRun() { return new Cheetah("cheetah_run"); }

}  // namespace dreamsearch::dmc
