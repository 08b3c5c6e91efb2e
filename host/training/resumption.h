// resumption.h - from where an unfinished run goes on.
//
// A checkpoint continues a run if it names the run's UUID and if the database has the
// decisions and episodes that it was made with: all of them, and with the values it saw
// (results::RowSums). Of those that do, the newest is taken. Files and database may have
// parted: one of them copied, put back, merged, moved or lost. Of an Extent of kOutline only
// header and counts are read, not the large parts.
//
// Order    a process commits its rows, then renames the checkpoint that counts them into
//          place, then commits the artifact row that names it. So whatever ends the
//          process, its newest whole checkpoint continues the run; and a run whose
//          database names a checkpoint has had one.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "host/saving/checkpoint.h"
#include "host/settings/settings.h"
#include "results/database/database.h"
#include "results/database/run_writer.h"

namespace dreamsearch {

// What a checkpoint of the run says of itself.
CheckpointHeader HeaderOf(const RunSpec& spec, const std::string& uuid);

// Adds to a checkpoint what the database had when it was made; after the commit of those
// rows.
void AddRowSums(const results::RunWriter& writer, CheckpointWriter* checkpoint);

// Why the checkpoint does not continue the run; empty if it does.
std::string WhyUnfit(results::Database* database, const results::RunInfo& run, const RunSpec& spec,
                     const Checkpoint& checkpoint);

struct Resumption {
  std::optional<CheckpointFolder::Loaded> checkpoint;  // nothing: from the start
  results::ResumePoint point;
};
// From where an unfinished run goes on; among what was skipped is also a newer checkpoint
// that is not there any more. From the start only if it never had one: throws Failure 65 if no
// checkpoint that is there continues the run, 66 if it had one and none is there. Changes nothing.
Resumption FindResumption(results::Database* database, const results::RunInfo& run,
                          const RunSpec& spec, const std::filesystem::path& folder,
                          CheckpointFolder::Extent extent);

}  // namespace dreamsearch
