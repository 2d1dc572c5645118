// Compiled once for each instruction set, JAMSHAPE_SET.

#include "landscape/history_kernels.hpp"

#include <cstring>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace jamshape {
namespace {

constexpr int AT_ONCE = HistoryKernels::AT_ONCE;

#if defined(__AVX512F__)
constexpr int LANES = 16;
#elif defined(__AVX2__)
constexpr int LANES = 8;
#else
constexpr int LANES = 4;
#endif
using Floats = float __attribute__((vector_size(4 * LANES)));
using Bits = std::uint32_t __attribute__((vector_size(4 * LANES)));

/// A register of numbers: halves are widened by one instruction, where gcc makes several of
/// __builtin_convertvector.
Floats in_single_precision(const FirstHalf *from)
{
  Bits bits;
#if defined(__AVX512F__)
  bits = Bits(_mm512_cvtepu16_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i_u *>(from))));
#elif defined(__AVX2__)
  bits = Bits(_mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i_u *>(from))));
#else
  for (int k = 0; k < LANES; ++k) bits[k] = from[k];
#endif
  return Floats(bits << 16);
}

void shorten(int n, double by, const double *vector, FirstHalf *to)
{
  for (int k = 0; k < n; ++k) {
    const auto number = static_cast<float>(by * vector[k]);
    std::uint32_t bits;
    std::memcpy(&bits, &number, sizeof(bits));
    to[k] = static_cast<FirstHalf>((bits + 0x7fff + (bits >> 16 & 1)) >> 16);  // to nearest, even
  }
}

/// The sum of AT_ONCE numbers.
float sum_of(const Floats (&in_parts)[AT_ONCE / LANES])
{
  float each[AT_ONCE];
  std::memcpy(each, in_parts, sizeof(each));
  for (int half = AT_ONCE / 2; half > 0; half /= 2) {
    for (int m = 0; m < half; ++m) each[m] += each[m + half];
  }
  return each[0];
}

/// AT_ONCE sums with any set, so that all round identically.
float dot(int n, const FirstHalf *a, const FirstHalf *b)
{
  Floats sum[AT_ONCE / LANES]{};  // in turns, since each addition waits for the one before
  for (int k = 0; k < n; k += AT_ONCE) {
    for (int m = 0; m < AT_ONCE / LANES; ++m) {
      const int at = k + LANES * m;
      sum[m] += in_single_precision(a + at) * in_single_precision(b + at);
    }
  }
  return sum_of(sum);
}

float add_and_dot(int n, float by, const FirstHalf *vector, const FirstHalf *further, float *x)
{
  Floats sum[AT_ONCE / LANES]{};
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
  return sum_of(sum);
}

}  // namespace

template <InstructionSet SET> HistoryKernels history_kernels_of()
{
  return {&shorten, &dot, &add_and_dot};
}

template HistoryKernels history_kernels_of<InstructionSet::JAMSHAPE_SET>();

}  // namespace jamshape
