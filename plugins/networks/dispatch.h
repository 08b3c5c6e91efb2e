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
// the one of the chosen set, and DREAMSEARCH_CHOSEN_KERNELS(ProductKernels) declares
// Kernels<T>(), which does so at its first call.
//
// Where every function of a header is such a kernel, for T float and double, the file lists
// them once, as result, name, parameters and arguments,
//
//   #define DREAMSEARCH_WAVE(KERNEL) KERNEL(void, Sine, (In<T> x, Mat<T> y), (x, y)) ...
//
// and the rest follows from the list: DREAMSEARCH_KERNEL_TABLE(WaveKernels, DREAMSEARCH_WAVE)
// before the kernels, which are templates of the same names, DREAMSEARCH_KERNELS_OF_SET behind
// them, and DREAMSEARCH_FORWARD_KERNELS in the part that is compiled once.
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

// Kernels<T>(), the table of the chosen set. In a namespace around that of the sets.
#define DREAMSEARCH_CHOSEN_KERNELS(Table)                              \
  namespace {                                                          \
  template <typename T>                                                \
  const Table<T>& Kernels() {                                          \
    static const Table<T>& kernels = DREAMSEARCH_CHOOSE(KernelsOf<T>); \
    return kernels;                                                    \
  }                                                                    \
  }

#define DREAMSEARCH_KERNEL_MEMBER(result, name, parameters, arguments) result(*name) parameters;
#define DREAMSEARCH_KERNEL_ADDRESS(result, name, parameters, arguments) &name<T>,
#define DREAMSEARCH_KERNEL_FORWARD(result, name, parameters, arguments) \
  template <typename T>                                                 \
  result name parameters {                                              \
    return Kernels<T>().name arguments;                                 \
  }

// The kernels of one instruction set, a pointer each.
#define DREAMSEARCH_KERNEL_TABLE(Table, LIST) \
  template <typename T>                       \
  struct Table {                              \
    LIST(DREAMSEARCH_KERNEL_MEMBER)           \
  };

// KernelsOf<T>(), the table of the set that is being compiled.
#define DREAMSEARCH_KERNELS_OF_SET(Table, LIST)                             \
  template <typename T>                                                     \
  const Table<T>& KernelsOf() {                                             \
    static constexpr Table<T> kernels = {LIST(DREAMSEARCH_KERNEL_ADDRESS)}; \
    return kernels;                                                         \
  }

// The functions of the header, which call the chosen set's. The variable names all of them
// for both types, so that they are compiled here.
#define DREAMSEARCH_FORWARD_KERNELS(Table, LIST)                      \
  DREAMSEARCH_CHOSEN_KERNELS(Table)                                   \
  LIST(DREAMSEARCH_KERNEL_FORWARD)                                    \
  template <typename T>                                               \
  Table<T> functions_of_##Table = {LIST(DREAMSEARCH_KERNEL_ADDRESS)}; \
  template Table<float> functions_of_##Table<float>;                  \
  template Table<double> functions_of_##Table<double>;
