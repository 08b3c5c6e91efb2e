// runner explain RUN --decision T - why did the planner choose this action?
#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "host/acting/activity_clock.h"
#include "host/acting/decision_tree.h"
#include "host/acting/episode.h"
#include "host/commands/commands.h"
#include "host/commands/page/embedded.h"
#include "host/commands/progress.h"
#include "host/films/filmed_episode.h"
#include "host/flags/flags.h"
#include "host/processes/child_request.h"
#include "host/sweeps/sweep.h"
#include "host/sweeps/trained_run.h"
#include "host/training/evaluation.h"
#include "host/training/experiment.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/json_text.h"
#include "results/text/table.h"
#include "results/text/text.h"
#include "results/text/web_page.h"

namespace dreamsearch {
namespace {

// What the run plays when it is evaluated with search, and its checkpoint.
struct Subject {
  RunSpec spec;  // an evaluation
  std::filesystem::path agent;
  results::RunInfo info;
};

Subject FindSubject(results::Database* database, const std::string& run,
                    const TrustedCode& trusted) {
  Subject subject;
  subject.info = database->GetRun(run);
  subject.spec = RecordedSpec(database, subject.info);
  if (subject.spec.evaluation) {
    subject.spec = TrustedSpec(database, subject.info, trusted);
    if (const std::string changed = ChangedFile(subject.spec); !changed.empty()) {
      std::cerr << "warning: run " << subject.info.run_id
                << " was played before something changed: " << changed << "\n";
    }
    subject.spec.evaluation->ranks = {};
    subject.agent = AgentCheckpoint(database, subject.spec);
    return subject;
  }
  const TrainedRun trained = FindTrainedRun(database, run, trusted);
  for (const std::string& warning : trained.warnings) std::cerr << "warning: " << warning << "\n";
  subject.spec = trained.spec;
  subject.spec.planner = trained.spec.eval_planner;
  EvaluationSpec& evaluation = subject.spec.evaluation.emplace();
  evaluation.parent_run_id = trained.info.run_id;
  evaluation.parent_uuid = trained.info.uuid;
  evaluation.env_step = trained.env_step;
  evaluation.agent_sha256 = trained.agent_sha256;
  subject.agent = trained.checkpoint;
  return subject;
}

Subject TrainingSubject(results::Database* database, const std::string& run) {
  Subject subject;
  subject.info = database->GetRun(run);
  subject.spec = RecordedSpec(database, subject.info);
  if (subject.spec.evaluation) {
    throw Failure(ExitCode::kUsage, "runner explain: --training: run " +
                                        std::to_string(subject.info.run_id) +
                                        " is an evaluation and trained nothing");
  }
  return subject;
}

// The tree of a training decision as --record-trees kept it.
nlohmann::json KeptTree(const std::filesystem::path& folder, const std::string& name,
                        std::uint64_t episode, std::uint64_t decision) {
  const std::filesystem::path path = Experiment::TreesPath(folder, episode);
  if (!std::filesystem::exists(path)) {
    throw Failure(ExitCode::kNotFound,
                  name + " kept no trees of training episode " + std::to_string(episode) + " (" +
                      path.string() +
                      "): it was run without --record-trees, the episode has not ended, or "
                      "its actions were random");
  }
  const Experiment::Trees trees = Experiment::ReadTrees(path);
  const auto found = trees.find(decision);
  if (found == trees.end()) {
    throw Failure(ExitCode::kUsage, "--decision: training episode " + std::to_string(episode) +
                                        " has the trees of " + std::to_string(trees.size()) +
                                        " decisions from 0, found " + std::to_string(decision));
  }
  return results::ParseJson(found->second);
}

std::string Number(double value) { return FormatNumber("%.4g", value); }

std::string ActionText(const nlohmann::json& action) {
  std::string text = "[";
  for (const auto& component : action) {
    text += (text.size() > 1 ? " " : "") + Number(component.get<double>());
  }
  return text + "]";
}

// The root's most visited actions.
void PrintRoot(const nlohmann::json& tree) {
  const nlohmann::json& root = tree.at("root");
  std::cout << "played " << ActionText(tree.at("action")) << ", root value "
            << Number(root.at("value")) << ", " << root.at("simulations") << " simulations, "
            << root.at("nodes") << " nodes, depth " << root.at("depth") << ", visit entropy "
            << Number(root.at("visit_entropy")) << " nats\n";
  std::vector<std::size_t> order;
  const nlohmann::json& edges = tree.at("edges");
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (edges[i].at("parent") == -1) order.push_back(i);
  }
  const std::size_t all = order.size();
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const auto key = [&](std::size_t i) {
      return std::pair(edges[i].at("visits").get<double>(), edges[i].at("q").get<double>());
    };
    return key(a) > key(b);
  });
  constexpr std::size_t kMost = 5;
  if (order.size() > kMost) order.resize(kMost);
  results::Table table = {{"", "action", "visits", "Q", "prior", "reward", "value"}, {}};
  for (const std::size_t i : order) {
    const nlohmann::json& edge = edges[i];
    table.rows.push_back(
        {std::string(tree.at("chosen_edge") == i ? "*" : ""), ActionText(edge.at("action")),
         std::to_string(edge.at("visits").get<std::uint64_t>()), Number(edge.at("q")),
         Number(edge.at("prior")), Number(edge.at("reward")), Number(edge.at("value"))});
  }
  std::cout << table.Print(results::TableForm::kText);
  if (all > kMost) std::cout << "and " << all - kMost << " more actions\n";
}

// One page of HTML that holds all it needs. `tree` is TreeJson with what the page
// says about the decision: run_id, run_uuid, env, planner, model, seed, env_step,
// phase, episode, decision.
std::string TreePage(const nlohmann::json& tree, const std::string& picture) {
  const std::string image =
      picture.empty() ? "" : "<img src=\"" + picture + "\" alt=\"the state that was decided in\">";
  return FillTemplate(ExplainTemplate(), {{"style", std::string(ExplainStyle())},
                                          {"picture", image},
                                          {"tree", ScriptJson(tree)},
                                          {"script", std::string(ExplainScript())}});
}

// What the environment shows, as a link that holds the picture; empty where it draws none.
std::string PictureLink(Environment* environment, const std::string& name) {
  try {
    return PngLink(PngOf(SceneOf(environment, name, 320, 240, 0)));
  } catch (const Failure& error) {
    std::cerr << "note: the page has no picture of the state: " << error.what() << "\n";
    return "";
  }
}

struct Explain {
  std::string run, db = kDefaultDatabase, out;
  std::int64_t episode = 0, decision = 0;
  bool training = false;
  TrustedCode trusted;

  CommandSpec Declare() {
    return {
        .name = "runner explain",
        .summary = "shows the search tree of a decision",
        .examples = {"runner explain 3 --decision 120"},
        .about =
            "Replays an evaluation episode from the run's newest checkpoint up to the "
            "decision and writes the tree that the search made there: PREFIX.json for "
            "programs, and PREFIX.html, a page that needs no network and shows the root's "
            "actions and every edge with visits, Q, prior, reward and value. The run is a "
            "training or an evaluation of `runner eval`. With --training the command shows a "
            "tree that a training with --record-trees kept, exploration noise included.",
        .arguments = {RunArgument(&run)},
        .groups = {
            {"Which decision",
             {{"decision", "T", Whole(&decision, 0).Default("").Required(),
               "decision of the episode, counted from 0"},
              {"episode", "I", Whole(&episode, 0), "the episode, counted from 0"},
              {"training", "", Switch(&training), "take the decision from training episode I"}}},
            {"Where",
             {DatabaseFlag(&db),
              PluginPathFlag(&trusted.folders),
              TrustModuleFlag(&trusted.modules),
              {"out", "PREFIX", Text(&out).Default("runR_episodeI_decisionT, runR_training_..."),
               "begin the names of the two files with this, or write them to this "
               "folder"}}}}};
  }
  int Run();
};

int Explain::Run() {
  const auto database = results::Database::OpenReadOnly(db);
  const Subject subject =
      training ? TrainingSubject(database.get(), run) : FindSubject(database.get(), run, trusted);
  const RunSpec& spec = subject.spec;
  const std::string name =
      "run " + std::to_string(subject.info.run_id) + " (" + RunLabel(spec) + ")";
  if (!training && !spec.planner.Has(kSearches)) {
    throw Failure(ExitCode::kUsage, name + " plays without search: planner '" +
                                        spec.planner.name() +
                                        "' makes no tree. `runner eval` evaluates it under a "
                                        "planner that searches, and that run can be explained");
  }
  const std::uint64_t episodes = spec.run.Integer("eval_episodes");
  if (!training && static_cast<std::uint64_t>(episode) >= episodes) {
    throw Failure(ExitCode::kUsage, "--episode: " + name + " is evaluated with " +
                                        Counted(episodes, "episode") + ", expected 0 to " +
                                        std::to_string(episodes - 1) + ", found " +
                                        std::to_string(episode));
  }
  nlohmann::json tree;
  if (training) {
    tree = KeptTree(database->RunFolder(subject.info), name, static_cast<std::uint64_t>(episode),
                    static_cast<std::uint64_t>(decision));
  } else {
    ChildRequest request;
    request.command = "explain-decision";
    request.who = name;
    request.show_messages = true;
    tree = AskChild(request, {{"spec", ToJson(spec)},
                              {"agent", subject.agent.string()},
                              {"episode", episode},
                              {"decision", decision}});
    tree["env_step"] = spec.evaluation->env_step;
  }
  // For the page; what programs read has numbers alone.
  const std::string picture = tree.value("picture", "");
  tree.erase("picture");
  tree["format"] = "dreamsearch tree 1";
  tree["run_id"] = subject.info.run_id;
  tree["run_uuid"] = subject.info.uuid;
  tree["env"] = spec.environment.task();
  tree["planner"] = spec.planner.name();
  tree["model"] = spec.model.name();
  tree["seed"] = spec.seed;
  tree["phase"] = training ? "training" : "evaluation";
  tree["episode"] = episode;
  tree["decision"] = decision;
  out = OutputPath(out, "run" + std::to_string(subject.info.run_id) +
                            (training ? "_training" : "") + "_episode" + std::to_string(episode) +
                            "_decision" + std::to_string(decision));
  WriteFile(out + ".json", results::JsonText(tree) + "\n");
  WriteFile(out + ".html", TreePage(tree, picture));
  PrintRoot(tree);
  std::cerr << "wrote " << out << ".json and " << out << ".html: " << tree["edges"].size()
            << " edges\n";
  return 0;
}

}  // namespace

Command ExplainCommand() { return MakeCommand<Explain>(); }

int ExplainDecisionMain() {
  return AnswerMain([](const nlohmann::json& request) {
    const RunSpec spec = RunSpecFromJson(request.at("spec"));
    const auto wanted = request.at("decision").get<std::uint64_t>();
    const Components components(spec);
    EvaluationPlayer player(components, spec,
                            OpenAgent(spec, request.at("agent").get<std::string>()), 1, 1);
    TreeCollector tree;
    Decision decided;
    std::vector<double> action, metrics;
    std::uint64_t played = 0;
    const double begin = ActivityClock::Now();
    double shown = begin;
    std::optional<std::uint64_t> next = request.at("episode").get<std::uint64_t>();
    EpisodeFaults faults;
    EpisodeCourse course;
    course.next = [&] { return std::exchange(next, std::nullopt); };
    course.go_on = [&](std::uint64_t, std::uint64_t t) {
      const double now = ActivityClock::Now();
      if (now - shown > 5) {
        shown = now;
        std::cerr << "replayed " << t << " of " << wanted << " decisions, about "
                  << FormatDuration((now - begin) / static_cast<double>(t) *
                                    static_cast<double>(wanted + 1 - t))
                  << " left" << std::endl;
      }
      return t <= wanted;
    };
    course.tree = [&](std::uint64_t, std::uint64_t t) -> TreeSink* {
      return t == wanted ? &tree : nullptr;
    };
    std::string picture;
    course.arrived = [&](std::uint64_t, std::uint64_t t, Environment* environment,
                         const HeldAction*) {
      if (t == wanted) picture = PictureLink(environment, spec.environment.name());
    };
    course.decided = [&](std::uint64_t, std::uint64_t t, const Decision& decision,
                         const Agent& agent) {
      played = t + 1;
      if (t != wanted) return;
      decided = decision;
      action.assign(agent.action().begin(), agent.action().end());
      metrics.assign(agent.metrics().begin(), agent.metrics().end());
    };
    course.ended = [](std::uint64_t, const results::EpisodeRow&) {};
    course.failed = [&](std::uint64_t index, std::exception_ptr error) {
      faults.Add(index, std::move(error));
    };
    player.Play(course);
    faults.RethrowFirst();
    if (played <= wanted) {
      throw Failure(ExitCode::kUsage, "--decision: expected 0 to " + std::to_string(played - 1) +
                                          " in that episode, found " + std::to_string(wanted));
    }
    const std::string who = "planner '" + spec.planner.name() + "'";
    if (tree.faulty()) {
      throw Failure(ExitCode::kInternal,
                    who + " reported an edge before its parent, or memory ran out");
    }
    if (tree.edges().empty()) {
      throw Failure(ExitCode::kBadInput, who + " reports no tree");
    }
    nlohmann::json json = TreeJson(tree, {action.data(), action.size()}, decided, metrics,
                                   components.planner().metrics);
    json["picture"] = picture;
    return json;
  });
}

}  // namespace dreamsearch
