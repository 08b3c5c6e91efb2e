// actor.h - the actor alone as a planner: the mode action that the model proposes, and
// the value that it gives the root.
//
// What every search is compared with. It never explores and carries nothing from one
// decision to the next.
#pragma once

#include "host/acting/components.h"

namespace dreamsearch {

PlannerPtr MakeActor();

}  // namespace dreamsearch
