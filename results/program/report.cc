// results report FILE.html - what do the runs show, on one page?
#include "results/report/report.h"

#include <filesystem>
#include <iostream>

#include "results/program/commands.h"
#include "results/program/selection.h"
#include "results/system/error.h"
#include "results/system/file.h"

namespace dreamsearch::results {

namespace {

struct Report {
  Selection selection;
  ReportRequest request;
  std::string file;

  CommandSpec Declare() {
    return {.name = "results report",
            .summary = "writes one HTML page with every figure and table",
            .examples = {"results report report.html"},
            .about =
                "The page needs neither a network nor other files. It has learning curves to "
                "explore, times, a comparison, what is missing, settings and machines.",
            .arguments = {{"", "FILE.html", Text(&file).Required(), "the page to write"}},
            .groups = {SelectionFlags(&selection),
                       {"What to show",
                        {PublishedFlag(&request.published),
                         BootstrapSeedFlag(&request.bootstrap_seed),
                         {"title", "TEXT", Text(&request.title), "the page's title"}}}}};
  }
  int Run();
};

int Report::Run() {
  const std::string suffix = std::filesystem::path(file).extension().string();
  if (suffix != ".html" && suffix != ".htm") {
    throw Failure(ExitCode::kUsage, "results report: FILE.html: " + AbsolutePath(file) +
                                        ": expected a file name that ends in .html");
  }
  request.filter = selection.filter;
  const auto databases = OpenSelected(selection);
  CheckPublished(databases, request.published);
  WriteFile(file, ReportPage(databases, request));
  std::cerr << "wrote " << AbsolutePath(file) << "\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command ReportCommand() { return MakeCommand<Report>(); }

}  // namespace dreamsearch::results
