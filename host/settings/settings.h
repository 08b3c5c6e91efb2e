// settings.h - from names and key=value pairs to runs with every value resolved.
//
// Values resolve as default < preset < configuration file < command line; a value of `run.*`, the
// runner's own, as default < preset < the model's < the environment's < file < command line. In one
// source a key that names a component (mcts_pw.k, planner/mcts_pw.k) wins over
// one that names a kind (planner.k).
#pragma once

#include <string>
#include <vector>

#include "host/plugins/catalogue.h"
#include "host/settings/run_options.h"
#include "host/settings/run_spec.h"

namespace dreamsearch {

// The cross product seed x environment x planner x model, in that order, the
// last fastest. Errors: kUsage, or kBadInput when the value is the file's;
// kNotFound and kPluginRefused from Catalogue::Find. Where `base` is given, its
// components' values and `run` stand where the preset's and the model's would.
std::vector<RunSpec> ResolveMatrix(const RunOptions& options, const Catalogue& catalogue,
                                   const RunSpec* base = nullptr);

// A component as the catalogue has it now with the values of a recorded one; what
// was not declared then has its preset's value.
ResolvedComponent Rebased(const ResolvedComponent& recorded, const std::string& preset,
                          const Catalogue& catalogue);

// Gives a recorded run the runner's own parameters that came after it (LaterRunParameter).
void AddLaterRunParameters(ResolvedValues* run);

}  // namespace dreamsearch
