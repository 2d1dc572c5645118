#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace jamshape {

/// Random numbers as `numpy.random.default_rng(seed)` draws them, so that a seed gives the same
/// start in a deck and in Python: PCG64 (O'Neill, HMC-CS-2014-0905), seeded by NumPy's
/// SeedSequence.
class NumpyRandom {
 public:
  explicit NumpyRandom(std::uint64_t seed)
  {
    const std::array<std::uint64_t, 4> key = seed_sequence(seed);
    increment = (wide(key[2], key[3]) << 1U) | 1U;
    advance();
    state += wide(key[0], key[1]);
    advance();
  }

  /// Uniform in [0, 1): `random()`.
  double uniform() { return static_cast<double>(next() >> 11U) * 0x1p-53; }

  /// `permutation(n)`.
  std::vector<std::size_t> permutation(std::size_t n)
  {
    std::vector<std::size_t> order(n);
    std::iota(order.begin(), order.end(), std::size_t{0});
    for (std::size_t i = n; i-- > 1;)
      std::swap(order[i], order[up_to(static_cast<std::uint32_t>(i))]);
    return order;
  }

 private:
  __extension__ using Wide = unsigned __int128;

  Wide state = 0, increment = 0;
  bool has_half = false;
  std::uint32_t half = 0;

  static Wide wide(std::uint64_t high, std::uint64_t low) { return (Wide(high) << 64U) | low; }

  void advance()
  {
    state = state * wide(2549297995355413924ULL, 4865540595714422341ULL) + increment;
  }

  std::uint64_t next()
  {
    advance();
    const auto folded =
        static_cast<std::uint64_t>(state >> 64U) ^ static_cast<std::uint64_t>(state);
    const auto turn = static_cast<unsigned>(state >> 122U);
    return (folded >> turn) | (folded << ((64U - turn) % 64U));
  }

  std::uint32_t next_half()
  {
    has_half = !has_half;
    if (!has_half) return half;
    const std::uint64_t both = next();
    half = static_cast<std::uint32_t>(both >> 32U);
    return static_cast<std::uint32_t>(both);
  }

  /// A random integer from 0 to `most`.
  std::uint32_t up_to(std::uint32_t most)
  {
    std::uint32_t mask = most;
    for (const unsigned by : {1U, 2U, 4U, 8U, 16U}) mask |= mask >> by;
    std::uint32_t drawn;
    do drawn = next_half() & mask;
    while (drawn > most);
    return drawn;
  }

  static std::array<std::uint64_t, 4> seed_sequence(std::uint64_t seed)
  {
    std::uint32_t factor = 0x43b0d7e5U;
    const auto hashed = [&factor](std::uint32_t value, std::uint32_t by) {
      value ^= factor;
      factor *= by;
      value *= factor;
      return value ^ (value >> 16U);
    };
    std::array<std::uint32_t, 4> pool{static_cast<std::uint32_t>(seed),
                                      static_cast<std::uint32_t>(seed >> 32U), 0, 0};
    for (std::uint32_t &word : pool) word = hashed(word, 0x931e8875U);
    for (std::size_t from = 0; from < pool.size(); ++from) {
      for (std::size_t to = 0; to < pool.size(); ++to) {
        if (to == from) continue;
        const std::uint32_t mixed =
            0xca01f9ddU * pool[to] - 0x4973f715U * hashed(pool[from], 0x931e8875U);
        pool[to] = mixed ^ (mixed >> 16U);
      }
    }
    factor = 0x8b51f9ddU;
    std::array<std::uint64_t, 4> key{};
    for (std::size_t k = 0; k < 2 * key.size(); ++k) {
      key[k / 2] |= std::uint64_t{hashed(pool[k % pool.size()], 0x58f38dedU)} << (32U * (k % 2));
    }
    return key;
  }
};

/// `numpy.sum`, to the last bit.
inline double numpy_sum(const double *values, std::size_t n)
{
  if (n < 8) {
    double sum = 0.0;
    for (std::size_t k = 0; k < n; ++k) sum += values[k];
    return sum;
  }
  if (n > 128) {
    const std::size_t first = n / 2 - n / 2 % 8;
    return numpy_sum(values, first) + numpy_sum(values + first, n - first);
  }
  std::array<double, 8> part{};
  for (std::size_t k = 0; k < n - n % 8; ++k) part[k % 8] += values[k];
  double sum =
      ((part[0] + part[1]) + (part[2] + part[3])) + ((part[4] + part[5]) + (part[6] + part[7]));
  for (std::size_t k = n - n % 8; k < n; ++k) sum += values[k];
  return sum;
}

}  // namespace jamshape
