// query.h - other people's SQL.
#pragma once

#include <string>

#include "results/database/database.h"
#include "results/database/table.h"

namespace dreamsearch::results {

// The rows of one query that reads and does nothing else. Error 2 if the text is
// not one, saying what SQLite says of it.
Table RunQuery(Database* database, const std::string& sql);

}  // namespace dreamsearch::results
