// A world of the user's own, and a trained agent in a changed one.
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

class WorldTest : public testing::Test {
 protected:
  WorldTest() {
    std::filesystem::create_directory(place_.Path("worlds"));
    for (const char* name : {"crane.xml", "crane.cfg"}) {
      std::filesystem::copy(
          std::filesystem::path(DREAMSEARCH_SOURCE_DIR) / "plugins/env_mjcf/example" / name,
          std::filesystem::path(place_.Path("worlds")) / name);
    }
  }

  // The example, small: the model's path is relative to the configuration file's folder.
  ProgramResult Crane(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = TinyRun("mjcf:crane", "dreamer", "w.db", more);
    arguments.insert(arguments.end(), {"--config", "worlds/crane.cfg"});
    return place_.Runner(arguments);
  }
  void ChangeModel() const {
    std::ofstream(place_.Path("worlds/crane.xml"), std::ios::app) << "\n";
  }
  // As if its process had died before its first checkpoint.
  void Unfinish() const {
    place_.Query("w.db", "update run set status = 'queued', exit_code = null, env_steps_done = 0");
    place_.Query("w.db", "delete from artifact");
    std::vector<std::filesystem::path> checkpoints;
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(place_.Path("w.db.files"))) {
      if (entry.path().extension() == ".ckpt") checkpoints.push_back(entry.path());
    }
    for (const std::filesystem::path& path : checkpoints) std::filesystem::remove(path);
  }
  std::string Value(const std::string& sql) const { return place_.Value("w.db", sql); }

  Workplace place_;
};

TEST_F(WorldTest, AModelFileAndALineOfConfigurationEachAreATaskThatIsLearned) {
  const ProgramResult result = Crane();
  ASSERT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(Value("select name from task"), "mjcf:crane");
  EXPECT_NE(Value("select count(*) from scalar join metric using (metric_id) where name like "
                  "'%observation_loss'"),
            "0");
  const ProgramResult again = Crane();
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(Value("select count(*) from run"), "1");
  EXPECT_EQ(place_.Runner({"verify", "1", "--db", "w.db"}).exit_status, 0);
}

TEST_F(WorldTest, ARunDoesNotResumeAfterItsModelFileHasChanged) {
  ASSERT_EQ(Crane().exit_status, 0);
  Unfinish();
  ChangeModel();
  const std::string changed = "file " + place_.Path("worlds/crane.xml") + " changed (SHA-256 ";
  const ProgramResult same = Crane();
  EXPECT_EQ(same.exit_status, 69) << same.err;
  EXPECT_NE(same.err.find(changed), std::string::npos) << same.err;
  EXPECT_NE(same.err.find("--replace"), std::string::npos) << same.err;
  const ProgramResult resumed = place_.Runner({"resume", "1", "--db", "w.db"});
  EXPECT_EQ(resumed.exit_status, 69) << resumed.err;
  EXPECT_NE(resumed.err.find(changed), std::string::npos) << resumed.err;
  EXPECT_EQ(Value("select status from run"), "queued");
  const ProgramResult replaced = Crane({"--replace"});
  EXPECT_EQ(replaced.exit_status, 0) << replaced.err;
  EXPECT_EQ(Value("select status from run"), "finished");
}

TEST_F(WorldTest, ARunDoesNotResumeAfterAFileThatItsModelIncludesHasChanged) {
  std::ofstream(place_.Path("worlds/floor.xml"))
      << "<mujoco><worldbody><geom name='pit' type='plane' pos='0 0 -9' size='9 9 1' "
         "contype='0' conaffinity='0'/></worldbody></mujoco>\n";
  std::ifstream model(place_.Path("worlds/crane.xml"));
  std::string text{std::istreambuf_iterator<char>(model), {}};
  const std::size_t end = text.rfind("</mujoco>");
  text.insert(end, "<include file=\"floor.xml\"/>");
  std::ofstream(place_.Path("worlds/crane.xml")) << text;
  const ProgramResult begun = Crane();
  ASSERT_EQ(begun.exit_status, 0) << begun.err;
  EXPECT_NE(Value("select detail from event where kind = 'ingredients'").find("\"floor.xml\":"),
            std::string::npos);
  Unfinish();
  std::ofstream(place_.Path("worlds/floor.xml"), std::ios::app) << "\n";
  const std::string changed = "floor.xml of environment 'mjcf:crane' changed (SHA-256 ";
  for (const ProgramResult& refused : {Crane(), place_.Runner({"resume", "1", "--db", "w.db"})}) {
    EXPECT_EQ(refused.exit_status, 69) << refused.err;
    EXPECT_NE(refused.err.find(changed), std::string::npos) << refused.err;
  }
  EXPECT_EQ(Crane({"--replace"}).exit_status, 0);
  EXPECT_EQ(place_.Runner({"verify", "1", "--db", "w.db"}).exit_status, 0);
}

TEST_F(WorldTest, APythonWorldKeepsItsHabitsAndIsRefusedOnceItsModulesHaveChanged) {
  if (!HasNumPy()) GTEST_SKIP() << "/usr/bin/python3 has no NumPy";
  std::filesystem::copy(
      std::filesystem::path(DREAMSEARCH_SOURCE_DIR) / "tests/plugins/env_gym/worlds.py",
      place_.Path("worlds/walks.py"));
  std::ofstream(place_.Path("worlds/mine.py")) << "from walks import Walk as Mine\n";
  const auto run = [&](const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"--set", "gym.module=worlds/mine.py",
                                          "--set", "gym.python=/usr/bin/python3",
                                          "--set", "gym.arguments={\"edge\": 1e9}"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return place_.Runner(TinyRun("gym:Mine", "dreamer", "w.db", arguments));
  };
  const ProgramResult begun = run();
  ASSERT_EQ(begun.exit_status, 0) << begun.err;
  EXPECT_NE(begun.err.find("note: gym:Mine has no time limit of its own; an episode ends after "
                           "1000 environment steps (env.episode_steps)"),
            std::string::npos)
      << begun.err;
  EXPECT_EQ(Value("select action_repeat from run"), "1");
  EXPECT_EQ(Value("select max(length) from episode"), "1000");
  const std::string made_of = Value("select detail from event where kind = 'ingredients'");
  for (const char* name :
       {"\"python\":\"CPython 3", "\"numpy\":", "\"mine.py\":", "\"walks.py\":"}) {
    EXPECT_NE(made_of.find(name), std::string::npos) << made_of;
  }
  Unfinish();
  std::ofstream(place_.Path("worlds/walks.py"), std::ios::app) << "\n";
  const ProgramResult refused = run();
  EXPECT_EQ(refused.exit_status, 69) << refused.err;
  EXPECT_NE(refused.err.find("walks.py of environment 'gym:Mine' changed (SHA-256 "),
            std::string::npos)
      << refused.err;
}

// Of a run that plays a Python class: its file must be in a folder that the command names, and a
// class of what is installed cannot stand in for it.
TEST_F(WorldTest, ARecordedRunDecidesNoPythonThatIsPlayed) {
  if (!HasNumPy()) GTEST_SKIP() << "/usr/bin/python3 has no NumPy";
  std::filesystem::copy(
      std::filesystem::path(DREAMSEARCH_SOURCE_DIR) / "tests/plugins/env_gym/worlds.py",
      place_.Path("worlds/worlds.py"));
  const std::string touch = "{\"args\": [\"touch\", \"" + place_.Path("called") + "\"]}";
  const ProgramResult begun =
      place_.Runner(TinyRun("gym:Walk", "dreamer", "w.db",
                            {"--set", "gym.module=worlds/worlds.py", "--set",
                             "gym.python=/usr/bin/python3", "--set", "gym.episode_steps=100"}));
  ASSERT_EQ(begun.exit_status, 0) << begun.err;
  const auto eval = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words = {"eval", "1", "--planner", "dreamer", "--db", "w.db"};
    words.insert(words.end(), more.begin(), more.end());
    return place_.Runner(words);
  };
  const ProgramResult refused = eval({});
  EXPECT_EQ(refused.exit_status, 69) << refused.err;
  EXPECT_NE(refused.err.find("--plugin-path " + place_.Path("worlds")), std::string::npos)
      << refused.err;
  const ProgramResult played = eval({"--plugin-path", "worlds"});
  EXPECT_EQ(played.exit_status, 0) << played.err;

  const std::filesystem::path file = std::filesystem::path(place_.Path("w.db.files")) /
                                     Value("select uuid from run where run_id = 1") / "run.json";
  nlohmann::json recorded = nlohmann::json::parse(std::ifstream(file));
  const std::function<void(nlohmann::json&)> forge = [&](nlohmann::json& part) {
    if (part.is_object() && part.contains("choice") && part.contains("sha256")) {
      const std::string name = part["name"];
      if (name == "module") part.update({{"choice", "subprocess"}, {"sha256", ""}});
      if (name == "id") part["choice"] = "Popen";
      if (name == "arguments") part["choice"] = touch;
    }
    for (nlohmann::json& inner : part) {
      if (inner.is_structured()) forge(inner);
    }
  };
  forge(recorded);
  std::ofstream(file) << recorded;
  const ProgramResult named = eval({"--plugin-path", "worlds"});
  EXPECT_EQ(named.exit_status, 69) << named.err;
  EXPECT_NE(named.err.find("--trust-module subprocess"), std::string::npos) << named.err;
  const ProgramResult trusted = eval({"--trust-module", "subprocess"});
  EXPECT_EQ(trusted.exit_status, 2) << trusted.err;
  EXPECT_NE(trusted.err.find("'Popen' of module subprocess makes no environment"),
            std::string::npos)
      << trusted.err;
  EXPECT_FALSE(std::filesystem::exists(place_.Path("called")));
}

TEST_F(WorldTest, AnEvaluationSaysThatTheModelFileHasChangedAndIsRefusedWithoutIt) {
  ASSERT_EQ(Crane().exit_status, 0);
  ChangeModel();
  const std::vector<std::string> eval = {"eval", "1", "--planner", "dreamer", "--db", "w.db"};
  const ProgramResult warned = place_.Runner(eval);
  EXPECT_EQ(warned.exit_status, 0) << warned.err;
  EXPECT_NE(warned.err.find("was trained with another file: file "), std::string::npos)
      << warned.err;
  const ProgramResult verified = place_.Runner({"verify", "1", "--db", "w.db"});
  EXPECT_EQ(verified.exit_status, 69) << verified.err;
  // A line feed more is no other world.
  EXPECT_EQ(place_.Runner({"verify", "1", "--force", "--db", "w.db"}).exit_status, 0);
  std::filesystem::remove(place_.Path("worlds/crane.xml"));
  const ProgramResult gone = place_.Runner(eval);
  EXPECT_EQ(gone.exit_status, 66) << gone.err;
  EXPECT_NE(gone.err.find("crane.xml"), std::string::npos) << gone.err;
}

TEST_F(WorldTest, AFileThatIsNotThereIsRefusedBeforeAnythingIsWritten) {
  std::filesystem::remove(place_.Path("worlds/crane.xml"));
  const ProgramResult result = Crane();
  EXPECT_EQ(result.exit_status, 66) << result.err;
  EXPECT_NE(result.err.find("crane.cfg, line 3: mjcf.model: expected a file, found nothing: " +
                            place_.Path("worlds/crane.xml")),
            std::string::npos)
      << result.err;
  EXPECT_FALSE(std::filesystem::exists(place_.Path("w.db")));
}

TEST_F(WorldTest, ATrainedAgentPlaysInAChangedWorld) {
  ASSERT_EQ(place_.Runner(TinyRun("cartpole_swingup", "dreamer", "w.db")).exit_status, 0);
  EXPECT_EQ(Value("select json from config").find("gravity_scale"), std::string::npos);
  const auto eval = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"eval", "1",    "--planner",  "dreamer",
                                          "--db", "w.db", "--episodes", "1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult result = place_.Runner(arguments);
    EXPECT_EQ(result.exit_status, 0) << result.err;
    return Value(
        "select digest from episode join run using (run_id) where parent_run_id = 1 "
        "order by run_id desc limit 1");
  };
  const std::string as_trained = eval({});
  EXPECT_EQ(as_trained, Value("select digest from episode where run_id = 1 and phase = 2 "
                              "order by env_step desc limit 1"));
  EXPECT_EQ(eval({"--set", "env.gravity_scale=1"}), as_trained);
  EXPECT_EQ(Value("select count(*) from run"), "2");  // it was the same evaluation
  std::vector<std::string> worlds = {as_trained};
  for (const char* change : {"env.gravity_scale=1.5", "env.mass_scale=2", "env.actuator_scale=0.5",
                             "env.observation_noise=0.1", "env.action_delay=1"}) {
    worlds.push_back(eval({"--set", change}));
    for (std::size_t i = 0; i + 1 < worlds.size(); ++i)
      EXPECT_NE(worlds.back(), worlds[i]) << change;
  }
}

TEST_F(WorldTest, AnEvaluationChangesTheWorldAndNotTheTask) {
  ASSERT_EQ(Crane().exit_status, 0);
  const ProgramResult result =
      place_.Runner({"eval", "1", "--planner", "dreamer", "--db", "w.db", "--set", "env.reward=1"});
  EXPECT_EQ(result.exit_status, 2) << result.err;
  EXPECT_NE(result.err.find("env.reward: expected a factor of variation (env.mass_scale, "),
            std::string::npos)
      << result.err;
}

}  // namespace
}  // namespace dreamsearch
