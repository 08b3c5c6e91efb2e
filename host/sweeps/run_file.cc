#include "host/sweeps/run_file.h"

#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/json_fields.h"
#include "results/text/json_text.h"

namespace dreamsearch {

RunFile ReadRunFile(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / kRunFile;
  std::error_code ignored;
  const auto type = std::filesystem::status(path, ignored).type();
  if (type != std::filesystem::file_type::regular && std::filesystem::exists(path, ignored)) {
    throw Failure(ExitCode::kBadInput, path.string() + ": expected a file, found something else");
  }
  try {
    return results::FieldsFromJson<RunFile>(results::ParseJson(ReadWholeFile(path)));
  } catch (const nlohmann::json::exception& error) {
    throw Failure(ExitCode::kBadInput,
                  path.string() + " is not what this `runner` writes: " + error.what() +
                      ". Resume with the runner that wrote it, or start the run over (its command "
                      "with --retry --replace)");
  }
}

void WriteRunFile(const WorkerJob& work) {
  std::error_code error;
  std::filesystem::create_directories(work.folder, error);
  if (error) {
    throw Failure(
        error == std::errc::permission_denied ? ExitCode::kPermission : ExitCode::kCannotCreate,
        "cannot create the folder " + work.folder.string() + ": " + error.message());
  }
  CheckIsNoLink(work.folder);
  const RunFile file = {work.spec, work.log_decisions, work.record_trees, work.keep_replay,
                        work.retries};
  WriteWholeFile(work.folder / kRunFile, results::JsonText(results::FieldsToJson(file), 2) + "\n");
}

}  // namespace dreamsearch
