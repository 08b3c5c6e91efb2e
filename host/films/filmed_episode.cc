#include "host/films/filmed_episode.h"

#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include "host/acting/episode.h"
#include "host/processes/child_process.h"
#include "host/processes/child_request.h"
#include "host/settings/settings.h"
#include "host/training/evaluation.h"
#include "results/system/child.h"
#include "results/system/error.h"
#include "results/text/json_fields.h"
#include "results/text/json_text.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

// Simulated time that nobody would wait for, or that is not known: shown at this pace.
constexpr double kLeastFramesPerSecond = 10;

constexpr char kPace[] = "frames_per_second";

// What the child writes: a line of JSON and the scene's bytes for each frame; at the end, or
// instead, a line with "end" or "error".
class FrameSender {
 public:
  FrameSender(const FilmRequest& request, const RunSpec& spec) : request_(request), spec_(spec) {}

  // The state after `decision` decisions; `held` led there, null at the start.
  void Arrive(std::uint64_t decision, Environment* environment, const HeldAction* held) {
    const EnvironmentSpec& spec = environment->spec();
    if (decision == 0) {
      const double seconds = spec.control_seconds * static_cast<double>(spec_.action_repeat());
      const double pace = seconds > 0 ? std::min(1 / seconds, 1e6) : 0;
      every_ = static_cast<std::uint64_t>(
          std::max(1.0, std::ceil(pace / request_.most_frames_per_second - 1e-9)));
      frames_per_second_ = std::max(pace / static_cast<double>(every_), kLeastFramesPerSecond);
    } else {
      frame_.episode_return += held->reward;
      frame_.seconds += static_cast<double>(held->steps) * spec.control_seconds;
    }
    frame_.decision = decision;
    const bool last = held != nullptr && (held->last || !held->diverged.empty());
    if (decision % every_ != 0 && !last) return;
    frame_.scene = SceneOf(environment, spec_.environment.name(), request_.width, request_.height,
                           request_.camera);
    nlohmann::json line = results::FieldsToJson(frame_);
    line[kPace] = frames_per_second_;
    const std::string_view pixels(reinterpret_cast<const char*>(frame_.scene.rgb.data()),
                                  frame_.scene.rgb.size());
    if (!WriteAll(kReportDescriptor, results::JsonText(line) + "\n") ||
        !WriteAll(kReportDescriptor, pixels)) {
      std::_Exit(0);  // nobody looks any more
    }
  }

  void Decide(const Decision& decision, const Agent& agent) {
    frame_.action.assign(agent.action().begin(), agent.action().end());
    frame_.value = decision.value;
    frame_.simulations = decision.simulations;
    frame_.depth = decision.depth;
  }

 private:
  const FilmRequest& request_;
  const RunSpec& spec_;
  std::uint64_t every_ = 1;
  double frames_per_second_ = kLeastFramesPerSecond;
  Frame frame_;
};

void FilmEpisode(const nlohmann::json& request) {
  const RunSpec spec = RunSpecFromJson(request.at("spec"));
  const Components components(spec);
  const auto agent = request.at("agent").get<std::string>();
  EvaluationPlayer player(components, spec, OpenAgent(spec, agent), 1, 1);
  FilmRequest film;
  results::FieldsFromJson(request.at("film"), &film);
  FrameSender sender(film, spec);
  std::optional<std::uint64_t> next = film.episode;
  EpisodeFaults faults;
  EpisodeCourse course;
  course.next = [&] { return std::exchange(next, std::nullopt); };
  course.go_on = [](std::uint64_t, std::uint64_t) { return true; };
  course.arrived = [&](std::uint64_t, std::uint64_t t, Environment* environment,
                       const HeldAction* held) { sender.Arrive(t, environment, held); };
  course.decided = [&](std::uint64_t, std::uint64_t, const Decision& decision,
                       const Agent& decider) { sender.Decide(decision, decider); };
  course.ended = [](std::uint64_t, const results::EpisodeRow&) {};
  course.failed = [&](std::uint64_t index, std::exception_ptr error) {
    faults.Add(index, std::move(error));
  };
  player.Play(course);
  faults.RethrowFirst();
}

}  // namespace

Picture SceneOf(Environment* environment, const std::string& name, std::uint32_t width,
                std::uint32_t height, std::uint32_t camera) {
  Picture scene;
  scene.width = static_cast<int>(width);
  scene.height = static_cast<int>(height);
  scene.rgb.resize(std::size_t{width} * height * 3);
  auto* rendering = ExtensionOf<Rendering>(environment);
  const Status status =
      rendering == nullptr
          ? Error(StatusCode::kUnimplemented, "it does not offer '%s'", Rendering::kName)
          : rendering->Render({.width = width, .height = height, .camera = camera},
                              {scene.rgb.data(), scene.rgb.size()});
  if (!status.ok()) {
    throw Failure(ExitCode::kPluginRefused,
                  "environment '" + name + "' draws no picture: " + status.message);
  }
  return scene;
}

int FilmEpisodeMain() {
  return AnswerMain([](const nlohmann::json& question) -> nlohmann::json {
    FilmEpisode(question);
    return {{"end", true}};
  });
}

FilmedEpisode::FilmedEpisode(const RunSpec& spec, const std::filesystem::path& agent,
                             const FilmRequest& request, const std::string& who)
    : who_(who), request_(request) {
  Pipe pipe = MakePipe();
  const FileDescriptor input =
      MemoryFile(results::JsonText({{"spec", ToJson(spec)},
                                    {"agent", agent.string()},
                                    {"film", results::FieldsToJson(request)}}));
  ChildSpec child;
  child.arguments = {"film-episode"};
  child.input = input.get();
  child.log = STDERR_FILENO;
  child.report = pipe.write.get();
  pid_ = StartChild(child);
  frames_ = std::move(pipe.read);
}

FilmedEpisode::~FilmedEpisode() {
  if (pid_ < 0) return;
  ::kill(pid_, SIGKILL);
  WaitForEnd(pid_);
}

bool FilmedEpisode::Fill() {
  buffer_.erase(0, read_);
  read_ = 0;
  for (;;) {
    pollfd polled{frames_.get(), POLLIN, 0};
    ::poll(&polled, 1, -1);
    char bytes[65536];
    const ssize_t got = ::read(frames_.get(), bytes, sizeof bytes);
    if (got > 0) {
      buffer_.append(bytes, static_cast<std::size_t>(got));
      return true;
    }
    if (got == 0 || (errno != EAGAIN && errno != EINTR)) return false;
  }
}

std::string FilmedEpisode::ReadLine() {
  for (;;) {
    const std::size_t end = buffer_.find('\n', read_);
    if (end != std::string::npos) {
      std::string line = buffer_.substr(read_, end - read_);
      read_ = end + 1;
      return line;
    }
    if (!Fill()) Fail();
  }
}

void FilmedEpisode::ReadExactly(char* to, std::size_t size) {
  while (size > 0) {
    if (read_ == buffer_.size() && !Fill()) Fail();
    const std::size_t part = std::min(size, buffer_.size() - read_);
    std::memcpy(to, buffer_.data() + read_, part);
    read_ += part;
    to += part;
    size -= part;
  }
}

void FilmedEpisode::Fail() {
  const int status = WaitForEnd(std::exchange(pid_, -1));
  throw Failure(ExitCode::kPluginCrashed,
                "the episode of " + who_ + " ended with " + DescribeWaitStatus(status));
}

std::optional<Frame> FilmedEpisode::Next() {
  if (pid_ < 0) return std::nullopt;
  const nlohmann::json line = results::ParseJsonOrDiscard(ReadLine());
  if (!line.is_object()) Fail();
  if (line.contains("end") || line.contains("error")) {
    const int status = WaitForEnd(std::exchange(pid_, -1));
    if (line.contains("end")) return std::nullopt;
    throw Failure(static_cast<ExitCode>(WIFEXITED(status) ? WEXITSTATUS(status) : 70),
                  who_ + ": " + line["error"].get<std::string>());
  }
  frames_per_second_ = line.at(kPace).get<double>();
  Frame frame;
  results::FieldsFromJson(line, &frame);
  frame.scene.width = static_cast<int>(request_.width);
  frame.scene.height = static_cast<int>(request_.height);
  frame.scene.rgb.resize(std::size_t{request_.width} * request_.height * 3);
  ReadExactly(reinterpret_cast<char*>(frame.scene.rgb.data()), frame.scene.rgb.size());
  return frame;
}

}  // namespace dreamsearch
