// A database that comes from a stranger, with its files, is data: reading it or going on with its
// runs loads no code of its own and writes nowhere but in its own folder.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

namespace fs = std::filesystem;

std::string Text(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

void Replace(const fs::path& path, const std::string& from, const std::string& to) {
  std::string text = Text(path);
  ASSERT_NE(text.find(from), std::string::npos) << text;
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
  std::ofstream(path) << text;
}

// A run of a moment, and a folder `elsewhere` that none of its commands may touch.
class Stranger : public testing::Test {
 protected:
  Stranger() {
    fs::create_directory(place_.folder() / "elsewhere");
    std::ofstream(place_.folder() / "elsewhere/kept") << "kept";
    std::vector<std::string> run = Command();
    run.insert(run.end(), {"--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR});
    const ProgramResult result = place_.Runner(run);
    EXPECT_EQ(result.exit_status, 0) << result.err;
  }

  static std::vector<std::string> Command() {
    std::vector<std::string> command = {
        "--env",  "good_environment", "--model", "idle_model", "--planner",
        "random", "--steps",          "100",     "--db",       "s.db"};
    for (const char* setting : {"run.action_repeat=1", "run.prefill_steps=20",
                                "run.sequence_length=4", "run.eval_episodes=1"}) {
      command.insert(command.end(), {"--set", setting});
    }
    return command;
  }
  // As if the run's process had died before its first checkpoint.
  void Unfinish() const {
    place_.Query("s.db", "update run set status = 'queued', exit_code = null, env_steps_done = 0");
    place_.Query("s.db", "delete from artifact");
    for (const auto& entry : fs::directory_iterator(Folder())) {
      if (entry.path().extension() == ".ckpt") fs::remove(entry.path());
    }
  }
  fs::path Folder() const {
    return place_.folder() / "s.db.files" / place_.Value("s.db", "select uuid from run");
  }
  ProgramResult Runner(const std::string& command,
                       const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = {command, "1", "--db", "s.db"};
    words.insert(words.end(), more.begin(), more.end());
    return place_.Runner(words);
  }
  void ExpectNothingElsewhere() const {
    EXPECT_EQ(Text(place_.folder() / "elsewhere/kept"), "kept");
    EXPECT_EQ(std::distance(fs::directory_iterator(place_.folder() / "elsewhere"), {}), 1);
  }

  Workplace place_;
};

TEST_F(Stranger, NoLibraryIsLoadedFromTheCurrentFolder) {
  // Of the names that the programs need; loading one would fail, as it is empty.
  for (const char* library : {"libsqlite3.so.0", "libz.so.1", "libstdc++.so.6"}) {
    std::ofstream(place_.Path(library)) << "";
  }
  ProgramResult result = place_.Runner({"status", "--db", "s.db"});
  EXPECT_EQ(result.exit_status, 0) << result.err;
  result = place_.Results({"list", "--db", "s.db"});
  EXPECT_EQ(result.exit_status, 0) << result.err;
}

TEST_F(Stranger, ItsFilesNameNoCodeThatIsLoaded) {
  const fs::path own = fs::path(DREAMSEARCH_FAULTY_PLUGIN_DIR);
  fs::create_directory(place_.folder() / "s.db.files/plugins");
  for (const auto& entry : fs::directory_iterator(own)) {
    fs::copy(DREAMSEARCH_INTRUDER,
             place_.folder() / "s.db.files/plugins" / entry.path().filename());
  }
  Replace(Folder() / "run.json", own.string(), (place_.folder() / "s.db.files/plugins").string());
  const auto expect_refused = [&](const std::string& command,
                                  const std::vector<std::string>& more) {
    const ProgramResult result = Runner(command, more);
    EXPECT_EQ(result.exit_status, 69) << command << ": " << result.err;
    EXPECT_NE(result.err.find("--plugin-path " + place_.Path("s.db.files/plugins")),
              std::string::npos)
        << command << ": " << result.err;
    EXPECT_FALSE(fs::exists(place_.folder() / "loaded")) << command;
  };
  expect_refused("eval", {"--planner", "random"});
  expect_refused("explain", {"--decision", "0"});
  expect_refused("export", {});
  expect_refused("verify", {});
  expect_refused("render", {"--out", "x.png"});
  expect_refused("extend", {"--steps", "200"});
  Unfinish();
  expect_refused("resume", {});
}

// The same plugin in a folder that the user names is the same plugin.
TEST_F(Stranger, ItsRunGoesOnWithThePluginsOfAFolderThatIsNamed) {
  Unfinish();
  EXPECT_EQ(Runner("resume").exit_status, 69);
  const ProgramResult resumed = Runner("resume", {"--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR});
  EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
  EXPECT_EQ(place_.Value("s.db", "select status from run"), "finished");
}

TEST_F(Stranger, ASettingNamesNoProgramThatIsRun) {
  Unfinish();
  std::ofstream(place_.folder() / "elsewhere/kept") << "kept";
  const fs::path program = place_.folder() / "program";
  std::ofstream(program) << "#!/bin/sh\ntouch " << place_.Path("loaded") << "\n";
  ::chmod(program.c_str(), 0755);
  std::string text = Text(Folder() / "run.json");
  const std::string values = "\"values\": []";
  ASSERT_NE(text.find(values), std::string::npos) << "a component without parameters";
  text.replace(text.find(values), values.size(),
               "\"values\": [{\"name\": \"python\", \"type\": 4, \"number\": 0, \"choice\": \"" +
                   program.string() + "\", \"sha256\": \"\", \"origin\": 0}]");
  std::ofstream(Folder() / "run.json") << text;
  const ProgramResult result = Runner("resume", {"--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR});
  EXPECT_EQ(result.exit_status, 69) << result.err;
  EXPECT_NE(result.err.find("in 'python' the program " + program.string()), std::string::npos)
      << result.err;
  EXPECT_FALSE(fs::exists(place_.folder() / "loaded"));
}

// A module is code however it is named: by a file in any folder, or by a name that whatever is
// installed answers to.
TEST_F(Stranger, ASettingNamesNoModuleThatIsImported) {
  Unfinish();
  const fs::path file = Folder() / "run.json";
  const std::string text = Text(file), values = "\"values\": []";
  const auto at = text.find(values);
  ASSERT_NE(at, std::string::npos) << "a component without parameters";
  const auto resume = [&](const std::string& module, std::vector<std::string> more) {
    std::string changed = text;
    changed.replace(
        at, values.size(),
        "\"values\": [{\"name\": \"module\", \"type\": 5, \"number\": 0, \"choice\": \"" + module +
            "\", \"sha256\": \"\", \"origin\": 0}]");
    std::ofstream(file) << changed;
    more.insert(more.end(), {"--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR});
    return Runner("resume", more);
  };
  const struct {
    std::string module, advice;
  } kModules[] = {{"subprocess", "--trust-module subprocess"},
                  {"a b", "--trust-module 'a b'"},
                  {"world.py", "--plugin-path " + place_.folder().string()},
                  {place_.Path("elsewhere/.py"), "--plugin-path " + place_.Path("elsewhere")},
                  {"/usr/lib/python3.11/subprocess.py", "--plugin-path /usr/lib/python3.11"}};
  for (const auto& [module, advice] : kModules) {
    const ProgramResult refused = resume(module, {});
    EXPECT_EQ(refused.exit_status, 69) << refused.err;
    EXPECT_NE(refused.err.find("in 'module' the module " + module), std::string::npos)
        << refused.err;
    EXPECT_NE(refused.err.find("If it is trusted, add " + advice), std::string::npos)
        << refused.err;
  }
  EXPECT_EQ(resume("subprocess", {"--trust-module", "subprocesses"}).exit_status, 69);
  const ProgramResult trusted = resume("subprocess", {"--trust-module", "subprocess"});
  EXPECT_EQ(trusted.exit_status, 0) << trusted.err;
}

TEST_F(Stranger, ASettingOutsideItsRangeIsRefused) {
  Unfinish();
  const auto steps = place_.Value("s.db", "select env_steps_target from run");
  Replace(Folder() / "run.json", "\"number\": 100.0", "\"number\": -1e300");
  const ProgramResult result = Runner("resume", {"--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR});
  EXPECT_EQ(result.exit_status, 65) << result.err;
  EXPECT_NE(result.err.find("run.steps: found -1e+300"), std::string::npos) << result.err;
}

TEST_F(Stranger, LinksInARunsFolderAreNotFollowed) {
  Unfinish();
  const fs::path target = place_.folder() / "elsewhere/kept";
  const std::vector<std::string> plugins = {"--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR};
  for (const char* name : {"run.json.tmp", "checkpoint-100.ckpt.tmp", "checkpoint-100.ckpt"}) {
    fs::create_symlink(target, Folder() / name);
  }
  // What a link replaces is replaced; what it points at stays.
  std::vector<std::string> again = Command();
  again.insert(again.end(), plugins.begin(), plugins.end());
  EXPECT_EQ(place_.Runner(again).exit_status, 65);  // a link is no checkpoint
  fs::remove(Folder() / "checkpoint-100.ckpt");
  const ProgramResult result = place_.Runner(again);
  EXPECT_EQ(result.exit_status, 0) << result.err;
  ExpectNothingElsewhere();

  for (const auto& [name, code] : {std::pair("run.log", 73), std::pair("lock", 74)}) {
    Unfinish();
    fs::remove(Folder() / name);
    fs::create_symlink(target, Folder() / name);
    EXPECT_EQ(Runner("resume", plugins).exit_status, code) << name;
    ExpectNothingElsewhere();
    fs::remove(Folder() / name);
  }
  Unfinish();
  fs::rename(Folder(), place_.folder() / "folder");
  fs::create_directory_symlink(place_.folder() / "folder", Folder());
  const ProgramResult linked = Runner("resume", plugins);
  EXPECT_EQ(linked.exit_status, 65) << linked.err;
  EXPECT_NE(linked.err.find("found a symbolic link"), std::string::npos) << linked.err;
}

TEST_F(Stranger, LinksInPlaceOfSqlitesFilesAreNotFollowed) {
  const fs::path target = place_.folder() / "elsewhere/kept";
  for (const char* name : {"s.db-wal", "s.db-journal", "s.db-shm"}) {
    fs::create_symlink(target, place_.folder() / name);
    const ProgramResult listed = place_.Results({"list", "--db", "s.db"});
    EXPECT_EQ(listed.exit_status, 65) << listed.err;
    EXPECT_EQ(Runner("resume").exit_status, 65);
    ExpectNothingElsewhere();
    fs::remove(place_.folder() / name);
  }
}

TEST_F(Stranger, AUuidNamesNoOtherFolder) {
  Unfinish();
  const fs::path folder = Folder();
  for (const char* uuid :
       {"../elsewhere", "..", "", ".", "/tmp", "%2e%2e", "00000000-0000-0000-0000-00000000000/"}) {
    place_.Query("s.db", std::string("update run set uuid = '") + uuid + "', log_path = '" + uuid +
                             "/run.log'");
    for (const char* command : {"resume", "eval", "verify"}) {
      const std::vector<std::string> more = std::string(command) == "eval"
                                                ? std::vector<std::string>{"--planner", "random"}
                                                : std::vector<std::string>{};
      const ProgramResult result = Runner(command, more);
      EXPECT_EQ(result.exit_status, 65) << command << " " << uuid << ": " << result.err;
    }
    const ProgramResult deleted = place_.Results({"delete", "1", "--files", "--db", "s.db"});
    EXPECT_EQ(deleted.exit_status, 65) << deleted.err;
    ExpectNothingElsewhere();
  }
  EXPECT_TRUE(fs::exists(folder / "run.json"));
}

TEST_F(Stranger, DeepJsonIsRefusedByWhoeverReadsIt) {
  const std::string deep(200000, '[');
  place_.Query("s.db", "update config set json = '" + deep + "'");
  for (const std::vector<std::string>& command : {std::vector<std::string>{"list"},
                                                  {"show", "1"},
                                                  {"report", "r.html"},
                                                  {"verify"},
                                                  {"export", "--out", "e"},
                                                  {"compare"},
                                                  {"curves"}}) {
    std::vector<std::string> words = command;
    words.insert(words.end(), {"--db", "s.db"});
    const ProgramResult result = place_.Results(words);
    EXPECT_LT(result.exit_status, 128) << words[0] << ": " << result.err;
    EXPECT_NE(result.exit_status, 70) << words[0] << ": " << result.err;
  }
  std::ofstream(Folder() / "run.json") << deep;
  Unfinish();
  for (const char* command : {"resume", "export", "verify"}) {
    const ProgramResult result = Runner(command);
    EXPECT_EQ(result.exit_status, 65) << command << ": " << result.err;
  }
}

TEST_F(Stranger, ItsTextsDoNotSteerTheTerminal) {
  const std::string evil =
      "x\x1b]0;title\x07\xc2\x9b"
      "31m\xe2\x80\xae";
  place_.Query("s.db", "update run set error = '" + evil + "', planner = '" + evil + "'");
  place_.Query("s.db", "update task set name = '" + evil + "'");
  const auto expect_plain = [&](const ProgramResult& result, const std::string& what) {
    for (const std::string& text : {result.out, result.err}) {
      EXPECT_EQ(text.find('\x1b'), std::string::npos) << what;
      EXPECT_EQ(text.find("\xc2\x9b"), std::string::npos) << what;
      EXPECT_EQ(text.find("\xe2\x80\xae"), std::string::npos) << what;
    }
  };
  for (const std::vector<std::string>& command : {std::vector<std::string>{"list"},
                                                  {"show", "1"},
                                                  {"delete", "1"},
                                                  {"verify"},
                                                  {"curves", "--out", "c.svg"},
                                                  {"compare"},
                                                  {"sql", "SELECT planner, error FROM run"}}) {
    std::vector<std::string> words = command;
    words.insert(words.end(), {"--db", "s.db"});
    expect_plain(place_.Results(words), words[0]);
  }
  expect_plain(place_.Runner({"status", "--db", "s.db"}), "status");
  expect_plain(Runner("export"), "export");
  Unfinish();
  expect_plain(Runner("resume", {"--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR}), "resume");
}

// A view or a table of ours that would never come to an end.
TEST_F(Stranger, AnEndlessViewIsNotRead) {
  const std::string endless =
      " AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT ";
  const std::string columns = place_.Value(
      "s.db", "select group_concat('i AS \"' || name || '\"') from pragma_table_info('v_run')");
  place_.Query("s.db", "drop view v_run");
  place_.Query("s.db", "create view v_run" + endless + columns + " FROM n");
  for (const std::vector<std::string>& command : {std::vector<std::string>{"list"},
                                                  {"list", "--missing"},
                                                  {"curves"},
                                                  {"report", "r.html"},
                                                  {"sql", "SELECT count(*) FROM v_run"}}) {
    std::vector<std::string> words = command;
    words.insert(words.end(), {"--db", "s.db"});
    const ProgramResult result = place_.Results(words);
    EXPECT_LT(result.exit_status, 70) << words[0] << ": " << result.err;
  }
  EXPECT_EQ(place_.Results({"verify", "--db", "s.db"}).exit_status, 78);
  EXPECT_EQ(
      place_.Results({"sql", "SELECT count(*) AS n FROM v_run", "--format", "csv", "--db", "s.db"})
          .out,
      "n\n1\n");
  place_.Query("s.db", "create table other AS SELECT * FROM scalar");
  place_.Query("s.db", "drop table scalar");
  place_.Query("s.db", "create view scalar" + endless + "i AS run_id FROM n");
  EXPECT_EQ(place_.Results({"list", "--db", "s.db"}).exit_status, 65);
}

}  // namespace
}  // namespace dreamsearch
