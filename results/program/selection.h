// selection.h - what the commands of `results` have in common: which runs of which
// databases they read, and in which form they print a table.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "results/analysis/run_groups.h"
#include "results/command_line/database_flag.h"
#include "results/command_line/values.h"
#include "results/database/database.h"
#include "results/text/table.h"

namespace dreamsearch::results {

// What --db, --study, --env, --planner, --seed and, where there is one, --status say.
struct Selection {
  std::vector<std::string> databases = {kDefaultDatabase};
  RunFilter filter;
};

// --db, several times or with commas, and --study --env --planner --seed.
FlagGroup SelectionFlags(Selection* selection);
// --study --env --planner --seed --status.
std::vector<Flag> FilterFlags(RunFilter* filter);
Flag StatusFlag(RunFilter* filter);
// --phase; *phase is a CurvePhase or an std::optional of one.
const Choices<CurvePhase>& PhaseChoices();
// --format for tables.
Flag FormFlag(TableForm* form);
// --published.
Flag PublishedFlag(std::vector<std::string>* published);
// --bootstrap-seed.
Flag BootstrapSeedFlag(std::uint64_t* seed);

// Sees to it that every published method asked for, as METHOD, METHOD/OBS or all, was
// imported into one of the databases; Failure 66 naming those that are.
void CheckPublished(const std::vector<std::unique_ptr<Database>>& databases,
                    const std::vector<std::string>& methods);

// Opens the databases for reading and sees to it that every name asked for is in
// one of them; Failure 2 naming those that are.
std::vector<std::unique_ptr<Database>> OpenSelected(const Selection& selection);

// The form that a file's suffix names (.txt, .md, .csv, .json); none for another suffix.
std::optional<TableForm> FormOfTablePath(const std::string& path);

// To the file, in the form of its suffix, or to standard output in `form` if `out` is
// empty. Failure 2 for a suffix that is no table's.
void PrintTable(const Table& table, TableForm form, const std::string& out);

}  // namespace dreamsearch::results
