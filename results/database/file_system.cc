#include "results/database/file_system.h"

#include <fcntl.h>
#include <sys/statfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iterator>

#include "results/system/file_descriptor.h"

namespace dreamsearch::results {
namespace {

struct Known {
  std::uint32_t type;
  const char* name;
  bool write_ahead_is_safe;
};

constexpr Known kKnown[] = {
    {0x0000ef53, "ext4", true},
    {0x58465342, "XFS", true},
    {0x9123683e, "Btrfs", true},
    {0x2fc12fc1, "ZFS", true},
    {0xf2f52010, "F2FS", true},
    {0xca451a4e, "bcachefs", true},
    {0x01021994, "tmpfs", true},
    {0x858458f6, "ramfs", true},
    {0x794c7630, "overlay", true},
    {0x3153464a, "JFS", true},
    {0x52654973, "ReiserFS", true},
    {0x00003434, "NILFS", true},
    {0x24051905, "UBIFS", true},
    {0x00004d44, "FAT", true},
    {0x2011bab0, "exFAT", true},
    {0x7366746e, "NTFS", true},
    {0x0000f15f, "eCryptfs", true},
    {0x73717368, "SquashFS", true},
    {0xe0f5e1e2, "EROFS", true},
    {0x00009660, "ISO 9660", true},
    {0x00006969, "NFS", false},
    {0x0000517b, "SMB", false},
    {0xff534d42, "CIFS", false},
    {0xfe534d42, "SMB 2", false},
    {0x5346414f, "AFS", false},
    {0x6b414653, "AFS", false},
    {0x73757245, "Coda", false},
    {0x0bd00bd0, "Lustre", false},
    {0x47504653, "GPFS", false},
    {0x19830326, "BeeGFS", false},
    {0x00c36400, "Ceph", false},
    {0x01021997, "9P", false},
    {0x01161970, "GFS2", false},
    {0x7461636f, "OCFS2", false},
    {0x20030528, "OrangeFS", false},
    {0xaad7aaea, "PanFS", false},
    {0x65735546, "FUSE", false},
    {0x786f4256, "a VirtualBox share", false},
    {0xbacbacbc, "a VMware share", false},
};

}  // namespace

FileSystem FileSystemOfType(std::uint32_t type) {
  const auto* known = std::find_if(std::begin(kKnown), std::end(kKnown),
                                   [type](const Known& each) { return each.type == type; });
  if (known != std::end(kKnown)) return {known->name, known->write_ahead_is_safe};
  char text[48];
  std::snprintf(text, sizeof text, "a file system of type 0x%08x", type);
  return {text, false};
}

FileSystem FileSystemOf(const std::string& path) {
  std::filesystem::path place = path;
  struct statfs info;
  while (::statfs(place.c_str(), &info) != 0) {
    if (errno == EINTR) continue;
    if (errno != ENOENT || !place.has_relative_path()) return {"an ordinary disk", true};
    place = place.parent_path();
  }
  return FileSystemOfType(static_cast<std::uint32_t>(info.f_type));
}

std::string WhyNoLocks(const std::string& path) {
  std::string name =
      (std::filesystem::path(path).parent_path() / ".dreamsearch-lock-XXXXXX").string();
  const FileDescriptor file(::mkostemp(name.data(), O_CLOEXEC));
  if (file.get() < 0) return "";
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  lock.l_len = 1;
  const int error = ::fcntl(file.get(), F_SETLK, &lock) == 0 ? 0 : errno;
  ::unlink(name.c_str());
  return error == 0 ? "" : std::strerror(error);
}

}  // namespace dreamsearch::results
