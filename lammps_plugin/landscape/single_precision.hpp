#pragma once

#include <cstring>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace jamshape {
namespace {  // compiled for several instruction sets: not to be merged by the linker

/// A vector of doubles from single precision: in one instruction, where gcc makes several of
/// __builtin_convertvector.
template <class Doubles> Doubles in_doubles(const float *from)
{
#if defined(__AVX512F__)
  if constexpr (sizeof(Doubles) == sizeof(__m512d)) return _mm512_cvtps_pd(_mm256_loadu_ps(from));
#endif
#if defined(__AVX2__)
  if constexpr (sizeof(Doubles) == sizeof(__m256d)) return _mm256_cvtps_pd(_mm_loadu_ps(from));
#endif
  float __attribute__((vector_size(sizeof(Doubles) / 2))) v;
  std::memcpy(&v, from, sizeof(v));
  return __builtin_convertvector(v, Doubles);
}

}  // namespace
}  // namespace jamshape
