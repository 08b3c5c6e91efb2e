// run_flags.h - the command line of `runner` without a command, and of `runner eval`.
//
// Kept from the commands so that tests read command lines without running anything.
#pragma once

#include <string>

#include "host/settings/run_options.h"
#include "host/settings/run_spec.h"
#include "results/command_line/command.h"

namespace dreamsearch {

// Which experiments, and how. The configuration file of --config holds the same flags.
CommandSpec RunFlags(RunOptions* options);

struct EvaluationOptions {
  std::string run;  // the trained run; empty: none
  // Empty lists where the command line says nothing. The settings hold --episodes as
  // run.eval_episodes.
  RunOptions choice;
  RankingSpec ranks;
};
CommandSpec EvaluationFlags(EvaluationOptions* evaluation);

// What the flags of `runner eval` mean together, and the defaults that depend on whether
// there is a trained run. Failure 2 for what does not go together: a task, seeds or a study
// beside RUN, no task without one, settings of the training.
void CompleteEvaluation(EvaluationOptions* evaluation);

}  // namespace dreamsearch
