// run_with_instruction_set SET PROGRAM [ARGUMENT ...]
//
// Runs a program with an instruction set forced. Exits with 77 and a sentence where the
// processor does not have it, which CTest counts as skipped.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "dreamsearch/instruction_set.h"

int main(int argc, char** argv) {
  using namespace dreamsearch;
  InstructionSet set{};
  if (argc < 3 || !ParseInstructionSet(argv[1], &set)) {
    std::fprintf(
        stderr, "usage: run_with_instruction_set x86-64|avx2|avx512|avx512_bf16|amx PROGRAM ...\n");
    return 2;
  }
  if (set > BestInstructionSet()) {
    std::printf("skipped: this processor has %s at best\n",
                InstructionSetName(BestInstructionSet()));
    return 77;
  }
  ::setenv(kInstructionSetVariable, argv[1], 1);
  ::execv(argv[2], argv + 2);
  std::perror(argv[2]);
  return 2;
}
