// dispatch.h - kernels written once, compiled for every instruction set, chosen by
// ChosenInstructionSet().
//
// A file with such kernels includes itself once for each set (Highway's foreach_target)
// and puts them into HWY_NAMESPACE, together with a function that returns them, say
//
//   template <typename T>
//   const ProductKernels<T>& KernelsOf();
//
// Outside, in the part that is compiled once, DREAMSEARCH_CHOOSE(KernelsOf<float>) calls
// the one of the chosen set.
#pragma once

#include <hwy/highway.h>

#include "dreamsearch/instruction_set.h"

#if HWY_TARGETS & HWY_AVX3
#define DREAMSEARCH_OF_AVX512(function)                                                  \
  if (::dreamsearch::ChosenInstructionSet() >= ::dreamsearch::InstructionSet::kAvx512) { \
    return N_AVX3::function();                                                           \
  }
#else
#define DREAMSEARCH_OF_AVX512(function)
#endif

#if HWY_TARGETS & HWY_AVX2
#define DREAMSEARCH_OF_AVX2(function)                                                  \
  if (::dreamsearch::ChosenInstructionSet() >= ::dreamsearch::InstructionSet::kAvx2) { \
    return N_AVX2::function();                                                         \
  }
#else
#define DREAMSEARCH_OF_AVX2(function)
#endif

// What `function` of the chosen set's namespace returns; to be used in the namespace
// around it.
#define DREAMSEARCH_CHOOSE(function)        \
  ([]() -> decltype(auto) {                 \
    DREAMSEARCH_OF_AVX512(function)         \
    DREAMSEARCH_OF_AVX2(function)           \
    return HWY_STATIC_DISPATCH(function)(); \
  }())
