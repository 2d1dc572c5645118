#pragma once

#include "contact/contact.hpp"
#include "contact/math/vec.hpp"

#include "landscape/near_pairs.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <optional>
#include <vector>

namespace jamshape {

/// A pair of particles whatever list it is in: both, and the cell vectors by which the second is
/// shifted.
using PairName = std::array<std::int64_t, 5>;

/// The energy of a pair near a kink is the larger of two smooth pieces. On the kink it may be any
/// mixture of both: (1 - weight) V_from + weight V_to, in which the state stays on the kink while
/// it is held there. `hold_kinks` adds a stiffness across, along the difference of the gradients:
/// (stiffness / 2) (V_to - V_from)^2.
struct Kink {
  PairName pair;
  int from, to;
  double weight, stiffness;
  bool is_held;
};

/// A kink seen from a point: V_to - V_from there, and by these coordinates (-1 for none) the
/// gradient of that difference, and of V_from minus the energy of the pair. It exists if the pair
/// touches.
struct KinkThere {
  static constexpr int MOST = 12;
  bool exists;
  double gap;
  std::array<std::int64_t, MOST> column;
  std::array<double, MOST> jump, change;

  /// Adds a multiple of a gradient to a vector (n,).
  void add(double part, const std::array<double, MOST> &gradient, Eigen::VectorXd &to) const
  {
    for (int k = 0; k < MOST; ++k) {
      if (column[k] >= 0) to[column[k]] += part * gradient[k];
    }
  }
  /// Change of the difference by a displacement (n,).
  double across(const Eigen::VectorXd &step) const
  {
    double sum = 0.0;
    for (int k = 0; k < MOST; ++k) {
      if (column[k] >= 0) sum += jump[k] * step[column[k]];
    }
    return sum;
  }
  double jump_squared() const
  {
    double sum = 0.0;
    for (int k = 0; k < MOST; ++k) sum += column[k] >= 0 ? jump[k] * jump[k] : 0.0;
    return sum;
  }
};

/// A pair of a list, whatever its number there.
template <int D> PairName name_of(const NearPairs<D> &list, std::size_t p)
{
  PairName name{};
  std::copy_n(&list.particles[2 * p], 2, name.begin());
  std::copy_n(&list.shift[D * p], D, name.begin() + 2);
  return name;
}

/// The number of each of these pairs in a list, if it is there.
template <int D>
std::vector<std::optional<std::size_t>> numbers_of(const NearPairs<D> &list,
                                                   const std::vector<Kink> &kinks)
{
  std::vector<std::optional<std::size_t>> found(kinks.size());
  for (std::size_t p = 0; p < list.list().n; ++p) {
    for (std::size_t k = 0; k < kinks.size(); ++k) {
      if (list.particles[2 * p] == kinks[k].pair[0] && name_of(list, p) == kinks[k].pair) {
        found[k] = p;
      }
    }
  }
  return found;
}

/// A kink of a pair, with this number and these particles.
template <class Model, int D, class Pairs>
KinkThere kink_of(const Pairs &posed, std::size_t p, const std::int64_t *particles,
                  const Coordinates &coordinates, const Kink &kink)
{
  using S = typename Pairs::S;
  constexpr int BLOCK = BasePoses<D>::BLOCK;
  const Vec<D, S> r = posed.separation(p);
  const auto i = posed.first_body(p, r);
  const auto &j = posed.second_body(p);
  const auto whole = contact_of(i, j, posed.law(p));
  KinkThere found{};
  found.exists = whole.status == ContactStatus::TOUCHING;
  if (!found.exists) return found;
  const auto from = contact_of(i, j, Model::on_piece(posed.law(p), kink.from));
  const auto to = contact_of(i, j, Model::on_piece(posed.law(p), kink.to));
  found.gap = static_cast<double>(to.energy - from.energy);
  found.column.fill(-1);
  for (int side = 0; side < 2; ++side) {
    const double scale = coordinates.radians_per_length[particles[side]];
    for (int k = 0; k < coordinates.count(particles[side]); ++k) {
      const int c = BLOCK * side + k;
      found.column[c] = coordinates.first[particles[side]] + k;
      const auto slope = [&](const auto &of) {
        if (k < D) return side == 0 ? -of.force[k] : of.force[k];
        return -scale * (side == 0 ? of.torque_i : of.torque_j)[k - D];
      };
      found.jump[c] = static_cast<double>(slope(to) - slope(from));
      found.change[c] = static_cast<double>(slope(from) - slope(whole));
    }
  }
  return found;
}

}  // namespace jamshape
