#include "host/plugins/elf.h"

#include <elf.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "results/system/error.h"

namespace dreamsearch {
namespace {

#if defined(__x86_64__)
constexpr std::uint16_t kHostMachine = EM_X86_64;
#elif defined(__aarch64__)
constexpr std::uint16_t kHostMachine = EM_AARCH64;
#elif defined(__riscv)
constexpr std::uint16_t kHostMachine = EM_RISCV;
#elif defined(__powerpc64__)
constexpr std::uint16_t kHostMachine = EM_PPC64;
#elif defined(__s390x__)
constexpr std::uint16_t kHostMachine = EM_S390;
#else
#error "name this machine's ELF number here"
#endif

constexpr unsigned char kHostByteOrder =
    std::endian::native == std::endian::little ? ELFDATA2LSB : ELFDATA2MSB;

std::string MachineName(std::uint16_t machine) {
  switch (machine) {
    case EM_386:
      return "x86 (32-bit)";
    case EM_X86_64:
      return "x86-64";
    case EM_ARM:
      return "ARM (32-bit)";
    case EM_AARCH64:
      return "AArch64";
    case EM_RISCV:
      return "RISC-V";
    case EM_PPC64:
      return "PowerPC64";
    case EM_S390:
      return "S/390";
    default:
      return "machine number " + std::to_string(machine);
  }
}

// An open file of known size; every read says whether it was inside.
class File {
 public:
  explicit File(const std::filesystem::path& path) : path_(path) {
    // Without O_NONBLOCK the open of a named pipe waits for a writer.
    descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (descriptor_ < 0) {
      const int error = errno;
      const ExitCode code = error == ENOENT || error == ENOTDIR ? ExitCode::kNotFound
                            : error == EACCES                   ? ExitCode::kPermission
                                                                : ExitCode::kInputOutput;
      throw Failure(code, "cannot open plugin " + path.string() + ": " + std::strerror(error));
    }
    struct stat status;
    if (::fstat(descriptor_, &status) != 0) {
      const int error = errno;
      ::close(descriptor_);
      throw Failure(ExitCode::kInputOutput,
                    "cannot read plugin " + path.string() + ": " + std::strerror(error));
    }
    is_folder_ = S_ISDIR(status.st_mode);
    is_regular_ = S_ISREG(status.st_mode);
    size_ = static_cast<std::uint64_t>(status.st_size);
  }
  ~File() { ::close(descriptor_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  bool is_folder() const { return is_folder_; }
  bool is_regular() const { return is_regular_; }
  std::uint64_t size() const { return size_; }

  bool Holds(std::uint64_t offset, std::uint64_t size) const {
    return offset <= size_ && size <= size_ - offset;
  }
  void Read(std::uint64_t offset, void* data, std::uint64_t size) const {
    auto* bytes = static_cast<char*>(data);
    while (size > 0) {
      const ssize_t got = ::pread(descriptor_, bytes, size, static_cast<off_t>(offset));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) {
        throw Failure(ExitCode::kInputOutput, "cannot read plugin " + path_.string() + ": " +
                                                  (got < 0 ? std::strerror(errno) : "it shrank"));
      }
      bytes += got;
      offset += static_cast<std::uint64_t>(got);
      size -= static_cast<std::uint64_t>(got);
    }
  }

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
  bool is_folder_ = false;
  bool is_regular_ = false;
  std::uint64_t size_ = 0;
};

[[noreturn]] void Refuse(const std::filesystem::path& file, const std::string& found) {
  throw Failure(ExitCode::kPluginRefused, "plugin " + file.string() +
                                              ": expected a shared library for " +
                                              MachineName(kHostMachine) + ", found " + found);
}

// What the first bytes of a file that is not ELF look like.
std::string Describe(const std::string& head, std::uint64_t size) {
  const std::string bytes = " (" + std::to_string(size) + " bytes)";
  if (head.starts_with("!<arch>\n")) return "a static library (ar archive)" + bytes;
  if (head.starts_with("MZ")) return "a Windows program or library" + bytes;
  if (head.starts_with("\xcf\xfa\xed\xfe") || head.starts_with("\xca\xfe\xba\xbe")) {
    return "a macOS program or library" + bytes;
  }
  if (head.starts_with("\x1f\x8b") || head.starts_with("PK\x03\x04")) {
    return "a compressed archive" + bytes;
  }
  const bool text = std::all_of(head.begin(), head.end(), [](unsigned char c) {
    return c >= 0x80 || std::isprint(c) != 0 || c == '\n' || c == '\r' || c == '\t';
  });
  if (!text) return "a file that is not ELF" + bytes;
  std::string line = head.substr(0, std::min(head.find_first_of("\r\n"), std::size_t{40}));
  while (!line.empty() && static_cast<unsigned char>(line.back()) >= 0x80) line.pop_back();
  return "text beginning '" + line + "'" + bytes;
}

}  // namespace

void CheckSharedLibrary(const std::filesystem::path& path) {
  const File file(path);
  if (file.is_folder()) Refuse(path, "a folder");
  if (!file.is_regular()) Refuse(path, "something that is not a regular file");
  if (file.size() == 0) Refuse(path, "an empty file");

  std::string head(std::min<std::uint64_t>(file.size(), 256), '\0');
  file.Read(0, head.data(), head.size());
  if (!head.starts_with(ELFMAG)) Refuse(path, Describe(head, file.size()));

  const auto cut = [&](const std::string& what, std::uint64_t offset, std::uint64_t size) {
    if (file.Holds(offset, size)) return;
    Refuse(path, "one that was cut short: " + what + " is " + std::to_string(size) +
                     " bytes at offset " + std::to_string(offset) + ", the file has only " +
                     std::to_string(file.size()) + " bytes");
  };
  cut("its identification", 0, EI_NIDENT);
  const auto ident = [&](int i) { return static_cast<unsigned char>(head[i]); };
  if (ident(EI_CLASS) == ELFCLASS32) Refuse(path, "a 32-bit ELF file");
  if (ident(EI_CLASS) != ELFCLASS64) Refuse(path, "an ELF file of unknown class");
  if (ident(EI_DATA) != kHostByteOrder) Refuse(path, "an ELF file of the other byte order");

  Elf64_Ehdr header;
  cut("its ELF header", 0, sizeof header);
  file.Read(0, &header, sizeof header);
  if (header.e_machine != kHostMachine) {
    Refuse(path, "an ELF file for " + MachineName(header.e_machine));
  }
  if (header.e_type == ET_REL) Refuse(path, "an object file (.o) that is not linked");
  if (header.e_type == ET_EXEC) Refuse(path, "a program");
  if (header.e_type == ET_CORE) Refuse(path, "a core dump");
  if (header.e_type != ET_DYN) {
    Refuse(path, "an ELF file of type " + std::to_string(header.e_type));
  }

  if (header.e_phnum == 0 || header.e_phentsize != sizeof(Elf64_Phdr)) {
    Refuse(path, "an ELF file without a usable table of segments");
  }
  std::vector<Elf64_Phdr> segments(header.e_phnum);
  cut("its table of segments", header.e_phoff, segments.size() * sizeof(Elf64_Phdr));
  file.Read(header.e_phoff, segments.data(), segments.size() * sizeof(Elf64_Phdr));
  bool dynamic = false;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (segments[i].p_type == PT_NULL) continue;
    cut("segment " + std::to_string(i), segments[i].p_offset, segments[i].p_filesz);
    if (segments[i].p_type == PT_DYNAMIC) dynamic = true;
  }
  if (!dynamic) Refuse(path, "an ELF file without a dynamic section");

  // A library may have been stripped of its section table; the loader needs none.
  if (header.e_shoff == 0 || header.e_shnum == 0) return;
  if (header.e_shentsize != sizeof(Elf64_Shdr)) {
    Refuse(path, "an ELF file with a damaged table of sections");
  }
  std::vector<Elf64_Shdr> sections(header.e_shnum);
  cut("its table of sections", header.e_shoff, sections.size() * sizeof(Elf64_Shdr));
  file.Read(header.e_shoff, sections.data(), sections.size() * sizeof(Elf64_Shdr));
  for (std::size_t i = 0; i < sections.size(); ++i) {
    if (sections[i].sh_type == SHT_NOBITS || sections[i].sh_type == SHT_NULL) continue;
    cut("section " + std::to_string(i), sections[i].sh_offset, sections[i].sh_size);
  }
}

}  // namespace dreamsearch
