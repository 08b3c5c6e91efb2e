#include "host/settings/cores.h"

#include <fcntl.h>
#include <sched.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <memory>
#include <sstream>
#include <system_error>
#include <thread>

#include "dreamsearch/random.h"
#include "host/settings/control_groups.h"
#include "results/system/file_descriptor.h"

namespace dreamsearch {
namespace {

// Room for the affinity mask of any machine.
constexpr int kMostProcessors = 1 << 16;

// Nobody runs more at once on the same cores; more know only of each other in one command.
constexpr std::size_t kPlaces = 4096;

struct MaskDeleter {
  void operator()(cpu_set_t* set) const { CPU_FREE(set); }
};

Cores AffinityCores() {
  const std::unique_ptr<cpu_set_t, MaskDeleter> set(CPU_ALLOC(kMostProcessors));
  const std::size_t size = CPU_ALLOC_SIZE(kMostProcessors);
  if (!set || ::sched_getaffinity(0, size, set.get()) != 0) {
    return {std::max(1u, std::thread::hardware_concurrency()), "all"};
  }
  std::uint64_t mask = 0;
  for (int i = 0; i < kMostProcessors; ++i) {
    if (CPU_ISSET_S(i, size, set.get())) mask = DeriveSeed(mask, static_cast<std::uint64_t>(i));
  }
  return {static_cast<std::uint32_t>(std::max(1, CPU_COUNT_S(size, set.get()))),
          std::to_string(mask)};
}

// Version 2, one file: "150000 100000", or "max 100000".
double Quota(const std::filesystem::path& group) {
  std::string quota;
  double period = 0;
  std::ifstream(group / "cpu.max") >> quota >> period;
  const double microseconds = std::strtod(quota.c_str(), nullptr);  // 0 if it is "max"
  return microseconds > 0 && period > 0 ? microseconds / period
                                        : std::numeric_limits<double>::infinity();
}

// Version 1, two files; a quota of -1 is none.
double QuotaOfVersion1(const std::filesystem::path& group) {
  double quota = 0, period = 0;
  std::ifstream(group / "cpu.cfs_quota_us") >> quota;
  std::ifstream(group / "cpu.cfs_period_us") >> period;
  return quota > 0 && period > 0 ? quota / period : std::numeric_limits<double>::infinity();
}

std::filesystem::path FileOf(const Cores& cores) {
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::temp_directory_path(error);
  std::uint64_t number = 0;
  for (const char c : cores.name) number = DeriveSeed(number, static_cast<unsigned char>(c));
  std::ostringstream name;
  name << "dreamsearch-cores-" << std::hex << std::setfill('0') << std::setw(16) << number;
  return (error ? std::filesystem::path("/tmp") : folder) / name.str();
}

// Opens the file, made for all users if it is not there. Many systems forbid O_CREAT on another
// user's file in /tmp, so it is given only where there is none.
FileDescriptor OpenForAll(const std::filesystem::path& path) {
  constexpr int kFlags = O_RDWR | O_CLOEXEC | O_NOFOLLOW;
  for (int attempt = 0; attempt < 3; ++attempt) {
    FileDescriptor file(::open(path.c_str(), kFlags));
    if (file.get() >= 0 || errno != ENOENT) return file;
    file = FileDescriptor(::open(path.c_str(), kFlags | O_CREAT | O_EXCL, 0666));
    if (file.get() >= 0) {
      ::fchmod(file.get(), 0666);  // whatever the umask
      return file;
    }
    if (errno != EEXIST) break;
  }
  return FileDescriptor();
}

// Of `count` bytes, 0 for all from `first`. The lock is the open file's, so that two
// CoreSharings of one process are strangers to each other too.
struct flock LockOf(short type, std::size_t first, std::size_t count) {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  lock.l_start = static_cast<off_t>(first);
  lock.l_len = static_cast<off_t>(count);
  return lock;
}

}  // namespace

ControlGroupLimit LimitOfControlGroups(const std::filesystem::path& membership,
                                       const std::filesystem::path& root) {
  ControlGroupLimit limit;
  ForEachControlGroup(membership, root, "cpu", [&limit](const ControlGroup& group) {
    const double cores = group.version1 ? QuotaOfVersion1(group.folder) : Quota(group.folder);
    if (cores < limit.cores) limit = {cores, group.name};
  });
  return limit;
}

Cores AvailableCores() {
  Cores cores = AffinityCores();
  const ControlGroupLimit limit = LimitOfControlGroups("/proc/self/cgroup", "/sys/fs/cgroup");
  if (limit.cores < cores.count) {
    // The rest of a core is used by one thread more.
    cores.count = std::max(1u, static_cast<std::uint32_t>(std::ceil(limit.cores)));
    cores.name += limit.group;
  }
  return cores;
}

CoreSharing::CoreSharing(const Cores& cores) : CoreSharing(cores.count, FileOf(cores)) {}

CoreSharing::CoreSharing(std::uint32_t cores, const std::filesystem::path& file)
    : cores_(cores), file_(OpenForAll(file)) {}

std::size_t CoreSharing::Enter() {
  for (std::size_t place = 0;; ++place) {
    if (own_.count(place) != 0) continue;
    struct flock lock = LockOf(F_WRLCK, place, 1);
    if (file_.get() >= 0 && ::fcntl(file_.get(), F_OFD_SETLK, &lock) != 0) {
      const bool taken = errno == EAGAIN || errno == EACCES;
      if (taken && place < kPlaces) continue;
      file_.Close();  // no locks on this file system, or nonsense in the file's
    }
    own_.insert(place);
    return place;
  }
}

void CoreSharing::Leave(std::size_t place) {
  if (own_.erase(place) == 0 || file_.get() < 0) return;
  struct flock lock = LockOf(F_UNLCK, place, 1);
  ::fcntl(file_.get(), F_OFD_SETLK, &lock);
}

bool CoreSharing::TakenElsewhere(std::size_t first, std::size_t count) const {
  struct flock lock = LockOf(F_WRLCK, first, count);
  return file_.get() >= 0 && ::fcntl(file_.get(), F_OFD_GETLK, &lock) == 0 &&
         lock.l_type != F_UNLCK;
}

std::map<std::size_t, std::uint32_t> CoreSharing::Threads() const {
  std::set<std::size_t> taken = own_;
  for (std::size_t i = 0; i < kPlaces && TakenElsewhere(i, 0); ++i) {
    if (TakenElsewhere(i, 1)) taken.insert(i);
  }
  std::map<std::size_t, std::uint32_t> threads;
  std::size_t rank = 0;
  for (const std::size_t place : taken) {
    const std::size_t share = cores_ / taken.size() + (rank++ < cores_ % taken.size() ? 1 : 0);
    if (own_.count(place) != 0) {
      threads[place] = static_cast<std::uint32_t>(std::max<std::size_t>(1, share));
    }
  }
  return threads;
}

}  // namespace dreamsearch
