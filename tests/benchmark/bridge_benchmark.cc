// bridge_benchmark.cc - what a step of a Python environment costs beyond the environment's own.
//
//     tests/bin/bridge_benchmark PYTHON [ID]
//
// PYTHON is an interpreter that has Gymnasium; ID is Hopper-v5 unless given. Every step is timed
// here, and in Python around the environment's own `step`; the overhead is the difference, pipe,
// two wake-ups and conversions. Wall time: the process and its environment take turns, so another
// load on the other core disturbs; the machine's load is shown. Exits with 1 if the median overhead
// is above 60 us.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "dreamsearch/random.h"
#include "plugins/env_gym/python_environment.h"

namespace dreamsearch::gym {
namespace {

constexpr double kMostMicroseconds = 60;
constexpr int kWarmUp = 500;
constexpr int kSteps = 20000;

double Quantile(std::vector<double> values, double place) {
  const auto at = static_cast<std::ptrdiff_t>(place * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

void MustBeOk(const Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "%s\n", status.message);
  std::exit(1);
}

int Measure(const std::string& interpreter, const std::string& id) {
  PythonEnvironmentSettings settings;
  settings.kind = "gym";
  settings.interpreter = interpreter;
  settings.module = DREAMSEARCH_SOURCE_DIR "/tests/benchmark/timed_world.py";
  settings.id = "Timed";
  settings.arguments = "{\"id\": \"" + id + "\"}";
  auto* environment = new PythonEnvironment(settings);
  const EnvironmentSpec& spec = environment->spec();
  std::vector<double> observation(spec.observation_size), action(spec.action_size);
  const View<double> observed{observation.data(), observation.size()};
  std::vector<double> steps, own, overheads;
  Random random(1);
  StepResult result;
  result.last = true;
  std::uint32_t episode = 0;
  for (int i = 0; i < kWarmUp + kSteps; ++i) {
    if (result.last) MustBeOk(environment->Reset(episode++, observed));
    for (std::size_t j = 0; j < action.size(); ++j) {
      action[j] = random.Uniform(spec.action_low[j], spec.action_high[j]);
    }
    const auto begin = std::chrono::steady_clock::now();
    MustBeOk(environment->Step({action.data(), action.size()}, observed, &result));
    const std::chrono::duration<double, std::micro> step = std::chrono::steady_clock::now() - begin;
    if (i < kWarmUp) continue;
    steps.push_back(step.count());
    own.push_back(1e6 * observation.back());
    overheads.push_back(steps.back() - own.back());
  }
  environment->Destroy();
  double load[3] = {};
  ::getloadavg(load, 3);
  const double median = Quantile(overheads, 0.5);
  std::printf(
      "%s, %d steps, microseconds (median, 90 %%)\n  Step         %7.1f %7.1f\n  its own step "
      "%7.1f "
      "%7.1f\n  overhead     %7.1f %7.1f   at most %g in the median\nload average %.2f\n",
      id.c_str(), kSteps, Quantile(steps, 0.5), Quantile(steps, 0.9), Quantile(own, 0.5),
      Quantile(own, 0.9), median, Quantile(overheads, 0.9), kMostMicroseconds, load[0]);
  return median <= kMostMicroseconds ? 0 : 1;
}

}  // namespace
}  // namespace dreamsearch::gym

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);  // as the host's processes do
  if (argc < 2 || argc > 3) {
    std::fprintf(stderr, "usage: bridge_benchmark PYTHON [ID]\n");
    return 2;
  }
  try {
    return dreamsearch::gym::Measure(argv[1], argc == 3 ? argv[2] : "Hopper-v5");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
