// manipulator.cc - manipulator_bring_ball.
#include <array>
#include <cmath>
#include <numbers>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

// The order of draws and observations, which is not the model's joint order.
constexpr std::array<const char*, 8> kArm = {"arm_root", "arm_shoulder", "arm_elbow", "arm_wrist",
                                             "finger",   "fingertip",    "thumb",     "thumbtip"};
constexpr std::array<const char*, 5> kTouch = {"palm_touch", "finger_touch", "thumb_touch",
                                               "fingertip_touch", "thumbtip_touch"};
constexpr std::array<const char*, 3> kBall = {"ball_x", "ball_z", "ball_y"};
constexpr double kInHand = 0.1;    // share of episodes that start with the ball in the hand
constexpr double kInTarget = 0.1;  // share that start with the ball at the target

class Manipulator final : public ControlTask {
 public:
  explicit Manipulator(const char* name)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled("manipulator", ModelText("manipulator.xml")),
                     .substeps = 10,
                     .observation = {{"arm_pos", 16},
                                     {"arm_vel", 8},
                                     {"touch", 5},
                                     {"hand_pos", 4},
                                     {"object_pos", 4},
                                     {"object_vel", 3},
                                     {"target_pos", 4}}}),
        hand_(Id(mjOBJ_BODY, "hand")),
        ball_(Id(mjOBJ_BODY, "ball")),
        target_(Id(mjOBJ_BODY, "target_ball")),
        ball_site_(Id(mjOBJ_SITE, "ball")),
        target_site_(Id(mjOBJ_SITE, "target_ball")),
        grasp_site_(Id(mjOBJ_SITE, "grasp")),
        target_pos_(model()->body_pos + 3 * target_),
        target_quat_(model()->body_quat + 4 * target_) {
    for (std::size_t i = 0; i < kArm.size(); ++i) {
      arm_[i] = Id(mjOBJ_JOINT, kArm[i]);
      arm_qpos_[i] = QposAddress(kArm[i]);
      arm_dof_[i] = DofAddress(kArm[i]);
    }
    for (std::size_t i = 0; i < kTouch.size(); ++i) touch_[i] = Sensor(kTouch[i]);
    for (std::size_t i = 0; i < kBall.size(); ++i) {
      ball_qpos_[i] = QposAddress(kBall[i]);
      ball_dof_[i] = DofAddress(kBall[i]);
    }
    DeclareWritten(target_pos_, 3);
    DeclareWritten(target_quat_, 4);
  }

  void Observe(double* out) const override {
    for (const int address : arm_qpos_) {
      *out++ = std::sin(data()->qpos[address]);
      *out++ = std::cos(data()->qpos[address]);
    }
    for (const int address : arm_dof_) *out++ = data()->qvel[address];
    for (const mjtNum* touch : touch_) *out++ = std::log1p(*touch);
    out = ObservePose(hand_, out);
    out = ObservePose(ball_, out);
    for (const int address : ball_dof_) *out++ = data()->qvel[address];
    ObservePose(target_, out);
  }

  double Reward() const override {
    return near_(
        mju_dist3(data()->site_xpos + 3 * ball_site_, data()->site_xpos + 3 * target_site_));
  }

 private:
  // In the plane: x, z and the two quaternion entries that turn about y.
  double* ObservePose(int body, double* out) const {
    *out++ = data()->xpos[3 * body];
    *out++ = data()->xpos[3 * body + 2];
    *out++ = data()->xquat[4 * body];
    *out++ = data()->xquat[4 * body + 2];
    return out;
  }

  void DrawInitialState(NumpyRandom& random) override {
    do {
      DrawAttempt(random);
      ForwardWithoutActuation();
    } while (data()->ncon > 0);
  }

  // The ball's velocity is not cleared: one drawn for a rejected attempt stays.
  void DrawAttempt(NumpyRandom& random) {
    constexpr double kPi = std::numbers::pi;
    for (std::size_t i = 0; i < kArm.size(); ++i) {
      const bool limited = model()->jnt_limited[arm_[i]];
      const mjtNum* range = model()->jnt_range + 2 * arm_[i];
      data()->qpos[arm_qpos_[i]] =
          limited ? random.Uniform(range[0], range[1]) : random.Uniform(-kPi, kPi);
    }
    data()->qpos[QposAddress("finger")] = data()->qpos[QposAddress("thumb")];

    target_pos_[0] = random.Uniform(-0.4, 0.4);
    target_pos_[2] = random.Uniform(0.1, 0.4);
    const double target_angle = random.Uniform(-kPi, kPi);
    target_quat_[0] = std::cos(target_angle / 2);
    target_quat_[2] = std::sin(target_angle / 2);

    double x, z, angle;
    const double choice = random.Uniform();
    if (choice < kInHand) {
      ForwardWithoutActuation();
      x = data()->site_xpos[3 * grasp_site_];
      z = data()->site_xpos[3 * grasp_site_ + 2];
      const mjtNum* hand = data()->site_xmat + 9 * grasp_site_;
      angle = kPi - std::atan2(hand[kZX], hand[kXX]);
    } else if (choice < kInHand + kInTarget) {
      x = target_pos_[0];
      z = target_pos_[2];
      angle = target_angle;
    } else {
      x = random.Uniform(-0.5, 0.5);
      z = random.Uniform(0, 0.7);
      angle = random.Uniform(0, 2 * kPi);
      data()->qvel[ball_dof_[0]] = random.Uniform(-5, 5);
    }
    data()->qpos[ball_qpos_[0]] = x;
    data()->qpos[ball_qpos_[1]] = z;
    data()->qpos[ball_qpos_[2]] = angle;
  }

  int hand_;
  int ball_;
  int target_;
  int ball_site_;
  int target_site_;
  int grasp_site_;
  mjtNum* target_pos_;
  mjtNum* target_quat_;
  std::array<int, 8> arm_;
  std::array<int, 8> arm_qpos_;
  std::array<int, 8> arm_dof_;
  std::array<const mjtNum*, 5> touch_;
  std::array<int, 3> ball_qpos_;
  std::array<int, 3> ball_dof_;
  Tolerance near_{0, 0.01, 0.02};
};

}  // namespace

ControlTask* MakeManipulatorBringBall() { return new Manipulator("manipulator_bring_ball"); }

}  // namespace dreamsearch::dmc
