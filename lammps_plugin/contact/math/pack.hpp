#pragma once

#include "contact/math/scalar.hpp"

#include <cstring>
#include <utility>

/// The instruction set that this file is compiled for. Packs and everything built from them carry
/// its name, because a linker merges functions of the same name.
#ifndef JAMSHAPE_SET
#define JAMSHAPE_SET baseline
#endif

namespace jamshape {
inline namespace JAMSHAPE_SET {

/// Number of doubles in a register.
#if defined(__AVX512F__)
inline constexpr int LANES = 8;
#elif defined(__AVX__)
inline constexpr int LANES = 4;
#else
inline constexpr int LANES = 2;
#endif

using Doubles = double __attribute__((vector_size(8 * LANES)));
using Words = long long __attribute__((vector_size(8 * LANES)));
using Naturals = unsigned long long __attribute__((vector_size(8 * LANES)));

/// One truth value per lane, as words of all ones or all zeros.
struct Mask {
  Words words;

  friend Mask operator&(const Mask &a, const Mask &b) { return {a.words & b.words}; }
  friend Mask operator|(const Mask &a, const Mask &b) { return {a.words | b.words}; }
  friend Mask operator^(const Mask &a, const Mask &b) { return {a.words ^ b.words}; }
  friend Mask operator!(const Mask &a) { return {~a.words}; }
  friend Mask select(const Mask &where, const Mask &a, const Mask &b)
  {
    return {(where.words & a.words) | (~where.words & b.words)};
  }
};

/// A register of doubles as a scalar: geometry written for any scalar and without branches runs on
/// all lanes at once, with the rounding of doubles in each.
struct Pack {
  Doubles lanes;

  Pack() = default;
  Pack(double x) : lanes(x - Doubles{}) {}  // constants convert implicitly
  explicit Pack(const Doubles &values) : lanes(values) {}

  /// A pack of of(0) to of(LANES - 1).
  template <class Of> static Pack from(const Of &of) { return from(of, Each()); }
  static Pack load(const double *at)
  {
    Pack a;
    std::memcpy(&a.lanes, at, sizeof(a.lanes));
    return a;
  }
  void store(double *at) const { std::memcpy(at, &lanes, sizeof(lanes)); }

  friend Pack operator+(const Pack &a, const Pack &b) { return Pack(a.lanes + b.lanes); }
  friend Pack operator-(const Pack &a, const Pack &b) { return Pack(a.lanes - b.lanes); }
  friend Pack operator*(const Pack &a, const Pack &b) { return Pack(a.lanes * b.lanes); }
  friend Pack operator/(const Pack &a, const Pack &b) { return Pack(a.lanes / b.lanes); }
  friend Pack operator-(const Pack &a) { return Pack(-a.lanes); }
  friend Pack &operator+=(Pack &a, const Pack &b) { return a = a + b; }
  friend Pack &operator-=(Pack &a, const Pack &b) { return a = a - b; }
  friend Pack &operator*=(Pack &a, const Pack &b) { return a = a * b; }

  friend Mask operator<(const Pack &a, const Pack &b) { return {a.lanes < b.lanes}; }
  friend Mask operator>(const Pack &a, const Pack &b) { return {a.lanes > b.lanes}; }
  friend Mask operator<=(const Pack &a, const Pack &b) { return {a.lanes <= b.lanes}; }
  friend Mask operator>=(const Pack &a, const Pack &b) { return {a.lanes >= b.lanes}; }
  friend Mask operator==(const Pack &a, const Pack &b) { return {a.lanes == b.lanes}; }

  friend Pack select(const Mask &where, const Pack &a, const Pack &b)
  {
    return Pack(where.words < 0 ? a.lanes : b.lanes);
  }
  friend Pack least(const Pack &a, const Pack &b)
  {
    return Pack(b.lanes < a.lanes ? b.lanes : a.lanes);
  }
  friend Pack most(const Pack &a, const Pack &b)
  {
    return Pack(a.lanes < b.lanes ? b.lanes : a.lanes);
  }
  friend void exchange(const Mask &where, Pack &a, Pack &b)
  {
    const Pack kept = a;
    a = select(where, b, a);
    b = select(where, kept, b);
  }
  friend Pack sqrt(const Pack &a)
  {
    return from([&](int k) { return std::sqrt(a.lanes[k]); });  // one instruction
  }
  friend Pack abs(const Pack &a) { return of_words(a.words() & ~SIGN); }
  friend Pack copysign(const Pack &a, const Pack &sign)
  {
    return of_words((a.words() & ~SIGN) | (sign.words() & SIGN));
  }

  /// Rounds to the nearest integer; |a| must be below 2^51.
  friend Pack nearest_whole(const Pack &a) { return a + WHOLE - WHOLE; }
  /// 2^n for integers n from -1022 to 1023.
  friend Pack power_of_two(const Pack &whole)
  {
    return of_words(((whole + WHOLE).naturals() + BIAS) << MANTISSA);
  }
  friend struct PowerOfTwo;

 private:
  using Each = std::make_integer_sequence<int, LANES>;
  static constexpr long long SIGN = static_cast<long long>(1ULL << 63);
  static constexpr int MANTISSA = 52;               // number of its bits
  static constexpr unsigned long long BIAS = 1023;  // bias of the exponent above it
  static constexpr double WHOLE = 0x1.8p52;         // doubles near this one are integers

  template <class Of, int... K> static Pack from(const Of &of, std::integer_sequence<int, K...>)
  {
    return Pack(Doubles{of(K)...});
  }
  Words words() const { return reinterpret_cast<Words>(lanes); }
  Naturals naturals() const { return reinterpret_cast<Naturals>(lanes); }
  template <class W> static Pack of_words(const W &words)
  {
    return Pack(reinterpret_cast<Doubles>(words));
  }
};

/// Four consecutive numbers of each lane, from(k)[0] to from(k)[3], as four packs: fewer
/// instructions than one number at a time.
template <class From> void load_fours(const From &from, Pack (&to)[4])
{
  // Each register holds the numbers of one lane, or of lanes k and k + 4; they are transposed.
#if defined(__AVX512F__)
  using Four = double __attribute__((vector_size(32)));
  const auto of = [&](int k) {
    Four low, high;
    std::memcpy(&low, from(k), sizeof(low));
    std::memcpy(&high, from(k + 4), sizeof(high));
    return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
  };
  const Doubles a = of(0), b = of(1), c = of(2), d = of(3);
  const auto even = [](const Doubles &x, const Doubles &y) {
    return __builtin_shufflevector(x, y, 0, 8, 2, 10, 4, 12, 6, 14);
  };
  const auto odd = [](const Doubles &x, const Doubles &y) {
    return __builtin_shufflevector(x, y, 1, 9, 3, 11, 5, 13, 7, 15);
  };
  const auto first = [](const Doubles &x, const Doubles &y) {
    return Pack(__builtin_shufflevector(x, y, 0, 1, 8, 9, 4, 5, 12, 13));
  };
  const auto last = [](const Doubles &x, const Doubles &y) {
    return Pack(__builtin_shufflevector(x, y, 2, 3, 10, 11, 6, 7, 14, 15));
  };
#elif defined(__AVX__)
  const auto of = [&](int k) { return Pack::load(from(k)).lanes; };
  const Doubles a = of(0), b = of(1), c = of(2), d = of(3);
  const auto even = [](const Doubles &x, const Doubles &y) {
    return __builtin_shufflevector(x, y, 0, 4, 2, 6);
  };
  const auto odd = [](const Doubles &x, const Doubles &y) {
    return __builtin_shufflevector(x, y, 1, 5, 3, 7);
  };
  const auto first = [](const Doubles &x, const Doubles &y) {
    return Pack(__builtin_shufflevector(x, y, 0, 1, 4, 5));
  };
  const auto last = [](const Doubles &x, const Doubles &y) {
    return Pack(__builtin_shufflevector(x, y, 2, 3, 6, 7));
  };
#endif
#if defined(__AVX__)
  const Doubles even_ab = even(a, b), even_cd = even(c, d), odd_ab = odd(a, b), odd_cd = odd(c, d);
  to[0] = first(even_ab, even_cd);
  to[1] = first(odd_ab, odd_cd);
  to[2] = last(even_ab, even_cd);
  to[3] = last(odd_ab, odd_cd);
#else
  for (int n = 0; n < 4; ++n) to[n] = Pack::from([&](int k) { return from(k)[n]; });
#endif
}

/// A number x = 2^power rest, rest from sqrt(1/2) to sqrt(2).
struct PowerOfTwo {
  Pack power, rest;

  /// Requires positive normal numbers.
  explicit PowerOfTwo(const Pack &x)
  {
    // Exponents relative to sqrt(1/2), shifted by ABOVE to stay positive.
    constexpr unsigned long long FROM = 0x3fe6a09e667f3bcd, ABOVE = 1024;
    const Naturals above = (x.naturals() - FROM + (ABOVE << Pack::MANTISSA)) >> Pack::MANTISSA;
    power = Pack::of_words(above + WHOLE_WORD) - (Pack::WHOLE + ABOVE);
    rest = Pack::of_words(x.naturals() - ((above - ABOVE) << Pack::MANTISSA));
  }

 private:
  static constexpr unsigned long long WHOLE_WORD = 0x4338000000000000;  // bits of Pack::WHOLE
};

/// The truth values as bits, lane 0 the lowest.
inline unsigned bits_of(const Mask &mask)
{
#if defined(__AVX512F__)
  return static_cast<unsigned>(__builtin_ia32_cvtq2mask512(mask.words));
#elif defined(__AVX__)
  return static_cast<unsigned>(__builtin_ia32_movmskpd256(reinterpret_cast<Doubles>(mask.words)));
#elif defined(__SSE2__)
  return static_cast<unsigned>(__builtin_ia32_movmskpd(reinterpret_cast<Doubles>(mask.words)));
#else
  unsigned bits = 0;
  for (int k = 0; k < LANES; ++k) bits |= mask.words[k] < 0 ? 1U << k : 0U;
  return bits;
#endif
}
inline bool any(const Mask &mask) { return bits_of(mask) != 0; }
inline bool all(const Mask &mask) { return bits_of(mask) == (1U << LANES) - 1; }

/// A pack has no derivatives: it is its own value.
inline const Pack &value_of(const Pack &x) { return x; }
inline const Pack &constant(const Pack &x) { return x; }
inline const Pack &with_value(const Pack &, const Pack &value) { return value; }

}  // namespace JAMSHAPE_SET

template <> struct PlainOf<Pack> {
  using Type = Pack;
};
template <> struct CommonOf<Pack> {
  using Type = double;
};

}  // namespace jamshape
