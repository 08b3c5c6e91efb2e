// runner render [RUN] - what does the agent do? A film of an evaluation episode.
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>

#include "host/acting/activity_clock.h"
#include "host/commands/commands.h"
#include "host/films/film_writer.h"
#include "host/films/filmed_episode.h"
#include "host/flags/flags.h"
#include "host/flags/run_flags.h"
#include "host/sweeps/evaluations.h"
#include "host/sweeps/sweep.h"
#include "host/sweeps/trained_run.h"
#include "results/report/strip.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

// One episode of several side by side.
struct Shown {
  std::string title;
  std::unique_ptr<FilmedEpisode> episode;
  std::optional<Frame> frame;  // the last one stays when the episode is over
  bool over = false;
};

// Says how far the film is, now and then.
class FilmProgress {
 public:
  void Add(std::uint64_t decision) {
    const double now = ActivityClock::Now();
    if (now - shown_ < 5) return;
    shown_ = now;
    std::cerr << "filmed " << decision << " decisions in " << FormatDuration(now - begin_)
              << std::endl;
  }

 private:
  const double begin_ = ActivityClock::Now();
  double shown_ = begin_;
};

struct Render {
  EvaluationOptions evaluation;
  FilmRequest film;
  std::string out;
  bool plain = false, strip = false;

  CommandSpec Declare() {
    RunOptions* options = &evaluation.choice;
    options->evaluate = true;
    options->preset.clear();
    options->study.clear();
    ProcessOptions* process = &options->process;
    std::vector<Flag> without_run = {{"env", "NAME", Names(&options->environments), "the task"}};
    for (Flag& flag : SeedFlags(&options->seeds)) without_run.push_back(std::move(flag));
    return {
        .name = "runner render",
        .summary = "films an evaluation episode of a trained agent, under any planner",
        .usage = {"runner render RUN [flags]                        a trained run's newest "
                  "checkpoint",
                  "runner render --env NAME --planner NAMES [flags]    no training: on the oracle"},
        .examples = {"runner render 3", "runner render 3 --planner dreamer,mcts_pw --out both.mp4",
                     "runner render 3 --episode 2 --out sheet.png",
                     "runner render --env walker_walk --planner random --out random.gif"},
        .about =
            "Plays an evaluation episode, the very one that `runner eval` plays, and films it "
            "in simulated time. Above a picture stand the planner and the return so far; below "
            "it the time, the search's depth, and a bar for each action component. With several "
            "planners or models the film shows them side by side, from the same start.\n"
            "Videos need the program ffmpeg, pictures of MuJoCo the packages libegl1 and "
            "libgl1-mesa-dri; no display is needed.",
        .arguments = {{"", "RUN", Text(&evaluation.run),
                       "the trained run: its number or the beginning of its UUID, from `runner "
                       "status`"}},
        .groups =
            {{"What to film",
              {{"planner", "NAMES",
                Names(&options->planners).Default("the run's own, of its evaluation"),
                "planners, separated by commas"},
               {"model", "NAMES",
                Names(&options->models)
                    .Default("the run's own; without RUN the default model that does not learn"),
                "models, separated by commas"},
               {"episode", "I", Whole(&film.episode, 0), "the episode, counted from 0"},
               SetFlag(&options->settings)}},
             {"Without RUN", std::move(without_run)},
             {"The picture",
              {{"width", "N", Whole(&film.width, 64, 1920), "pixels of a scene"},
               {"height", "N", Whole(&film.height, 64, 1080), "pixels of a scene"},
               {"camera", "N", Whole(&film.camera, 0, 100), "the environment's camera"},
               {"fps", "N", Whole(&film.most_frames_per_second, 1, 120),
                "at most so many pictures a simulated second"},
               {"plain", "", Switch(&plain), "the scene alone, without text and bars"}}},
             {"Where to",
              {DatabaseFlag(process),
               PluginPathFlag(&process->plugin_path),
               TrustModuleFlag(&process->trusted_modules),
               {"out", "FILE", Text(&out).Default("runR_episodeI.mp4"),
                "a video (.mp4, .webm, .gif), a sheet of twelve pictures (.png), or a folder for "
                "every picture (FOLDER/)"},
               {"strip", "", Switch(&strip),
                "keep eight small pictures of the episode with the run, for `results report`"}}}},
        .exclusive = {{"seeds", "seed-list"}, {"out", "strip"}}};
  }
  int Run();

 private:
  std::vector<Shown> Begin();
  void RunFilm(std::vector<Shown>* shown);
  std::filesystem::path folder_;  // of the trained run
  std::string name_;              // of the output
};

std::vector<Shown> Render::Begin() {
  RunOptions& options = evaluation.choice;
  std::vector<RunSpec> specs;
  std::filesystem::path agent;
  if (!evaluation.run.empty()) {
    const auto database = results::Database::OpenReadOnly(options.process.db.string());
    const TrainedRun trained =
        FindTrainedRun(database.get(), evaluation.run, options.process.trusted());
    for (const std::string& warning : trained.warnings) {
      std::cerr << "warning: " << warning << "\n";
    }
    if (options.planners.empty()) options.planners = {trained.spec.eval_planner.name()};
    CompleteEvaluation(&evaluation);
    specs = EvaluationsOf(trained, options);
    agent = trained.checkpoint;
    folder_ = database->RunFolder(trained.info);
    name_ = "run" + std::to_string(trained.info.run_id);
    std::cerr << RunName(trained) << " after " << GroupDigits(trained.env_step)
              << " environment steps of training\n";
  } else {
    if (options.environments.empty()) {
      throw Failure(ExitCode::kUsage,
                    "runner render: expected a trained run or a task, RUN or --env NAME, found "
                    "neither. Example: runner render --env cartpole_swingup --planner random");
    }
    if (options.planners.empty()) {
      throw Failure(ExitCode::kUsage,
                    "runner render: expected --planner NAMES, because there is no trained run "
                    "whose planner could play");
    }
    CompleteEvaluation(&evaluation);
    const Catalogue catalogue = ScanPlugins(options.process.plugin_path);
    specs = EvaluationsWithoutTraining(options, catalogue);
    name_ = specs.front().environment.name() + "_" + options.planners.front();
  }
  constexpr std::size_t kMostShown = 6;
  if (specs.size() > kMostShown) {
    throw Failure(ExitCode::kUsage, "runner render: expected at most " +
                                        std::to_string(kMostShown) + " films side by side, found " +
                                        std::to_string(specs.size()));
  }
  const bool models_differ = std::any_of(specs.begin(), specs.end(), [&](const RunSpec& spec) {
    return spec.model.name() != specs.front().model.name();
  });
  std::vector<Shown> shown;
  for (const RunSpec& spec : specs) {
    Shown& one = shown.emplace_back();
    one.title = spec.environment.task() + ", " + spec.planner.name();
    if (models_differ) one.title += " on " + spec.model.name();
    if (specs.front().seed != spec.seed) one.title += ", seed " + std::to_string(spec.seed);
    one.episode = std::make_unique<FilmedEpisode>(spec, agent, film, one.title);
  }
  return shown;
}

void Render::RunFilm(std::vector<Shown>* shown) {
  std::unique_ptr<FilmWriter> writer;
  PictureSheet sheet(results::kStripPictures);
  FilmProgress progress;
  for (;;) {
    bool any = false;
    std::vector<Picture> pictures;
    for (Shown& one : *shown) {
      if (!one.over) {
        if (std::optional<Frame> frame = one.episode->Next()) {
          one.frame = std::move(frame);
          any = true;
        } else {
          one.over = true;
        }
      }
      pictures.push_back(plain || strip ? one.frame->scene : Panel(*one.frame, one.title));
    }
    if (!any) break;
    progress.Add(shown->front().frame->decision);
    const Picture picture = Grid(pictures, pictures.size() > 3 ? 3 : 6);
    if (strip) {
      sheet.Add(picture);
      continue;
    }
    if (writer == nullptr) {
      writer = FilmWriter::Make(out, shown->front().episode->frames_per_second());
    }
    writer->Add(picture);
  }
  if (strip) {
    std::vector<Picture> pictures = sheet.Chosen();
    WriteFile((folder_ / results::kStripFile).string(),
              PngOf(Grid(pictures, static_cast<int>(pictures.size()))));
  } else {
    writer->Finish();
  }
}

int Render::Run() {
  if (strip) {
    if (evaluation.run.empty()) {
      throw Failure(ExitCode::kUsage,
                    "runner render: --strip: expected RUN, whose strip it is to be");
    }
    film.width = results::kStripWidth;
    film.height = results::kStripHeight;
    film.most_frames_per_second = 5;
  }
  if (!out.empty()) FilmWriter::CheckPath(out);
  std::vector<Shown> shown = Begin();
  if (strip && shown.size() > 1) {
    throw Failure(ExitCode::kUsage, "runner render: --strip: expected one planner and model");
  }
  if (out.empty()) out = name_ + "_episode" + std::to_string(film.episode) + ".mp4";
  RunFilm(&shown);
  std::cerr << "wrote " << AbsolutePath(strip ? (folder_ / results::kStripFile).string() : out)
            << ":";
  for (const Shown& one : shown) {
    std::cerr << (&one == &shown.front() ? " " : "; ") << one.title << " returned "
              << FormatNumber("%.1f", one.frame->episode_return);
  }
  std::cerr << "\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command RenderCommand() { return MakeCommand<Render>(); }

}  // namespace dreamsearch
