#include "host/films/filmed_episode.h"

#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
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
#include "host/settings/settings.h"
#include "host/training/evaluation.h"
#include "results/system/error.h"
#include "results/text/json_text.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

// Simulated time that nobody would wait for, or that is not known: shown at this pace.
constexpr double kLeastFramesPerSecond = 10;

std::string LineOf(const Frame& frame, double frames_per_second) {
  return results::JsonText({{"frames_per_second", frames_per_second},
                            {"decision", frame.decision},
                            {"seconds", frame.seconds},
                            {"return", frame.episode_return},
                            {"action", frame.action},
                            {"value", frame.value},
                            {"simulations", frame.simulations},
                            {"depth", frame.depth}}) +
         "\n";
}

// What the child writes: a line of JSON and the scene's bytes for each frame; at the end, or
// instead, a line with "end" or "error".
class FrameSender {
 public:
  FrameSender(const nlohmann::json& request, const RunSpec& spec)
      : spec_(spec),
        width_(request.at("width").get<std::uint32_t>()),
        height_(request.at("height").get<std::uint32_t>()),
        camera_(request.at("camera").get<std::uint32_t>()),
        most_(request.at("most_frames_per_second").get<double>()) {}

  // The state after `decision` decisions; `held` led there, null at the start.
  void Arrive(std::uint64_t decision, Environment* environment, const HeldAction* held) {
    const EnvironmentSpec& spec = environment->spec();
    if (decision == 0) {
      const double seconds = spec.control_seconds * static_cast<double>(spec_.action_repeat());
      const double pace = seconds > 0 ? std::min(1 / seconds, 1e6) : 0;
      every_ = static_cast<std::uint64_t>(std::max(1.0, std::ceil(pace / most_ - 1e-9)));
      frames_per_second_ = std::max(pace / static_cast<double>(every_), kLeastFramesPerSecond);
    } else {
      frame_.episode_return += held->reward;
      frame_.seconds += static_cast<double>(held->steps) * spec.control_seconds;
    }
    frame_.decision = decision;
    const bool last = held != nullptr && (held->last || !held->diverged.empty());
    if (decision % every_ != 0 && !last) return;
    frame_.scene = SceneOf(environment, spec_.environment.name(), width_, height_, camera_);
    const std::string_view pixels(reinterpret_cast<const char*>(frame_.scene.rgb.data()),
                                  frame_.scene.rgb.size());
    if (!WriteAll(kReportDescriptor, LineOf(frame_, frames_per_second_)) ||
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
  const RunSpec& spec_;
  const std::uint32_t width_, height_, camera_;
  const double most_;
  std::uint64_t every_ = 1;
  double frames_per_second_ = kLeastFramesPerSecond;
  Frame frame_;
};

void FilmEpisode(const nlohmann::json& request) {
  const RunSpec spec = RunSpecFromJson(request.at("spec"));
  const Components components(spec);
  const auto agent = request.at("agent").get<std::string>();
  EvaluationPlayer player(components, spec, OpenAgent(spec, agent), 1, 1);
  FrameSender sender(request, spec);
  std::optional<std::uint64_t> next = request.at("episode").get<std::uint64_t>();
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
  const Status status = environment->Render({.width = width, .height = height, .camera = camera},
                                            {scene.rgb.data(), scene.rgb.size()});
  if (!status.ok()) {
    throw Failure(ExitCode::kPluginRefused,
                  "environment '" + name + "' draws no picture: " + status.message);
  }
  return scene;
}

int FilmEpisodeMain() {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::signal(SIGPIPE, SIG_IGN);
  nlohmann::json end = {{"end", true}};
  int status = 0;
  try {
    FilmEpisode(results::ParseJson(ReadAll(0)));
  } catch (const Failure& error) {
    end = {{"error", error.what()}};
    status = error.exit_status();
  } catch (const nlohmann::json::exception& error) {
    end = {{"error", std::string("this command is started by `runner` itself: ") + error.what()}};
    status = static_cast<int>(ExitCode::kInternal);
  } catch (const std::bad_alloc&) {
    end = {{"error", "out of memory"}};
    status = static_cast<int>(ExitCode::kInternal);
  }
  WriteAll(kReportDescriptor, results::JsonTextReplacing(end) + "\n");
  return status;
}

FilmedEpisode::FilmedEpisode(const RunSpec& spec, const std::filesystem::path& agent,
                             const FilmRequest& request, const std::string& who)
    : who_(who), request_(request) {
  Pipe pipe = MakePipe();
  const FileDescriptor input =
      MemoryFile(results::JsonText({{"spec", ToJson(spec)},
                                    {"agent", agent.string()},
                                    {"episode", request.episode},
                                    {"width", request.width},
                                    {"height", request.height},
                                    {"camera", request.camera},
                                    {"most_frames_per_second", request.most_frames_per_second}}));
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
  while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
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
  int status = 0;
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  throw Failure(ExitCode::kPluginCrashed,
                "the episode of " + who_ + " ended with " + DescribeWaitStatus(status));
}

std::optional<Frame> FilmedEpisode::Next() {
  if (pid_ < 0) return std::nullopt;
  const nlohmann::json line = results::ParseJsonOrDiscard(ReadLine());
  if (!line.is_object()) Fail();
  if (line.contains("end") || line.contains("error")) {
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
    if (line.contains("end")) return std::nullopt;
    throw Failure(static_cast<ExitCode>(WIFEXITED(status) ? WEXITSTATUS(status) : 70),
                  who_ + ": " + line["error"].get<std::string>());
  }
  frames_per_second_ = line.at("frames_per_second").get<double>();
  Frame frame;
  frame.decision = line.at("decision").get<std::uint64_t>();
  frame.seconds = line.at("seconds").get<double>();
  frame.episode_return = line.at("return").get<double>();
  frame.action = line.at("action").get<std::vector<double>>();
  frame.value = line.at("value").get<double>();
  frame.simulations = line.at("simulations").get<std::uint32_t>();
  frame.depth = line.at("depth").get<std::uint32_t>();
  frame.scene.width = static_cast<int>(request_.width);
  frame.scene.height = static_cast<int>(request_.height);
  frame.scene.rgb.resize(std::size_t{request_.width} * request_.height * 3);
  ReadExactly(reinterpret_cast<char*>(frame.scene.rgb.data()), frame.scene.rgb.size());
  return frame;
}

}  // namespace dreamsearch
