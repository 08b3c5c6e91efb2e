// mcts.h - Monte Carlo tree search over sampled actions (Koul et al. 2020): the
// components `mcts_pw` and `mcts_fixed`. README.md derives it.
#pragma once

#include "dreamsearch/plugin.h"

namespace dreamsearch {

extern const ComponentDescriptor kMctsPw;
extern const ComponentDescriptor kMctsFixed;

}  // namespace dreamsearch
