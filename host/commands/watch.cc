// runner watch - how does a sweep get on, seen from another terminal?
#include <poll.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <limits>
#include <map>
#include <optional>
#include <vector>

#include "host/acting/activity_clock.h"
#include "host/clusters/run_state.h"
#include "host/clusters/slurm.h"
#include "host/clusters/submission.h"
#include "host/commands/commands.h"
#include "host/flags/flags.h"
#include "host/training/rate_meter.h"
#include "results/database/database.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/run_lock.h"
#include "results/text/terminal_text.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr std::size_t kCurveColumns = 20;
constexpr std::size_t kNarrow = 100;  // has half of them
constexpr double kRedrawSeconds = 1;
constexpr double kRedrawFolderSeconds = 5;  // a database a run, and Slurm is asked

std::atomic<bool> end_asked{false};
void OnEnd(int) { end_asked = true; }
void OnResize(int) {}  // ends the waiting

// A screen of its own that is given back whatever ends the program but SIGKILL.
class Screen {
 public:
  Screen() {
    struct sigaction action {};
    action.sa_handler = OnEnd;
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) {
      ::sigaction(signal, &action, nullptr);
    }
    action.sa_handler = OnResize;
    ::sigaction(SIGWINCH, &action, nullptr);
    keys_ = ::tcgetattr(STDIN_FILENO, &before_) == 0;
    if (keys_) {
      termios raw = before_;
      raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
      ::tcsetattr(STDIN_FILENO, TCSANOW, &raw);
    }
    std::cout << "\033[?1049h\033[?25l" << std::flush;
  }
  ~Screen() {
    if (keys_) ::tcsetattr(STDIN_FILENO, TCSANOW, &before_);
    std::cout << "\033[?25h\033[?1049l" << std::flush;
  }
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  static winsize Size() {
    winsize size{};
    if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) size = {24, 80, 0, 0};
    return size;
  }

  static void Draw(const std::vector<std::string>& lines) {
    std::string text = "\033[H";
    for (std::size_t i = 0; i < lines.size(); ++i) {
      // Erased first: after a line of full width the last character would go.
      text += "\033[2K" + lines[i] + (i + 1 < lines.size() ? "\n" : "");
    }
    std::cout << text << "\033[J" << std::flush;
  }

  // Until so much time has passed, the size has changed or a key was pressed; false to end.
  bool Wait(double seconds) {
    pollfd key{keys_ ? STDIN_FILENO : -1, POLLIN, 0};
    if (::poll(&key, 1, static_cast<int>(seconds * 1000)) > 0) {
      char pressed = 0;
      if (::read(STDIN_FILENO, &pressed, 1) != 1) keys_ = false;  // its other end is gone
      if (pressed == 'q' || pressed == 'Q' || pressed == '\003') return false;
    }
    return !end_asked;
  }

 private:
  bool keys_ = false;
  termios before_{};
};

struct Curve {
  std::int64_t at = -1;  // environment steps
  std::vector<double> training;
  // The last episode of evaluation with search, or of the actor alone.
  double evaluated = std::numeric_limits<double>::quiet_NaN();
};

struct Row {
  std::string label;
  std::string task;
  std::string state;
  bool active = false;
  bool ended = false;
  std::int64_t steps = 0;
  std::int64_t target = 0;
  std::string note;
  Curve* curve = nullptr;
  double rate = 0;
};

struct Watch {
  std::string db = kDefaultDatabase;
  std::string folder;

  CommandSpec Declare() {
    return {.name = "runner watch",
            .summary = "shows how the runs of a sweep get on, redrawn every second",
            .usage = {"runner watch [--db FILE]", "runner watch --folder DIR    of a cluster"},
            .examples = {"runner watch --db walker.db", "runner watch --folder sweep"},
            .about =
                "Each run has a line: a curve of its training returns, on one scale for each task, "
                "how far it is, its last evaluation and what it does. Active runs come first. q or "
                "Ctrl-C ends it. It changes nothing and may be started and ended at any time. "
                "If the output is not a terminal it is printed once.",
            .groups = {{"Where",
                        {DatabaseFlag(&db),
                         {"folder", "DIR", Text(&folder),
                          "the folder of a sweep that `runner submit` began"}}}},
            .exclusive = {{"db", "folder"}}};
  }
  int Run();

 private:
  std::vector<Row> Rows();
  std::vector<Row> RowsOfFolder();
  Row RowOf(results::Database* database, const results::RunInfo& run, const std::string& key);
  std::vector<std::string> Lines(std::size_t width, std::size_t height, bool unicode);
  void Rate(const std::string& key, Row* row);

  bool models_differ_ = false;
  std::map<std::string, Curve> curves_;     // by the run
  std::map<std::string, RateMeter> rates_;  // of active runs
};

void Watch::Rate(const std::string& key, Row* row) {
  if (!row->active) {
    rates_.erase(key);
    return;
  }
  RateMeter& meter = rates_.try_emplace(key, 1).first->second;
  meter.Add(ActivityClock::Now(), static_cast<std::uint64_t>(row->steps), row->steps > 0);
  row->rate = meter.Rate();
}

Row Watch::RowOf(results::Database* database, const results::RunInfo& run, const std::string& key) {
  Row row;
  row.task = run.task;
  row.label = run.task + " " + run.planner + (models_differ_ ? " on " + run.model : "") + " seed " +
              std::to_string(run.seed) + (run.parent_run_id ? ", evaluation" : "");
  row.steps = run.env_steps_done;
  row.target = run.env_steps_target;
  row.note = run.error;
  row.active = RunIsLocked(database->RunFolder(run));
  row.state = results::RunStatusName(run.status);
  row.ended = run.status == results::RunStatus::kFinished || results::HasFailed(run.status);
  if (run.status == results::RunStatus::kRunning && !row.active) {
    row.active = results::IsActive(run);  // on another machine, whose locks do not show here
    if (!row.active) row.state = "stale";
  }
  Curve& curve = curves_[key];
  if (curve.at != run.env_steps_done || row.active) {
    curve = {};
    curve.at = run.env_steps_done;
    bool searched = false;
    for (const results::EpisodeInfo& episode : database->ListEpisodes(run.run_id)) {
      const double value =
          episode.episode_return.value_or(std::numeric_limits<double>::quiet_NaN());
      if (episode.phase == 0) {
        curve.training.push_back(value);
      } else if (episode.phase == 1 || !searched) {
        curve.evaluated = value;
        searched = episode.phase == 1;
      }
    }
  }
  row.curve = &curve;
  Rate(key, &row);
  return row;
}

std::vector<Row> Watch::Rows() {
  if (!folder.empty()) return RowsOfFolder();
  const auto database = results::Database::OpenReadOnly(db);
  std::vector<Row> rows;
  const std::vector<results::RunInfo> runs = database->ListRuns();
  models_differ_ = std::any_of(runs.begin(), runs.end(), [&](const results::RunInfo& run) {
    return run.model != runs.front().model;
  });
  for (const results::RunInfo& run : runs) {
    rows.push_back(RowOf(database.get(), run, run.uuid));
  }
  return rows;
}

std::vector<Row> Watch::RowsOfFolder() {
  const Submission submission = ReadSubmission(folder);
  std::optional<Queue> queue;
  try {
    queue = AskQueue(submission.Jobs());
  } catch (const Failure&) {  // no Slurm here: the databases alone tell
  }
  std::vector<Row> rows;
  for (const SubmittedRun& run : submission.runs) {
    const RunCondition condition = ConditionOf(folder, run, queue ? &*queue : nullptr);
    Row row;
    const std::filesystem::path path = RunDatabase(folder, run.id);
    if (std::filesystem::exists(path)) {
      try {
        const auto database = results::Database::OpenReadOnly(path.string());
        const std::vector<results::RunInfo> runs = database->ListRuns();
        if (!runs.empty()) row = RowOf(database.get(), runs.front(), run.id);
      } catch (const Failure& error) {
        row.note = error.what();
      }
    }
    row.label = run.label;
    row.task = run.label.substr(0, run.label.find(' '));
    row.state = condition.name();
    row.active = condition.state == RunState::kRunning;
    row.ended = condition.state == RunState::kFinished || condition.state == RunState::kFailed;
    row.steps = condition.steps;
    row.target = static_cast<std::int64_t>(run.steps);
    row.note = condition.note;
    if (row.active && !condition.node.empty()) row.note = "on " + condition.node;
    rows.push_back(std::move(row));
  }
  return rows;
}

std::string Padded(const std::string& text, std::size_t width) {
  const std::size_t is = Width(text);
  return is < width ? text + std::string(width - is, ' ') : text;
}

std::vector<std::string> Watch::Lines(std::size_t width, std::size_t height, bool unicode) {
  std::vector<Row> rows = Rows();
  const std::size_t curve_columns = width < kNarrow ? kCurveColumns / 2 : kCurveColumns;
  std::map<std::string, std::pair<double, double>> scales;  // by task
  std::map<std::string, int> states;
  std::size_t label = 0, state = 0;
  double left = 0, rate = 0, waiting = 0;
  for (const Row& row : rows) {
    ++states[row.state];
    label = std::max(label, Width(Printable(row.label)));
    state = std::max(state, Width(row.state));
    if (!row.ended && !row.active) waiting += static_cast<double>(row.target - row.steps);
    if (row.rate > 0) {
      rate += row.rate;
      left = std::max(left, static_cast<double>(row.target - row.steps) / row.rate);
    }
    if (row.curve == nullptr) continue;
    auto& [low, high] = scales.try_emplace(row.task, 1e300, -1e300).first->second;
    for (const double value : MeansOfColumns(row.curve->training, curve_columns)) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) {
    const auto rank = [](const Row& row) { return row.active ? 0 : row.ended ? 2 : 1; };
    return rank(a) < rank(b);
  });
  std::string summary = Counted(rows.size(), "run") + ":";
  const char* separator = " ";
  for (const auto& [name, count] : states) {
    summary += separator + std::to_string(count) + " " + name;
    separator = ", ";
  }
  if (rate > 0) summary += "; about " + FormatDuration(left + waiting / rate) + " left";
  std::vector<std::string> lines = {OneLine(summary, width), ""};
  const std::size_t shown = height > 4 && rows.size() + 2 > height ? height - 3 : rows.size();
  for (std::size_t i = 0; i < shown; ++i) {
    const Row& row = rows[i];
    std::string curve, returned;
    if (row.curve != nullptr) {
      const auto& [low, high] = scales[row.task];
      // As long as the run is far.
      const double share =
          row.target > 0 ? static_cast<double>(row.steps) / static_cast<double>(row.target) : 1;
      const auto columns = static_cast<std::size_t>(
          std::ceil(static_cast<double>(curve_columns) * std::clamp(share, 0.0, 1.0)));
      curve = Sparkline(MeansOfColumns(row.curve->training, columns), low, high, unicode);
      if (std::isfinite(row.curve->evaluated)) {
        returned = "evaluated " + FormatNumber("%.1f", row.curve->evaluated);
      } else if (!row.curve->training.empty()) {
        returned = "return " + FormatNumber("%.1f", row.curve->training.back());
      }
    }
    std::string text = Padded(Printable(row.label), label) + "  " + Padded(curve, curve_columns) +
                       "  " + Padded(Printable(row.state), state) + "  " + GroupDigits(row.steps) +
                       " of " + GroupDigits(row.target) + "  " + returned;
    if (row.rate > 0) {
      text += "  " + FormatNumber("%.0f", row.rate) + " steps/s, " +
              FormatDuration(static_cast<double>(row.target - row.steps) / row.rate) + " left";
    }
    if (!row.note.empty()) text += "  " + row.note;
    lines.push_back(OneLine(text, width));
  }
  if (shown < rows.size()) {
    lines.push_back(OneLine("and " + Counted(rows.size() - shown, "run") + " more", width));
  }
  return lines;
}

int Watch::Run() {
  if (!folder.empty() && !HasSubmission(folder)) {
    throw Failure(ExitCode::kNotFound, AbsolutePath(folder) +
                                           ": expected a folder in which `runner submit` has begun "
                                           "a sweep, found no submission.json");
  }
  const bool unicode = TerminalHasUtf8();
  const char* term = std::getenv("TERM");
  if (::isatty(STDOUT_FILENO) == 0 || term == nullptr || std::string(term) == "dumb") {
    constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max() / 2;
    for (const std::string& line : Lines(kAll, kAll, unicode)) std::cout << line << "\n";
    return static_cast<int>(ExitCode::kOk);
  }
  Lines(1, 1, unicode);  // what is wrong from the beginning is said without a screen
  Screen screen;
  do {
    const winsize size = Screen::Size();
    try {
      Screen::Draw(Lines(size.ws_col, size.ws_row, unicode));
    } catch (const Failure& error) {  // it may be put back at this moment, or locked for long
      Screen::Draw({OneLine(error.what(), size.ws_col)});
    }
  } while (screen.Wait(folder.empty() ? kRedrawSeconds : kRedrawFolderSeconds));
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command WatchCommand() { return MakeCommand<Watch>(); }

}  // namespace dreamsearch
