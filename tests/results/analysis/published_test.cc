#include "results/analysis/published.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <fstream>

#include "results/figures/curve_figure.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/table.h"
#include "tests/results/database/recording.h"

namespace dreamsearch::results {
namespace {

std::vector<PublishedPoint> Parse(const std::string& bytes, const ImportSettings& settings = {},
                                  const std::string& path = "/x/tdmpc2/walker-walk.csv") {
  return ParsePublished(path, bytes, settings);
}

// The exit code and that the message names the place.
void ExpectMalformed(const std::string& bytes, const std::string& where) {
  try {
    Parse(bytes);
    FAIL() << bytes;
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    EXPECT_NE(std::string(error.what()).find(where), std::string::npos) << error.what();
  }
}

constexpr char kScores[] =
    "source,method,obs,task,env_steps,seed,return,target,n_seeds,seed_sd\r\n"
    "lab/agent,agent,state,walker_walk,105000,0,57.07,100000,,\r\n"
    "\"lab, the other\",agent,pixels,dmc_ball_in_cup_catch,500000,mean,12.5,500000,5,3.25\r\n";

TEST(Published, ScoresAreReadByTheNamesOfTheirColumns) {
  const std::vector<PublishedPoint> points = Parse(kScores);
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].source, "lab/agent");
  EXPECT_EQ(points[0].env_steps, 105000);
  EXPECT_EQ(points[0].seed, 0);
  EXPECT_EQ(points[0].episode_return, 57.07);
  EXPECT_FALSE(points[0].n_seeds);
  EXPECT_EQ(points[1].source, "lab, the other");
  EXPECT_EQ(points[1].task, "cup_catch");
  EXPECT_FALSE(points[1].seed);
  EXPECT_EQ(points[1].n_seeds, 5);
  EXPECT_EQ(points[1].seed_sd, 3.25);
}

TEST(Published, DreamersListsAreRead) {
  const std::vector<PublishedPoint> points = Parse(
      R"([{"task":"dmc_walker_walk","method":"dreamer","seed":"3","xs":[1e4,20000],"ys":[1.5,2]}])",
      {.steps_per_unit = 2});
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].task, "walker_walk");
  EXPECT_EQ(points[0].env_steps, 20000);
  EXPECT_EQ(points[1].env_steps, 40000);
  EXPECT_EQ(points[1].seed, 3);
  EXPECT_EQ(points[1].episode_return, 2);
}

TEST(Published, TdmpcsFilesTakeTaskAndMethodFromTheirPath) {
  const std::vector<PublishedPoint> points = Parse("step,reward,seed\n0,1.25,1\n50000,900,1\n");
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].task, "walker_walk");
  EXPECT_EQ(points[0].method, "tdmpc2");
  EXPECT_EQ(points[1].env_steps, 50000);
  EXPECT_EQ(points[1].seed, 1);
}

std::string Gzip(const std::string& text) {
  z_stream stream = {};
  deflateInit2(&stream, 9, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
  std::string packed(deflateBound(&stream, text.size()) + 64, '\0');
  std::string input = text;
  stream.next_in = reinterpret_cast<Bytef*>(input.data());
  stream.avail_in = static_cast<uInt>(input.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  deflate(&stream, Z_FINISH);
  packed.resize(packed.size() - stream.avail_out);
  deflateEnd(&stream);
  return packed;
}

constexpr char kList[] =
    R"([{"task":"dmc_walker_walk","method":"m","seed":0,"xs":[1,2],"ys":[1.5,2]}])";

TEST(Published, GzipFilesAreUnpacked) {
  std::vector<PublishedPoint> points = Parse(Gzip(kList), {}, "/x/dmc_proprio-m.json.gz");
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].source, "dmc_proprio-m.json");
  EXPECT_EQ(points[1].episode_return, 2);
  points = Parse(Gzip("step,reward,seed\n0,1,1\n"), {}, "/x/tdmpc2/walker-walk.csv.gz");
  EXPECT_EQ(points.at(0).task, "walker_walk");
  // Of several members, and longer than a buffer.
  std::string csv = "step,reward,seed\n";
  for (int i = 0; i < 30000; ++i) csv += std::to_string(i) + ",0.5,1\n";
  const std::string half = csv.substr(0, 100000);
  EXPECT_EQ(Parse(Gzip(half) + Gzip(csv.substr(100000))).size(), 30000u);
}

TEST(Published, OtherCompressedFilesAreNamedWithTheCommandThatUnpacksThem) {
  const std::string gzip = Gzip(kList);
  ExpectMalformed(gzip.substr(0, gzip.size() - 9), "damaged or cut short");
  ExpectMalformed(gzip.substr(0, 2), "damaged or cut short");
  std::string flipped = gzip;
  flipped[gzip.size() / 2] = static_cast<char>(flipped[gzip.size() / 2] ^ 4);
  ExpectMalformed(flipped, "damaged or cut short");
  ExpectMalformed(gzip + "x", "damaged or cut short");
  ExpectMalformed(std::string("\xfd") + "7zXZ", "xz -dk /x/tdmpc2/walker-walk.csv");
  ExpectMalformed("\x28\xb5\x2f\xfd.", "zstd -dk /x");
  ExpectMalformed("BZh91AY", "bzip2 -dk /x");
  ExpectMalformed("PK\x03\x04.", "unzip /x");
}

TEST(Published, WhatAMethodObservesIsToldByANameOrUnknown) {
  const auto obs = [](const std::string& path, const ImportSettings& settings = {}) {
    return Parse(kList, settings, path).at(0).obs;
  };
  EXPECT_EQ(obs("/x/dmc_proprio-dreamerv3.json"), "state");
  EXPECT_EQ(obs("/x/dmc_vision-dreamerv3.json.gz"), "pixels");
  EXPECT_EQ(obs("/x/scores.json"), kUnknownObs);
  EXPECT_EQ(obs("/vision/scores.json"), kUnknownObs);        // a folder of many files
  EXPECT_EQ(obs("/x/stateless.json"), kUnknownObs);          // part of a word
  EXPECT_EQ(obs("/x/proprio-vs-pixels.json"), kUnknownObs);  // of both
  EXPECT_EQ(obs("/x/dmc_vision.json", {.obs = "state"}), "state");
  EXPECT_EQ(obs("/x/scores.json", {.method = "drq-pixels"}), "pixels");
  const std::string csv = "step,reward,seed\n0,1,1\n";
  EXPECT_EQ(Parse(csv, {}, "/x/tdmpc2/walker-walk.csv").at(0).obs, kUnknownObs);
  EXPECT_EQ(Parse(csv, {}, "/x/tdmpc2-pixels/walker-walk.csv").at(0).obs, "pixels");
}

TEST(Published, WhatWasUnknownIsReplacedWhenItIsTold) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  StorePublished(db.get(), Parse(kList, {}, "/x/a.json"));
  EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM published WHERE obs = 'unknown'"), 2);
  StorePublished(db.get(), Parse(kList, {.obs = "state"}, "/x/a.json"));
  EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM published"), 2);
  EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM published WHERE obs = 'state'"), 2);
}

// Episodes of one evaluation; the last of them is not the evaluation's return.
TEST(Published, PointsOfOneSeedAtOneStepAreTheirMean) {
  const std::vector<PublishedPoint> points =
      Parse("step,reward,seed\n0,1,1\n0,2,1\n5,9,1\n0,6,1\n");
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].episode_return, 3);
  EXPECT_EQ(points[1].episode_return, 9);
}

TEST(Published, TwoCurvesOfOneSeedAreRefused) {
  ExpectMalformed(R"([{"task":"t","method":"m","seed":0,"xs":[1],"ys":[1]},)"
                  R"({"task":"t","method":"m","seed":0,"xs":[1],"ys":[2]}])",
                  "item 1");
}

TEST(Published, UnsortedPointsAreDrawnInOrder) {
  const TemporaryFolder folder;
  std::vector<std::unique_ptr<Database>> databases;
  databases.push_back(Database::OpenOrCreate(folder / "r.db"));
  MakeRun(databases[0].get());
  StorePublished(databases[0].get(),
                 Parse("step,reward,seed\n30,3,1\n10,1,1\n9007199254740992,4,1\n20,2,1\n"));
  const std::vector<Line> lines = ReadLines(databases, {.published = {"all"}});
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[1].label, "tdmpc2, published");
  EXPECT_EQ(lines[1].runs.at(0).value, (std::vector<double>{1, 2, 3, 4}));
}

TEST(Published, WhatIsMalformedIsNamedWithItsPlace) {
  ExpectMalformed("", "is empty");
  ExpectMalformed("a,b\n1,2\n", "column 'source'");
  ExpectMalformed("step,reward,seed\n1,x,0\n", ".csv:2");
  ExpectMalformed("step,reward,seed\n1,nan,0\n", "finite");
  ExpectMalformed("step,reward,seed\n1,inf,0\n", "finite");
  ExpectMalformed("step,reward,seed\n1.5,1,0\n", "whole number");
  ExpectMalformed("step,reward,seed\n-1,1,0\n", "whole number");
  ExpectMalformed("step,reward,seed\n1e300,1,0\n", "whole number");
  ExpectMalformed("step,reward,seed\n1,1,-1\n", "seed");
  ExpectMalformed("step,reward,seed\n1,1\n", "expected 3 fields");
  ExpectMalformed("step,reward,seed\n\"1,1,0\n", "quote");
  ExpectMalformed("[", "JSON");
  ExpectMalformed("[1]", "item 0");
  ExpectMalformed(R"([{"task":"t","method":"m","seed":0,"xs":[1],"ys":[]}])", "as many ys");
  ExpectMalformed(R"([{"task":"t","method":"m","seed":0,"xs":[1],"ys":["a"]}])", "finite numbers");
  ExpectMalformed(R"([{"task":"t","method":"m","seed":1.5,"xs":[],"ys":[]}])", "'seed'");
  ExpectMalformed(R"([{"method":"m","seed":1,"xs":[],"ys":[]}])", "'task'");
}

TEST(Published, StoringTwiceStoresOnce) {
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  StorePublished(db.get(), Parse(kScores));
  StorePublished(db.get(), Parse(kScores));
  EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM published"), 2);
}

TEST(Published, WhatWeExportCanBeImported) {
  const TemporaryFolder folder;
  std::vector<std::unique_ptr<Database>> databases;
  databases.push_back(Database::OpenOrCreate(folder / "r.db"));
  for (const int seed : {0, 1}) {
    RunWriter writer(databases[0].get(), MakeRun(databases[0].get(), {.seed = seed}));
    writer.BeginSegment(MakeSegment(databases[0].get()));
    for (std::int64_t i = 0; i < 3; ++i) {
      writer.AddEpisode({.phase = Phase::kSearchEvaluation,
                         .episode = i,
                         .env_step = i * 10000,
                         .episode_return = 100.0 * seed + 1.0 / 3 + static_cast<double>(i)});
    }
    writer.Finish();
  }
  const std::vector<Line> lines = ReadLines(databases, {});
  ASSERT_EQ(lines.size(), 1u);
  for (const std::string& bytes : {DreamerScores(lines), TdmpcScores(lines[0])}) {
    const std::vector<PublishedPoint> points = Parse(bytes);
    ASSERT_EQ(points.size(), 6u);
    EXPECT_EQ(points[4].env_steps, 10000);
    EXPECT_EQ(points[4].seed, 1);
    EXPECT_EQ(points[4].episode_return, 100 + 1.0 / 3 + 1);
    EXPECT_EQ(points[4].task, "walker_walk");
  }
}

TEST(Published, CurvesAreDrawnBesideOurs) {
  const TemporaryFolder folder;
  std::vector<std::unique_ptr<Database>> databases;
  databases.push_back(Database::OpenOrCreate(folder / "r.db"));
  MakeRun(databases[0].get());
  StorePublished(databases[0].get(), Parse(kScores));
  EXPECT_EQ(ReadLines(databases, {}).size(), 1u);
  const std::vector<Line> lines = ReadLines(databases, {.published = {"agent/state"}});
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_TRUE(lines[1].published);
  EXPECT_EQ(lines[1].task, "walker_walk");
  EXPECT_EQ(lines[1].n(), 1);
}

// Else its legend would say that one seed was run.
TEST(Published, AMeanOverSeedsIsNotCalledASeed) {
  const TemporaryFolder folder;
  std::vector<std::unique_ptr<Database>> databases;
  databases.push_back(Database::OpenOrCreate(folder / "r.db"));
  MakeRun(databases[0].get(), {.task = "cup_catch"});
  StorePublished(databases[0].get(), Parse(kScores));
  const std::vector<Line> lines = ReadLines(databases, {.published = {"all"}});
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[1].label, "agent pixels, published mean over seeds");
}

TEST(Published, TheAxisEndsWithOurRuns) {
  const auto line = [](bool published, std::vector<double> x) {
    Line made = {.task = "walker_walk", .label = published ? "theirs" : "ours"};
    made.published = published;
    RunCurve run;
    for (const double at : x) run.env_step.push_back(static_cast<std::int64_t>(at));
    run.value.assign(x.size(), 1);
    run.x = std::move(x);
    made.runs.push_back(run);
    return made;
  };
  const auto end = [](const std::vector<Line>& lines) {
    return CurvesByTask(lines, {}, CurveInterval::kMinMax).x_high;
  };
  const Line ours = line(false, {0, 100000});
  EXPECT_FALSE(end({ours}));
  EXPECT_DOUBLE_EQ(*end({ours, line(true, {0, 50000, 2e6})}), 110000);
  // Not so early that nothing of theirs is left.
  EXPECT_DOUBLE_EQ(*end({ours, line(true, {200000, 2e6})}), 220000);
  EXPECT_FALSE(end({line(true, {200000, 2e6})}));
  EXPECT_FALSE(end({ours, line(true, {50000, 100000})}));
  // A logarithmic axis has all of them, and the note says nothing of a cut.
  const Line theirs = line(true, {0, 50000, 2e6});
  const auto cut = [&](bool log_x) {
    const Figure figure = CurvesByTask({ours, theirs}, {.log_x = log_x}, CurveInterval::kMinMax);
    EXPECT_EQ(figure.x_log, log_x);
    return figure.x_high.has_value() ||
           figure.notes.at(0).find("beyond the axis") != std::string::npos;
  };
  EXPECT_TRUE(cut(false));
  EXPECT_FALSE(cut(true));
}

// The file of published scores, where it is at hand.
TEST(Published, TheAnchorsAreReadAsTheyAre) {
  const std::string path = std::string(DREAMSEARCH_SOURCE_DIR) + "/../shared/anchors/scores.csv";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no published scores at hand";
  const TemporaryFolder folder;
  const auto db = Database::OpenOrCreate(folder / "r.db");
  const std::vector<PublishedPoint> points = ParsePublished(path, ReadWholeFile(path), {});
  EXPECT_GT(points.size(), 10000u);
  StorePublished(db.get(), points);
  EXPECT_GT(Count(db.get(), "SELECT count(*) FROM published WHERE method = 'tdmpc2'"), 300);
  EXPECT_EQ(Count(db.get(), "SELECT count(DISTINCT task) FROM published WHERE task = 'cup_catch'"),
            1);
}

}  // namespace
}  // namespace dreamsearch::results
