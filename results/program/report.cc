// results report FILE.html - one page with every figure and table.
#include "results/report/report.h"

#include <filesystem>
#include <iostream>

#include "results/program/arguments.h"
#include "results/program/commands.h"
#include "results/system/error.h"
#include "results/system/file.h"

namespace dreamsearch::results {

int ReportCommand(const Words& words) {
  Arguments arguments(
      "report", "FILE.html [options]",
      "Writes one HTML page that needs neither a network nor other files: learning\n"
      "curves to explore, time, comparison, what is missing, settings and machines.");
  arguments.AddDatabase();
  arguments.AddFilter();
  namespace po = boost::program_options;
  arguments.Add()("published", po::value<std::vector<std::string>>()->value_name("LIST"),
                  "imported curves to draw beside: methods, as METHOD or METHOD/OBS, or all")(
      "bootstrap-seed", po::value<std::string>()->default_value("0"),
      "equal seeds give equal intervals")("title", po::value<std::string>()->default_value(""),
                                          "a title");
  arguments.AddPositional("file");
  if (!arguments.Parse(words)) return static_cast<int>(ExitCode::kOk);
  if (!arguments.Has("file"))
    throw Failure(ExitCode::kUsage, "report: expected FILE.html, found none");
  const std::string file = arguments.Get<std::vector<std::string>>("file").front();
  const std::string suffix = std::filesystem::path(file).extension().string();
  if (suffix != ".html" && suffix != ".htm") {
    throw Failure(ExitCode::kUsage,
                  AbsolutePath(file) + ": expected a file name that ends in .html");
  }
  const Selection selection = arguments.GetSelection();
  ReportRequest request;
  request.title = arguments.Get<std::string>("title");
  request.filter = selection.filter;
  request.published = arguments.List("published");
  request.bootstrap_seed = static_cast<std::uint64_t>(
      ParseNumber(arguments.Get<std::string>("bootstrap-seed"), "--bootstrap-seed", 0));
  const auto databases = OpenSelected(selection);
  CheckPublished(databases, request.published);
  WriteFile(file, ReportPage(databases, request));
  std::cerr << "wrote " << AbsolutePath(file) << "\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace dreamsearch::results
