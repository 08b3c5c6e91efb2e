#include "host/saving/checkpoint.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <functional>
#include <iterator>
#include <utility>

#include "dreamsearch/random.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/temporary_folder.h"

namespace dreamsearch {
namespace {

class CheckpointTest : public testing::Test {
 protected:
  static std::string Read(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  static void Write(const std::filesystem::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
  }

  // Three parts; the step is in the first.
  static std::function<void(CheckpointWriter*)> Parts(std::uint64_t step = 7) {
    return [step](CheckpointWriter* writer) {
      writer->Part(kStep, [&](StateWriter* part) { (*part)("step", &step); });
      writer->Part(kModel, [&](StateWriter* part) {
        EXPECT_TRUE(
            part->Stream("state", [&](ByteSink* sink) { return sink->Write(Model().data(), 300); })
                .ok());
      });
      writer->Part(kEmpty, [](StateWriter*) {});
    };
  }
  static std::string Model() { return std::string(299, 'm') + "e"; }
  static std::uint64_t Step(const Checkpoint& checkpoint) {
    std::uint64_t step = 0;
    checkpoint.Read(kStep, [&](StateReader* part) { (*part)("step", &step); });
    return step;
  }
  // Opens and verifies.
  static void Check(const std::filesystem::path& path) { Checkpoint(path).Verify(); }
  // The message of a refusal, which must be of exit code 65; empty if there was none.
  template <typename Call>
  static std::string Refusal(Call call) {
    try {
      call();
      return "";
    } catch (const Failure& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput) << error.what();
      return error.what();
    }
  }

  static constexpr PartName kStep{"step", 1}, kModel{"model", 3}, kEmpty{"empty", 1};
  TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
};

TEST_F(CheckpointTest, ReadsBackWhatWasWritten) {
  const WrittenFile written = WriteCheckpointFile(folder_ / "x", Parts());
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.tmp"));
  const Checkpoint checkpoint(folder_ / "x");
  EXPECT_EQ(Step(checkpoint), 7u);
  std::string model;
  checkpoint.Read(kModel, [&](StateReader* part) {
    part->Stream("state", [&](std::string_view bytes) { model += bytes; });
  });
  EXPECT_EQ(model, Model());
  EXPECT_TRUE(checkpoint.Has(kEmpty));
  EXPECT_FALSE(checkpoint.Has({"absent", 1}));
  checkpoint.Read(kEmpty, [](StateReader*) {});
}

TEST_F(CheckpointTest, DigestsComputedWhileWritingAreThoseOfTheFile) {
  const WrittenFile written = WriteCheckpointFile(folder_ / "x", Parts());
  EXPECT_EQ(written.sha256, Sha256HexOfFile(folder_ / "x"));
  EXPECT_EQ(written.bytes, std::filesystem::file_size(folder_ / "x"));
  EXPECT_EQ(Checkpoint(folder_ / "x").StreamSha256(kModel, "state"), Sha256Hex(Model()));
}

TEST_F(CheckpointTest, AnyFlippedByteIsFound) {
  WriteCheckpointFile(folder_ / "x", Parts());
  const std::string good = Read(folder_ / "x");
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ (1 << (i % 8)));
    Write(folder_ / "bad", bad);
    const std::string message = Refusal([&] { Check(folder_ / "bad"); });
    EXPECT_NE(message.find((folder_ / "bad").string()), std::string::npos)
        << "byte " << i << ": " << message;
  }
}

TEST_F(CheckpointTest, AnyCutIsFound) {
  WriteCheckpointFile(folder_ / "x", Parts());
  const std::string good = Read(folder_ / "x");
  for (std::size_t size = 0; size < good.size(); ++size) {
    Write(folder_ / "bad", good.substr(0, size));
    // Even if only the small parts are asked for.
    EXPECT_NE(Refusal([&] { Checkpoint(folder_ / "bad"); }), "") << "cut at " << size;
  }
  Write(folder_ / "bad", good + "x");
  EXPECT_NE(Refusal([&] { Checkpoint(folder_ / "bad"); }), "");
}

TEST_F(CheckpointTest, AnotherFormatIsRefusedWithASentence) {
  WriteCheckpointFile(folder_ / "x", Parts());
  std::string other = Read(folder_ / "x");
  other[7] = 1;
  Write(folder_ / "old", other);
  const std::string message = Refusal([&] { Checkpoint(folder_ / "old"); });
  EXPECT_NE(message.find("/old is a checkpoint of format 1, of another runner"), std::string::npos)
      << message;
  EXPECT_NE(message.find("reads format 2"), std::string::npos) << message;
  EXPECT_NE(message.find("--retry --replace"), std::string::npos) << message;
}

TEST_F(CheckpointTest, FieldsThatAreMissingSurplusRenamedOrOfAnotherTypeAreRefusedByName) {
  const CheckpointHeader header{"uuid", "abc", 3, "avx2", {{"p", "1"}, {"q", "2"}}};
  const auto refusal = [&](const std::function<void(StateWriter*)>& fields) {
    WriteCheckpointFile(folder_ / "x",
                        [&](CheckpointWriter* writer) { writer->Part(kHeaderPart, fields); });
    return Refusal([&] { Checkpoint(folder_ / "x").Value<CheckpointHeader>(kHeaderPart); });
  };
  const std::string run = "uuid", configuration = "abc";
  EXPECT_EQ(refusal([&](StateWriter* part) { CheckpointHeader(header).Fields(part); }), "");
  const std::pair<std::function<void(StateWriter*)>, const char*> cases[] = {
      {[&](StateWriter* part) { (*part)("configuration", &configuration); },
       "expected the field 'run', found the field 'configuration'"},
      {[&](StateWriter* part) { (*part)("name", &run); },
       "expected the field 'run', found the field 'name'"},
      {[&](StateWriter* part) { (*part)("run", &run); },
       "expected the field 'configuration', found no more fields"},
      {[&](StateWriter* part) {
         CheckpointHeader(header).Fields(part);
         (*part)("surplus", &run);
       },
       "expected no more fields, found the field 'surplus'"},
      {[&](StateWriter* part) {
         const double number = 1;
         (*part)("run", &number);
       },
       "field 'run': expected a text, found doubles"},
  };
  for (const auto& [fields, expected] : cases) {
    const std::string message = refusal(fields);
    EXPECT_NE(message.find((folder_ / "x").string() + ", part 'header': "), std::string::npos)
        << message;
    EXPECT_NE(message.find(expected), std::string::npos) << message;
    EXPECT_NE(message.find("It was written by runner "), std::string::npos) << message;
    EXPECT_NE(message.find("start the run over"), std::string::npos) << message;
  }
}

TEST_F(CheckpointTest, PartsThatAreMissingOrOfAnotherVersionAreRefusedByName) {
  WriteCheckpointFile(folder_ / "x", Parts());
  const Checkpoint checkpoint(folder_ / "x");
  const std::string missing = Refusal([&] { checkpoint.Read({"replay", 1}, [](StateReader*) {}); });
  EXPECT_NE(missing.find("expected a part 'replay', found none. It was written by runner "),
            std::string::npos)
      << missing;
  const std::string version = Refusal([&] { checkpoint.Read({"model", 4}, [](StateReader*) {}); });
  EXPECT_NE(version.find("part 'model': expected version 4, found 3. It was written by runner "),
            std::string::npos)
      << version;
}

TEST_F(CheckpointTest, WhatIsNoCheckpointIsRefused) {
  Write(folder_ / "x", "SQLite format 3, or anything else that is long enough to be a checkpoint");
  EXPECT_NE(Refusal([&] { Checkpoint(folder_ / "x"); }).find("is no checkpoint"),
            std::string::npos);
  EXPECT_NE(Refusal([&] { Checkpoint{folder_}; }).find("no regular file"), std::string::npos);
  try {
    const Checkpoint absent(folder_ / "absent");
    ADD_FAILURE();
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kNotFound);
  }
}

TEST_F(CheckpointTest, AnOpenOneStaysWhatItWas) {
  WriteCheckpointFile(folder_ / "x", Parts(7));
  const Checkpoint checkpoint(folder_ / "x");
  WriteCheckpointFile(folder_ / "x", Parts(8));
  EXPECT_EQ(Step(checkpoint), 7u);
  EXPECT_EQ(Step(Checkpoint(folder_ / "x")), 8u);
}

TEST_F(CheckpointTest, KeepsTheLastTwoAndLoadsTheNewest) {
  CheckpointFolder checkpoints(folder_);
  EXPECT_FALSE(checkpoints.LoadNewest());
  std::uint64_t before = 0;
  for (const std::uint64_t step : {1000, 2000, 10000}) {
    checkpoints.Write(step, Parts(step), before);
    before = step;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "checkpoint-1000.ckpt"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "checkpoint-2000.ckpt"));
  EXPECT_EQ(Step(checkpoints.LoadNewest()->checkpoint), 10000u);
}

TEST_F(CheckpointTest, FallsBackToTheOneBeforeADamagedOne) {
  CheckpointFolder checkpoints(folder_);
  checkpoints.Write(1000, Parts(1000), 0);
  checkpoints.Write(2000, Parts(2000), 1000);
  Write(folder_ / "checkpoint-2000.ckpt", Read(folder_ / "checkpoint-2000.ckpt").substr(0, 30));
  const auto loaded = checkpoints.LoadNewest();
  EXPECT_EQ(Step(loaded->checkpoint), 1000u);
  ASSERT_EQ(loaded->skipped.size(), 1u);
  EXPECT_TRUE(loaded->skipped[0].damaged);
  EXPECT_NE(loaded->skipped[0].why.find("checkpoint-2000.ckpt"), std::string::npos);
  Write(folder_ / "checkpoint-1000.ckpt", "");
  EXPECT_THROW(checkpoints.LoadNewest(), Failure);
}

// A run that went back from 3000 to 1000 must not lose what it writes on its way there.
TEST_F(CheckpointTest, KeepsWhatWasWrittenAndWhereItCameFromBesideLaterOnes) {
  CheckpointFolder checkpoints(folder_);
  for (const std::uint64_t step : {1000, 2500, 3000}) checkpoints.Write(step, Parts(), step);
  checkpoints.Write(2000, Parts(), 1000);
  const auto there = [&](std::uint64_t step) {
    return std::filesystem::exists(checkpoints.PathOf(step));
  };
  EXPECT_TRUE(there(1000) && there(2000) && there(2500) && there(3000));
  checkpoints.Write(2800, Parts(), 2000);
  EXPECT_TRUE(!there(1000) && there(2000) && !there(2500) && there(2800) && there(3000));
}

TEST_F(CheckpointTest, LoadsTheNewestThatTheJudgeLetsThrough) {
  CheckpointFolder checkpoints(folder_);
  for (const std::uint64_t step : {1000, 2000, 3000}) {
    checkpoints.Write(step, Parts(step), step);
  }
  const auto loaded = checkpoints.LoadNewest(
      [](const Checkpoint& checkpoint) { return Step(checkpoint) == 1000 ? "" : "is too new"; });
  EXPECT_EQ(Step(loaded->checkpoint), 1000u);
  ASSERT_EQ(loaded->skipped.size(), 2u);
  EXPECT_FALSE(loaded->skipped[0].damaged);
  EXPECT_EQ(loaded->skipped[0].why, checkpoints.PathOf(3000).string() + " is too new");
  try {
    checkpoints.LoadNewest([](const Checkpoint&) { return "is of another run"; });
    ADD_FAILURE() << "none will do";
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    EXPECT_NE(std::string(error.what()).find("checkpoint-1000.ckpt is of another run"),
              std::string::npos)
        << error.what();
  }
}

TEST_F(CheckpointTest, AnOutlineDoesNotReadTheLargeParts) {
  CheckpointFolder checkpoints(folder_);
  checkpoints.Write(1000, Parts(1000), 0);
  std::string bad = Read(checkpoints.PathOf(1000));
  bad[bad.find("mmm")] = 'n';
  Write(checkpoints.PathOf(1000), bad);
  const auto outline = checkpoints.LoadNewest({}, CheckpointFolder::Extent::kOutline);
  EXPECT_EQ(Step(outline->checkpoint), 1000u);
  EXPECT_NE(Refusal([&] {
              outline->checkpoint.StreamSha256(kModel, "state");
            }).find("the checksum of part 'model' does not match"),
            std::string::npos);
  EXPECT_THROW(checkpoints.LoadNewest(), Failure);
}

TEST_F(CheckpointTest, SaysWhereItCannotWrite) {
  try {
    WriteCheckpointFile(folder_ / "absent" / "x", Parts());
    FAIL();
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kCannotCreate);
    EXPECT_NE(std::string(error.what()).find("absent/x"), std::string::npos) << error.what();
  }
}

TEST_F(CheckpointTest, ADiskThatTakesNoMoreIsAnInputOutputError) {
  ::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit little = {16, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &little);
  const auto restore = [&] { ::setrlimit(RLIMIT_FSIZE, &before); };
  try {
    WriteCheckpointFile(folder_ / "x", Parts());
    restore();
    FAIL();
  } catch (const Failure& error) {
    restore();
    EXPECT_EQ(error.code(), ExitCode::kInputOutput) << error.what();
    EXPECT_NE(std::string(error.what()).find("bytes free"), std::string::npos) << error.what();
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(CheckpointTest, AFileThatCannotBeReadIsNotPassedOverForAnOlderOne) {
  if (::geteuid() == 0) GTEST_SKIP() << "root reads what it likes";
  const CheckpointFolder folder(folder_);
  for (const std::uint64_t step : {1, 2}) CheckpointFolder(folder_).Write(step, Parts(), step - 1);
  std::filesystem::permissions(folder.PathOf(2), std::filesystem::perms::none);
  EXPECT_THROW(folder.LoadNewest(), Failure);
}

TEST_F(CheckpointTest, WhatAKilledWriterLeftGoesWithTheNextCheckpoint) {
  CheckpointFolder folder(folder_);
  const TemporaryFile left = MakeTemporaryFile(folder.PathOf(7));
  const std::filesystem::path other = folder_ / "notes.tmp";
  std::ofstream(other) << "mine";
  folder.Write(8, Parts(), 0);
  EXPECT_FALSE(std::filesystem::exists(left.path));
  EXPECT_TRUE(std::filesystem::exists(other));
}

TEST_F(CheckpointTest, WritesThroughNoLinkAndOverNoFileThatItDidNotMake) {
  const std::filesystem::path target = folder_ / "target";
  std::ofstream(target) << "kept";
  std::filesystem::create_symlink(target, folder_ / "x");
  std::filesystem::create_symlink(target, folder_ / "x.tmp");
  WriteCheckpointFile(folder_ / "x", Parts());
  EXPECT_EQ(std::filesystem::file_size(target), 4u);
  EXPECT_FALSE(std::filesystem::is_symlink(folder_ / "x"));
  EXPECT_EQ(Step(Checkpoint(folder_ / "x")), 7u);
}

}  // namespace
}  // namespace dreamsearch
