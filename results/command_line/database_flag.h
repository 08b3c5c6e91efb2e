// database_flag.h - --db, which most commands of both programs have.
#pragma once

#include <string>

#include "results/command_line/values.h"
#include "results/system/default_database.h"  // IWYU pragma: export

namespace dreamsearch {

inline Flag DatabaseFlag(std::string* db) {
  return {"db", "FILE", Text(db), "the results database"};
}

}  // namespace dreamsearch
