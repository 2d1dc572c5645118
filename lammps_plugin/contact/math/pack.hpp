#pragma once

#include "contact/math/scalar.hpp"

#include <cstring>
#include <utility>

/// The set of instructions that this file is compiled for. Packs bear its name, and so does all
/// that is made of them: a linker takes two functions that are called alike for one.
#ifndef JAMSHAPE_SET
#define JAMSHAPE_SET baseline
#endif

namespace jamshape {
inline namespace JAMSHAPE_SET {

/// As many doubles as a register holds.
#if defined(__AVX512F__)
inline constexpr int LANES = 8;
#elif defined(__AVX__)
inline constexpr int LANES = 4;
#else
inline constexpr int LANES = 2;
#endif

using Doubles = double __attribute__((vector_size(8 * LANES)));
using Words = long long __attribute__((vector_size(8 * LANES)));

/// As many truths, words of ones or zeros.
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

/// A register of doubles as a scalar: geometry that is written for any scalar and without branches
/// runs on all lanes at once, each with the roundings of a double.
struct Pack {
  Doubles lanes;

  Pack() = default;
  Pack(double x) : lanes(x - Doubles{}) {}  // constants convert by themselves
  explicit Pack(const Doubles &values) : lanes(values) {}

  /// of(0) to of(LANES - 1).
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
  friend Pack sqrt(const Pack &a)
  {
    return from([&](int k) { return std::sqrt(a.lanes[k]); });  // one instruction
  }
  // One by one, by the library: so that they round alike on every machine.
  friend Pack exp(const Pack &a)
  {
    return a.each([](double x) { return std::exp(x); });
  }
  friend Pack log(const Pack &a)
  {
    return a.each([](double x) { return std::log(x); });
  }
  friend Pack log1p(const Pack &a)
  {
    return a.each([](double x) { return std::log1p(x); });
  }
  friend Pack abs(const Pack &a) { return of_words(a.words() & ~SIGN); }
  friend Pack copysign(const Pack &a, const Pack &sign)
  {
    return of_words((a.words() & ~SIGN) | (sign.words() & SIGN));
  }

 private:
  using Each = std::make_integer_sequence<int, LANES>;
  static constexpr long long SIGN = static_cast<long long>(1ULL << 63);

  template <class Of, int... K> static Pack from(const Of &of, std::integer_sequence<int, K...>)
  {
    return Pack(Doubles{of(K)...});
  }
  template <class Function> Pack each(const Function &function) const
  {
    return from([&](int k) { return function(lanes[k]); });
  }
  Words words() const { return reinterpret_cast<Words>(lanes); }
  static Pack of_words(const Words &words) { return Pack(reinterpret_cast<Doubles>(words)); }
};

/// The truths as bits, lane 0 the lowest.
inline unsigned bits_of(const Mask &mask)
{
#if defined(__AVX__) && !defined(__AVX512F__)
  return static_cast<unsigned>(__builtin_ia32_movmskpd256(reinterpret_cast<Doubles>(mask.words)));
#elif defined(__SSE2__) && !defined(__AVX512F__)
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

}  // namespace jamshape
