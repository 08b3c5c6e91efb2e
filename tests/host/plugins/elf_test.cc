// What CheckSharedLibrary says of files that are no complete shared library.
#include "host/plugins/elf.h"

#include <elf.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "dreamsearch/random.h"
#include "results/system/error.h"
#include "tests/host/plugins/library_folder.h"

namespace dreamsearch {
namespace {

std::string GoodLibrary() {
  std::ifstream stream(DREAMSEARCH_CORPUS_DIR "/good.so", std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

struct Answer {
  ExitCode code = ExitCode::kOk;
  std::string message;
};

Answer Check(const std::filesystem::path& file) {
  try {
    CheckSharedLibrary(file);
    return {};
  } catch (const Failure& error) {
    return {error.code(), error.what()};
  }
}

void ExpectRefusal(const std::string& bytes, const std::string& found) {
  const LibraryFolder folder;
  const auto file = folder.Write("x.so", bytes);
  const Answer answer = Check(file);
  EXPECT_EQ(answer.code, ExitCode::kPluginRefused) << found;
  EXPECT_NE(answer.message.find(found), std::string::npos) << answer.message;
  EXPECT_NE(answer.message.find(file.string()), std::string::npos) << answer.message;
}

TEST(CheckSharedLibrary, AcceptsACompleteLibrary) {
  ASSERT_GT(GoodLibrary().size(), sizeof(Elf64_Ehdr));
  EXPECT_EQ(Check(DREAMSEARCH_CORPUS_DIR "/good.so").code, ExitCode::kOk);
}

TEST(CheckSharedLibrary, SaysWhatAFileIsThatIsNotElf) {
  ExpectRefusal("", "an empty file");
  ExpectRefusal("#!/bin/sh\necho hello\n", "text beginning '#!/bin/sh'");
  ExpectRefusal("!<arch>\nlibx.o/", "a static library");
  ExpectRefusal(std::string("MZ\x90\0\3", 5), "a Windows program");
  ExpectRefusal(std::string("\0\1\2\3\4", 5), "a file that is not ELF");
}

TEST(CheckSharedLibrary, SaysThatAFolderIsAFolder) {
  const LibraryFolder folder;
  const Answer answer = Check(folder.path());
  EXPECT_EQ(answer.code, ExitCode::kPluginRefused);
  EXPECT_NE(answer.message.find("a folder"), std::string::npos) << answer.message;
}

TEST(CheckSharedLibrary, SaysThatNothingIsThere) {
  const LibraryFolder folder;
  const Answer answer = Check(folder.path() / "nowhere.so");
  EXPECT_EQ(answer.code, ExitCode::kNotFound);
  EXPECT_NE(answer.message.find("nowhere.so"), std::string::npos) << answer.message;
}

TEST(CheckSharedLibrary, RefusesAnotherMachineClassByteOrderOrType) {
  const auto changed = [](std::size_t offset, std::uint16_t value, std::size_t size) {
    std::string bytes = GoodLibrary();
    std::memcpy(bytes.data() + offset, &value, size);
    return bytes;
  };
  ExpectRefusal(changed(EI_CLASS, ELFCLASS32, 1), "a 32-bit ELF file");
  ExpectRefusal(changed(EI_DATA, ELFDATA2MSB, 1), "the other byte order");
  ExpectRefusal(changed(offsetof(Elf64_Ehdr, e_machine), EM_RISCV, 2), "for RISC-V");
  ExpectRefusal(changed(offsetof(Elf64_Ehdr, e_machine), 0x7777, 2), "machine number 30583");
  ExpectRefusal(changed(offsetof(Elf64_Ehdr, e_type), ET_REL, 2), "an object file");
  ExpectRefusal(changed(offsetof(Elf64_Ehdr, e_type), ET_EXEC, 2), "a program");
  ExpectRefusal(changed(offsetof(Elf64_Ehdr, e_phnum), 0, 2), "table of segments");
}

// dlopen of such a file ends the process with SIGBUS.
TEST(CheckSharedLibrary, RefusesALibraryCutAtAnyLength) {
  const std::string whole = GoodLibrary();
  const LibraryFolder folder;
  std::vector<std::size_t> lengths;
  for (std::size_t n = 0; n < 1200; ++n) lengths.push_back(n);
  for (std::size_t n = 1200; n < whole.size(); n += 97) lengths.push_back(n);
  for (std::size_t k = 1; k < 200; ++k) lengths.push_back(whole.size() - k);
  for (const std::size_t n : lengths) {
    const Answer answer = Check(folder.Write("x.so", whole.substr(0, n)));
    ASSERT_EQ(answer.code, ExitCode::kPluginRefused) << "cut at " << n << " of " << whole.size();
    if (n >= sizeof(Elf64_Ehdr)) {
      ASSERT_NE(answer.message.find("cut short"), std::string::npos) << n << ": " << answer.message;
    }
  }
}

// The tables are read with offsets and counts that the file itself gives.
TEST(CheckSharedLibrary, SurvivesAnyBytesInHeaderAndTables) {
  const std::string whole = GoodLibrary();
  const LibraryFolder folder;
  constexpr std::uint64_t kSeed = 11;
  Random random(kSeed);
  int refused = 0;
  for (int i = 0; i < 500; ++i) {
    std::string bytes = whole;
    for (int k = 0; k < 4; ++k) {
      // The header and the table of segments after it.
      bytes[EI_NIDENT + random.Below(600)] = static_cast<char>(random.Next());
    }
    const Answer answer = Check(folder.Write("x.so", bytes));
    EXPECT_TRUE(answer.code == ExitCode::kOk || answer.code == ExitCode::kPluginRefused)
        << "seed " << kSeed << ", " << i << ": " << answer.message;
    refused += answer.code == ExitCode::kPluginRefused ? 1 : 0;
  }
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace dreamsearch
