// instruction_set.h - which vector instructions this process computes with.
//
// Kernels are compiled for several instruction sets and chosen while running. All
// of them, in the host and in every plugin, ask ChosenInstructionSet(), so that one
// name, stored with each segment of a run, says which bits the run has.
//
//   DREAMSEARCH_INSTRUCTION_SET=avx2 runner ...
//
// chooses a set below the processor's best: x86-64, avx2, avx512, avx512_bf16 or amx.
// Results of different sets differ in their last bits.
//
// Threads  any; the answer is found once and does not change.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <cstring>

#if defined(__x86_64__)
#include <cpuid.h>
#if defined(__linux__)
#include <sys/syscall.h>
#include <unistd.h>
#endif
#endif

namespace dreamsearch {

// In ascending order: who has one has those before it.
enum class InstructionSet : std::uint32_t {
  kBaseline = 0,    // what every processor of the architecture has
  kAvx2 = 1,        // AVX2 and FMA
  kAvx512 = 2,      // AVX-512 F, BW, CD, DQ, VL
  kAvx512Bf16 = 3,  // these and BF16, products of bfloat16
  kAmx = 4,         // these and the tile unit with bfloat16 products
};

inline constexpr const char* kInstructionSetVariable = "DREAMSEARCH_INSTRUCTION_SET";
inline constexpr InstructionSet kInstructionSets[] = {
    InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512,
    InstructionSet::kAvx512Bf16, InstructionSet::kAmx};

inline const char* InstructionSetName(InstructionSet set) noexcept {
  switch (set) {
    case InstructionSet::kBaseline:
      return "x86-64";
    case InstructionSet::kAvx2:
      return "avx2";
    case InstructionSet::kAvx512:
      return "avx512";
    case InstructionSet::kAvx512Bf16:
      return "avx512_bf16";
    case InstructionSet::kAmx:
      return "amx";
  }
  return "unknown";
}

// False if there is no set of that name; *set is then unchanged.
inline bool ParseInstructionSet(const char* name, InstructionSet* set) noexcept {
  for (const InstructionSet candidate : kInstructionSets) {
    if (std::strcmp(name, InstructionSetName(candidate)) != 0) continue;
    *set = candidate;
    return true;
  }
  return false;
}

namespace detail {

// What the processor has and the system saves; asks the system for the tile unit.
inline InstructionSet FindInstructionSet() noexcept {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) {
    return InstructionSet::kBaseline;
  }
  if (!__builtin_cpu_supports("avx512f") || !__builtin_cpu_supports("avx512bw") ||
      !__builtin_cpu_supports("avx512cd") || !__builtin_cpu_supports("avx512dq") ||
      !__builtin_cpu_supports("avx512vl")) {
    return InstructionSet::kAvx2;
  }
  unsigned a = 0, b = 0, c = 0, d = 0;
  if (__get_cpuid_count(7, 1, &a, &b, &c, &d) == 0 || (a >> 5 & 1) == 0) {
    return InstructionSet::kAvx512;
  }
#if defined(__linux__)
  if (__get_cpuid_count(7, 0, &a, &b, &c, &d) == 0) return InstructionSet::kAvx512Bf16;
  const bool tiles = (d >> 22 & 1) != 0 && (d >> 24 & 1) != 0;  // amx-bf16, amx-tile
  constexpr long kRequestPermission = 0x1023;                   // ARCH_REQ_XCOMP_PERM
  constexpr long kTileData = 18;
  if (tiles && ::syscall(SYS_arch_prctl, kRequestPermission, kTileData) == 0) {
    return InstructionSet::kAmx;
  }
#endif
  return InstructionSet::kAvx512Bf16;
#else
  return InstructionSet::kBaseline;
#endif
}

}  // namespace detail

// The best set that this processor has and the system permits.
inline InstructionSet BestInstructionSet() noexcept {
  static const InstructionSet best = detail::FindInstructionSet();
  return best;
}

// The set to compute with: the best one, or the one that the variable names if that is
// lower. A name that does not exist counts as none; the host refuses it, and sets that
// the processor lacks, before it loads a plugin.
inline InstructionSet ChosenInstructionSet() noexcept {
  static const InstructionSet chosen = [] {
    InstructionSet set = BestInstructionSet();
    const char* name = std::getenv(kInstructionSetVariable);
    InstructionSet asked = set;
    if (name != nullptr && ParseInstructionSet(name, &asked) && asked < set) set = asked;
    return set;
  }();
  return chosen;
}

}  // namespace dreamsearch
