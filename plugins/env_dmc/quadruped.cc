// quadruped.cc - quadruped_walk, quadruped_run.
#include <cmath>
#include <limits>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLift = 0.01;  // m
constexpr int kMostLifts = 10000;
constexpr int kForceTorqueSize = 24;

class Quadruped final : public ControlTask {
 public:
  // speed: to be reached, in m/s.
  Quadruped(const char* name, double speed)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled(name, ModelText(std::string(name) + ".xml")),
                     .substeps = 4,
                     .observation = {{"egocentric_state", 44},
                                     {"torso_velocity", 3},
                                     {"torso_upright", 1},
                                     {"imu", 6},
                                     {"force_torque", kForceTorqueSize}}}),
        torso_(Id(mjOBJ_BODY, "torso")),
        velocimeter_(Sensor("velocimeter")),
        accelerometer_(Sensor("imu_accel")),
        gyro_(Sensor("imu_gyro")),
        force_torque_(Sensor("force_toe_front_left")),
        moving_(speed, kInfinity, speed, Falloff::kLinear, 0.5) {
    // Four forces and then four torques, three numbers each, lie side by side.
    if (Sensor("torque_toe_back_left") + 3 != force_torque_ + kForceTorqueSize) {
      throw EngineError("the sensors of the toes are not in the expected order");
    }
  }

  void Observe(double* out) const override {
    const int hinges = model()->nq - 7;
    mju_copy(out, data()->qpos + 7, hinges);
    out += hinges;
    mju_copy(out, data()->qvel + 6, hinges);
    out += hinges;
    mju_copy(out, data()->act, model()->na);
    out += model()->na;
    mju_copy3(out, velocimeter_);
    out += 3;
    *out++ = data()->xmat[9 * torso_ + kZZ];
    mju_copy3(out, accelerometer_);
    mju_copy3(out + 3, gyro_);
    out += 6;
    for (int i = 0; i < kForceTorqueSize; ++i) *out++ = std::asinh(force_torque_[i]);
  }

  double Reward() const override {
    return upright_(data()->xmat[9 * torso_ + kZZ]) * moving_(velocimeter_[0]);
  }

 private:
  // A random orientation, lifted off the floor until nothing touches. The suite
  // makes two forward passes at every height; each height starts afresh, so all
  // but the last are needed for their contacts alone.
  void DrawInitialState(NumpyRandom& random) override {
    double q[4];
    for (double& x : q) x = random.Normal();
    const double norm = QuaternionNorm(q);
    for (double& x : q) x /= norm;
    mjtNum position[3] = {0, 0, 0};
    const auto place = [&] {
      mju_copy3(data()->qpos, position);
      mju_copy4(data()->qpos + 3, q);
    };
    for (int lifts = 0;; ++lifts, position[2] += kLift) {
      if (lifts == kMostLifts) throw EngineError("no pose without contacts in 10000 lifts");
      place();
      mj_kinematics(model(), data());
      mj_collision(model(), data());
      if (data()->ncon == 0) break;
    }
    mj_resetData(model(), data());
    ForwardWithoutActuation();
    place();
    ForwardWithoutActuation();
    ClearWarnings();  // those of the search are nobody's concern
  }

  int torso_;
  const mjtNum* velocimeter_;
  const mjtNum* accelerometer_;
  const mjtNum* gyro_;
  const mjtNum* force_torque_;
  Tolerance upright_{1, kInfinity, 2, Falloff::kLinear, 0};
  Tolerance moving_;
};

}  // namespace

ControlTask* MakeQuadrupedWalk() { return new Quadruped("quadruped_walk", 0.5); }
ControlTask* MakeQuadrupedRun() { return new Quadruped("quadruped_run", 5); }

}  // namespace dreamsearch::dmc
