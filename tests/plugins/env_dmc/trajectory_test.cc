// Our tasks against recorded episodes: resets, single steps, free runs, probes.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "tests/plugins/env_dmc/reference_data.h"

namespace dreamsearch::dmc {
namespace {

View<double> ViewOfVector(std::vector<double>& values) { return {values.data(), values.size()}; }
View<const double> ConstViewOf(const std::vector<double>& values) {
  return {values.data(), values.size()};
}

struct Recording {
  std::string path;
  std::string task;
  Json header;
  std::vector<Json> steps;
};

// Calls visit(recording) for every recorded episode.
template <typename Visit>
void ForEachRecording(Visit visit) {
  int count = 0;
  for (const std::string& path : ReferenceFiles("trajectories")) {
    std::vector<Json> lines = ReadJsonLines(path);
    const std::string task = TaskName(lines.at(0));
    if (!HasTask(task)) continue;  // one that is not offered
    SCOPED_TRACE(path);
    visit(Recording{path, task, lines[0], {lines.begin() + 1, lines.end()}});
    ++count;
  }
  EXPECT_GE(count, static_cast<int>(std::size(kTasks)));
}

void SetPhysics(const Json& state, ControlTask* task) {
  mjData* data = task->data();
  const mjModel* model = task->model();
  for (int i = 0; i < model->nq; ++i) data->qpos[i] = state.at("q")[i];
  for (int i = 0; i < model->nv; ++i) data->qvel[i] = state.at("v")[i];
  for (int i = 0; i < model->na; ++i) data->act[i] = state.at("act")[i];
  if (state.contains("w")) {
    for (int i = 0; i < model->nv; ++i) data->qacc_warmstart[i] = state.at("w")[i];
  }
}

TEST(Trajectory, SpecificationIsTheRecordedOne) {
  ForEachRecording([](const Recording& recording) {
    const TaskPtr task = MakeTask(recording.task);
    const EnvironmentSpec& spec = task->spec();
    const Json& header = recording.header;
    EXPECT_EQ(spec.substeps, header.at("n_sub_steps"));
    EXPECT_EQ(spec.episode_steps, header.at("step_limit"));
    EXPECT_DOUBLE_EQ(spec.control_seconds,
                     header.at("timestep").get<double>() * header.at("n_sub_steps").get<int>());
    ASSERT_EQ(spec.action_size, header.at("nu"));
    for (std::uint64_t i = 0; i < spec.action_size; ++i) {
      EXPECT_EQ(spec.action_low[i], header.at("action_min")[i]);
      EXPECT_EQ(spec.action_high[i], header.at("action_max")[i]);
    }
    const Json& parts = header.at("obs");
    ASSERT_EQ(spec.observation.size, parts.size());
    std::uint64_t total = 0;
    for (std::uint64_t i = 0; i < parts.size(); ++i) {
      EXPECT_EQ(spec.observation[i].name, parts[i].at("name"));
      std::uint64_t size = 1;
      for (const Json& extent : parts[i].at("shape")) size *= extent.get<std::uint64_t>();
      EXPECT_EQ(spec.observation[i].size, size);
      total += size;
    }
    EXPECT_EQ(spec.observation_size, total);
  });
}

TEST(Trajectory, ResetGivesTheInitialStateOfTheNumpySeed) {
  ForEachRecording([](const Recording& recording) {
    const TaskPtr task = MakeTask(recording.task);
    std::vector<double> observation(task->spec().observation_size);
    const Status status = task->Reset(recording.header.at("seed"), ViewOfVector(observation));
    ASSERT_TRUE(status.ok()) << status.message;
    const Json& initial = recording.header.at("initial");
    const double q = LargestDifference(initial.at("q"), task->data()->qpos);
    const double v = LargestDifference(initial.at("v"), task->data()->qvel);
    const double o = LargestDifference(initial.at("o"), observation.data());
    EXPECT_LE(q, 1e-12);
    EXPECT_LE(v, 1e-12);
    EXPECT_LE(o, 1e-12);
    if (initial.contains("act")) {
      EXPECT_LE(LargestDifference(initial.at("act"), task->data()->act), 1e-12);
    }
    EXPECT_EQ(task->data()->ncon, initial.at("ncon"));
    EXPECT_EQ(task->data()->time, 0);
    Show("reset " + Stem(recording.path), std::max({q, v, o}));

    // The model fields that the reset wrote: writing the recorded rows changes nothing.
    const ModelPtr before(mj_copyModel(nullptr, task->model()));
    WriteModelFields(initial.at("model"), task->model());
    const auto same = [&](const mjtNum* a, const mjtNum* b, int n) {
      for (int i = 0; i < n; ++i) EXPECT_NEAR(a[i], b[i], 1e-12);
    };
    const mjModel* after = task->model();
    same(before->body_pos, after->body_pos, 3 * after->nbody);
    same(before->body_quat, after->body_quat, 4 * after->nbody);
    same(before->dof_damping, after->dof_damping, after->nv);
    same(before->geom_pos, after->geom_pos, 3 * after->ngeom);
    same(before->geom_size, after->geom_size, 3 * after->ngeom);
    same(before->light_pos, after->light_pos, 3 * after->nlight);
    same(before->site_pos, after->site_pos, 3 * after->nsite);
    same(before->site_size, after->site_size, 3 * after->nsite);
  });
}

TEST(Trajectory, EveryStepFromARecordedStateGivesTheRecordedStep) {
  ForEachRecording([](const Recording& recording) {
    const TaskPtr task = MakeTask(recording.task);
    std::vector<double> observation(task->spec().observation_size);
    ASSERT_TRUE(task->Reset(recording.header.at("seed"), ViewOfVector(observation)).ok());
    const Json* from = &recording.header.at("initial");
    double largest = 0;
    for (const Json& step : recording.steps) {
      SetPhysics(*from, task.get());
      task->AdoptPhysics(step.at("k").get<std::uint32_t>() - 1);
      const std::vector<double> action = step.at("a");
      StepResult result;
      const Status status = task->Step(ConstViewOf(action), ViewOfVector(observation), &result);
      ASSERT_TRUE(status.ok()) << status.message;
      const double q = LargestDifference(step.at("q"), task->data()->qpos);
      const double v = LargestDifference(step.at("v"), task->data()->qvel);
      const double o = LargestDifference(step.at("o"), observation.data());
      const double r = std::abs(step.at("r").get<double>() - result.reward);
      ASSERT_LE(q, 1e-9) << "step " << step.at("k");
      ASSERT_LE(v, 1e-9) << "step " << step.at("k");
      ASSERT_LE(o, 1e-9) << "step " << step.at("k");
      ASSERT_LE(r, 1e-9) << "step " << step.at("k");
      if (step.contains("act")) {
        ASSERT_LE(LargestDifference(step.at("act"), task->data()->act), 1e-9);
      }
      EXPECT_EQ(result.discount, step.at("d"));
      EXPECT_EQ(result.last, step.at("last"));
      largest = std::max({largest, q, v, o, r});
      from = &step;
    }
    Show("single steps " + Stem(recording.path), largest);
  });
}

// What a nudge of 1e-10 grew to when the reference was nudged bounds what rounding
// may grow to here; below 1e-12 it is rounding itself.
TEST(Trajectory, RunFreelyStaysWithinTheRecordedSensitivity) {
  const Json sensitivity = ReadJson(ReferenceFile("sensitivity.json"));
  ForEachRecording([&](const Recording& recording) {
    const TaskPtr task = MakeTask(recording.task);
    std::vector<double> observation(task->spec().observation_size);
    const std::uint32_t seed = recording.header.at("seed");
    ASSERT_TRUE(task->Reset(seed, ViewOfVector(observation)).ok());
    const Json& growth = sensitivity.at(recording.task).at(seed);
    ASSERT_EQ(growth.at("seed"), seed);
    double largest = 0;
    for (const Json& step : recording.steps) {
      const std::vector<double> action = step.at("a");
      StepResult result;
      ASSERT_TRUE(task->Step(ConstViewOf(action), ViewOfVector(observation), &result).ok());
      const std::string key = "step_" + std::to_string(step.at("k").get<int>());
      const double o = LargestDifference(step.at("o"), observation.data());
      largest = std::max(largest, o);
      if (!growth.contains(key)) continue;
      EXPECT_LE(o, std::max(1e-12, growth.at(key).get<double>())) << key;
    }
    Show("free run " + Stem(recording.path), largest);
  });
}

TEST(Probe, RewardAndObservationAtStatesSetByHand) {
  std::set<std::string> seen;
  for (const std::string& path : ReferenceFiles("probes")) {
    const std::vector<Json> lines = ReadJsonLines(path);
    const std::string name = TaskName(lines.at(0));
    if (!HasTask(name)) continue;
    SCOPED_TRACE(path);
    seen.insert(name);
    const TaskPtr task = MakeTask(name);
    std::vector<double> observation(task->spec().observation_size);
    // One reset writes the model fields that every reset of the task sets alike.
    ASSERT_TRUE(task->Reset(0, ViewOfVector(observation)).ok());
    double largest = 0;
    for (std::size_t i = 1; i < lines.size(); ++i) {
      const Json& probe = lines[i];
      mj_resetData(task->model(), task->data());
      WriteModelFields(probe.at("model"), task->model());
      SetPhysics(probe, task.get());
      task->ForwardWithoutActuation();
      for (int j = 0; j < task->model()->nu; ++j) task->data()->ctrl[j] = probe.at("ctrl")[j];
      task->Observe(observation.data());
      const double o = LargestDifference(probe.at("o"), observation.data());
      const double r = std::abs(probe.at("r").get<double>() - task->Reward());
      EXPECT_LE(o, 1e-9) << probe.at("label");
      EXPECT_LE(r, 1e-9) << probe.at("label");
      largest = std::max({largest, o, r});
    }
    Show("probes " + name, largest);
  }
  EXPECT_EQ(seen.size(), std::size(kTasks));
}

}  // namespace
}  // namespace dreamsearch::dmc
