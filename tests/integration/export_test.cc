// runner export: the file holds the very numbers of the checkpoint's model.
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "host/acting/components.h"
#include "host/saving/checkpoint.h"
#include "host/saving/safetensors.h"
#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

std::string FileBytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

class ExportTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    const ProgramResult trained = place_->Runner(TinyRun("cartpole_balance", "dreamer", "e.db"));
    ASSERT_EQ(trained.exit_status, 0) << trained.err;
    result_ = place_->Runner({"export", "1", "--db", "e.db", "--out", "w.safetensors"});
  }
  static void TearDownTestSuite() { delete place_; }

  static Workplace* place_;
  static ProgramResult result_;
};
Workplace* ExportTest::place_ = nullptr;
ProgramResult ExportTest::result_;

TEST_F(ExportTest, HoldsWhatTheModelExportsFromTheNewestCheckpoint) {
  ASSERT_EQ(result_.exit_status, 0) << result_.err;
  const std::string uuid = place_->Value("e.db", "select uuid from run");
  const std::string folder = place_->Path("e.db.files/" + uuid);
  const RunSpec spec = RunSpecFromJson(nlohmann::json::parse(FileBytes(folder + "/run.json")));
  const Components components(spec);
  const EnvironmentPtr environment = components.MakeEnvironment();
  const ModelPtr model = components.MakeModel(environment->spec(), 1, nullptr);
  LoadModel(Checkpoint(folder + "/checkpoint-4000.ckpt"), "dreamer", model.get());
  TensorCollector expected;
  ASSERT_TRUE(ExtensionOf<TensorExport>(model.get())->Export(&expected).ok());
  ASSERT_GT(expected.tensors().size(), 10u);

  const std::string bytes = FileBytes(place_->Path("w.safetensors"));
  std::uint64_t length = 0;
  ASSERT_GT(bytes.size(), sizeof length);
  std::memcpy(&length, bytes.data(), sizeof length);
  ASSERT_LT(length, bytes.size());
  const std::uint64_t begin = sizeof length + length;
  EXPECT_EQ(begin % 64, 0u);
  const nlohmann::json header = nlohmann::json::parse(bytes.substr(sizeof length, length));
  EXPECT_EQ(header.size(), expected.tensors().size() + 1);
  EXPECT_EQ(header["__metadata__"]["run_uuid"], uuid);
  EXPECT_EQ(header["__metadata__"]["env"], "cartpole_balance");
  EXPECT_EQ(header["__metadata__"]["env_step"], "4000");
  EXPECT_EQ(header["__metadata__"]["config_sha256"],
            place_->Value("e.db", "select sha256 from config"));
  std::uint64_t data = 0;
  for (const NamedTensor& tensor : expected.tensors()) {
    ASSERT_TRUE(header.contains(tensor.name)) << tensor.name;
    const nlohmann::json& entry = header[tensor.name];
    EXPECT_EQ(entry["dtype"], "F32");
    EXPECT_EQ(entry["shape"].get<std::vector<std::uint64_t>>(), tensor.shape);
    const std::uint64_t from = entry["data_offsets"][0], to = entry["data_offsets"][1];
    ASSERT_EQ(to - from, tensor.values.size() * sizeof(float)) << tensor.name;
    ASSERT_LE(begin + to, bytes.size());
    EXPECT_EQ(std::memcmp(bytes.data() + begin + from, tensor.values.data(), to - from), 0)
        << tensor.name;
    data += to - from;
    EXPECT_NE(result_.out.find(tensor.name), std::string::npos) << tensor.name;
  }
  EXPECT_EQ(begin + data, bytes.size());  // no gap, nothing after the end
}

TEST_F(ExportTest, PythonReadsItWithItsStandardLibrary) {
  if (std::system("python3 --version > /dev/null 2>&1") != 0) GTEST_SKIP() << "no python3";
  {
    std::ofstream script(place_->Path("read.py"));
    script << R"(import json, math, struct, sys
with open(sys.argv[1], "rb") as file:
    length, = struct.unpack("<Q", file.read(8))
    header = json.loads(file.read(length))
    data = file.read()
header.pop("__metadata__")
ends = 0
for name, entry in header.items():
    begin, end = entry["data_offsets"]
    count = math.prod(entry["shape"])
    values = struct.unpack("<%df" % count, data[begin:end])
    assert all(map(math.isfinite, values)), name
    ends = max(ends, end)
assert ends == len(data), (ends, len(data))
print(len(header))
)";
  }
  const std::string command = "python3 " + place_->Path("read.py") + " " +
                              place_->Path("w.safetensors") + " > " + place_->Path("count");
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_GT(std::stoi(FileBytes(place_->Path("count"))), 10);
}

TEST_F(ExportTest, WritesWhereALinkPoints) {
  std::filesystem::create_symlink("elsewhere", place_->Path("link"));
  ASSERT_EQ(place_->Runner({"export", "1", "--db", "e.db", "--out", "link"}).exit_status, 0);
  EXPECT_TRUE(std::filesystem::is_symlink(place_->Path("link")));
  EXPECT_EQ(FileBytes(place_->Path("elsewhere")), FileBytes(place_->Path("w.safetensors")));
}

TEST_F(ExportTest, NamesWhatItCannotExport) {
  const ProgramResult absent = place_->Runner({"export", "99", "--db", "e.db"});
  EXPECT_EQ(absent.exit_status, 66) << absent.err;
  EXPECT_NE(absent.err.find("no run '99'"), std::string::npos) << absent.err;
  const ProgramResult none = place_->Runner({"export", "--db", "e.db"});
  EXPECT_EQ(none.exit_status, 2) << none.err;
  EXPECT_NE(none.err.find("expected RUN ("), std::string::npos) << none.err;
  const ProgramResult folder =
      place_->Runner({"export", "1", "--db", "e.db", "--out", "nowhere/w.safetensors"});
  EXPECT_EQ(folder.exit_status, 73) << folder.err;
  EXPECT_NE(folder.err.find("nowhere/w.safetensors"), std::string::npos) << folder.err;
}

TEST(TensorCollector, RefusesAShapeThatIsNotTheSize) {
  TensorCollector collector;
  const std::uint64_t shape[] = {2, 3};
  const float values[5] = {};
  EXPECT_EQ(collector.Tensor("w", {shape, 2}, {values, 5}).code, StatusCode::kInvalidArgument);
  EXPECT_TRUE(collector.tensors().empty());
}

}  // namespace
}  // namespace dreamsearch
