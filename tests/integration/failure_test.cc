// A component that fails costs its run and nothing else.
#include <gtest/gtest.h>

#include "program.h"

namespace dreamsearch {
namespace {

struct Fault {
  const char* planner;
  const char* model;
  const char* status;
  int exit_status;
  const char* message;  // what the error must name
};

class FailureTest : public testing::TestWithParam<Fault> {};

TEST_P(FailureTest, EndsItsRunAndTheSweepGoesOn) {
  const Fault& fault = GetParam();
  const Workplace place;
  const std::string planners =
      std::string(fault.planner) == "dreamer" ? "dreamer" : std::string(fault.planner) + ",dreamer";
  std::vector<std::string> arguments = {
      "--env", "cartpole_balance", "--planner", planners, "--db", "f.db", "--steps", "2000",
      "--model", std::string(fault.model) == "dreamer" ? "dreamer"
                                                        : std::string(fault.model) + ",dreamer",
      "--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR, "--hang-timeout", "1"};
  for (const char* setting :
       {"run.prefill_steps=1000", "run.pretrain_updates=2", "run.train_every=500",
        "run.batch_size=2", "run.sequence_length=8", "run.eval_episodes=1", "dreamer.hidden=8",
        "dreamer.deterministic=8", "dreamer.stochastic=2", "dreamer.imagination_starts=4",
        "dreamer.horizon=2"}) {
    arguments.insert(arguments.end(), {"--set", setting});
  }
  const ProgramResult result = place.Runner(arguments);
  EXPECT_EQ(result.exit_status, fault.exit_status) << result.err;
  const std::string bad = std::string("planner = '") + fault.planner + "' and model = '" +
                          fault.model + "'";
  EXPECT_EQ(place.Value("f.db", "select status from run where " + bad), fault.status)
      << result.err;
  const std::string error = place.Value("f.db", "select error from run where " + bad);
  EXPECT_NE(error.find(fault.message), std::string::npos) << error;
  EXPECT_EQ(place.Value("f.db", "select status from run where planner = 'dreamer' and model = "
                                "'dreamer'"),
            "finished")
      << result.err;
}

INSTANTIATE_TEST_SUITE_P(
    Faults, FailureTest,
    testing::Values(
        Fault{"nan_action", "dreamer", "diverged", 72, "nan_action"},
        Fault{"outside_action", "dreamer", "failed", 70, "outside_action"},
        Fault{"throwing_planner", "dreamer", "crashed", 71, "thrown on purpose"},
        Fault{"segfault_planner", "dreamer", "crashed", 71, "signal 11"},
        Fault{"exiting_planner", "dreamer", "crashed", 71, "without finishing"},
        Fault{"hanging_planner", "dreamer", "crashed", 71, "no sign of life"},
        Fault{"null_planner", "dreamer", "failed", 70, "null_planner"},
        Fault{"dreamer", "nan_model", "diverged", 72, "nan_model"},
        Fault{"dreamer", "wrong_size_model", "failed", 70, "wrong_size_model"}),
    [](const auto& tested) {
      return std::string(tested.param.planner) + "_on_" + tested.param.model;
    });

}  // namespace
}  // namespace dreamsearch
