// cluster_place.h - where in a cluster a run is worked on.
#pragma once

#include <cstdint>
#include <string>

#include "results/database/database.h"

namespace dreamsearch::results {

struct ClusterPlace {
  std::string job;  // as segment.slurm_job
  std::string node;
};

// Of the run's last segment; empty texts outside Slurm.
ClusterPlace LastPlace(Database* database, std::int64_t run_id);

}  // namespace dreamsearch::results
