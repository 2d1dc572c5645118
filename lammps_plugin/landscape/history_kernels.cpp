// Compiled once for each instruction set, JAMSHAPE_SET.

#include "landscape/history_kernels.hpp"

#include <cstring>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace jamshape {
namespace {

constexpr int AT_ONCE = HistoryKernels::AT_ONCE;

// A register of numbers, from their first halves: in two instructions, where gcc makes several of
// __builtin_convertvector.
#if defined(__AVX512F__)
constexpr int LANES = 16;
using Floats = float __attribute__((vector_size(64)));
Floats in_single_precision(const FirstHalf *from)
{
  const __m256i halves = _mm256_loadu_si256(reinterpret_cast<const __m256i_u *>(from));
  return _mm512_castsi512_ps(_mm512_slli_epi32(_mm512_cvtepu16_epi32(halves), 16));
}
#elif defined(__AVX2__)
constexpr int LANES = 8;
using Floats = float __attribute__((vector_size(32)));
Floats in_single_precision(const FirstHalf *from)
{
  const __m128i halves = _mm_loadu_si128(reinterpret_cast<const __m128i_u *>(from));
  return _mm256_castsi256_ps(_mm256_slli_epi32(_mm256_cvtepu16_epi32(halves), 16));
}
#else
constexpr int LANES = 4;
using Floats = float __attribute__((vector_size(16)));
Floats in_single_precision(const FirstHalf *from)
{
  std::uint32_t whole[LANES];
  for (int k = 0; k < LANES; ++k) whole[k] = std::uint32_t{from[k]} << 16;
  Floats found;
  std::memcpy(&found, whole, sizeof(found));
  return found;
}
#endif

void shorten(int n, double by, const double *vector, FirstHalf *to)
{
  for (int k = 0; k < n; ++k) {
    const auto number = static_cast<float>(by * vector[k]);
    std::uint32_t bits;
    std::memcpy(&bits, &number, sizeof(bits));
    to[k] = static_cast<FirstHalf>((bits + 0x7fff + (bits >> 16 & 1)) >> 16);  // to nearest, even
  }
}

/// AT_ONCE sums with any set, so that all round identically.
float add_and_dot(int n, float by, const FirstHalf *vector, const FirstHalf *further, float *x)
{
  Floats sum[AT_ONCE / LANES]{};  // in turns, since each addition waits for the one before
  for (int k = 0; k < n; k += AT_ONCE) {
    for (int m = 0; m < AT_ONCE / LANES; ++m) {
      const int at = k + LANES * m;
      Floats own;
      std::memcpy(&own, x + at, sizeof(own));
      own += by * in_single_precision(vector + at);
      std::memcpy(x + at, &own, sizeof(own));
      sum[m] += own * in_single_precision(further + at);
    }
  }
  float each[AT_ONCE];
  std::memcpy(each, sum, sizeof(each));
  for (int half = AT_ONCE / 2; half > 0; half /= 2) {
    for (int m = 0; m < half; ++m) each[m] += each[m + half];
  }
  return each[0];
}

}  // namespace

template <InstructionSet SET> HistoryKernels history_kernels_of()
{
  return {&shorten, &add_and_dot};
}

template HistoryKernels history_kernels_of<InstructionSet::JAMSHAPE_SET>();

}  // namespace jamshape
