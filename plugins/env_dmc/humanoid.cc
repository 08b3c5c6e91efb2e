// humanoid.cc - humanoid_stand, humanoid_walk, humanoid_run.
#include <array>
#include <cmath>
#include <limits>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kRootQpos = 7;  // position and quaternion; the hinges follow

class Humanoid final : public ControlTask {
 public:
  // speed: to be reached, in m/s; 0 asks for standing still.
  Humanoid(const char* name, double speed)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("humanoid", ModelText("humanoid.xml")),
                     .substeps = 5,
                     .observation = {{"joint_angles", 21},
                                     {"head_height", 1},
                                     {"extremities", 12},
                                     {"torso_vertical", 3},
                                     {"com_velocity", 3},
                                     {"velocity", 27}}}),
        must_move_(speed > 0),
        torso_(Id(mjOBJ_BODY, "torso")),
        head_(Id(mjOBJ_BODY, "head")),
        extremities_{Id(mjOBJ_BODY, "left_hand"), Id(mjOBJ_BODY, "left_foot"),
                     Id(mjOBJ_BODY, "right_hand"), Id(mjOBJ_BODY, "right_foot")},
        velocity_(Sensor("torso_subtreelinvel")),
        moving_(speed, kInfinity, speed, Falloff::kLinear, 0) {}

  void Observe(double* out) const override {
    const int hinges = model()->nq - kRootQpos;
    mju_copy(out, data()->qpos + kRootQpos, hinges);
    out += hinges;
    *out++ = data()->xpos[3 * head_ + 2];
    for (const int body : extremities_) {
      mjtNum from_torso[3];
      mju_sub3(from_torso, data()->xpos + 3 * body, data()->xpos + 3 * torso_);
      mju_rotVecMatT(out, from_torso, data()->xmat + 9 * torso_);
      out += 3;
    }
    *out++ = data()->xmat[9 * torso_ + kZX];
    *out++ = data()->xmat[9 * torso_ + kZY];
    *out++ = data()->xmat[9 * torso_ + kZZ];
    mju_copy3(out, velocity_);
    mju_copy(out + 3, data()->qvel, model()->nv);
  }

  double Reward() const override {
    const double standing = standing_(data()->xpos[3 * head_ + 2]);
    const double stand_reward = standing * upright_(data()->xmat[9 * torso_ + kZZ]);
    double small_control = 0;
    for (int i = 0; i < model()->nu; ++i) small_control += small_control_(data()->ctrl[i]);
    small_control = (4 + small_control / model()->nu) / 5;
    const double x = velocity_[0];
    const double y = velocity_[1];
    if (!must_move_) return small_control * stand_reward * ((still_(x) + still_(y)) / 2);
    return small_control * stand_reward * (5 * moving_(std::sqrt(x * x + y * y)) + 1) / 6;
  }

 private:
  void DrawInitialState(NumpyRandom& random) override {
    do {
      RandomiseJoints(random);
      ForwardWithoutActuation();
    } while (data()->ncon > 0);
  }

  bool must_move_;
  int torso_;
  int head_;
  std::array<int, 4> extremities_;
  const mjtNum* velocity_;  // of the centre of mass, world axes
  Tolerance standing_{1.4, kInfinity, 0.35};
  Tolerance upright_{0.9, kInfinity, 1.9, Falloff::kLinear, 0};
  Tolerance small_control_{0, 0, 1, Falloff::kQuadratic, 0};
  Tolerance still_{0, 0, 2};
  Tolerance moving_;
};

}  // namespace

ControlTask* MakeHumanoidStand() { return new Humanoid("humanoid_stand", 0); }
ControlTask* MakeHumanoidWalk() { return new Humanoid("humanoid_walk", 1); }
ControlTask* MakeHumanoidRun() { return new Humanoid("humanoid_run", 10); }

}  // namespace dreamsearch::dmc
