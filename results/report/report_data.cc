#include "results/report/report_data.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "results/analysis/line_statistics.h"
#include "results/database/schema.h"
#include "results/figures/curve_figure.h"
#include "results/figures/figure.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

using nlohmann::ordered_json;

struct Curve {
  std::string label;
  LineCurve numbers;
  std::vector<RunCurve> runs;  // those with a point; none of a mean over tasks
};
struct Chart {
  std::string name, y_title;
  bool over_tasks = false;
  std::vector<Curve> curves;
};

std::vector<Chart> ChartsOf(const std::vector<Line>& lines) {
  std::vector<Chart> charts;
  for (const Line& line : lines) {
    if (charts.empty() || charts.back().name != line.task) {
      charts.push_back({line.task, "evaluation return"});
    }
    Curve& curve = charts.back().curves.emplace_back();
    curve.label = line.label;
    curve.numbers = CurveOf(line);
    for (const RunCurve& run : line.runs) {
      if (!run.x.empty()) curve.runs.push_back(run);
    }
  }
  const std::size_t tasks = charts.size();
  if (tasks < 2) return charts;
  Chart& over_tasks = charts.emplace_back();
  over_tasks.name = "mean over " + Counted(tasks, "task");
  over_tasks.y_title = "normalised return";
  over_tasks.over_tasks = true;
  for (TaskMean& mean : MeansOverTasks(lines)) {
    if (!mean.left_out.empty()) continue;
    const int n = mean.points.empty() ? 0 : mean.points.front().n;
    over_tasks.curves.push_back({mean.label, {.n = n, .points = std::move(mean.points)}, {}});
  }
  return charts;
}

ordered_json RunsJson(const std::vector<RunCurve>& runs) {
  ordered_json list = ordered_json::array();
  for (const RunCurve& run : runs) {
    list.push_back(
        {{"seed", std::to_string(run.seed)}, {"x", ordered_json::object()}, {"y", run.value}});
  }
  return list;
}

// Without places on the axes.
ordered_json CurveJson(const Curve& curve, std::size_t line) {
  const auto numbers = [&](auto member) {
    ordered_json list = ordered_json::array();
    for (const LinePoint& point : curve.numbers.points) list.push_back(point.*member);
    return list;
  };
  ordered_json json;
  json["line"] = line;
  json["n"] = curve.numbers.n;
  json["interval"] = curve.numbers.n >= kIntervalRuns;
  json["env_step"] = numbers(&LinePoint::env_step);
  json["x"] = ordered_json::object();
  json["mean"] = numbers(&LinePoint::mean);
  json["iqm"] = numbers(&LinePoint::interquartile_mean);
  json["lo"] = numbers(&LinePoint::lo);
  json["hi"] = numbers(&LinePoint::hi);
  json["runs"] = RunsJson(curve.runs);
  json["tails"] = RunsJson(curve.numbers.tails);
  return json;
}

void AddPlaces(const std::string& axis, const Curve& curve, ordered_json* json) {
  ordered_json& places = (*json)["x"][axis] = ordered_json::array();
  for (const LinePoint& point : curve.numbers.points) places.push_back(point.x);
  for (std::size_t i = 0; i < curve.runs.size(); ++i) {
    (*json)["runs"][i]["x"][axis] = curve.runs[i].x;
  }
  for (std::size_t i = 0; i < curve.numbers.tails.size(); ++i) {
    (*json)["tails"][i]["x"][axis] = curve.numbers.tails[i].x;
  }
}

ordered_json StylesJson(std::size_t count) {
  ordered_json styles = ordered_json::array();
  for (std::size_t i = 0; i < count; ++i) {
    const Style style = StyleOf(static_cast<int>(i));
    styles.push_back(
        {{"colour", style.colour}, {"dash", style.dash}, {"marker", MarkerName(style.marker)}});
  }
  return styles;
}

ordered_json TimeJson(const std::vector<TimeUse>& uses) {
  ordered_json json = {{"planners", ordered_json::array()}, {"activities", ordered_json::array()}};
  for (const TimeUse& use : uses) {
    json["planners"].push_back(use.label + " (n = " + std::to_string(use.runs) + ")");
  }
  for (std::size_t a = 0; a < kActivities.size(); ++a) {
    ordered_json seconds = ordered_json::array();
    bool recorded = false;
    for (const TimeUse& use : uses) {
      seconds.push_back(use.SecondsFor1000Steps(kActivities[a]));
      recorded = recorded || use.seconds.count(kActivities[a]) > 0;
    }
    if (!recorded) continue;
    json["activities"].push_back({{"name", kActivities[a]},
                                  {"style", static_cast<int>(a)},
                                  {"seconds", std::move(seconds)}});
  }
  return json;
}

}  // namespace

ordered_json ReportData(const std::vector<AxisLines>& axes, const std::vector<TimeUse>& time) {
  const std::vector<Line>& lines = axes.front().lines;
  const std::vector<std::string> labels = OrderedLabels(lines);
  std::map<std::string, std::size_t> places;  // of labels
  for (const std::string& label : labels) places.emplace(label, places.size());
  std::set<std::string> published;
  std::set<std::int64_t> seeds;
  for (const Line& line : lines) {
    if (line.published) published.insert(line.label);
    for (const RunCurve& run : line.runs) {
      if (!line.published) seeds.insert(run.seed);
    }
  }

  ordered_json data;
  data["styles"] = StylesJson(std::max(labels.size(), kActivities.size()));
  data["axes"] = ordered_json::array();
  for (const AxisLines& axis : axes) {
    data["axes"].push_back({{"key", axis.key}, {"name", axis.name}, {"title", XLabel(axis.axis)}});
  }
  data["statistics"] = {{{"key", "mean"}, {"title", "mean"}},
                        {{"key", "iqm"}, {"title", "interquartile mean"}}};
  data["lines"] = ordered_json::array();
  for (std::size_t i = 0; i < labels.size(); ++i) {
    data["lines"].push_back(
        {{"label", labels[i]}, {"style", i}, {"published", published.count(labels[i]) > 0}});
  }
  data["seeds"] = ordered_json::array();
  for (const std::int64_t seed : seeds) data["seeds"].push_back(std::to_string(seed));
  const std::optional<double> end = EndOfOwnRuns(lines);
  data["x_end"] = end ? ordered_json(*end) : ordered_json(nullptr);

  std::map<std::pair<std::string, std::string>, ordered_json*> curves;  // by chart and label
  ordered_json& charts = data["charts"] = ordered_json::array();
  const std::vector<Chart> drawn = ChartsOf(lines);
  for (const Chart& chart : drawn) {
    ordered_json json = {{"name", chart.name},
                         {"y_title", chart.y_title},
                         {"over_tasks", chart.over_tasks},
                         {"curves", ordered_json::array()}};
    for (const Curve& curve : chart.curves) {
      json["curves"].push_back(CurveJson(curve, places.at(curve.label)));
    }
    charts.push_back(std::move(json));
  }
  for (std::size_t c = 0; c < drawn.size(); ++c) {
    for (std::size_t i = 0; i < drawn[c].curves.size(); ++i) {
      curves[{drawn[c].name, drawn[c].curves[i].label}] = &charts[c]["curves"][i];
    }
  }
  for (const AxisLines& axis : axes) {
    for (const Chart& chart : ChartsOf(axis.lines)) {
      for (const Curve& curve : chart.curves) {
        const auto found = curves.find({chart.name, curve.label});
        if (found != curves.end()) AddPlaces(axis.key, curve, found->second);
      }
    }
  }
  data["time"] = TimeJson(time);
  return data;
}

}  // namespace dreamsearch::results
