#include "tests/plugins/env_dmc/reference_data.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <span>
#include <stdexcept>

namespace dreamsearch::dmc {
namespace {

std::string ReadAll(const std::string& path) {
  const gzFile file = gzopen(path.c_str(), "rb");
  if (file == nullptr) throw std::runtime_error("cannot open " + path);
  std::string text;
  char buffer[1 << 16];
  int size;
  while ((size = gzread(file, buffer, sizeof buffer)) > 0) text.append(buffer, size);
  gzclose(file);
  if (size < 0) throw std::runtime_error("cannot read " + path);
  return text;
}

// The row of `object` in a model field that resets write.
std::span<mjtNum> ModelRow(const std::string& name, const std::string& object, mjModel* model) {
  struct Field {
    const char* name;
    mjtObj type;
    mjtNum* values;
    std::size_t width;
  };
  const Field fields[] = {
      {"body_pos", mjOBJ_BODY, model->body_pos, 3},
      {"body_quat", mjOBJ_BODY, model->body_quat, 4},
      {"dof_damping", mjOBJ_JOINT, model->dof_damping, 1},
      {"geom_pos", mjOBJ_GEOM, model->geom_pos, 3},
      {"geom_size", mjOBJ_GEOM, model->geom_size, 3},
      {"light_pos", mjOBJ_LIGHT, model->light_pos, 3},
      {"site_pos", mjOBJ_SITE, model->site_pos, 3},
      {"site_size", mjOBJ_SITE, model->site_size, 3},
  };
  for (const Field& field : fields) {
    if (name != field.name) continue;
    // A degree of freedom is called "hinge[0]" after its joint.
    const std::string plain = object.substr(0, object.find('['));
    int row = mj_name2id(model, field.type, plain.c_str());
    if (row < 0) throw std::runtime_error("no object " + object);
    if (field.values == model->dof_damping) row = model->jnt_dofadr[row];
    return {field.values + static_cast<std::size_t>(row) * field.width, field.width};
  }
  throw std::runtime_error("unknown model field " + name);
}

}  // namespace

std::vector<std::string> ReferenceFolders() {
  std::vector<std::string> folders = {DREAMSEARCH_TEST_DATA_DIR "/dmc"};
  const std::string whole = DREAMSEARCH_SOURCE_DIR "/../shared/dmc";
  if (std::filesystem::exists(whole + "/index.json")) folders.push_back(whole);
  return folders;
}

std::vector<std::string> ReferenceFiles(const std::string& part) {
  std::vector<std::string> files;
  for (const std::string& folder : ReferenceFolders()) {
    std::vector<std::string> here;
    for (const auto& entry : std::filesystem::directory_iterator(folder + "/" + part)) {
      here.push_back(entry.path().string());
    }
    std::sort(here.begin(), here.end());
    files.insert(files.end(), here.begin(), here.end());
  }
  return files;
}

std::string ReferenceFile(const std::string& name) {
  const std::string path = ReferenceFolders().back() + "/" + name;
  return std::filesystem::exists(path) ? path : path + ".gz";
}

std::vector<Json> ReadJsonLines(const std::string& path) {
  const std::string text = ReadAll(path);
  std::vector<Json> lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    if (end > begin) lines.push_back(Json::parse(text.begin() + begin, text.begin() + end));
    begin = end + 1;
  }
  return lines;
}

Json ReadJson(const std::string& path) { return Json::parse(ReadAll(path)); }

std::string Stem(const std::string& path) {
  const std::string name = std::filesystem::path(path).filename().string();
  return name.substr(0, name.find('.'));
}

bool HasTask(const std::string& name) {
  return std::any_of(std::begin(kTasks), std::end(kTasks), [&name](const TaskEntry& entry) {
    return name == entry.name || (entry.aliases != nullptr && name == entry.aliases);
  });
}

TaskPtr MakeTask(const std::string& name) {
  for (const TaskEntry& entry : kTasks) {
    if (name == entry.name || (entry.aliases != nullptr && name == entry.aliases)) {
      return TaskPtr(entry.make());
    }
  }
  throw std::runtime_error("no task " + name);
}

std::string TaskName(const Json& header) {
  return header.at("domain").get<std::string>() + "_" + header.at("task").get<std::string>();
}

void WriteModelFields(const Json& rows, mjModel* model) {
  for (const auto& [field, objects] : rows.items()) {
    for (const auto& [object, values] : objects.items()) {
      const std::span<mjtNum> row = ModelRow(field, object, model);
      if (!values.is_array()) {
        row[0] = values;
        continue;
      }
      for (std::size_t i = 0; i < row.size(); ++i) row[i] = values.at(i);
    }
  }
}

double ModelField(const std::string& field, const std::string& object, int index, mjModel* model) {
  return ModelRow(field, object, model)[static_cast<std::size_t>(index)];
}

void Show(const std::string& what, double residual) {
  if (std::getenv("DREAMSEARCH_SHOW_RESIDUALS") == nullptr) return;
  std::printf("%-60s %.3g\n", what.c_str(), residual);
}

double LargestDifference(const Json& expected, const double* found) {
  double largest = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const double difference = std::abs(expected[i].get<double>() - found[i]);
    if (!(difference <= largest)) largest = difference;  // NaN wins
  }
  return largest;
}

}  // namespace dreamsearch::dmc
