// Compiled once for each instruction set, JAMSHAPE_SET.

#include "landscape/near_kernels.hpp"

#include "contact/math/pack.hpp"
#include "contact/math/vec.hpp"

#include "landscape/single_precision.hpp"

#include <algorithm>
#include <cstring>

namespace jamshape {
namespace {

/// Pairs of a group, from `first` on, after displacements and a strain.
template <int D> struct MovedPack {
  const PairGroup<D> &group;
  int first;
  Vec<D, Pack> r;
  unsigned near;  // bits of those whose bounding spheres touch

  MovedPack(const MovedGroups<D> &of, std::size_t number_of_group, int from) :
      group(of.groups[number_of_group]), first(from)
  {
    alignas(64) double each[LANES][4];
    for (int k = 0; k < LANES; ++k) {
      const double *const at = of.displacement;
      subtract(at + D * group.i[first + k], at + D * group.j[first + k], each[k]);
    }
    Pack moved[4];
    load_fours([&](int k) { return each[k]; }, moved);
    Pack r_sq = 0.0;
    for (int a = 0; a < D; ++a) {
      const Pack apart = Pack::load(group.apart[a] + first);
      const Pack small = Pack(in_doubles<Doubles>(group.rest[a] + first)) + moved[a];
      r[a] = apart + (small + of.strain * (apart + small));  // one rounding of the size of r
      r_sq += r[a] * r[a];
    }
    near = bits_of(r_sq < Pack(in_doubles<Doubles>(group.reach_sq + first)));
  }

  /// Adds those whose bits are set to a block; p is the number of the first one.
  void add(unsigned bits, int p, ContactBlock<D> &block, int *number) const
  {
#if defined(__AVX512F__)
    const auto chosen = static_cast<__mmask8>(bits);
    for (int a = 0; a < D; ++a) {
      _mm512_storeu_pd(block.separation[a] + block.n,
                       _mm512_maskz_compress_pd(chosen, __m512d(r[a].lanes)));
    }
    const auto put = [&](const __m256i &eight, int *to) {
      const __m512i kept = _mm512_maskz_compress_epi32(chosen, _mm512_castsi256_si512(eight));
      _mm256_storeu_si256(reinterpret_cast<__m256i_u *>(to), _mm512_castsi512_si256(kept));
    };
    const auto eight = [](const int *from) {
      return _mm256_loadu_si256(reinterpret_cast<const __m256i_u *>(from));
    };
    put(eight(group.i), block.i + block.n);
    put(eight(group.j), block.j + block.n);
    put(_mm256_add_epi32(_mm256_set1_epi32(p), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)),
        number + block.n);
    block.n += __builtin_popcount(bits);
#else
    for (int k = 0; k < LANES; ++k) {
      block.i[block.n] = group.i[first + k];
      block.j[block.n] = group.j[first + k];
      for (int a = 0; a < D; ++a) block.separation[a][block.n] = r[a].lanes[k];
      number[block.n] = p + k;
      block.n += bits >> k & 1;  // a branch would be unpredictable
    }
#endif
  }

 private:
  /// In one register, of which the last numbers may be without meaning.
  static void subtract(const double *a, const double *b, double *to)
  {
    double __attribute__((vector_size(32))) left, right;
    std::memcpy(&left, a, sizeof(left));
    std::memcpy(&right, b, sizeof(right));
    left -= right;
    std::memcpy(to, &left, sizeof(left));
  }
};

template <int D>
[[gnu::flatten]] std::size_t touching(const MovedGroups<D> &pairs, std::size_t first,
                                      std::size_t last, ContactBlock<D> &block, int *number)
{
  constexpr int SIZE = PairGroup<D>::SIZE;
  for (std::size_t p = first - first % SIZE; p < last; p += SIZE) {
    if (block.n > block.MOST - SIZE) return std::max(p, first);
    for (int k = 0; k < SIZE; k += LANES) {
      const MovedPack<D> pack(pairs, p / SIZE, k);
      unsigned bits = pack.near;
      for (int lane = 0; lane < LANES && (p < first || p + SIZE > last); ++lane) {
        const std::size_t own = p + k + lane;
        if (own < first || own >= last) bits &= ~(1U << lane);
      }
      pack.add(bits, static_cast<int>(p) + k, block, number);
    }
  }
  return last;
}

template <int D>
[[gnu::flatten]] double longest_sq(std::size_t N, const double *vectors, const double *others)
{
  const auto load = [](const double *from, std::size_t n, Pack(&to)[4]) {
    load_fours([&](int k) { return from + D * (n + k); }, to);
  };
  Pack longest = 0.0;
  std::size_t n = 0;
  for (; n + LANES + 1 < N; n += LANES) {  // four numbers may be read beyond the last vector
    Pack own[4], other[4], sum = 0.0;
    load(vectors, n, own);
    if (others != nullptr) {
      load(others, n, other);
      for (int a = 0; a < D; ++a) own[a] += other[a];
    }
    for (int a = 0; a < D; ++a) sum += own[a] * own[a];
    longest = most(longest, sum);
  }
  double found = 0.0;
  for (int k = 0; k < LANES; ++k) found = std::max(found, longest.lanes[k]);
  for (; n < N; ++n) {
    double sum = 0.0;
    for (std::size_t c = D * n; c < D * (n + 1); ++c) {
      const double own = others == nullptr ? vectors[c] : vectors[c] + others[c];
      sum += own * own;
    }
    found = std::max(found, sum);
  }
  return found;
}

}  // namespace

template <InstructionSet SET, int D> NearKernels<D> near_kernels_of()
{
  return {&touching<D>, &longest_sq<D>};
}

template NearKernels<2> near_kernels_of<InstructionSet::JAMSHAPE_SET, 2>();
template NearKernels<3> near_kernels_of<InstructionSet::JAMSHAPE_SET, 3>();

}  // namespace jamshape
