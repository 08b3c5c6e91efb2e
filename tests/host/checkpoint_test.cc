#include "host/saving/checkpoint.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>

#include "dreamsearch/random.h"
#include "results/system/error.h"

namespace dreamsearch {
namespace {

class CheckpointTest : public testing::Test {
 protected:
  CheckpointTest() {
    std::string name = (std::filesystem::temp_directory_path() / "checkpoint_XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  ~CheckpointTest() override { std::filesystem::remove_all(folder_); }

  static std::string Read(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  static void Write(const std::filesystem::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
  }

  std::filesystem::path folder_;
  const CheckpointSections sections_ = {
      {"model", std::string(300, 'm')}, {"position", std::string("a\0b", 3)}, {"empty", ""}};
};

TEST_F(CheckpointTest, ReadsBackWhatWasWritten) {
  WriteCheckpointFile(folder_ / "x", sections_);
  EXPECT_EQ(ReadCheckpointFile(folder_ / "x"), sections_);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.tmp"));
}

TEST_F(CheckpointTest, AnyFlippedByteIsFound) {
  WriteCheckpointFile(folder_ / "x", sections_);
  const std::string good = Read(folder_ / "x");
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ (1 << (i % 8)));
    Write(folder_ / "bad", bad);
    EXPECT_THROW(ReadCheckpointFile(folder_ / "bad"), Failure) << "byte " << i;
  }
}

TEST_F(CheckpointTest, AnyCutIsFound) {
  WriteCheckpointFile(folder_ / "x", sections_);
  const std::string good = Read(folder_ / "x");
  for (std::size_t size = 0; size < good.size(); ++size) {
    Write(folder_ / "bad", good.substr(0, size));
    EXPECT_THROW(ReadCheckpointFile(folder_ / "bad"), Failure) << "cut at " << size;
  }
  Write(folder_ / "bad", good + "x");
  EXPECT_THROW(ReadCheckpointFile(folder_ / "bad"), Failure);
}

TEST_F(CheckpointTest, KeepsTheLastTwoAndLoadsTheNewest) {
  CheckpointFolder checkpoints(folder_);
  EXPECT_FALSE(checkpoints.LoadNewest());
  std::uint64_t before = 0;
  for (const std::uint64_t step : {1000, 2000, 10000}) {
    checkpoints.Write(step, {{"step", std::to_string(step)}}, before);
    before = step;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "checkpoint-1000.ckpt"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "checkpoint-2000.ckpt"));
  EXPECT_EQ(checkpoints.LoadNewest()->sections.at("step"), "10000");
}

TEST_F(CheckpointTest, FallsBackToTheOneBeforeADamagedOne) {
  CheckpointFolder checkpoints(folder_);
  checkpoints.Write(1000, {{"step", "1000"}}, 0);
  checkpoints.Write(2000, {{"step", "2000"}}, 1000);
  Write(folder_ / "checkpoint-2000.ckpt", Read(folder_ / "checkpoint-2000.ckpt").substr(0, 30));
  const auto loaded = checkpoints.LoadNewest();
  EXPECT_EQ(loaded->sections.at("step"), "1000");
  ASSERT_EQ(loaded->skipped.size(), 1u);
  EXPECT_TRUE(loaded->skipped[0].damaged);
  EXPECT_NE(loaded->skipped[0].why.find("checkpoint-2000.ckpt"), std::string::npos);
  Write(folder_ / "checkpoint-1000.ckpt", "");
  EXPECT_THROW(checkpoints.LoadNewest(), Failure);
}

// A run that went back from 3000 to 1000 must not lose what it writes on its way there.
TEST_F(CheckpointTest, KeepsWhatWasWrittenAndWhereItCameFromBesideLaterOnes) {
  CheckpointFolder checkpoints(folder_);
  for (const std::uint64_t step : {1000, 2500, 3000}) checkpoints.Write(step, sections_, step);
  checkpoints.Write(2000, sections_, 1000);
  const auto there = [&](std::uint64_t step) {
    return std::filesystem::exists(checkpoints.PathOf(step));
  };
  EXPECT_TRUE(there(1000) && there(2000) && there(2500) && there(3000));
  checkpoints.Write(2800, sections_, 2000);
  EXPECT_TRUE(!there(1000) && there(2000) && !there(2500) && there(2800) && there(3000));
}

TEST_F(CheckpointTest, LoadsTheNewestThatTheJudgeLetsThrough) {
  CheckpointFolder checkpoints(folder_);
  for (const std::uint64_t step : {1000, 2000, 3000}) {
    checkpoints.Write(step, {{"step", std::to_string(step)}}, step);
  }
  const auto loaded = checkpoints.LoadNewest([](const CheckpointSections& sections) {
    return sections.at("step") == "1000" ? "" : "is too new";
  });
  EXPECT_EQ(loaded->sections.at("step"), "1000");
  ASSERT_EQ(loaded->skipped.size(), 2u);
  EXPECT_FALSE(loaded->skipped[0].damaged);
  EXPECT_EQ(loaded->skipped[0].why, checkpoints.PathOf(3000).string() + " is too new");
  try {
    checkpoints.LoadNewest([](const CheckpointSections&) { return "is of another run"; });
    ADD_FAILURE() << "none will do";
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    EXPECT_NE(std::string(error.what()).find("checkpoint-1000.ckpt is of another run"),
              std::string::npos)
        << error.what();
  }
}

TEST_F(CheckpointTest, ReadsTheWantedSectionsAlone) {
  WriteCheckpointFile(folder_ / "x", sections_);
  const auto position = [](const std::string& name) { return name == "position"; };
  EXPECT_EQ(ReadCheckpointFile(folder_ / "x", position),
            CheckpointSections({{"position", sections_.at("position")}}));
  const std::string good = Read(folder_ / "x");
  for (std::size_t size = 0; size < good.size(); ++size) {
    Write(folder_ / "bad", good.substr(0, size));
    EXPECT_THROW(ReadCheckpointFile(folder_ / "bad", position), Failure) << "cut at " << size;
  }
}

TEST_F(CheckpointTest, SaysWhereItCannotWrite) {
  try {
    WriteCheckpointFile(folder_ / "absent" / "x", sections_);
    FAIL();
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kCannotCreate);
    EXPECT_NE(std::string(error.what()).find("absent/x"), std::string::npos) << error.what();
  }
}

TEST_F(CheckpointTest, AFullDiskIsAnInputOutputError) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  std::filesystem::create_symlink("/dev/full", folder_ / "x.tmp");
  try {
    WriteCheckpointFile(folder_ / "x", sections_);
    FAIL();
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kInputOutput) << error.what();
    EXPECT_NE(std::string(error.what()).find("bytes free"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace dreamsearch
