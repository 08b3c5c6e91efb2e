// tasks.h - the list of all tasks; one file a domain makes them.
#pragma once

#include "control_task.h"

namespace dreamsearch::dmc {

// Each makes a new instance, which its Destroy() ends.
//   EngineError  the model does not compile (a defect of this plugin).
ControlTask* MakeCartpoleBalance();
ControlTask* MakeCartpoleBalanceSparse();
ControlTask* MakeCartpoleSwingup();
ControlTask* MakeCartpoleSwingupSparse();
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
    {"cartpole_balance", nullptr, "keep a pole upright on a cart that starts below it",
     MakeCartpoleBalance},
    {"cartpole_balance_sparse", nullptr, "the same, rewarded only while upright and near the centre",
     MakeCartpoleBalanceSparse},
    {"cartpole_swingup", nullptr, "swing a hanging pole up and keep it upright",
     MakeCartpoleSwingup},
    {"cartpole_swingup_sparse", nullptr,
     "the same, rewarded only while upright and near the centre", MakeCartpoleSwingupSparse},
    {"walker_run", nullptr, "a planar biped: stand up and run at 8 m/s", MakeWalkerRun},
    {"walker_stand", nullptr, "a planar biped: stand up", MakeWalkerStand},
    {"walker_walk", nullptr, "a planar biped: stand up and walk at 1 m/s", MakeWalkerWalk},
};

}  // namespace dreamsearch::dmc
