#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace jamshape {

/// Laws of the contacts of N particles: one for all pairs, or one for each pair of their kinds.
template <class Law> class Laws {
 public:
  explicit Laws(const Law &of_all) : common(of_all) {}

  /// A table (T, T), symmetric and not empty, and kinds (N,) in 0 ... T - 1.
  Laws(std::size_t n_kinds, std::vector<Law> of_kinds, std::vector<std::size_t> kinds) :
      common(of_kinds.front()), n(n_kinds), table(std::move(of_kinds)), kind(std::move(kinds))
  {
  }

  bool is_one() const { return table.empty(); }

  /// The law of particles i and j, unless there is only one.
  const Law &of(std::size_t i, std::size_t j) const { return table[n * kind[i] + kind[j]]; }

  /// One of the laws, which differ in k_e only.
  const Law &any() const { return common; }

 private:
  Law common;
  std::size_t n = 0;
  std::vector<Law> table;
  std::vector<std::size_t> kind;
};

}  // namespace jamshape
