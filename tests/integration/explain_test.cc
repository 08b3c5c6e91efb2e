// runner explain: the tree of one decision, as JSON and as a page.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

std::string FileText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

class ExplainTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    const ProgramResult trained = place_->Runner(TinyRun("cartpole_balance", "mcts_pw", "e.db"));
    ASSERT_EQ(trained.exit_status, 0) << trained.err;
    result_ = Explain("1", "7", "tree");
  }
  static void TearDownTestSuite() { delete place_; }

  static ProgramResult Explain(const std::string& run, const std::string& decision,
                               const std::string& out) {
    return place_->Runner({"explain", run, "--decision", decision, "--db", "e.db", "--out", out});
  }
  static nlohmann::json Tree(const std::string& out) {
    return nlohmann::json::parse(FileText(place_->Path(out + ".json")));
  }

  static Workplace* place_;
  static ProgramResult result_;
};
Workplace* ExplainTest::place_ = nullptr;
ProgramResult ExplainTest::result_;

TEST_F(ExplainTest, TheTreeHasEverySimulationAndThePlayedAction) {
  ASSERT_EQ(result_.exit_status, 0) << result_.err;
  const nlohmann::json tree = Tree("tree");
  EXPECT_EQ(tree["env"], "cartpole_balance");
  EXPECT_EQ(tree["planner"], "mcts_pw");
  EXPECT_EQ(tree["decision"], 7);
  EXPECT_EQ(tree["env_step"], 4000);
  // mcts_pw with 6 simulations: 6 visits at the root, a node each besides the root.
  EXPECT_EQ(tree["root"]["simulations"], 6);
  EXPECT_EQ(tree["root"]["visits"], 6);
  EXPECT_EQ(tree["root"]["nodes"], 7);
  const nlohmann::json& edges = tree["edges"];
  int expanded = 0;
  double entropy = 0;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    EXPECT_LT(edges[i]["parent"], static_cast<std::int64_t>(i));
    expanded += edges[i]["expanded"].get<bool>() ? 1 : 0;
    if (edges[i]["parent"] != -1 || edges[i]["visits"] == 0) continue;
    const double share = edges[i]["visits"].get<double>() / 6;
    entropy -= share * std::log(share);
  }
  EXPECT_EQ(expanded, 6);
  // The same few terms in the same order.
  EXPECT_DOUBLE_EQ(tree["root"]["visit_entropy"].get<double>(), entropy);
  EXPECT_TRUE(tree["chosen_is_exact"].get<bool>());
  const nlohmann::json& chosen = edges[tree["chosen_edge"].get<std::size_t>()];
  EXPECT_EQ(chosen["action"], tree["action"]);
  EXPECT_EQ(chosen["q"], tree["root"]["value"]);
}

TEST_F(ExplainTest, ReplaysTheSameBitsAgain) {
  ASSERT_EQ(Explain("1", "7", "again").exit_status, 0);
  EXPECT_EQ(FileText(place_->Path("again.json")), FileText(place_->Path("tree.json")));
  ASSERT_EQ(Explain("1", "8", "next").exit_status, 0);
  EXPECT_NE(Tree("next")["edges"], Tree("tree")["edges"]);
}

TEST_F(ExplainTest, AnEvaluationOfTheSamePlannerHasTheSameTree) {
  ASSERT_EQ(place_->Runner({"eval", "1", "--planner", "mcts_pw", "--db", "e.db"}).exit_status, 0);
  const ProgramResult result = Explain("2", "7", "evaluation");
  ASSERT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(Tree("evaluation")["edges"], Tree("tree")["edges"]);
}

TEST_F(ExplainTest, ThePageHoldsTheTreeAndNeedsNoNetwork) {
  const std::string page = FileText(place_->Path("tree.html"));
  for (const char* outside : {"http:", "https:", "@import", "url("}) {
    EXPECT_EQ(page.find(outside), std::string::npos) << outside;
  }
  for (std::size_t at = 0; (at = page.find("src=", at)) != std::string::npos; ++at) {
    EXPECT_EQ(page.substr(at, 15), "src=\"data:image");  // the page holds its picture
  }
  const std::string begin = "<script type=\"application/json\" id=\"data\">";
  const auto from = page.find(begin) + begin.size();
  const nlohmann::json held =
      nlohmann::json::parse(page.substr(from, page.find("</script>", from) - from));
  EXPECT_EQ(held, Tree("tree"));
}

TEST_F(ExplainTest, ABrowserShowsEveryRootAction) {
  if (std::system("chromium --version > /dev/null 2>&1") != 0) GTEST_SKIP() << "no chromium";
  const std::string command =
      "timeout 60 chromium --headless=new --no-sandbox --dump-dom --user-data-dir=" +
      place_->Path("browser") + " file://" + place_->Path("tree.html") + " > " +
      place_->Path("dom") + " 2> /dev/null";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const std::string dom = FileText(place_->Path("dom"));
  EXPECT_NE(dom.find("Decision 7 of evaluation episode 0"), std::string::npos);
  std::size_t bars = 0, roots = 0;
  for (auto at = dom.find("class=\"fill\" style=\"left"); at != std::string::npos;
       at = dom.find("class=\"fill\" style=\"left", at + 1)) {
    ++bars;
  }
  const nlohmann::json tree = Tree("tree");
  for (const auto& edge : tree["edges"]) roots += edge["parent"] == -1 ? 1 : 0;
  EXPECT_EQ(bars, roots + 1);  // and the one component of the selected action
  EXPECT_NE(dom.find(">played<"), std::string::npos);
}

TEST_F(ExplainTest, AFolderGetsFilesOfTheUsualName) {
  std::filesystem::create_directory(place_->Path("trees"));
  for (const char* out : {"trees", "trees/"}) {
    ASSERT_EQ(Explain("1", "7", out).exit_status, 0);
    EXPECT_EQ(Tree("trees/run1_episode0_decision7")["edges"], Tree("tree")["edges"]);
    std::filesystem::remove(place_->Path("trees/run1_episode0_decision7.json"));
  }
  EXPECT_EQ(Explain("1", "7", "nowhere/").exit_status, 73);
}

TEST_F(ExplainTest, TrainingKeepsItsTreesAndItsDigest) {
  const ProgramResult trained =
      place_->Runner(TinyRun("cartpole_balance", "mcts_pw", "kept.db", {"--record-trees"}));
  ASSERT_EQ(trained.exit_status, 0) << trained.err;
  EXPECT_EQ(place_->Value("kept.db", "select result_digest from run"),
            place_->Value("e.db", "select result_digest from run where run_id = 1"));
  // Episode 0 was random; 1, 2 and 3 were planned.
  EXPECT_EQ(place_->Value("kept.db", "select count(*) from artifact where kind = 'trees'"), "3");
  const ProgramResult shown =
      place_->Runner({"explain", "1", "--training", "--episode", "2", "--decision", "30", "--db",
                      "kept.db", "--out", "training"});
  ASSERT_EQ(shown.exit_status, 0) << shown.err;
  const nlohmann::json tree = Tree("training");
  EXPECT_EQ(tree["phase"], "training");
  // The decision's own row says the same.
  const std::string row = place_->Value(
      "kept.db", "select simulations || ' ' || nodes || ' ' || depth || ' ' || (value = " +
                     tree["root"]["value"].dump() +
                     ") || ' ' || (env_step - 2) from step where "
                     "episode = 2 and t = 30");
  EXPECT_EQ(row, tree["root"]["simulations"].dump() + " " + tree["root"]["nodes"].dump() + " " +
                     tree["root"]["depth"].dump() + " 1 " + tree["env_step"].dump());
  const ProgramResult random =
      place_->Runner({"explain", "1", "--training", "--decision", "0", "--db", "kept.db"});
  EXPECT_EQ(random.exit_status, 66) << random.err;
  EXPECT_NE(random.err.find("random"), std::string::npos) << random.err;

  // Resumed, here from the beginning, it goes on keeping them.
  place_->Query("kept.db", "update run set status = 'queued', env_steps_done = 0");
  place_->Query("kept.db", "delete from artifact");
  std::vector<std::filesystem::path> before;
  for (const auto& file :
       std::filesystem::recursive_directory_iterator(place_->Path("kept.db.files"))) {
    const std::filesystem::path kind = file.path().extension();
    if (kind == ".trees" || kind == ".ckpt") before.push_back(file.path());
  }
  for (const std::filesystem::path& file : before) std::filesystem::remove(file);
  ASSERT_EQ(place_->Runner({"resume", "1", "--db", "kept.db"}).exit_status, 0);
  EXPECT_EQ(place_->Value("kept.db", "select count(*) from artifact where kind = 'trees'"), "3");
}

TEST_F(ExplainTest, SaysWhatItCannotShow) {
  const ProgramResult beyond = Explain("1", "500", "x");
  EXPECT_EQ(beyond.exit_status, 2) << beyond.err;
  EXPECT_NE(beyond.err.find("expected 0 to 499"), std::string::npos) << beyond.err;
  EXPECT_FALSE(std::filesystem::exists(place_->Path("x.json")));
  const ProgramResult late = place_->Runner(
      {"explain", "1", "--decision", "7", "--episode", "1", "--db", "e.db", "--out", "x"});
  EXPECT_EQ(late.exit_status, 2) << late.err;
  EXPECT_NE(late.err.find("is evaluated with 1 episode, expected 0 to 0, found 1"),
            std::string::npos)
      << late.err;
  EXPECT_FALSE(std::filesystem::exists(place_->Path("x.json")));
  const ProgramResult none = place_->Runner({"explain", "1", "--db", "e.db"});
  EXPECT_EQ(none.exit_status, 2) << none.err;
  EXPECT_NE(none.err.find("expected --decision T"), std::string::npos) << none.err;
}

}  // namespace
}  // namespace dreamsearch
