// provenance.h - what produced a result: this build and this machine.
#pragma once

#include <string>

#include "results/database.h"

namespace dreamsearch {

// Version, commit, compiler, flags and library versions of this build.
results::BuildInfo ThisBuild();

// Name, processor, cores, memory and system of this machine.
results::HostInfo ThisHost();

// The vector instructions that numeric code may use here: what the build allows
// and the processor has. Products differ in their last bits between them.
std::string InstructionSet();

}  // namespace dreamsearch
