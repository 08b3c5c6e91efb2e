// run_copies.h - the statements that copy what a run recorded from one database to another.
#pragma once

#include <string>
#include <vector>

#include "results/database/sqlite.h"

namespace dreamsearch::results {

inline constexpr char kScalarTable[] = "scalar";

// Copies the rows of the run ?1 of the attached database `source` to the run ?2 of main, in the
// order of their keys, so that they are appended. Of kScalarTable those of the metric ?3, which is
// ?4 in main. Needs temp.host_map and temp.build_map, of old and new numbers, and the function
// merged_path.
struct RunCopy {
  std::string table;
  std::string sql;
};

// One a table. Tables and columns are those of the schema, less what triggers make; every database
// that is open has the newest, so they are read once.
const std::vector<RunCopy>& RunCopies(Connection& db);

}  // namespace dreamsearch::results
