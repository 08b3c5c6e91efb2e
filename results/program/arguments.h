// arguments.h - the options that the subcommands of `results` have in common.
#pragma once

#include <boost/program_options.hpp>
#include <memory>
#include <string>
#include <vector>

#include "results/database/database.h"
#include "results/system/names.h"
#include "results/system/table.h"

namespace dreamsearch::results {

// What --db, --study, --env, --planner, --seed and, where there is one, --status say.
struct Selection {
  std::vector<std::string> databases = {"results/dreamsearch.db"};
  RunFilter filter;
};

// One subcommand's command line. Prints its help and says so when asked to.
class Arguments {
 public:
  // usage: what follows "results NAME", summary: one line.
  Arguments(const std::string& name, const std::string& usage, const std::string& summary);

  boost::program_options::options_description_easy_init Add() { return options_.add_options(); }
  // --db, several times or with commas.
  void AddDatabase();
  // --study --env --planner --seed.
  void AddFilter();
  // A word without dashes; `many` takes all that follow.
  void AddPositional(const std::string& name, bool many = false);

  // False when --help was asked for and has been printed. Error 2 for anything
  // that is not an option, with what is known.
  bool Parse(const std::vector<std::string>& arguments);

  bool Has(const std::string& name) const { return values_.count(name) > 0; }
  template <typename T>
  const T& Get(const std::string& name) const {
    return values_[name].as<T>();
  }
  // The values of a list option, also those joined by commas.
  std::vector<std::string> List(const std::string& name) const;
  Selection GetSelection() const;

 private:
  std::string name_, usage_, summary_;
  boost::program_options::options_description options_;
  boost::program_options::options_description hidden_;
  boost::program_options::positional_options_description positional_;
  boost::program_options::variables_map values_;
};

// Sees to it that every published method asked for, as METHOD, METHOD/OBS or all, was
// imported into one of the databases; Error 66 naming those that are.
void CheckPublished(const std::vector<std::unique_ptr<Database>>& databases,
                    const std::vector<std::string>& methods);

// Opens the databases for reading and sees to it that every name asked for is in
// one of them; Error 2 naming those that are.
std::vector<std::unique_ptr<Database>> OpenSelected(const Selection& selection);

// To the file, by its suffix (.txt, .md, .csv, .json), or to standard output in
// `form`.
bool IsTablePath(const std::string& path);
TableForm FormOfTablePath(const std::string& path);  // of one that is
void PrintTable(const Table& table, const std::string& form, const std::string& out);

// A whole number of at least `least`; Error 2 otherwise.
std::int64_t ParseNumber(const std::string& text, const std::string& what, std::int64_t least);

}  // namespace dreamsearch::results
