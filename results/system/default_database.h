// default_database.h - where runs are stored unless --db names another file.
#pragma once

namespace dreamsearch {

// Under the folder in which the command is typed.
inline constexpr char kDefaultDatabase[] = "results/dreamsearch.db";

}  // namespace dreamsearch
