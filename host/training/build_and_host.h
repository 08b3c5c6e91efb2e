// build_and_host.h - what produced a result: this build and this machine.
#pragma once

#include <string>

#include "results/database/database.h"
#include "results/database/run_writer.h"

namespace dreamsearch {

// Version, commit, compiler, flags and library versions of this build.
results::BuildInfo ThisBuild();

// Name, processor, cores, memory and system of this machine.
results::HostInfo ThisHost();

// Of which job of Slurm this process is, if it is of one: job, restarts and node.
void AddSlurmJob(results::SegmentInfo* segment);

// The name of the instruction set that every kernel of this process computes with.
// Products differ in their last bits between sets.
std::string InstructionSetInUse();

// Throws Failure 2 if DREAMSEARCH_INSTRUCTION_SET names no set, or one that this
// processor lacks.
void CheckInstructionSet();

}  // namespace dreamsearch
