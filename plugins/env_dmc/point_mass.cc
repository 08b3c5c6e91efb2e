// point_mass.cc - point_mass_easy.
#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

class PointMass final : public ControlTask {
 public:
  explicit PointMass(const char* name)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("point_mass", ModelText("point_mass.xml")),
                     .substeps = 1,
                     .observation = {{"position", 2}, {"velocity", 2}}}),
        mass_(Id(mjOBJ_GEOM, "pointmass")),
        target_(Id(mjOBJ_GEOM, "target")),
        near_(0, model()->geom_size[3 * target_], model()->geom_size[3 * target_]) {}

  void Observe(double* out) const override {
    mju_copy(out, data()->qpos, model()->nq);
    mju_copy(out + model()->nq, data()->qvel, model()->nv);
  }

  double Reward() const override {
    const double near =
        near_(mju_dist3(data()->geom_xpos + 3 * target_, data()->geom_xpos + 3 * mass_));
    double small_control = 0;
    for (int i = 0; i < model()->nu; ++i) small_control += small_control_(data()->ctrl[i]);
    return near * ((small_control / model()->nu + 4) / 5);
  }

 private:
  void DrawInitialState(NumpyRandom& random) override { RandomiseJoints(random); }

  int mass_;
  int target_;
  Tolerance near_;
  Tolerance small_control_{0, 0, 1, Falloff::kQuadratic, 0};
};

}  // namespace

ControlTask* MakePointMassEasy() { return new PointMass("point_mass_easy"); }

}  // namespace dreamsearch::dmc
