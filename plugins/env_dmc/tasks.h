// tasks.h - the list of all tasks; one file a domain makes them.
#pragma once

#include "model_files.h"
#include "plugins/mujoco/control_task.h"
#include "plugins/mujoco/tolerance.h"

namespace dreamsearch::dmc {

using mujoco::ControlTask;
using mujoco::DataPtr;
using mujoco::EngineError;
using mujoco::Falloff;
using mujoco::ModelPtr;
using mujoco::NumpyRandom;
using mujoco::QuaternionNorm;
using mujoco::Tolerance;
using enum mujoco::MatrixEntry;

// Each makes a new instance, which its Destroy() ends.
//   EngineError  the model does not compile (a defect of this plugin).
ControlTask* MakeAcrobotSwingup();
ControlTask* MakeAcrobotSwingupSparse();
ControlTask* MakeCartpoleBalance();
ControlTask* MakeCartpoleBalanceSparse();
ControlTask* MakeCartpoleSwingup();
ControlTask* MakeCartpoleSwingupSparse();
ControlTask* MakeCheetahRun();
ControlTask* MakeBallInCupCatch();
ControlTask* MakeFingerSpin();
ControlTask* MakeFingerTurnEasy();
ControlTask* MakeFingerTurnHard();
ControlTask* MakeFishSwim();
ControlTask* MakeFishUpright();
ControlTask* MakeHopperHop();
ControlTask* MakeHopperStand();
ControlTask* MakeHumanoidRun();
ControlTask* MakeHumanoidStand();
ControlTask* MakeHumanoidWalk();
ControlTask* MakeManipulatorBringBall();
ControlTask* MakePendulumSwingup();
ControlTask* MakePointMassEasy();
ControlTask* MakeQuadrupedRun();
ControlTask* MakeQuadrupedWalk();
ControlTask* MakeReacherEasy();
ControlTask* MakeReacherHard();
ControlTask* MakeSwimmer15();
ControlTask* MakeSwimmer6();
ControlTask* MakeWalkerRun();
ControlTask* MakeWalkerStand();
ControlTask* MakeWalkerWalk();

struct TaskEntry {
  const char* name;
  const char* aliases;  // "one,two" or null
  const char* summary;
  ControlTask* (*make)();
};

inline constexpr TaskEntry kTasks[] = {
    {"acrobot_swingup", nullptr, "swing a two-link arm up to a target by its elbow",
     MakeAcrobotSwingup},
    {"acrobot_swingup_sparse", nullptr, "the same, rewarded only at the target",
     MakeAcrobotSwingupSparse},
    {"cartpole_balance", nullptr, "keep a pole upright on a cart, starting upright",
     MakeCartpoleBalance},
    {"cartpole_balance_sparse", nullptr, "the same, rewarded only while upright near the centre",
     MakeCartpoleBalanceSparse},
    {"cartpole_swingup", nullptr, "swing a hanging pole up on a cart and keep it upright",
     MakeCartpoleSwingup},
    {"cartpole_swingup_sparse", nullptr, "the same, rewarded only while upright near the centre",
     MakeCartpoleSwingupSparse},
    {"cheetah_run", nullptr, "a planar running animal: run at 10 m/s", MakeCheetahRun},
    {"cup_catch", "ball_in_cup_catch", "swing a ball on a string into a cup", MakeBallInCupCatch},
    {"finger_spin", nullptr, "spin a free body with a two-joint finger at 15 rad/s",
     MakeFingerSpin},
    {"finger_turn_easy", nullptr, "turn a free body's tip to a large target", MakeFingerTurnEasy},
    {"finger_turn_hard", nullptr, "turn a free body's tip to a small target", MakeFingerTurnHard},
    {"fish_swim", nullptr, "a fish: bring the mouth to a target", MakeFishSwim},
    {"fish_upright", nullptr, "a fish: turn upright", MakeFishUpright},
    {"hopper_hop", nullptr, "a planar one-legged robot: hop forward at 2 m/s", MakeHopperHop},
    {"hopper_stand", nullptr, "a planar one-legged robot: stand with little control",
     MakeHopperStand},
    {"humanoid_run", nullptr, "a humanoid: stand up and run at 10 m/s", MakeHumanoidRun},
    {"humanoid_stand", nullptr, "a humanoid: stand up and stay still", MakeHumanoidStand},
    {"humanoid_walk", nullptr, "a humanoid: stand up and walk at 1 m/s", MakeHumanoidWalk},
    {"manipulator_bring_ball", nullptr, "a planar arm with a gripper: bring a ball to a place",
     MakeManipulatorBringBall},
    {"pendulum_swingup", nullptr,
     "swing a pendulum up with a weak motor, rewarded only near the top", MakePendulumSwingup},
    {"point_mass_easy", nullptr, "move a point mass to the centre", MakePointMassEasy},
    {"quadruped_run", nullptr, "a four-legged robot: run at 5 m/s", MakeQuadrupedRun},
    {"quadruped_walk", nullptr, "a four-legged robot: walk at 0.5 m/s", MakeQuadrupedWalk},
    {"reacher_easy", nullptr, "reach a large target with a planar two-link arm", MakeReacherEasy},
    {"reacher_hard", nullptr, "reach a small target with a planar two-link arm", MakeReacherHard},
    {"swimmer_swimmer15", nullptr, "a chain of 15 links in a fluid: bring the nose to a target",
     MakeSwimmer15},
    {"swimmer_swimmer6", nullptr, "a chain of 6 links in a fluid: bring the nose to a target",
     MakeSwimmer6},
    {"walker_run", nullptr, "a planar biped: stand up and run at 8 m/s", MakeWalkerRun},
    {"walker_stand", nullptr, "a planar biped: stand up", MakeWalkerStand},
    {"walker_walk", nullptr, "a planar biped: stand up and walk at 1 m/s", MakeWalkerWalk},
};

}  // namespace dreamsearch::dmc
