// runner extend: a finished run goes on to the bits of a longer one. And what it kept can be taken
// away.
#include <gtest/gtest.h>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

// Episodes of 120 to 216 steps that end in a death, two steps an action: where the budget ends an
// episode is cut, and the last action may be short.
class ExtendTest : public testing::Test {
 protected:
  // eval_every and replay_capacity follow from the budget unless given.
  ProgramResult Run(const std::string& steps, const std::string& db, const std::string& eval_every,
                    const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"--plugin-path", DREAMSEARCH_EARLY_PLUGIN_DIR};
    arguments.insert(arguments.end(), more.begin(), more.end());
    arguments = TinyRun("varied", "dreamer", db, arguments);
    for (std::string& argument : arguments) {
      if (argument == "4000") argument = steps;
      if (argument == "run.prefill_steps=1000") argument = "run.prefill_steps=300";
      if (argument == "run.train_every=250") argument = "run.train_every=50";
      if (argument == "run.eval_every=2000") argument = "run.eval_every=" + eval_every;
      if (argument == "run.checkpoint_every=1000") argument = "run.checkpoint_every=100000";
    }
    return place_.Runner(arguments);
  }
  ProgramResult Extend(const std::string& steps) const {
    return place_.Runner({"extend", "1", "--steps", steps, "--db", "x.db", "--plugin-path",
                          DREAMSEARCH_EARLY_PLUGIN_DIR});
  }
  std::string Value(const std::string& sql) const { return place_.Value("x.db", sql); }

  Workplace place_;
};

TEST_F(ExtendTest, AnExtendedRunHasTheBitsOfALongerOneAndIsThatRun) {
  ASSERT_EQ(Run("1000", "x.db", "0", {"--keep-replay"}).exit_status, 0);
  const std::string before = Value("select result_digest from run");
  const ProgramResult extended = Extend("2200");
  ASSERT_EQ(extended.exit_status, 0) << extended.err;
  EXPECT_NE(extended.err.find("run.eval_every = 100 and run.replay_capacity = 1002"),
            std::string::npos)
      << extended.err;
  const std::vector<std::string> capacity = {"--set", "run.replay_capacity=1002"};
  const ProgramResult longer = Run("2200", "longer.db", "100", capacity);
  ASSERT_EQ(longer.exit_status, 0) << longer.err;
  for (const char* sql :
       {"select result_digest from run order by run_id desc limit 1",
        "select count(*), sum(reward), sum(value), max(env_step) from step where run_id = "
        "(select max(run_id) from run)",
        "select count(*), sum(value) from scalar where run_id = (select max(run_id) from run)",
        "select sha256 from config join run using (config_id) order by run_id desc limit 1"}) {
    EXPECT_EQ(place_.Query("x.db", sql), place_.Query("longer.db", sql)) << sql;
  }
  // The finished run is as it was, and the command of the longer one finds it done.
  EXPECT_EQ(Value("select result_digest from run where run_id = 1"), before);
  EXPECT_EQ(Value("select group_concat(env_steps_done) from run"), "1000,2200");
  EXPECT_EQ(Run("2200", "x.db", "100", capacity).exit_status, 0);
  EXPECT_EQ(Value("select count(*) from run"), "2");
  const ProgramResult verified = place_.Results({"verify", "--db", "x.db"});
  EXPECT_EQ(verified.exit_status, 0) << verified.out << verified.err;
  // It can be extended again: it kept what its beginning kept.
  EXPECT_EQ(place_
                .Runner({"extend", "2", "--steps", "2400", "--db", "x.db", "--plugin-path",
                         DREAMSEARCH_EARLY_PLUGIN_DIR})
                .exit_status,
            0);
}

TEST_F(ExtendTest, ARunThatKeptNoReplayIsRefusedWithASentence) {
  ASSERT_EQ(Run("1000", "x.db", "0").exit_status, 0);
  const ProgramResult refused = Extend("2000");
  EXPECT_EQ(refused.exit_status, 66) << refused.err;
  EXPECT_NE(refused.err.find("begun with --keep-replay"), std::string::npos) << refused.err;
  EXPECT_EQ(Value("select count(*) from run"), "1");
  for (const char* steps : {"1000", "900", "2001"}) {
    const ProgramResult budget = Extend(steps);
    EXPECT_EQ(budget.exit_status, 2) << budget.err;
    EXPECT_NE(budget.err.find("expected more than the run's 1000 environment steps, a multiple"),
              std::string::npos)
        << budget.err;
  }
}

TEST_F(ExtendTest, AnInterruptedExtensionIsResumedByTheSameCommand) {
  ASSERT_EQ(Run("1000", "x.db", "0", {"--keep-replay"}).exit_status, 0);
  ASSERT_EQ(Extend("2200").exit_status, 0);
  const std::string digest = Value("select result_digest from run where run_id = 2");
  // As if its process had been killed before anybody worked on it.
  place_.Query("x.db", "delete from segment where run_id = 2");
  place_.Query("x.db", "delete from step where run_id = 2 and env_step > 500");
  place_.Query("x.db", "update run set status = 'queued', exit_code = null where run_id = 2");
  const std::string folder =
      place_.Path("x.db.files/") + Value("select uuid from run where run_id = 2");
  for (const char* name : {"checkpoint-998.ckpt", "checkpoint-999.ckpt", "checkpoint-2198.ckpt",
                           "checkpoint-2199.ckpt", "checkpoint-2200.ckpt"}) {
    std::filesystem::remove(folder + "/" + name);
  }
  place_.Query("x.db", "delete from artifact where run_id = 2");
  const ProgramResult again = Extend("2200");
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(Value("select result_digest from run where run_id = 2"), digest);
  EXPECT_EQ(Value("select max(from_env_step) > 900 from segment where run_id = 2"), "1");
}

TEST_F(ExtendTest, NumPyReadsTheEpisodesAsTheyWereLived) {
  if (!HasNumPy()) GTEST_SKIP() << "/usr/bin/python3 has no NumPy";
  ASSERT_EQ(Run("1000", "x.db", "0", {"--keep-replay"}).exit_status, 0);
  const ProgramResult exported =
      place_.Runner({"export", "1", "--db", "x.db", "--episodes", "e.npz"});
  ASSERT_EQ(exported.exit_status, 0) << exported.err;
  // Rows of `step` are decisions; the file has the episodes' first observations besides, and lacks
  // the budget's last action.
  const std::string script =
      "import numpy, sqlite3, zipfile\n"
      "assert zipfile.ZipFile('e.npz').testzip() is None\n"
      "e = numpy.load('e.npz')\n"
      "shapes = {name: (e[name].dtype.str, e[name].shape) for name in e}\n"
      "rows = len(e['episode'])\n"
      "assert shapes == {'observations': ('<f4', (rows, 2)), 'actions': ('<f4', (rows, 1)),\n"
      "                  'rewards': ('<f4', (rows,)), 'terminated': ('|b1', (rows,)),\n"
      "                  'truncated': ('|b1', (rows,)), 'episode': ('<i8', (rows,))}, shapes\n"
      "steps = sqlite3.connect('x.db').execute('select episode, reward from "
      "step').fetchall()[:-1]\n"
      "first = numpy.flatnonzero(numpy.diff(e['episode'], prepend=-1))\n"
      "assert (e['rewards'][first] == 0).all() and (e['actions'][first] == 0).all()\n"
      "assert (abs(e['actions']) <= 1).all() and (e['actions'] != 0).any()\n"
      "lived = numpy.delete(numpy.arange(rows), first)\n"
      "assert list(zip(e['episode'][lived], e['rewards'][lived])) == steps\n"
      "last = numpy.append(first[1:], rows) - 1\n"
      "assert e['terminated'][last[:-1]].all() and e['terminated'].sum() == len(last) - 1\n"
      "assert not e['truncated'].any()\n"  // the last episode goes on
      "assert (e['observations'][1:, 1] - e['observations'][:-1, 1])[lived - 1].max() < 0.021\n";
  EXPECT_EQ(place_.Python(script), 0);
}

}  // namespace
}  // namespace dreamsearch
