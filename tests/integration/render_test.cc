// runner render: films of trained agents and of planners on the oracle.
#include <gtest/gtest.h>

#include <filesystem>

#include "results/system/file.h"
#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

class RenderTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    const ProgramResult trained = place_->Runner(TinyRun("cartpole_balance", "mcts_pw", "r.db"));
    ASSERT_EQ(trained.exit_status, 0) << trained.err;
  }
  static void TearDownTestSuite() { delete place_; }

  static ProgramResult Render(std::vector<std::string> words) {
    words.insert(words.begin(), "render");
    words.insert(words.end(), {"--db", "r.db", "--width", "96", "--height", "64"});
    return place_->Runner(words);
  }
  static std::string FileText(const std::string& name) { return ReadWholeFile(place_->Path(name)); }

  static Workplace* place_;
};
Workplace* RenderTest::place_ = nullptr;

// The return that a film ends with, by the last line.
std::string ReturnIn(const ProgramResult& result) {
  const std::size_t at = result.err.rfind("returned ");
  return at == std::string::npos ? ""
                                 : result.err.substr(at + 9, result.err.find('\n', at) - at - 9);
}

TEST_F(RenderTest, AFilmShowsTheEpisodeThatEvalPlays) {
  const ProgramResult film = Render({"1", "--episode", "1", "--fps", "5", "--out", "one.mp4"});
  ASSERT_EQ(film.exit_status, 0) << film.err;
  EXPECT_EQ(FileText("one.mp4").substr(4, 4), "ftyp");
  ASSERT_EQ(place_->Runner({"eval", "1", "--planner", "mcts_pw", "--episodes", "2", "--db", "r.db"})
                .exit_status,
            0);
  EXPECT_EQ(ReturnIn(film),
            place_->Value("r.db",
                          "SELECT printf('%.1f', episode_return) FROM episode e JOIN run r"
                          " USING (run_id) WHERE r.parent_run_id = 1 AND e.episode = 1"));
}

TEST_F(RenderTest, SeveralPlannersStandSideBySideAndASheetIsAPng) {
  const ProgramResult film =
      Render({"1", "--planner", "mcts_pw,random", "--fps", "1", "--out", "both.png"});
  ASSERT_EQ(film.exit_status, 0) << film.err;
  EXPECT_NE(film.err.find("cartpole_balance, mcts_pw returned"), std::string::npos) << film.err;
  EXPECT_NE(film.err.find("; cartpole_balance, random returned"), std::string::npos) << film.err;
  const std::string png = FileText("both.png");
  ASSERT_EQ(png.substr(0, 8), "\x89PNG\r\n\x1a\n");
  // Four columns of two scenes of 96 pixels.
  EXPECT_EQ(static_cast<unsigned char>(png[18]) * 256 + static_cast<unsigned char>(png[19]),
            4 * 2 * 96);
}

TEST_F(RenderTest, AStripIsShownInTheReport) {
  ASSERT_EQ(place_->Results({"report", "without.html", "--db", "r.db"}).exit_status, 0);
  EXPECT_NE(FileText("without.html").find("No run keeps pictures"), std::string::npos);
  const ProgramResult strip = Render({"1", "--strip"});
  ASSERT_EQ(strip.exit_status, 0) << strip.err;
  ASSERT_EQ(place_->Results({"report", "with.html", "--db", "r.db"}).exit_status, 0);
  const std::string page = FileText("with.html");
  EXPECT_NE(page.find("<img src=\"data:image/png;base64,iVBORw0KGgo"), std::string::npos);
  EXPECT_NE(page.find("cartpole_balance, mcts_pw on dreamer, seed 0"), std::string::npos);
  // Nothing that was recorded has changed.
  EXPECT_EQ(place_->Results({"verify", "--db", "r.db"}).exit_status, 0);
}

TEST_F(RenderTest, WithoutATrainedRunTheOracleIsFilmed) {
  const ProgramResult film =
      place_->Runner({"render", "--env", "cartpole_swingup", "--planner", "random", "--width", "96",
                      "--height", "64", "--fps", "1", "--out", "frames/"});
  ASSERT_EQ(film.exit_status, 0) << film.err;
  // Ten seconds, the beginning and the end.
  EXPECT_TRUE(std::filesystem::exists(place_->Path("frames/frame-000011.png")));
  EXPECT_FALSE(std::filesystem::exists(place_->Path("frames/frame-000012.png")));
}

TEST_F(RenderTest, WrongRequestsSayWhatIsExpected) {
  const struct {
    std::vector<std::string> words;
    int status;
    const char* text;
  } cases[] = {
      {{"render"}, 2, "expected a trained run or a task"},
      {{"render", "--env", "walker_walk"}, 2, "expected --planner NAMES"},
      {{"render", "1", "--db", "r.db", "--out", "x.avi"},
       2,
       "expected a video (.mp4, .webm, .gif)"},
      {{"render", "1", "--db", "r.db", "--camera", "9", "--out", "x.png"}, 69, "camera 9"},
      {{"render", "7", "--db", "r.db"}, 66, "no run '7'"},
      {{"render", "--strip", "--env", "walker_walk", "--planner", "random"}, 2, "expected RUN"},
  };
  for (const auto& wrong : cases) {
    const ProgramResult result = place_->Runner(wrong.words);
    EXPECT_EQ(result.exit_status, wrong.status) << result.err;
    EXPECT_NE(result.err.find(wrong.text), std::string::npos) << result.err;
  }
}

TEST_F(RenderTest, ThePageOfADecisionShowsTheState) {
  const ProgramResult result =
      place_->Runner({"explain", "1", "--decision", "4", "--db", "r.db", "--out", "shown"});
  ASSERT_EQ(result.exit_status, 0) << result.err;
  EXPECT_NE(FileText("shown.html").find("data:image/png;base64,iVBORw0KGgo"), std::string::npos);
  EXPECT_EQ(FileText("shown.json").find("base64"), std::string::npos);
}

}  // namespace
}  // namespace dreamsearch
