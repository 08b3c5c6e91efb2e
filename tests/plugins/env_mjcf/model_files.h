// model_files.h - models that lie in a folder of their own while a test runs.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace dreamsearch::mjcf {

class ModelFiles {
 public:
  ModelFiles()
      : folder_(std::filesystem::path(testing::TempDir()) /
                ("env_mjcf_" + std::to_string(getpid()) + "_" + std::to_string(++count_))) {
    std::filesystem::create_directories(folder_);
  }
  ~ModelFiles() { std::filesystem::remove_all(folder_); }
  ModelFiles(const ModelFiles&) = delete;
  ModelFiles& operator=(const ModelFiles&) = delete;

  // Writes a file and returns its path.
  std::string Write(const std::string& name, const std::string& text) const {
    const std::filesystem::path path = folder_ / name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << text;
    return path.string();
  }
  const std::filesystem::path& folder() const { return folder_; }

 private:
  static inline int count_ = 0;
  std::filesystem::path folder_;
};

// What a call throws; "" if it throws nothing.
template <typename Call>
std::string MessageOf(const Call& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

// A leg on a rail: what the tests of expressions and tasks look at.
inline constexpr char kLeg[] = R"(<mujoco model="leg">
  <option timestep="0.005"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1"/>
    <site name="goal" pos="1 2 3"/>
    <body name="torso" pos="0 0 2">
      <joint name="rail" type="slide" axis="0 0 1" limited="true" range="-0.5 0.5"/>
      <joint name="hip" type="hinge" axis="0 1 0"/>
      <geom name="trunk" type="box" size="0.1 0.2 0.3" mass="3"/>
      <body name="left foot" pos="0 0 -0.5">
        <joint name="ankle" type="ball"/>
        <geom name="sole" type="sphere" size="0.1" mass="1"/>
        <site name="toe" pos="0.1 0 0"/>
      </body>
    </body>
    <body name="free" pos="3 0 1">
      <freejoint name="root"/>
      <geom type="sphere" size="0.1" mass="1"/>
    </body>
  </worldbody>
  <sensor>
    <gyro name="turning" site="toe"/>
    <jointpos name="reach" joint="rail"/>
  </sensor>
  <actuator>
    <motor name="lift" joint="rail" ctrllimited="true" ctrlrange="-20 30"/>
    <motor name="swing" joint="hip" ctrllimited="true" ctrlrange="-1 1"/>
  </actuator>
  <keyframe>
    <key name="raised" time="7" qpos="0.3 0.1 1 0 0 0 3 0 1 1 0 0 0" ctrl="5 0.25"/>
  </keyframe>
</mujoco>)";

}  // namespace dreamsearch::mjcf
