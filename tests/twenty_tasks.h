// twenty_tasks.h - the tasks of the DeepMind Control Suite that papers compare methods on.
#pragma once

namespace dreamsearch {

inline constexpr const char* kTwentyTasks[] = {"acrobot_swingup",
                                               "cartpole_balance",
                                               "cartpole_balance_sparse",
                                               "cartpole_swingup",
                                               "cartpole_swingup_sparse",
                                               "cheetah_run",
                                               "cup_catch",
                                               "finger_spin",
                                               "finger_turn_easy",
                                               "finger_turn_hard",
                                               "hopper_hop",
                                               "hopper_stand",
                                               "pendulum_swingup",
                                               "quadruped_run",
                                               "quadruped_walk",
                                               "reacher_easy",
                                               "reacher_hard",
                                               "walker_run",
                                               "walker_stand",
                                               "walker_walk"};

}  // namespace dreamsearch
