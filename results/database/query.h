// query.h - what a statement returns as a table, and other people's SQL.
#pragma once

#include <string>
#include <vector>

#include "results/database/database.h"
#include "results/text/table.h"

namespace dreamsearch::results {

// The current row of a statement.
std::vector<Cell> ReadCells(const Statement& statement);
// The remaining rows of a statement.
Table ReadTable(Statement* statement);

// The rows of one query that reads and does nothing else. Failure 2 if the text is
// not one, saying what SQLite says of it.
Table RunQuery(Database* database, const std::string& sql);

}  // namespace dreamsearch::results
