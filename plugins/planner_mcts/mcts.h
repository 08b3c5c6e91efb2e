// mcts.h - the components of planner_mcts.so. README.md derives them.
#pragma once

#include "dreamsearch/plugin.h"

namespace dreamsearch {

extern const ComponentDescriptor kMctsPw;      // mcts.cc
extern const ComponentDescriptor kMctsFixed;   // mcts.cc
extern const ComponentDescriptor kMctsGumbel;  // gumbel.cc
extern const ComponentDescriptor kHoot;        // hoot.cc

}  // namespace dreamsearch
