// evaluations.h - what is to be played under which planner and model, without training.
#pragma once

#include <vector>

#include "host/plugins/catalogue.h"
#include "host/settings/run_options.h"
#include "host/settings/settings.h"
#include "host/sweeps/trained_run.h"

namespace dreamsearch {

// Evaluations of a trained run: its own task, seed and study, under each planner and model of the
// options. Failure 2 for a model that cannot take its agent.
std::vector<RunSpec> EvaluationsOf(const TrainedRun& trained, RunOptions options);

// Evaluations of each task, planner, model and seed of the options on models that need no
// training. Failure 2 for one that learns.
std::vector<RunSpec> EvaluationsWithoutTraining(const RunOptions& options,
                                                const Catalogue& catalogue);

}  // namespace dreamsearch
