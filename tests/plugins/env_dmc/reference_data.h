// reference_data.h - figures recorded from dm_control 1.0.7 on MuJoCo 2.2.2.
//
// A selection is in tests/data/dmc; where the whole collection lies beside the
// repository it is used too. Both have the same layout.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tasks.h"

namespace dreamsearch::dmc {

using Json = nlohmann::json;

// The folders to read from; the repository's own comes first.
std::vector<std::string> ReferenceFolders();

// The paths of the files "FOLDER/`part`/NAME.EXT", of every reference folder, with
// EXT "json" or "jsonl" and optionally ".gz"; sorted.
std::vector<std::string> ReferenceFiles(const std::string& part);

// The path of a file of the fullest reference folder, plain or gzipped.
std::string ReferenceFile(const std::string& name);

// The values of a file with one JSON value a line, or the one value of a .json
// file; plain or gzipped.
std::vector<Json> ReadJsonLines(const std::string& path);
Json ReadJson(const std::string& path);

// The file's name without folder and extensions.
std::string Stem(const std::string& path);

// A new instance of the task that the recording calls `domain` and `task`.
struct TaskDeleter {
  void operator()(ControlTask* task) const { task->Destroy(); }
};
using TaskPtr = std::unique_ptr<ControlTask, TaskDeleter>;
TaskPtr MakeTask(const std::string& name);
std::string TaskName(const Json& header);  // "walker_walk"
bool HasTask(const std::string& name);

// Writes the rows {"field": {"object": [values]}} into the model.
void WriteModelFields(const Json& rows, mjModel* model);

// One value of a row of a model field: ModelField("geom_pos", "target", 2, model).
double ModelField(const std::string& field, const std::string& object, int index, mjModel* model);

// Prints a true residual where DREAMSEARCH_SHOW_RESIDUALS is set.
void Show(const std::string& what, double residual);

// The largest |expected - found|, entry by entry.
double LargestDifference(const Json& expected, const double* found);

}  // namespace dreamsearch::dmc
