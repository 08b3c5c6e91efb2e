// run.exploration_hold: how long the random numbers of exploration stay the same.
#include <gtest/gtest.h>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

// The planner `random` plays its draws, so its actions are seen to be held after the prefill too.
TEST(Exploration, DrawsAreHeldInTrainingAlone) {
  Workplace place;
  const auto run = [&](const std::string& db, const std::string& hold) {
    return place.Runner(TinyRun("cartpole_balance", "random", db,
                                {"--keep-replay", "--set", "run.exploration_hold=" + hold}));
  };
  ASSERT_EQ(run("one.db", "1").exit_status, 0);
  const ProgramResult held = run("five.db", "5");
  ASSERT_EQ(held.exit_status, 0) << held.err;
  const std::string evaluated =
      "select group_concat(digest) from (select digest from episode where phase = 1 and env_step = "
      "0 order by episode)";
  EXPECT_EQ(place.Value("one.db", evaluated), place.Value("five.db", evaluated));
  EXPECT_NE(place.Value("one.db", evaluated), "");

  if (!HasNumPy()) GTEST_SKIP() << "/usr/bin/python3 has no NumPy";
  for (const std::string db : {"one", "five"}) {
    const ProgramResult exported =
        place.Runner({"export", "1", "--db", db + ".db", "--episodes", db + ".npz"});
    ASSERT_EQ(exported.exit_status, 0) << exported.err;
  }
  // The first and the last 500 decisions; four deviations of a share of 0.8 are 0.07.
  const std::string script =
      "import numpy\n"
      "def again(name):\n"
      "    e = numpy.load(name)\n"
      "    same = (e['actions'][1:] == e['actions'][:-1]).all(axis=1)\n"
      "    lived = e['episode'][1:] == e['episode'][:-1]\n"
      "    same = same[lived]\n"
      "    return same[:500].mean(), same[-500:].mean()\n"
      "assert again('one.npz') == (0, 0), again('one.npz')\n"
      "early, late = again('five.npz')\n"
      "assert abs(early - 0.8) < 0.08 and abs(late - 0.8) < 0.08, (early, late)\n";
  EXPECT_EQ(place.Python(script), 0);
}

}  // namespace
}  // namespace dreamsearch
