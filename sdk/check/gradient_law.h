// gradient_law.h - law M14: a model that gives gradients gives those of the returns it imagines.
#pragma once

#include "law.h"

namespace dreamsearch::check {

void GivesTheGradientOfItsReturns(const Trial& trial);

}  // namespace dreamsearch::check
