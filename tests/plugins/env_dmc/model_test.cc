// Our compiled models against the reference's, field by field.
#include <gtest/gtest.h>
#include <mujoco/mjxmacro.h>

#include <cmath>
#include <map>
#include <set>

#include "tests/plugins/env_dmc/reference_data.h"

namespace dreamsearch::dmc {
namespace {

// The task whose model a file of models/ describes: one of each domain is enough,
// as all tasks of a domain run on one model.
std::string TaskOfModel(const std::string& model) {
  for (const TaskEntry& entry : kTasks) {
    std::string name = entry.name;
    const std::string alias = entry.aliases != nullptr ? entry.aliases : "";
    if (name.starts_with(model + "_") || alias.starts_with(model + "_") || name == model) {
      return name;
    }
  }
  return "";
}

// mjModel's array prefixes and the lists of the reference file.
const std::map<std::string, std::string> kLists = {
    {"body", "body"},     {"jnt", "joint"},       {"dof", "dof"},     {"geom", "geom"},
    {"site", "site"},     {"cam", "camera"},      {"light", "light"}, {"hfield", "hfield"},
    {"tex", "texture"},   {"mat", "material"},    {"pair", "pair"},   {"exclude", "exclude"},
    {"eq", "equality"},   {"tendon", "tendon"},   {"wrap", "wrap"},   {"actuator", "actuator"},
    {"sensor", "sensor"}, {"numeric", "numeric"}, {"key", "key"},     {"tuple", "tuple"},
    {"text", "text"},
};

// Fields that a written model may give differently without any effect: the limits
// of a free joint, the drawn width of a fixed tendon, and which of the pictures'
// textures comes first.
bool IsInert(const std::string& model, const std::string& list, const std::string& field,
             const Json& row) {
  if (list == "texture" || field == "texid") return true;
  const bool free_joint = list == "joint" && row.at("type") == mjJNT_FREE;
  if (model == "fish" && free_joint) {
    return field == "range" || field == "solref" || field == "solimp";
  }
  return model.starts_with("manipulator") && list == "tendon" && field == "width";
}

class Comparison {
 public:
  // Relative 1e-9, as the reference asks; 1e-15 stands for rounding about 0.
  void Number(const std::string& what, double expected, double found) {
    ++compared_;
    if (!(std::abs(expected - found) <= 1e-9 * std::abs(expected) + 1e-15)) {
      ADD_FAILURE() << what << ": expected " << expected << ", found " << found;
    }
  }
  template <typename T>
  void Values(const std::string& what, const Json& expected, const T* found) {
    if (!expected.is_array()) return Number(what, expected.get<double>(), found[0]);
    for (std::size_t i = 0; i < expected.size(); ++i) {
      Number(what + "[" + std::to_string(i) + "]", expected[i].get<double>(), found[i]);
    }
  }
  int compared() const { return compared_; }

 private:
  int compared_ = 0;
};

TEST(Model, EveryFieldEqualsTheReferences) {
  std::set<std::string> seen;
  for (const std::string& path : ReferenceFiles("models")) {
    const std::string name = Stem(path);
    const std::string task_name = TaskOfModel(name);
    if (task_name.empty()) continue;  // a model of tasks that are not offered
    SCOPED_TRACE(path);
    seen.insert(name);
    const Json reference = ReadJson(path);
    const TaskPtr task = MakeTask(task_name);  // not reset: nothing written yet
    const mjModel* model = task->model();
    Comparison compare;

    for (const auto& [field, expected] : reference.at("sizes").items()) {
#define X(size)                                                                         \
  if (field == #size && field != "nbuffer" && field != "nnames" && field != "nstack") { \
    compare.Number(field, expected, model->size);                                       \
  }
      MJMODEL_INTS
#undef X
    }
    for (const auto& [field, expected] : reference.at("opt").items()) {
#define X(type, member) \
  if (field == #member) compare.Number("opt." + field, expected, model->opt.member);
      MJOPTION_FLOATS
#undef X
#define X(type, member) \
  if (field == #member) compare.Number("opt." + field, expected, model->opt.member);
      MJOPTION_INTS
#undef X
#define X(member, size) \
  if (field == #member) compare.Values("opt." + field, expected, model->opt.member);
      MJOPTION_VECTORS
#undef X
    }
    const Json& stat = reference.at("stat");
    compare.Number("stat.meaninertia", stat.at("meaninertia"), model->stat.meaninertia);
    compare.Number("stat.meanmass", stat.at("meanmass"), model->stat.meanmass);
    compare.Number("stat.meansize", stat.at("meansize"), model->stat.meansize);
    compare.Number("stat.extent", stat.at("extent"), model->stat.extent);
    compare.Values("stat.center", stat.at("center"), model->stat.center);
    const Json& map = reference.at("vis").at("map");
    compare.Number("vis.map.znear", map.at("znear"), model->vis.map.znear);
    compare.Number("vis.map.zfar", map.at("zfar"), model->vis.map.zfar);
    compare.Values("qpos0", reference.at("qpos0"), model->qpos0);
    compare.Values("qpos_spring", reference.at("qpos_spring"), model->qpos_spring);

    std::set<std::string> compared_fields;
    const auto array = [&](const std::string& full_name, const auto* values, int rows,
                           int columns) {
      const std::string prefix = full_name.substr(0, full_name.find('_'));
      const auto list = kLists.find(prefix);
      if (list == kLists.end() || full_name == prefix) return;
      const std::string field = full_name.substr(prefix.size() + 1);
      const Json& items = reference.at(list->second);
      if (items.size() != static_cast<std::size_t>(rows)) return;  // the sizes say so already
      for (int i = 0; i < rows; ++i) {
        if (!items[i].contains(field) || IsInert(name, list->second, field, items[i])) continue;
        compared_fields.insert(list->second + "." + field);
        compare.Values(list->second + "[" + items[i].at("name").get<std::string>() + "]." + field,
                       items[i].at(field), values + i * columns);
      }
    };
#define X(type, member, rows, columns) array(#member, model->member, model->rows, columns);
#undef MJ_M
#define MJ_M(n) model->n
    MJMODEL_POINTERS
#undef X
    // Every field the reference holds was looked at.
    for (const auto& [prefix, list] : kLists) {
      if (reference.at(list).empty()) continue;
      const Json& row = reference.at(list)[0];
      for (const auto& [field, value] : row.items()) {
        if (field == "id" || field == "name" || IsInert(name, list, field, row)) continue;
        EXPECT_TRUE(compared_fields.contains(list + "." + field))
            << list << "." << field << " was not compared";
      }
    }
    EXPECT_GT(compare.compared(), 100);
  }
  EXPECT_FALSE(seen.empty());
}

}  // namespace
}  // namespace dreamsearch::dmc
