#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include "landscape/near_kernels.hpp"
#include "landscape/poses.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace jamshape {

/// The coordinates, particle by particle: its displacement, and its rotation if contacts can rotate
/// it, measured as a length; a surface moves by at most the turning radius per radian.
struct Coordinates {
  std::vector<std::int64_t> first{0};                      // (N + 1,) number of each one's first
  std::vector<double> radians_per_length, turning_radius;  // (N,) 0 without rotation

  /// Adds the coordinates of a particle in D dimensions whose rotation has this length, or 0.
  template <int D> void add(double rotation_length, double radius)
  {
    const bool turns = rotation_length > 0.0;
    first.push_back(first.back() + D + (turns ? ROTATIONS<D> : 0));
    radians_per_length.push_back(turns ? 1.0 / rotation_length : 0.0);
    turning_radius.push_back(radius);
  }

  std::size_t n() const { return first.back(); }
  /// The number of coordinates of a particle.
  int count(std::size_t i) const { return static_cast<int>(first[i + 1] - first[i]); }
};

/// A point near the base: a displacement, then an affine strain of box and positions.
struct Displacement {
  const double *x;  // (n,) in the coordinates
  double strain;
};

/// Largest displacement and rotation of a particle in one step.
struct StepBounds {
  double longest, widest;
};

/// A base and the points near it, particle by particle.
template <int D> class BasePoses {
 public:
  static constexpr int BLOCK = D + ROTATIONS<D>;

  Coordinates coordinates;
  Poses base;
  /// Whether rotations in 3D are about the axes of each body at the base instead of those of space.
  bool along_bodies = false;

  explicit BasePoses(Coordinates of_particles) : coordinates(std::move(of_particles)) {}

  std::size_t n_particles() const { return coordinates.turning_radius.size(); }
  /// Whether contacts can rotate a particle, or any.
  bool turns(std::size_t i) const { return coordinates.count(i) > D; }
  bool any_turns() const { return coordinates.n() > D * n_particles(); }

  /// Calls `then` with each coordinate, and whether it is a rotation.
  template <class Then> void each_coordinate(const Then &then) const
  {
    for (std::size_t i = 0; i < n_particles(); ++i) {
      for (int k = 0; k < coordinates.count(i); ++k) then(coordinates.first[i] + k, k >= D);
    }
  }

  /// (N, D) where particles are within the box: distances along its edges, from 0 to their lengths.
  std::vector<double> in_box() const
  {
    const std::vector<double> &cell = base.cell[0];
    std::vector<double> found = base.position[0];
    for (std::size_t first = 0; first < found.size(); first += D) {
      for (int k = D; k-- > 0;) {
        const double edge = cell[(D + 1) * k], part = found[first + k] / edge;
        for (int m = 0; m < k; ++m) found[first + m] -= part * cell[D * m + k];
        found[first + k] = (part - std::floor(part)) * edge;
      }
    }
    return found;
  }

  Vec<D> shift(const Displacement &at, std::size_t i) const
  {
    Vec<D> by;
    std::copy_n(at.x + coordinates.first[i], D, by.c);
    return by;
  }

  /// Rotation vector of a particle, in space coordinates.
  Torque<D> turn(const Displacement &at, std::size_t i) const
  {
    if (!turns(i)) return {};
    const double *const turned = at.x + coordinates.first[i] + D;
    Torque<D> by;
    for (int k = 0; k < ROTATIONS<D>; ++k) by[k] = turned[k] * coordinates.radians_per_length[i];
    if constexpr (D == 3) {
      if (along_bodies) {
        return by[0] * axis_of(i, 0) + by[1] * axis_of(i, 1) + by[2] * axis_of(i, 2);
      }
    }
    return by;
  }

  Quaternion orientation(const Displacement &at, std::size_t i) const
  {
    const double *const now = &base.orientation[0][TURN_NUMBERS<D> * i];
    if constexpr (D == 2) {
      const double half = 0.5 * (now[0] + (base.orientation[1][i] + turn(at, i)[0]));
      return {std::cos(half), 0.0, 0.0, std::sin(half)};
    } else {
      return turned(normalized(Quaternion{now[0], now[1], now[2], now[3]}), turn(at, i));
    }
  }

  /// Moves poses from the base to a point, without the strain there.
  void displace(Poses &poses, const Displacement &at) const
  {
    for (std::size_t i = 0; i < n_particles(); ++i) {
      poses.shift<D>(i, shift(at, i));
      if (turns(i)) poses.turn<D>(i, turn(at, i));
    }
  }

  /// Body axis of a particle at the base.
  Vec<3> axis_of(std::size_t i, int b) const
  {
    const double *const q = &base.orientation[0][TURN_NUMBERS<D> * i];
    return body_axis(Quaternion{q[0], q[1], q[2], q[3]}, b);
  }

  /// Derivative of the energy by a particle's rotation at a point, from its torque in space.
  template <class S>
  Torque<D, S> along_rotations(const Displacement &at, std::size_t i,
                               const Torque<D, S> &torque) const
  {
    const Torque<D, S> own = by_turn(turn(at, i), torque);
    if constexpr (D == 3) {
      if (along_bodies) {
        Torque<D, S> found;
        for (int b = 0; b < 3; ++b) found[b] = dot(constants_of<S>(axis_of(i, b)), own);
        return found;
      }
    }
    return own;
  }

  /// At most 1: the fraction of a step (n,) that keeps every particle within its bounds.
  double part_within(const double *step, const StepBounds &bounds) const
  {
    if (!any_turns()) return 1.0 / std::max(1.0, longest(step) / bounds.longest);
    const Displacement by{step, 0.0};
    double farthest_sq = 0.0, excess = 1.0;
    for (std::size_t i = 0; i < n_particles(); ++i) {
      farthest_sq = std::max(farthest_sq, norm_sq(shift(by, i)));
      if (!turns(i)) continue;
      const double widest =
          std::max(bounds.widest, std::min(WIDE, bounds.longest / coordinates.turning_radius[i]));
      excess = std::max(excess, std::abs(angle_of(turn(by, i))) / widest);
    }
    excess = std::max(excess, std::sqrt(farthest_sq) / bounds.longest);
    return 1.0 / excess;
  }

  /// The largest magnitude of a particle's displacement, rotation, force or torque in a vector
  /// (n,).
  double largest_part(const double *vector) const
  {
    if (!any_turns()) return longest(vector);
    double most = 0.0;
    for (std::size_t i = 0; i < n_particles(); ++i) {
      const double *const own = vector + coordinates.first[i];
      double force = 0.0, torque = 0.0;
      for (int k = 0; k < D; ++k) force += own[k] * own[k];
      for (int k = D; k < coordinates.count(i); ++k) torque += own[k] * own[k];
      most = std::max(most, std::max(force, torque));
    }
    return std::sqrt(most);
  }

  /// The length of the longest of vectors (N, D), or of their sums with others.
  double longest(const double *vectors, const double *others = nullptr) const
  {
    return std::sqrt(kernels.longest_sq(n_particles(), vectors, others));
  }

 private:
  /// Largest rotation of nearly round particles in one step, if their surface stays within its
  /// bound.
  static constexpr double WIDE = 1.0;

  NearKernels<D> kernels = near_kernels<D>();

  static double angle_of(const Vec<1> &turn) { return turn[0]; }
  static double angle_of(const Vec<3> &turn) { return norm(turn); }

  /// The torque with respect to the rotation vector of a particle that was rotated by it.
  template <class S> static Vec<1, S> by_turn(const Vec<1> &, const Vec<1, S> &torque)
  {
    return torque;
  }
  template <class S> static Vec<3, S> by_turn(const Vec<3> &vector, const Vec<3, S> &torque)
  {
    if (norm_sq(vector) == 0.0) return torque;
    Vec<3> doubles;
    for (int k = 0; k < 3; ++k) doubles[k] = static_cast<double>(torque[k]);
    return constants_of<S>(torque_on_rotation_vector(vector, doubles));
  }
};

}  // namespace jamshape
