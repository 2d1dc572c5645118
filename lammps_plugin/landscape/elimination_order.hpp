#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <iterator>
#include <numeric>
#include <vector>

namespace jamshape {

/// Order of elimination by approximate minimum degree, of N particles and the pairs of them (M, 2)
/// that share a block: the place of each.
inline std::vector<int> by_minimum_degree(std::size_t N, const std::vector<std::int64_t> &pairs)
{
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t i = 0; i < N; ++i) entries.emplace_back(i, i, 1.0);
  for (std::size_t p = 0; p < pairs.size(); p += 2) {
    const auto [low, high] = std::minmax(pairs[p], pairs[p + 1]);
    entries.emplace_back(low, high, 1.0);
  }
  Eigen::SparseMatrix<double> neighbours(N, N);
  neighbours.setFromTriplets(entries.begin(), entries.end());
  Eigen::AMDOrdering<int>::PermutationType inverse;
  Eigen::AMDOrdering<int>()(neighbours.selfadjointView<Eigen::Upper>(), inverse);
  const auto order = inverse.inverse().eval();
  return {order.indices().data(), order.indices().data() + N};
}

/// Order of elimination by nested dissection (A. George, SIAM J. Numer. Anal. 10, 345 (1973)): a
/// region is halved across its longest side, and the particles that separate the halves are
/// eliminated after both.
template <int D> class Dissection {
 public:
  /// Order of particles at these positions (N, D), in a box that may be periodic.
  Dissection(const std::vector<double> &positions, const std::vector<std::int64_t> &pairs) :
      position(positions), neighbours(positions.size() / D), region(neighbours.size()),
      partner(neighbours.size()), reached(neighbours.size()), place(neighbours.size())
  {
    for (std::size_t p = 0; p < pairs.size(); p += 2) {
      neighbours[pairs[p]].push_back(static_cast<int>(pairs[p + 1]));
      neighbours[pairs[p + 1]].push_back(static_cast<int>(pairs[p]));
    }
    std::vector<int> all(neighbours.size());
    std::iota(all.begin(), all.end(), 0);
    dissect(all.data(), all.data() + all.size(), static_cast<int>(all.size()));
  }

  const std::vector<int> &places() const { return place; }

 private:
  /// Smallest number of particles that is divided further.
  static constexpr int DIVISIBLE = 8;
  static constexpr int NONE = -1;

  const std::vector<double> &position;
  std::vector<std::vector<int>> neighbours;
  std::vector<int> region;   // (N,) number of the region of each particle
  std::vector<int> partner;  // (N,) on the other side of the cut
  std::vector<int> reached;  // (N,) number of the search that reached it
  std::vector<int> place;
  int regions = 0, searches = 0;

  /// Gives these particles the places before `end`.
  void dissect(int *first, int *last, int end)
  {
    const auto n = static_cast<int>(last - first);
    if (n < DIVISIBLE) {
      while (first < last) place[*--last] = --end;
      return;
    }
    int *const middle = halve(first, last);
    const int left = ++regions, right = ++regions, between = ++regions;
    std::for_each(first, middle, [&](int i) { region[i] = left; });
    std::for_each(middle, last, [&](int i) { region[i] = right; });
    for (const int i : separator(first, middle, last, right)) region[i] = between;
    const auto is_in = [&](int which) { return [&, which](int i) { return region[i] == which; }; };
    int *const after_left = std::partition(first, last, is_in(left));
    int *const after_right = std::partition(after_left, last, is_in(right));
    for (int *i = last; i > after_right;) place[*--i] = --end;
    dissect(after_left, after_right, end);
    dissect(first, after_left, end - static_cast<int>(after_right - after_left));
  }

  /// Sorts particles into two halves across the longest side of their region.
  int *halve(int *first, int *last) const
  {
    int longest = 0;
    double most = -1.0;
    for (int k = 0; k < D; ++k) {
      const auto by = [&](int i, int j) { return position[D * i + k] < position[D * j + k]; };
      const auto [low, high] = std::minmax_element(first, last, by);
      const double length = position[D * *high + k] - position[D * *low + k];
      if (length > most) {
        most = length;
        longest = k;
      }
    }
    int *const middle = first + (last - first) / 2;
    std::nth_element(first, middle, last, [&](int i, int j) {
      return position[D * i + longest] < position[D * j + longest];
    });
    return middle;
  }

  /// The fewest particles with at least one of each pair across: those that no alternating path
  /// from a particle without a partner reaches on the left, and those that one reaches on the right
  /// (theorem of König).
  std::vector<int> separator(const int *first, const int *middle, const int *last, int right)
  {
    std::for_each(first, last, [&](int i) { partner[i] = NONE; });
    std::for_each(first, middle, [&](int i) {
      ++searches;
      find_partner(i, right);
    });
    ++searches;
    std::for_each(first, middle, [&](int i) {
      if (partner[i] == NONE) reach_from(i, right);
    });
    std::vector<int> found;
    std::copy_if(first, middle, std::back_inserter(found), [&](int i) { return !is_reached(i); });
    std::copy_if(middle, last, std::back_inserter(found), [&](int j) { return is_reached(j); });
    return found;
  }

  bool is_reached(int i) const { return reached[i] == searches; }

  /// Gives a particle a partner of its own among its neighbours on the right, if others can be
  /// given other ones.
  bool find_partner(int i, int right)
  {
    for (const int j : neighbours[i]) {
      if (region[j] != right || is_reached(j)) continue;
      reached[j] = searches;
      if (partner[j] != NONE && !find_partner(partner[j], right)) continue;
      partner[j] = i;
      partner[i] = j;
      return true;
    }
    return false;
  }

  /// Follows all paths from a particle to neighbours on the right and on to their partners.
  void reach_from(int i, int right)
  {
    reached[i] = searches;
    for (const int j : neighbours[i]) {
      if (region[j] != right || is_reached(j)) continue;
      reached[j] = searches;
      if (!is_reached(partner[j])) reach_from(partner[j], right);
    }
  }
};

/// (N,) places of particles in an order of elimination with little fill-in. Their positions (N, D)
/// may be in a periodic box, and `pairs` (M, 2) of them share a block. The minimum degree takes
/// fewer operations in a plane, dissection in space.
template <int D>
std::vector<int> elimination_order(const std::vector<double> &position,
                                   const std::vector<std::int64_t> &pairs)
{
  if constexpr (D == 2) return by_minimum_degree(position.size() / D, pairs);
  return Dissection<D>(position, pairs).places();
}

}  // namespace jamshape
