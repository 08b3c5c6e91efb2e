#include "results/upkeep/run_copies.h"

#include <map>

namespace dreamsearch::results {

const std::vector<RunCopy>& RunCopies(Connection& db) {
  static const std::vector<RunCopy> copies = [&db] {
    const std::map<std::string, std::string> mapped = {
        {"segment.host_id", "(SELECT new FROM temp.host_map WHERE old = host_id)"},
        {"segment.build_id", "(SELECT new FROM temp.build_map WHERE old = build_id)"},
        {"scalar.metric_id", "?4"},
        {"artifact.path", "merged_path(path)"},
        {"artifact.path_sha256", "sha256(merged_path(path))"}};
    Statement tables = db.Prepare(
        "SELECT t.name FROM main.sqlite_schema t WHERE t.type = 'table' AND t.name NOT IN ('run',"
        " 'curve_bin') AND EXISTS (SELECT 1 FROM pragma_table_info(t.name, 'main') c WHERE"
        " c.name = 'run_id') ORDER BY t.name");
    Statement columns = db.Prepare(
        "SELECT name FROM pragma_table_info(?1, 'main') WHERE name <> 'run_id' ORDER BY cid");
    Statement keys =
        db.Prepare("SELECT name FROM pragma_table_info(?1, 'main') WHERE pk > 0 ORDER BY pk");
    std::vector<RunCopy> made;
    while (tables.Step()) {
      const std::string table = tables.Text(0);
      std::string into = "INSERT INTO main." + table + " (run_id";
      std::string from = ") SELECT ?2";
      columns.Bind(table);
      while (columns.Step()) {
        const std::string column = columns.Text(0);
        const auto other = mapped.find(table + "." + column);
        into += ", " + column;
        from += ", " + (other != mapped.end() ? other->second : column);
      }
      std::string order;
      keys.Bind(table);
      while (keys.Step()) order += (order.empty() ? "" : ", ") + keys.Text(0);
      made.push_back({table, into + from + " FROM source." + table + " WHERE run_id = ?1" +
                                 (table == kScalarTable ? " AND metric_id = ?3" : "") +
                                 " ORDER BY " + order});
    }
    return made;
  }();
  return copies;
}

}  // namespace dreamsearch::results
