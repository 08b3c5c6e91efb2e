#include "results/database/cluster_place.h"

namespace dreamsearch::results {

ClusterPlace LastPlace(Database* database, std::int64_t run_id) {
  Statement find = database->connection().Prepare(
      "SELECT ifnull(slurm_job, ''), ifnull(slurm_node, '') FROM segment WHERE run_id = ?1"
      " ORDER BY segment DESC LIMIT 1");
  if (!find.Bind(run_id).Step()) return {};
  return {find.Text(0), find.Text(1)};
}

}  // namespace dreamsearch::results
