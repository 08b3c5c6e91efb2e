// control_task.cc - over 400 lines: an episode, its saved state and its pictures are of one engine.
#include "plugins/mujoco/control_task.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "dreamsearch/random.h"

namespace dreamsearch::mujoco {
namespace {

constexpr std::uint64_t kStateMagic = 0x31307473636d6473ull;  // "sdmcst01"

// FNV-1a.
std::uint64_t HashName(const std::string& name) {
  std::uint64_t hash = 14695981039346656037ull;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  return hash;
}

// Continues a 64-bit hash over whole doubles. Each step is a bijection of the hash
// so far, so a single changed bit anywhere changes the result.
std::uint64_t HashDoubles(const unsigned char* values, std::size_t count, std::uint64_t hash) {
  for (std::size_t i = 0; i < count; ++i) {
    std::uint64_t bits;
    std::memcpy(&bits, values + i * sizeof bits, sizeof bits);
    hash = (hash ^ bits) * 0x9e3779b97f4a7c15ull;
    hash ^= hash >> 32;
  }
  return hash;
}

// What else of mjData decides the future where the engine is MuJoCo 3: equalities that are
// switched, plugins, delayed sensors and actuators.
#if mjVERSION_HEADER >= 300
int EngineStateSize(const mjModel* model) { return mj_stateSize(model, mjSTATE_INTEGRATION); }
void GetEngineState(const mjModel* model, const mjData* data, double* state) {
  mj_getState(model, data, state, mjSTATE_INTEGRATION);
}
void SetEngineState(const mjModel* model, mjData* data, const double* state) {
  mj_setState(model, data, state, mjSTATE_INTEGRATION);
}
#else
int EngineStateSize(const mjModel*) { return 0; }
void GetEngineState(const mjModel*, const mjData*, double*) {}
void SetEngineState(const mjModel*, mjData*, const double*) {}
#endif

}  // namespace

struct ControlTask::StateHeader {
  std::uint64_t magic;
  std::uint64_t task;  // a hash of the task's name
  std::uint32_t steps;
  std::uint32_t running;
  std::uint64_t checksum;  // of steps, running and the doubles that follow

  std::uint64_t Checksum(const unsigned char* values, std::size_t count) const {
    return HashDoubles(values, count, magic ^ (std::uint64_t{steps} << 1 | running));
  }
};

ControlTask::ControlTask(TaskSettings settings)
    : name_(std::move(settings.name)),
      task_hash_(HashName(name_)),
      model_(std::move(settings.model)),
      data_(mj_makeData(model_.get())),
      rk4_(model_->opt.integrator == mjINT_RK4),
      substeps_(settings.substeps),
      parts_(std::move(settings.observation)),
      actuators_(std::move(settings.actuators)),
      action_low_(std::move(settings.action_low)),
      action_high_(std::move(settings.action_high)),
      made_of_(std::move(settings.made_of)),
      qpos_before_(model_->nq) {
  if (data_ == nullptr) throw EngineError("cannot allocate mjData");
  if (actuators_.empty()) {
    for (int i = 0; i < model_->nu; ++i) actuators_.push_back(i);
  }
  if (action_low_.empty()) {
    for (const int i : actuators_) {
      action_low_.push_back(model_->actuator_ctrlrange[2 * i]);
      action_high_.push_back(model_->actuator_ctrlrange[2 * i + 1]);
    }
  }
  for (const Part& part : parts_) observation_parts_.push_back({part.name.c_str(), part.size});
  spec_.observation = {observation_parts_.data(), observation_parts_.size()};
  for (const ObservationPart& part : observation_parts_) spec_.observation_size += part.size;
  spec_.action_size = actuators_.size();
  spec_.action_low = {action_low_.data(), action_low_.size()};
  spec_.action_high = {action_high_.data(), action_high_.size()};
  spec_.control_seconds = model_->opt.timestep * substeps_;
  spec_.substeps = static_cast<std::uint32_t>(substeps_);
  for (const auto& [name, value] : made_of_) ingredients_.push_back({name.c_str(), value.c_str()});
  spec_.ingredients = {ingredients_.data(), ingredients_.size()};
  spec_.episode_steps = settings.episode_steps;
  spec_.terminates = settings.terminates;
  spec_.return_low = settings.return_low;
  spec_.return_high = settings.return_high;
  LayOutState();
}

Status ControlTask::Reset(std::uint32_t seed, View<double> observation) noexcept {
  if (observation.size != spec_.observation_size) {
    return Error(StatusCode::kInvalidArgument,
                 "%s: Reset: expected %llu observation entries, got %llu", name_.c_str(),
                 static_cast<unsigned long long>(spec_.observation_size),
                 static_cast<unsigned long long>(observation.size));
  }
  running_ = false;
  try {
    NumpyRandom random(seed);
    seed_ = seed;
    std::fill(delayed_.begin(), delayed_.end(), 0.0);
    mj_resetData(model_.get(), data_.get());
    ForwardWithoutActuation();
    ClearWarnings();  // those of the default pose are nobody's concern
    DrawInitialState(random);
    mju_copy(qpos_before_.data(), data_->qpos, model_->nq);
    ForwardWithoutActuation();
    if (Status status = FirstWarning("in Reset"); !status.ok()) return status;
    ObserveWithNoise(0, observation);
  } catch (const std::exception& error) {
    return Fail("Reset", error.what());
  }
  steps_ = 0;
  running_ = true;
  PackState();
  return OkStatus();
}

Status ControlTask::Step(View<const double> action, View<double> observation,
                         StepResult* result) noexcept {
  if (!running_) {
    return Error(StatusCode::kFailedPrecondition, "%s: Step: no episode is under way; call Reset",
                 name_.c_str());
  }
  if (action.size != spec_.action_size || observation.size != spec_.observation_size) {
    return Error(StatusCode::kInvalidArgument,
                 "%s: Step: expected %llu action and %llu observation entries, got %llu and %llu",
                 name_.c_str(), static_cast<unsigned long long>(spec_.action_size),
                 static_cast<unsigned long long>(spec_.observation_size),
                 static_cast<unsigned long long>(action.size),
                 static_cast<unsigned long long>(observation.size));
  }
  for (std::uint64_t i = 0; i < action.size; ++i) {
    if (!std::isfinite(action[i])) {
      return Error(StatusCode::kInvalidArgument,
                   "%s: Step %u: action[%llu] is %g, expected a number", name_.c_str(), steps_ + 1,
                   static_cast<unsigned long long>(i), action[i]);
    }
  }
  bool terminal = false;
  try {
    Control(action);
    ClearWarnings();
    Advance(substeps_);
    if (Status status = FirstWarning("in the physics"); !status.ok()) {
      running_ = false;
      return status;
    }
    result->reward = Reward();
    terminal = Terminated();
    ObserveWithNoise(steps_ + 1, observation);
  } catch (const std::exception& error) {
    return Fail("Step", error.what());
  }
  ++steps_;
  running_ = !terminal && steps_ < spec_.episode_steps;
  result->discount = terminal ? 0 : 1;
  result->last = !running_;
  PackState();
  return OkStatus();
}

void ControlTask::Vary(const Variation& variation) {
  variation_ = variation;
  ChangeModel(variation, model_.get());
  delayed_.assign(variation.delay_steps * spec_.action_size, 0.0);
  LayOutState();
}

void ControlTask::Control(View<const double> action) {
  const double* now = action.data;
  if (!delayed_.empty()) {
    delayed_.insert(delayed_.end(), action.begin(), action.end());
    now = delayed_.data();
  }
  for (std::size_t i = 0; i < actuators_.size(); ++i) data_->ctrl[actuators_[i]] = now[i];
  if (!delayed_.empty()) {
    delayed_.erase(delayed_.begin(), delayed_.begin() + static_cast<std::ptrdiff_t>(action.size));
  }
}

// The noise of a step is that of the episode's seed and the step, so that a restored state sees
// the noise it would have seen.
void ControlTask::ObserveWithNoise(std::uint32_t step, View<double> observation) const {
  Observe(observation.data);
  if (variation_.observation_noise == 0) return;
  Random random(DeriveSeed(seed_, step));
  for (double& entry : observation) entry += variation_.observation_noise * random.Normal();
}

// What decides the future: time, positions, velocities, activations, the solver's
// starting point, the model values that the reset wrote, actions that have not acted yet and
// the seed of the noise. All else mj_step1 computes from these.
void ControlTask::LayOutState() {
  std::size_t size = 1 + model_->nq + 2 * model_->nv + model_->na;
  size += static_cast<std::size_t>(EngineStateSize(model_.get()));
  size += delayed_.size() + (variation_.observation_noise != 0 ? 1 : 0);
  for (const auto& values : written_) size += values.size();
  packed_.resize(size);
  state_bytes_ = sizeof(StateHeader) + size * sizeof(double);
  PackState();
}

void ControlTask::PackState() {
  double* out = packed_.data();
  GetEngineState(model_.get(), data_.get(), out);
  out += EngineStateSize(model_.get());
  *out++ = data_->time;
  out = std::copy_n(qpos_before_.data(), model_->nq, out);
  out = std::copy_n(data_->qvel, model_->nv, out);
  out = std::copy_n(data_->act, model_->na, out);
  out = std::copy_n(data_->qacc_warmstart, model_->nv, out);
  for (const auto& values : written_) out = std::copy(values.begin(), values.end(), out);
  out = std::copy(delayed_.begin(), delayed_.end(), out);
  if (variation_.observation_noise != 0) *out = seed_;
  packed_steps_ = steps_;
  packed_running_ = running_;
}

Status ControlTask::SaveState(View<std::byte> state) const noexcept {
  if (state.size != state_bytes_) {
    return Error(StatusCode::kInvalidArgument, "%s: SaveState: expected %llu bytes, got %llu",
                 name_.c_str(), static_cast<unsigned long long>(state_bytes_),
                 static_cast<unsigned long long>(state.size));
  }
  const std::size_t bytes = packed_.size() * sizeof(double);
  std::memcpy(state.data + sizeof(StateHeader), packed_.data(), bytes);
  StateHeader header = {.magic = kStateMagic,
                        .task = task_hash_,
                        .steps = packed_steps_,
                        .running = packed_running_,
                        .checksum = 0};
  header.checksum =
      header.Checksum(reinterpret_cast<const unsigned char*>(packed_.data()), packed_.size());
  std::memcpy(state.data, &header, sizeof header);
  return OkStatus();
}

Status ControlTask::RestoreState(View<const std::byte> state) noexcept {
  if (state.size != state_bytes_) {
    return Error(StatusCode::kDataLoss, "%s: RestoreState: expected %llu bytes, got %llu",
                 name_.c_str(), static_cast<unsigned long long>(state_bytes_),
                 static_cast<unsigned long long>(state.size));
  }
  StateHeader header;
  std::memcpy(&header, state.data, sizeof header);
  const auto* values = reinterpret_cast<const unsigned char*>(state.data + sizeof header);
  if (header.magic != kStateMagic || header.task != task_hash_) {
    return Error(StatusCode::kDataLoss, "%s: RestoreState: these bytes are not a state of %s",
                 name_.c_str(), name_.c_str());
  }
  if (header.running > 1 || header.checksum != header.Checksum(values, packed_.size())) {
    return Error(StatusCode::kDataLoss, "%s: RestoreState: the state is damaged (checksum)",
                 name_.c_str());
  }
  try {
    std::memcpy(packed_.data(), values, packed_.size() * sizeof(double));
    const double* in = packed_.data();
    SetEngineState(model_.get(), data_.get(), in);
    in += EngineStateSize(model_.get());
    data_->time = *in++;
    const auto take = [&in](mjtNum* to, std::size_t count) {
      std::copy_n(in, count, to);
      in += count;
    };
    take(data_->qpos, model_->nq);
    take(data_->qvel, model_->nv);
    take(data_->act, model_->na);
    take(data_->qacc_warmstart, model_->nv);
    for (const auto& written : written_) take(written.data(), written.size());
    take(delayed_.data(), delayed_.size());
    if (variation_.observation_noise != 0) seed_ = static_cast<std::uint32_t>(*in);
    mju_copy(qpos_before_.data(), data_->qpos, model_->nq);
    SetConstants();
    ClearWarnings();
    mj_step1(model_.get(), data_.get());
    steps_ = packed_steps_ = header.steps;
    running_ = packed_running_ = header.running != 0;
    if (Status status = FirstWarning("in RestoreState"); !status.ok()) {
      running_ = false;
      return status;
    }
  } catch (const std::exception& error) {
    return Fail("RestoreState", error.what());
  }
  return OkStatus();
}

Status ControlTask::Render(const RenderRequest& request, View<std::uint8_t> rgb) noexcept {
  constexpr std::uint32_t kLargest = 4096;
  if (request.width == 0 || request.height == 0 || request.width > kLargest ||
      request.height > kLargest || rgb.size != std::uint64_t{request.width} * request.height * 3) {
    return Error(StatusCode::kInvalidArgument,
                 "%s: Render: expected 1 to %u pixels a side and 3 bytes for each, got %u x %u and "
                 "%llu bytes",
                 name_.c_str(), kLargest, request.width, request.height,
                 static_cast<unsigned long long>(rgb.size));
  }
  try {
    if (renderer_ == nullptr) renderer_ = std::make_unique<Renderer>(model_.get());
    renderer_->Draw(data_.get(), static_cast<int>(request.camera), static_cast<int>(request.width),
                    static_cast<int>(request.height), rgb.data);
    return OkStatus();
  } catch (const std::exception& error) {
    return Error(StatusCode::kFailedPrecondition, "%s: Render: %s", name_.c_str(), error.what());
  }
}

void ControlTask::DeclareWritten(mjtNum* values, int count) {
  written_.emplace_back(values, count);
  LayOutState();
}

void ControlTask::AdoptPhysics(std::uint32_t steps) {
  mju_copy(qpos_before_.data(), data_->qpos, model_->nq);
  mj_step1(model_.get(), data_.get());
  steps_ = steps;
  running_ = steps < spec_.episode_steps;
  PackState();
}

void ControlTask::ForwardWithoutActuation() {
  struct RestoreFlags {
    int& flags;
    const int saved;
    ~RestoreFlags() { flags = saved; }
  } restore{model_->opt.disableflags, model_->opt.disableflags};
  model_->opt.disableflags |= mjDSBL_ACTUATION;
  mj_forward(model_.get(), data_.get());
}

void ControlTask::Advance(int physics_steps) {
  int remaining = physics_steps;
  if (!rk4_) {
    mj_step2(model_.get(), data_.get());
    --remaining;
  }
  for (; remaining > 0; --remaining) mj_step(model_.get(), data_.get());
  mju_copy(qpos_before_.data(), data_->qpos, model_->nq);
  mj_step1(model_.get(), data_.get());
}

void ControlTask::RandomiseJoints(NumpyRandom& random) {
  for (int j = 0; j < model_->njnt; ++j) {
    mjtNum* qpos = data_->qpos + model_->jnt_qposadr[j];
    const int type = model_->jnt_type[j];
    if (type == mjJNT_FREE) {
      double q[4];
      for (double& x : q) x = random.Uniform();
      const double norm = QuaternionNorm(q);
      for (int i = 0; i < 4; ++i) qpos[3 + i] = q[i] / norm;
    } else if (type == mjJNT_BALL) {
      throw EngineError("ball joints cannot be drawn uniformly");
    } else if (model_->jnt_limited[j]) {
      *qpos = random.Uniform(model_->jnt_range[2 * j], model_->jnt_range[2 * j + 1]);
    } else if (type == mjJNT_HINGE) {
      *qpos = random.Uniform(-std::numbers::pi, std::numbers::pi);
    }
  }
}

void ControlTask::ClearWarnings() {
  for (mjWarningStat& warning : data_->warning) warning.number = 0;
}

Status ControlTask::FirstWarning(const char* when) const {
  for (int i = 0; i < mjNWARNING; ++i) {
    if (data_->warning[i].number == 0) continue;
    return Error(StatusCode::kDiverged, "%s: engine warning %s, step %u of the episode: %s",
                 name_.c_str(), when, running_ ? steps_ + 1 : 0,
                 mju_warningText(i, data_->warning[i].lastinfo));
  }
  return OkStatus();
}

// After an exception the engine's scratch stack is anyone's guess: start afresh.
Status ControlTask::Fail(const char* call, const char* what) noexcept {
  running_ = false;
  mj_resetData(model_.get(), data_.get());
  return Error(StatusCode::kInternal, "%s: %s, step %u of the episode: %s", name_.c_str(), call,
               steps_ + 1, what);
}

int ControlTask::Id(mjtObj type, const char* name) const {
  const int id = mj_name2id(model_.get(), type, name);
  if (id < 0) {
    throw EngineError("the model has no " + std::string(mju_type2Str(type)) + " '" + name + "'");
  }
  return id;
}

int ControlTask::QposAddress(const char* joint) const {
  return model_->jnt_qposadr[Id(mjOBJ_JOINT, joint)];
}

int ControlTask::DofAddress(const char* joint) const {
  return model_->jnt_dofadr[Id(mjOBJ_JOINT, joint)];
}

const mjtNum* ControlTask::Sensor(const char* name) const {
  return data_->sensordata + model_->sensor_adr[Id(mjOBJ_SENSOR, name)];
}

double QuaternionNorm(const double* q) {
  return std::sqrt((q[0] * q[0] + q[2] * q[2]) + (q[1] * q[1] + q[3] * q[3]));
}

}  // namespace dreamsearch::mujoco
