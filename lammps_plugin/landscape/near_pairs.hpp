#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"
#include "contact/pair_derivatives.hpp"

#include "landscape/coordinates.hpp"
#include "landscape/near_kernels.hpp"
#include "packing/pair_sum.hpp"
#include "packing/split.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

namespace jamshape {

/// Pairs whose surfaces were closer than `skin` at some poses, and centres closer than `reach`.
template <int D> struct NearPairs {
  std::vector<std::int64_t> particles, shift;  // (M, 2), (M, D)
  Poses then;
  double skin, reach;
  // From `then` to the base: the box's strain (D, D), upper triangular, and apart from it (N, D)
  // displacements and (N,) angles, in 3D (N, 4) quaternions.
  std::vector<double> strain{}, moved{}, turned{};

  PairList list() const { return {particles.size() / 2, particles.data(), shift.data()}; }

  /// Measures what moved since then.
  void measure(const BasePoses<D> &near)
  {
    moved.resize(D * near.n_particles());
    turned.resize(TURN_NUMBERS<D> * near.n_particles());
    strain = strain_to(near.base);
    const Poses &base = near.base;
    double *const moved_by = moved.data();
    for (std::size_t c = 0; c < moved.size(); ++c) {
      const Split change = since(base.position, then.position, c);
      moved_by[c] = change.value + change.rest;
    }
    const auto is_zero = [](double x) { return x == 0.0; };
    if (!std::all_of(strain.begin(), strain.end(), is_zero)) subtract_strain(base);
    for (std::size_t i = 0; i < near.n_particles(); ++i) {
      if (near.turns(i)) measure_turn(base, i);
    }
  }

  /// Displacement of a particle at a point, apart from the box's strain.
  Vec<D> shift_to(const BasePoses<D> &near, const Displacement &at, std::size_t i) const
  {
    Vec<D> by = near.shift(at, i);
    for (int k = 0; k < D; ++k) by[k] += moved[D * i + k];
    return by;
  }

  /// Whether the gap of two surfaces may have shrunk by the skin, or by its remainder.
  bool is_beyond(const BasePoses<D> &near, const Displacement &at, double kept = 0.0) const
  {
    const double stretch = 1.0 + at.strain;
    const double most =
        near.any_turns() ? farthest(near, at) : stretch * near.longest(at.x, moved.data());
    return 2.0 * most >= skin - kept - box_strain(stretch) * reach;
  }

 private:
  /// Largest displacement of a point of any surface at a point, with the strain there.
  double farthest(const BasePoses<D> &near, const Displacement &at) const
  {
    double most = 0.0;
    for (std::size_t i = 0; i < near.n_particles(); ++i) {
      const double shifted = (1.0 + at.strain) * norm(shift_to(near, at, i));
      const double turning =
          near.turns(i) ? near.coordinates.turning_radius[i] * turned_to(near, at, i) : 0.0;
      most = std::max(most, shifted + turning);
    }
    return most;
  }

  /// Change of a number.
  static Split since(const Poses::Numbers &now, const Poses::Numbers &then, std::size_t k)
  {
    return difference(Poses::get(now, k), Poses::get(then, k));
  }

  /// Strain of the box: the map from its cell vectors then to those now, upper triangular like
  /// both, minus the identity.
  std::vector<double> strain_to(const Poses &base) const
  {
    const std::vector<double> &before = then.cell[0];
    std::vector<double> found(D * D);
    for (int k = 0; k < D; ++k) {
      for (int m = k; m < D; ++m) {
        double left = rounded(joined(since(base.cell, then.cell, D * k + m)));
        for (int l = k; l < m; ++l) left -= found[D * k + l] * before[D * l + m];
        found[D * k + m] = left / before[D * m + m];
      }
    }
    return found;
  }

  /// Subtracts the displacements with the box, in long doubles: they grow with its size.
  void subtract_strain(const Poses &base)
  {
    for (std::size_t c = 0; c < moved.size(); ++c) {
      const std::size_t k = c % D;
      long double own = joined(since(base.position, then.position, c));
      for (std::size_t m = k; m < D; ++m) {
        own -= strain[D * k + m] * joined(Poses::get(then.position, c - k + m));
      }
      moved[c] = rounded(own);
    }
  }

  void measure_turn(const Poses &base, std::size_t i)
  {
    constexpr int TURNS = TURN_NUMBERS<D>;
    const double *const now = &base.orientation[0][TURNS * i];
    const double *const before = &then.orientation[0][TURNS * i];
    if constexpr (D == 2) {
      turned[i] = now[0] - before[0];
    } else {
      const Quaternion q = Quaternion{now[0], now[1], now[2], now[3]} *
                           Quaternion{before[0], -before[1], -before[2], -before[3]};
      const double parts[] = {q.w, q.i, q.j, q.k};
      std::copy_n(parts, TURNS, &turned[TURNS * i]);
    }
  }

  /// An upper bound of the rotation angle of a particle at a point.
  double turned_to(const BasePoses<D> &near, const Displacement &at, std::size_t i) const
  {
    const double *const before = &turned[TURN_NUMBERS<D> * i];
    if constexpr (D == 2) {
      const double angle = std::abs(before[0] + near.turn(at, i)[0]);
      return angle > M_PI ? std::abs(std::remainder(angle, 2.0 * M_PI)) : angle;
    } else {
      const Quaternion q =
          rotation_by(near.turn(at, i)) * Quaternion{before[0], before[1], before[2], before[3]};
      return std::min(M_PI, 2.0 * norm(Vec<3>{{q.i, q.j, q.k}}) / std::abs(q.w));  // its tangent
    }
  }

  /// Bound of the relative change of a vector by the box's strain and then by a stretch.
  double box_strain(double stretch) const
  {
    double scaled = 0.0, sheared_sq = 0.0;
    for (int k = 0; k < D; ++k) {
      scaled = std::max(scaled, std::abs(stretch * (1.0 + strain[(D + 1) * k]) - 1.0));
      for (int m = k + 1; m < D; ++m) {
        const double sheared = stretch * strain[D * k + m];
        sheared_sq += sheared * sheared;
      }
    }
    return scaled + std::sqrt(sheared_sq);
  }
};

/// Pairs of a list near the poses at which it was made, in doubles. A separation is the one at that
/// time, strained with the box, plus the difference of the particles' displacements apart from it:
/// numbers so small that the size of the box costs no digits.
template <class Model, int D> class MovedPairs : public BodyPairs<Model, D, double> {
 public:
  using Base = BodyPairs<Model, D, double>;
  using Base::first;
  using Base::second;
  using Shape = typename Model::Shape;
  using InLong = PosedPair<Model, D, long double>;

  /// `exact(p)` returns a pair at the present poses in long doubles.
  MovedPairs(const std::vector<Shape> &particle_shapes, const NearPairs<D> &list,
             const Laws<typename Model::Law> &contact_laws,
             std::function<InLong(std::size_t)> exact_pair) :
      Base(particle_shapes, list.list(), contact_laws), exact(std::move(exact_pair)),
      groups((this->size() + GROUP - 1) / GROUP), shift(particle_shapes.size()),
      orientation(particle_shapes.size(), Quaternion{1.0, 0.0, 0.0, 0.0})
  {
    const SplitPoses then = list.then.view(0.0);
    for (std::size_t p = 0; p < this->size(); ++p) {
      const double reach = this->around[first(p)] + this->around[second(p)];
      group_of(p).reach_sq[p % GROUP] = std::nextafter(static_cast<float>(reach * reach), INFINITY);
      group_of(p).i[p % GROUP] = static_cast<int>(first(p));
      group_of(p).j[p % GROUP] = static_cast<int>(second(p));
      before.push_back(separation_of<D, long double>(then, this->pairs, p));
    }
    strain_by(std::vector<double>(D * D));
  }

  /// Strains all separations with the box since that time, (D, D), upper triangular.
  void strain_by(const std::vector<double> &strain_of_box)
  {
    if (strain_of_box == strained_by) return;
    strained_by = strain_of_box;
    for (std::size_t p = 0; p < before.size(); ++p) {
      for (int k = 0; k < D; ++k) {
        long double grown = before[p][k];
        for (int m = k; m < D; ++m) grown += strained_by[D * k + m] * before[p][m];
        const Split parts = split(grown);
        group_of(p).apart[k][p % GROUP] = parts.value;
        group_of(p).rest[k][p % GROUP] = static_cast<float>(parts.rest);
      }
    }
  }

  /// Strain of the separations of moved particles.
  double strain = 0.0;

  /// Displaces a particle, apart from the box's strain.
  void displace(std::size_t n, const Vec<D> &by) { std::copy_n(by.c, D, shift[n]); }
  void turn(std::size_t n, const Quaternion &to)
  {
    orientation[n] = to;
    Model::template turn_to<D>(this->body[n], to);
  }

  Vec<D> separation(std::size_t p) const
  {
    const PairGroup<D> &group = groups[p / GROUP];
    Vec<D> r;
    for (int k = 0; k < D; ++k) {
      const double apart = group.apart[k][p % GROUP];
      const double small = group.rest[k][p % GROUP] + (shift[first(p)][k] - shift[second(p)][k]);
      r[k] = apart + (small + strain * (apart + small));  // one rounding of the size of r
    }
    return r;
  }

  /// Adds to a block those of a range of pairs that may touch, until it is full.
  std::size_t fill(const Range &from, ContactBlock<D> &block, int *number) const
  {
    return kernels.touching({groups.data(), shift.data(), strain}, from.first, from.last, block,
                            number);
  }

  InLong pair_in_long(std::size_t p) const { return exact(p); }

  auto turned(std::size_t n, int first_variable) const
  {
    return turned_body<Model, D, double>(this->shapes[n], orientation[n], first_variable);
  }

 private:
  static constexpr int GROUP = PairGroup<D>::SIZE;

  std::function<InLong(std::size_t)> exact;
  std::vector<Vec<D, long double>> before;  // separations then
  std::vector<double> strained_by;
  std::vector<PairGroup<D>> groups;
  Vectors<D> shift;
  std::vector<Quaternion> orientation;
  NearKernels<D> kernels = near_kernels<D>();

  PairGroup<D> &group_of(std::size_t p) { return groups[p / GROUP]; }
};

}  // namespace jamshape
