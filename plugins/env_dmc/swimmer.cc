// swimmer.cc - swimmer_swimmer6, swimmer_swimmer15: chains of 6 and 15 links.
#include <cmath>
#include <cstdio>
#include <string>

#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

constexpr int kFirstVelocity = 12;  // sensordata before the links' velocimeters and gyros
constexpr double kNearShare = 0.2;  // share of episodes with the target close by
constexpr double kNearBox = 0.3;    // half-size of where it then is, in m
constexpr double kFarBox = 2;

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

// The model of a chain of `bodies` links: a head and bodies - 1 segments, each
// the child of the one before it.
std::string SwimmerModel(int bodies) {
  const double scale = bodies / 6.0;  // of the tracking cameras' distance
  const std::string range = Number(360.0 / bodies);
  std::string xml = R"(<mujoco model="swimmer">
  <include file="swimmer.xml"/>
  <worldbody>
    <body name="head" pos="0 0 0.05" childclass="swimmer">
      <light name="light_1" pos="0 0 1.5" diffuse="0.8 0.8 0.8"/>
)";
  xml += "<camera name='tracking1' mode='trackcom' pos='0 " + Number(-0.2 * scale) + " " +
         Number(0.5 * scale) + "' xyaxes='1 0 0 0 1 1' fovy='60'/>\n";
  xml += "<camera name='tracking2' mode='trackcom' pos='" + Number(-0.9 * scale) + " " +
         Number(0.5 * scale) + " " + Number(0.15 * scale) +
         "' xyaxes='0 -1 0 0.3 0 1' fovy='60'/>\n";
  xml += R"(
      <camera name="eyes" pos="0 -0.058 0.005" xyaxes="-1 0 0 0 0 1"/>
      <joint name="rootx" class="root" axis="1 0 0"/>
      <joint name="rooty" class="root" axis="0 1 0"/>
      <joint name="rootz" class="root" type="hinge" axis="0 0 1"/>
      <geom name="head" type="ellipsoid" pos="0 -0.022 0" size="0.02 0.04 0.017" mass="0"
            material="self"/>
      <geom name="nose" type="sphere" pos="0 -0.06 0" size="0.004" mass="0" material="effector"/>
      <geom name="eyes" type="capsule" fromto="-0.006 -0.054 0.005 0.006 -0.054 0.005"
            size="0.004" mass="0" material="eye"/>
      <geom name="inertial" class="inertial"/>
      <geom name="visual" class="visual"/>
      <site name="head"/>
)";
  std::string ends, motors, sensors;
  for (int i = 0; i < bodies - 1; ++i) {
    const std::string n = std::to_string(i);
    xml += "<body name='segment_" + n + "' pos='0 0.1 0'>\n";
    xml += "<joint name='joint_" + n + "' range='-" + range + " " + range + "'/>\n";
    xml += "<geom name='visual_" + n + "' class='visual'/>\n";
    xml += "<geom name='inertial_" + n + "' class='inertial'/>\n";
    xml += "<site name='site_" + n + "'/>\n";
    ends += "</body>\n";
    motors += "<motor name='motor_" + n + "' joint='joint_" + n + "'/>\n";
    sensors += "<velocimeter name='velocimeter_" + n + "' site='site_" + n + "'/>\n";
    sensors += "<gyro name='gyro_" + n + "' site='site_" + n + "'/>\n";
  }
  xml += ends + R"(    </body>
  </worldbody>
  <actuator>
)" + motors +
         R"(  </actuator>
  <sensor>
    <framepos name="nose_pos" objtype="geom" objname="nose"/>
    <framepos name="target_pos" objtype="geom" objname="target"/>
    <framexaxis name="head_xaxis" objtype="xbody" objname="head"/>
    <frameyaxis name="head_yaxis" objtype="xbody" objname="head"/>
    <velocimeter name="head_vel" site="head"/>
    <gyro name="head_gyro" site="head"/>
)" + sensors +
         R"(  </sensor>
</mujoco>
)";
  return xml;
}

class Swimmer final : public ControlTask {
 public:
  Swimmer(const char* name, int bodies)
      : ControlTask({.name = name,
                     .model = CopyOfCompiled(name, SwimmerModel(bodies)),
                     .substeps = 15,
                     .observation = {{"joints", static_cast<std::uint64_t>(bodies) - 1},
                                     {"to_target", 2},
                                     {"body_velocities", static_cast<std::uint64_t>(bodies) * 3}}}),
        bodies_(bodies),
        head_(Id(mjOBJ_BODY, "head")),
        nose_(Id(mjOBJ_GEOM, "nose")),
        target_(Id(mjOBJ_GEOM, "target")),
        near_(0, model()->geom_size[3 * target_], 5 * model()->geom_size[3 * target_],
              Falloff::kLongTail),
        target_pos_(model()->geom_pos + 3 * target_),
        light_pos_(model()->light_pos + 3 * Id(mjOBJ_LIGHT, "target_light")) {
    DeclareWritten(target_pos_, 2);
    DeclareWritten(light_pos_, 2);
  }

  void Observe(double* out) const override {
    mju_copy(out, data()->qpos + 3, bodies_ - 1);
    out += bodies_ - 1;
    ToTarget(out);
    out += 2;
    // Of each link, in its own frame: the velocity in the plane and the turn rate.
    for (int body = 0; body < bodies_; ++body) {
      const mjtNum* velocity = data()->sensordata + kFirstVelocity + 6 * body;
      *out++ = velocity[0];
      *out++ = velocity[1];
      *out++ = velocity[5];
    }
  }

  double Reward() const override {
    double to_target[2];
    ToTarget(to_target);
    return near_(std::sqrt(to_target[0] * to_target[0] + to_target[1] * to_target[1]));
  }

 private:
  // From the nose, in the head's frame, without the height. result: [2].
  void ToTarget(double* result) const {
    mjtNum difference[3], in_frame[3];
    mju_sub3(difference, data()->geom_xpos + 3 * target_, data()->geom_xpos + 3 * nose_);
    mju_rotVecMatT(in_frame, difference, data()->xmat + 9 * head_);
    result[0] = in_frame[0];
    result[1] = in_frame[1];
  }

  void DrawInitialState(NumpyRandom& random) override {
    RandomiseJoints(random);
    const double box = random.Uniform() < kNearShare ? kNearBox : kFarBox;
    for (int axis = 0; axis < 2; ++axis) {
      target_pos_[axis] = light_pos_[axis] = random.Uniform(-box, box);
    }
  }

  int bodies_;
  int head_;
  int nose_;
  int target_;
  Tolerance near_;
  mjtNum* target_pos_;
  mjtNum* light_pos_;
};

}  // namespace

ControlTask* MakeSwimmer6() { return new Swimmer("swimmer_swimmer6", 6); }
ControlTask* MakeSwimmer15() { return new Swimmer("swimmer_swimmer15", 15); }

}  // namespace dreamsearch::dmc
