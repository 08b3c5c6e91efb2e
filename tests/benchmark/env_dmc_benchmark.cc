// env_dmc_benchmark.cc - what a control step costs beyond the engine's own work.
//
//     tests/bin/env_dmc_benchmark [TASK...]
//
// Task by task, blocks of our steps (action, physics, reward, observation) and of
// a bare loop of the same engine calls on the same model, states and actions take
// turns. Both are measured in CPU time of the thread; the figure of a task is the
// median ratio of neighbouring blocks. At the end of each episode both must be in
// the same state to the bit. Also shown: our step in microseconds, and restoring a
// state and stepping, as a search does it, against stepping alone. Exits with 1 if
// the median over tasks is above 1.05 or a task above 1.15.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <string>
#include <vector>

#include "plugins/mujoco/numpy_random.h"
#include "tasks.h"

namespace dreamsearch::dmc {
namespace {

constexpr double kMostMedian = 1.05;
constexpr double kMostTask = 1.15;
constexpr double kSecondsATask = 2;
constexpr int kEpisodeSteps = 1000;

double CpuSeconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// The engine calls of one control step, and nothing else.
void BareStep(mjModel* model, mjData* data, const double* action, int substeps) {
  mju_copy(data->ctrl, action, model->nu);
  int remaining = substeps;
  if (model->opt.integrator != mjINT_RK4) {
    mj_step2(model, data);
    --remaining;
  }
  for (; remaining > 0; --remaining) mj_step(model, data);
  mj_step1(model, data);
}

struct Figures {
  double ratio = 0;              // our step / bare step
  double our_microseconds = 0;   // a control step
  double bare_microseconds = 0;  // a control step
  double restore_ratio = 0;      // restore and step / our step
};

[[noreturn]] void Stop(const std::string& task, const char* what) {
  std::fprintf(stderr, "%s: %s\n", task.c_str(), what);
  std::exit(2);
}

Figures Measure(const TaskEntry& entry) {
  ControlTask* task = entry.make();
  Environment* environment = task;
  const EnvironmentSpec& spec = environment->spec();
  const std::size_t actions = spec.action_size;
  std::vector<double> observation(spec.observation_size);
  std::vector<std::byte> state(task->state_bytes());
  std::vector<double> action_table(kEpisodeSteps * actions);
  const View<double> observation_view{observation.data(), observation.size()};
  const View<std::byte> state_view{state.data(), state.size()};
  const int substeps = static_cast<int>(spec.substeps);
  ModelPtr bare_model(mj_copyModel(nullptr, task->model()));
  DataPtr bare_data(mj_makeData(bare_model.get()));

  std::vector<double> ratios, restore_ratios;
  double our_seconds = 0, bare_seconds = 0;
  int steps = 0;  // of either
  double spent = 0;
  for (std::uint32_t seed = 0; spent < kSecondsATask || ratios.size() < 9; ++seed) {
    if (!environment->Reset(seed, observation_view).ok()) Stop(entry.name, "reset failed");
    mj_copyModel(bare_model.get(), task->model());
    mj_copyData(bare_data.get(), bare_model.get(), task->data());
    NumpyRandom random(seed + 12345);
    for (int i = 0; i < kEpisodeSteps; ++i) {
      for (std::size_t j = 0; j < actions; ++j) {
        action_table[i * actions + j] = random.Uniform(spec.action_low[j], spec.action_high[j]);
      }
    }

    const auto ours = [&](int begin, int end) {
      const double start = CpuSeconds();
      StepResult result;
      for (int i = begin; i < end; ++i) {
        const View<const double> action{action_table.data() + i * actions, actions};
        if (!environment->Step(action, observation_view, &result).ok()) {
          Stop(entry.name, "step failed");
        }
      }
      return CpuSeconds() - start;
    };
    const auto bare = [&](int begin, int end) {
      const double start = CpuSeconds();
      for (int i = begin; i < end; ++i) {
        BareStep(bare_model.get(), bare_data.get(), action_table.data() + i * actions, substeps);
      }
      return CpuSeconds() - start;
    };

    // The physics of one stretch cost much the same on both sides, as the states
    // are the same; which side goes first alternates.
    constexpr int kBlock = 50;
    for (int begin = 0; begin < kEpisodeSteps; begin += kBlock) {
      const bool ours_first = (begin / kBlock + seed) % 2 == 0;
      const double first = ours_first ? ours(begin, begin + kBlock) : bare(begin, begin + kBlock);
      const double second = ours_first ? bare(begin, begin + kBlock) : ours(begin, begin + kBlock);
      ratios.push_back(ours_first ? first / second : second / first);
      our_seconds += ours_first ? first : second;
      bare_seconds += ours_first ? second : first;
      steps += kBlock;
      spent += first + second;
    }
    if (std::memcmp(bare_data->qpos, task->data()->qpos,
                    sizeof(mjtNum) * static_cast<std::size_t>(bare_model->nq)) != 0) {
      Stop(entry.name, "the bare loop went elsewhere");
    }

    // One state, many actions from it: with and without going back to it.
    if (!environment->Reset(seed, observation_view).ok()) Stop(entry.name, "reset failed");
    ours(0, 100);
    if (!task->SaveState(state_view).ok()) Stop(entry.name, "save failed");
    for (int begin = 100; begin < 300; begin += kBlock) {
      const double start = CpuSeconds();
      StepResult result;
      for (int i = begin; i < begin + kBlock; ++i) {
        if (!task->RestoreState(state_view).ok()) Stop(entry.name, "restore failed");
        const View<const double> action{action_table.data() + i * actions, actions};
        if (!environment->Step(action, observation_view, &result).ok()) {
          Stop(entry.name, "step failed");
        }
      }
      const double with_restore = CpuSeconds() - start;
      const double without = ours(begin, begin + kBlock);
      restore_ratios.push_back(with_restore / without);
    }
  }
  environment->Destroy();
  return {Median(ratios), 1e6 * our_seconds / steps, 1e6 * bare_seconds / steps,
          Median(restore_ratios)};
}

int Run(const std::vector<std::string>& wanted) {
  std::printf("%-26s %14s %14s %12s %16s\n", "task", "our us/step", "bare us/step", "ours/bare",
              "restore+step/step");
  std::vector<double> ratios;
  for (const TaskEntry& entry : kTasks) {
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), entry.name) == wanted.end()) {
      continue;
    }
    const Figures figures = Measure(entry);
    std::printf("%-26s %14.2f %14.2f %12.3f %16.2f\n", entry.name, figures.our_microseconds,
                figures.bare_microseconds, figures.ratio, figures.restore_ratio);
    std::fflush(stdout);
    ratios.push_back(figures.ratio);
  }
  if (ratios.empty()) Stop(wanted[0], "no such task");
  const double median = Median(ratios);
  const double worst = *std::max_element(ratios.begin(), ratios.end());
  std::printf("median %.3f (at most %.2f), worst %.3f (at most %.2f)\n", median, kMostMedian, worst,
              kMostTask);
  return median <= kMostMedian && worst <= kMostTask ? 0 : 1;
}

}  // namespace
}  // namespace dreamsearch::dmc

int main(int argc, char** argv) {
  return dreamsearch::dmc::Run(std::vector<std::string>(argv + 1, argv + argc));
}
