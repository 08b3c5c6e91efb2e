// Where a write-ahead log is not safe, nobody who writes or reads relies on one.
//
// The tests run on a real FUSE file system (bindfs, if it is there and may be mounted), which
// cannot map a file that others write, and on this disk with the type of NFS injected: statfs
// below stands for the kernel's.
#include "results/database/file_system.h"

#include <gtest/gtest.h>
#include <sys/statfs.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "results/system/error.h"
#include "results/text/shell.h"
#include "tests/results/database/child.h"
#include "tests/results/database/recording.h"

namespace {
std::string injected_folder;  // what is below it has the type of NFS
}  // namespace

// In place of the C library's.
extern "C" int statfs(const char* path, struct statfs* info) noexcept {
  const long result = ::syscall(SYS_statfs, path, info);
  if (result == 0 && !injected_folder.empty() && std::string(path).rfind(injected_folder, 0) == 0) {
    info->f_type = 0x6969;
  }
  return static_cast<int>(result);
}

namespace dreamsearch::results {
namespace {

// A folder in which a write-ahead log is not safe.
class SharedFolder {
 public:
  explicit SharedFolder(bool fuse) : fuse_(fuse) {
    std::filesystem::create_directory(place_ / "below");
    std::filesystem::create_directory(place_ / "mount");
    if (fuse_) {
      mounted_ = std::system(("bindfs -o direct_io " + ShellWord(place_ / "below") + " " +
                              ShellWord(place_ / "mount") + " > /dev/null 2>&1")
                                 .c_str()) == 0;
    } else {
      injected_folder = place_ / "mount";
    }
  }
  ~SharedFolder() {
    injected_folder.clear();
    if (mounted_) {
      EXPECT_EQ(std::system(("fusermount -u " + ShellWord(place_ / "mount")).c_str()), 0);
    }
  }
  SharedFolder(const SharedFolder&) = delete;
  SharedFolder& operator=(const SharedFolder&) = delete;
  bool there() const { return !fuse_ || mounted_; }
  std::string operator/(const std::string& name) const { return place_ / ("mount/" + name); }
  std::string OnDisk(const std::string& name) const { return place_ / name; }

 private:
  const bool fuse_;
  const TemporaryFolder place_;
  bool mounted_ = false;
};

class SharedFileSystem : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    if (!folder_.there()) GTEST_SKIP() << "bindfs cannot mount a FUSE file system here";
  }
  const SharedFolder folder_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Kinds, SharedFileSystem, testing::Bool(), [](const auto& kind) {
  return std::string(kind.param ? "Fuse" : "InjectedNfs");
});

std::string Bytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// One study in the file, and one more in the log alone.
void WriteToLog(Database* db) {
  db->Study("in the file");
  db->connection().Execute("PRAGMA wal_checkpoint(TRUNCATE)");
  db->Study("in the log");
}

TEST(FileSystem, OneThatIsNotKnownToBeOfThisMachineIsTakenForShared) {
  for (const std::uint32_t local : {0xef53u, 0x01021994u, 0x58465342u, 0x9123683eu, 0x794c7630u}) {
    EXPECT_TRUE(FileSystemOfType(local).write_ahead_is_safe) << FileSystemOfType(local).name;
  }
  for (const std::uint32_t shared : {0x6969u, 0xff534d42u, 0x0bd00bd0u, 0x47504653u, 0x65735546u,
                                     0x19830326u, 0x00c36400u, 0x01021997u, 0x12345678u}) {
    EXPECT_FALSE(FileSystemOfType(shared).write_ahead_is_safe) << FileSystemOfType(shared).name;
  }
  EXPECT_EQ(FileSystemOfType(0x12345678).name, "a file system of type 0x12345678");
}

TEST(FileSystem, OfAFileThatIsYetToBeMadeIsItsFolders) {
  const TemporaryFolder folder;
  EXPECT_EQ(FileSystemOf(folder / "a/b/c.db").name, FileSystemOf(folder / "").name);
}

TEST(FileSystem, HereHasLocks) {
  const TemporaryFolder folder;
  EXPECT_EQ(WhyNoLocks(folder / "m.db"), "");
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST_P(SharedFileSystem, ADatabaseIsWrittenWithARollbackJournalAndThatIsSaid) {
  const std::string path = folder_ / "r.db";
  const auto db = Database::OpenOrCreate(path);
  EXPECT_EQ(db->connection().QueryText("PRAGMA journal_mode"), "delete");
  ASSERT_EQ(db->warnings().size(), 1u);
  EXPECT_NE(db->warnings()[0].find(GetParam() ? "is on FUSE" : "is on NFS"), std::string::npos)
      << db->warnings()[0];
  const auto reader = Database::OpenReadOnly(path);
  db->Study("new");
  EXPECT_EQ(Count(reader.get(), "SELECT count(*) FROM study"), 1);
  EXPECT_FALSE(std::filesystem::exists(path + "-wal"));
  EXPECT_FALSE(std::filesystem::exists(path + "-shm"));
}

TEST_P(SharedFileSystem, ReadingACopyWithAnEmptyLogChangesNothing) {
  const std::string path = folder_ / "r.db";
  {
    const auto db = Database::OpenOrCreate(folder_.OnDisk("r.db"));
    db->Study("copied");
  }
  std::filesystem::copy_file(folder_.OnDisk("r.db"), path);
  const std::string before = Bytes(path);
  ASSERT_EQ(before[18], 2);  // a write-ahead log
  const auto reader = Database::OpenReadOnly(path);
  EXPECT_EQ(Count(reader.get(), "SELECT count(*) FROM study WHERE name = 'copied'"), 1);
  EXPECT_EQ(Bytes(path), before);
  EXPECT_FALSE(std::filesystem::exists(path + "-shm"));
  // And as the source of a merge.
  const auto target = Database::OpenOrCreate(folder_.OnDisk("all.db"));
  target->connection().Execute("ATTACH '" + ReadOnlyUri(path) + "' AS source");
  EXPECT_EQ(Count(target.get(), "SELECT count(*) FROM source.study WHERE name = 'copied'"), 1);
}

TEST_P(SharedFileSystem, RowsThatAreInTheLogOfACopyAreSeenByReadersAndWriters) {
  for (const bool writes : {false, true}) {
    const std::string name = writes ? "w.db" : "r.db";
    const int status = Wait(Spawn([&] {
      const auto db = Database::OpenOrCreate(folder_.OnDisk(name));
      WriteToLog(db.get());
      for (const char* part : {"", "-wal"}) {
        std::filesystem::copy_file(folder_.OnDisk(name + part), folder_ / (name + part));
      }
    }));
    ASSERT_EQ(status, 0);
    ASSERT_GT(std::filesystem::file_size(folder_ / (name + "-wal")), 0u);
    const std::string path = folder_ / name;
    const auto db = writes ? Database::OpenExisting(path) : Database::OpenReadOnly(path);
    EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM study WHERE name LIKE 'in the %'"), 2);
    EXPECT_FALSE(std::filesystem::exists(path + "-wal"));
    if (writes) {
      EXPECT_EQ(db->connection().QueryText("PRAGMA journal_mode"), "delete");
    }
    EXPECT_EQ(db->connection().QueryText("PRAGMA integrity_check"), "ok");
  }
}

TEST_P(SharedFileSystem, FourWritersAndAReaderLoseNoRow) {
  constexpr int kWriters = 4, kStudies = 25;
  const std::string path = folder_ / "r.db";
  std::vector<pid_t> writers;
  for (int writer = 0; writer < kWriters; ++writer) {
    writers.push_back(Spawn([&] {
      const auto db = Database::OpenOrCreate(path);
      for (int i = 0; i < kStudies; ++i) {
        db->Study(std::to_string(writer) + "." + std::to_string(i));
        const auto reader = Database::OpenReadOnly(path);
        Count(reader.get(), "SELECT count(*) FROM study");
      }
    }));
  }
  for (const pid_t writer : writers) EXPECT_EQ(Wait(writer), 0);
  const auto db = Database::OpenReadOnly(path);
  EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM study"), kWriters * kStudies);
}

}  // namespace
}  // namespace dreamsearch::results
