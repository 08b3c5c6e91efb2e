#include "plugins/env_gym/python_environment.h"

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "plugins/env_gym/bridge.h"

namespace dreamsearch::gym {
namespace {

constexpr std::uint32_t kDefaultEpisodeSteps = 1000;
constexpr std::uint64_t kStateMagic = 0x31307473796d7967ull;  // "gymyst01"

std::string_view Bytes(View<const double> numbers) {
  return {reinterpret_cast<const char*>(numbers.data), numbers.size * sizeof(double)};
}

// bridge.py's answer to a step.
struct StepAnswer {
  double reward;
  bool terminated;
  bool truncated;
  static constexpr std::size_t kSize = sizeof(double) + 2;
};

}  // namespace

struct PythonEnvironment::StateHeader {
  std::uint64_t magic = kStateMagic;
  std::uint32_t seed = 0;
  std::uint32_t steps = 0;
  std::uint32_t running = 0;
  std::uint32_t unused = 0;
};

PythonEnvironment::PythonEnvironment(const PythonEnvironmentSettings& settings)
    : settings_(settings),
      process_(
          std::make_unique<PythonProcess>(settings.interpreter, std::string(BridgeProgram()))) {
  using Json = nlohmann::json;
  Json request = {{"kind", settings.kind},
                  {"id", settings.id},
                  {"module", settings.module},
                  {"action_low", nullptr},
                  {"action_high", nullptr}};
  request["arguments"] = Json::parse(settings.arguments, nullptr, false);
  if (!request["arguments"].is_object()) {
    throw std::invalid_argument("arguments: expected a JSON object such as {\"g\": 9.8}, found '" +
                                settings.arguments + "'");
  }
  if (settings.action_low < settings.action_high) {
    request["action_low"] = settings.action_low;
    request["action_high"] = settings.action_high;
  }
  const Json answer = Json::parse(process_->Ask('M', request.dump()));
  for (const Json& part : answer.at("observation")) {
    names_.push_back(part.at(0).get<std::string>());
    parts_.push_back({nullptr, part.at(1).get<std::uint64_t>()});
    spec_.observation_size += parts_.back().size;
  }
  for (std::size_t i = 0; i < parts_.size(); ++i) parts_[i].name = names_[i].c_str();
  low_ = answer.at("action_low").get<std::vector<double>>();
  high_ = answer.at("action_high").get<std::vector<double>>();
  own_state_bytes_ = answer.at("state_bytes").get<std::uint64_t>();
  made_of_ = answer.at("made_of").get<std::map<std::string, std::string>>();
  for (const auto& [name, value] : made_of_) ingredients_.push_back({name.c_str(), value.c_str()});
  const auto own_limit = answer.at("episode_steps").get<std::uint32_t>();
  spec_.observation = {parts_.data(), parts_.size()};
  spec_.action_size = low_.size();
  spec_.action_low = {low_.data(), low_.size()};
  spec_.action_high = {high_.data(), high_.size()};
  spec_.control_seconds = answer.at("control_seconds").get<double>();
  spec_.episode_steps = settings.episode_steps != 0 ? settings.episode_steps
                        : own_limit != 0            ? own_limit
                                                    : kDefaultEpisodeSteps;
  if (settings.episode_steps == 0 && own_limit == 0) {
    notice_ = settings.kind + ":" + settings.id +
              " has no time limit of its own; an episode ends " + "after " +
              std::to_string(kDefaultEpisodeSteps) + " environment steps (env.episode_steps)";
    spec_.notice = notice_.c_str();
  }
  spec_.ingredients = {ingredients_.data(), ingredients_.size()};
  spec_.terminates = settings.kind == "gym";
  state_bytes_ = sizeof(StateHeader) +
                 (own_state_bytes_ != 0 ? own_state_bytes_
                                        : spec_.episode_steps * spec_.action_size * sizeof(double));
  actions_.reserve(spec_.episode_steps * spec_.action_size);
}

template <typename Call>
Status PythonEnvironment::Guarded(const char* what, const Call& call) noexcept {
  try {
    return call();
  } catch (const std::exception& error) {
    running_ = false;
    return Error(StatusCode::kInternal, "%s: %s: %s", settings_.id.c_str(), what, error.what());
  }
}

Status PythonEnvironment::Observe(std::string_view numbers, View<double> observation) const {
  if (numbers.size() != observation.size * sizeof(double)) {
    return Error(StatusCode::kInvalidArgument,
                 "%s: expected %llu observation entries, the environment gave %zu",
                 settings_.id.c_str(), static_cast<unsigned long long>(observation.size),
                 numbers.size() / sizeof(double));
  }
  std::memcpy(observation.data, numbers.data(), numbers.size());
  for (std::uint64_t i = 0; i < observation.size; ++i) {
    if (std::isfinite(observation[i])) continue;
    return Error(StatusCode::kDiverged, "%s: step %u: observation %llu is %g", settings_.id.c_str(),
                 steps_, static_cast<unsigned long long>(i), observation[i]);
  }
  return OkStatus();
}

Status PythonEnvironment::Start(std::uint32_t seed, View<double> observation) {
  running_ = false;
  seed_ = seed;
  steps_ = 0;
  actions_.clear();
  const std::string_view answer =
      process_->Ask('R', {reinterpret_cast<const char*>(&seed), sizeof seed});
  if (Status status = Observe(answer, observation); !status.ok()) return status;
  running_ = true;
  return OkStatus();
}

Status PythonEnvironment::Advance(View<const double> action, View<double> observation,
                                  StepResult* result) {
  const std::string_view answer = process_->Ask('S', Bytes(action));
  if (answer.size() < StepAnswer::kSize) throw ProcessError("a step's answer is cut");
  StepAnswer given{};
  std::memcpy(&given.reward, answer.data(), sizeof given.reward);
  given.terminated = answer[sizeof(double)] != 0;
  given.truncated = answer[sizeof(double) + 1] != 0;
  ++steps_;
  actions_.insert(actions_.end(), action.begin(), action.end());
  running_ = !given.terminated && !given.truncated && steps_ < spec_.episode_steps;
  result->reward = given.reward;
  result->discount = given.terminated ? 0 : 1;
  result->last = !running_;
  Status status = Observe(answer.substr(StepAnswer::kSize), observation);
  if (status.ok() && !std::isfinite(given.reward)) {
    status = Error(StatusCode::kDiverged, "%s: step %u: the reward is %g", settings_.id.c_str(),
                   steps_, given.reward);
  }
  if (!status.ok()) running_ = false;
  return status;
}

// Before anything is asked of Python: a refused call must leave the episode as it is.
Status PythonEnvironment::CheckRoom(const char* call, View<double> observation) const noexcept {
  if (observation.size == spec_.observation_size) return OkStatus();
  return Error(StatusCode::kInvalidArgument, "%s: %s: expected room for %llu numbers, got %llu",
               settings_.id.c_str(), call, static_cast<unsigned long long>(spec_.observation_size),
               static_cast<unsigned long long>(observation.size));
}

Status PythonEnvironment::Reset(std::uint32_t seed, View<double> observation) noexcept {
  if (Status status = CheckRoom("Reset", observation); !status.ok()) return status;
  return Guarded("reset", [&] { return Start(seed, observation); });
}

Status PythonEnvironment::Step(View<const double> action, View<double> observation,
                               StepResult* result) noexcept {
  if (!running_) {
    return Error(StatusCode::kFailedPrecondition, "%s: Step: no episode is under way; call Reset",
                 settings_.id.c_str());
  }
  if (action.size != spec_.action_size) {
    return Error(StatusCode::kInvalidArgument, "%s: Step: expected %llu action entries, got %llu",
                 settings_.id.c_str(), static_cast<unsigned long long>(spec_.action_size),
                 static_cast<unsigned long long>(action.size));
  }
  for (std::uint64_t i = 0; i < action.size; ++i) {
    if (!std::isfinite(action[i])) {
      return Error(StatusCode::kInvalidArgument, "%s: Step %u: action[%llu] is %g",
                   settings_.id.c_str(), steps_ + 1, static_cast<unsigned long long>(i), action[i]);
    }
  }
  if (Status status = CheckRoom("Step", observation); !status.ok()) return status;
  return Guarded("step", [&] { return Advance(action, observation, result); });
}

Status PythonEnvironment::SaveState(View<std::byte> state) const noexcept {
  if (state.size != state_bytes_) {
    return Error(StatusCode::kInvalidArgument, "%s: SaveState: expected %llu bytes, got %llu",
                 settings_.id.c_str(), static_cast<unsigned long long>(state_bytes_),
                 static_cast<unsigned long long>(state.size));
  }
  std::memset(state.data, 0, state.size);
  const StateHeader header{kStateMagic, seed_, steps_, running_ ? 1u : 0u, 0};
  std::memcpy(state.data, &header, sizeof header);
  std::byte* const body = state.data + sizeof header;
  if (own_state_bytes_ == 0) {
    if (!actions_.empty()) std::memcpy(body, actions_.data(), actions_.size() * sizeof(double));
    return OkStatus();
  }
  try {
    const std::string_view saved = process_->Ask('G', {});
    if (saved.size() != own_state_bytes_) {
      return Error(
          StatusCode::kInternal, "%s: save_state gave %zu bytes, after the first reset %llu",
          settings_.id.c_str(), saved.size(), static_cast<unsigned long long>(own_state_bytes_));
    }
    std::memcpy(body, saved.data(), saved.size());
    return OkStatus();
  } catch (const std::exception& error) {
    return Error(StatusCode::kInternal, "%s: save_state: %s", settings_.id.c_str(), error.what());
  }
}

Status PythonEnvironment::RestoreState(View<const std::byte> state) noexcept {
  StateHeader header;
  if (state.size == state_bytes_) std::memcpy(&header, state.data, sizeof header);
  if (state.size != state_bytes_ || header.magic != kStateMagic ||
      header.steps > spec_.episode_steps) {
    return Error(StatusCode::kDataLoss, "%s: the bytes are no saved state", settings_.id.c_str());
  }
  const std::byte* const body = state.data + sizeof header;
  return Guarded("restore", [&]() -> Status {
    if (own_state_bytes_ != 0) {
      process_->Ask('P', {reinterpret_cast<const char*>(body), own_state_bytes_});
    } else {
      std::vector<double> wanted(header.steps * spec_.action_size);
      if (!wanted.empty()) std::memcpy(wanted.data(), body, wanted.size() * sizeof(double));
      std::vector<double> observation(spec_.observation_size);
      const View<double> into{observation.data(), observation.size()};
      // From where this episode is, if the state lies on its way.
      const bool ahead = running_ && header.seed == seed_ && header.steps >= steps_ &&
                         std::equal(actions_.begin(), actions_.end(), wanted.begin());
      if (!ahead) {
        if (Status status = Start(header.seed, into); !status.ok()) return status;
      }
      StepResult result;
      for (std::uint64_t step = steps_; step < header.steps; ++step) {
        const View<const double> action{wanted.data() + step * spec_.action_size,
                                        spec_.action_size};
        if (Status status = Advance(action, into, &result); !status.ok()) return status;
      }
    }
    seed_ = header.seed;
    steps_ = header.steps;
    running_ = header.running != 0;
    return OkStatus();
  });
}

Status PythonEnvironment::Render(const RenderRequest& request, View<std::uint8_t> rgb) noexcept {
  const std::uint32_t size[] = {request.width, request.height, request.camera};
  if (rgb.size != std::uint64_t{request.width} * request.height * 3) {
    return Error(StatusCode::kInvalidArgument, "%s: Render: expected width * height * 3 bytes",
                 settings_.id.c_str());
  }
  try {
    const std::string_view picture =
        process_->Ask('V', {reinterpret_cast<const char*>(size), sizeof size});
    if (picture.size() != rgb.size) throw ProcessError("a picture of another size");
    std::memcpy(rgb.data, picture.data(), picture.size());
    return OkStatus();
  } catch (const std::exception& error) {
    return Error(StatusCode::kFailedPrecondition, "%s: render: %s", settings_.id.c_str(),
                 error.what());
  }
}

}  // namespace dreamsearch::gym
