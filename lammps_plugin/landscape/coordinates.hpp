#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include "landscape/poses.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace jamshape {

/// Layout of the coordinates: column (N, D + rotations), -1 for none; rotations are measured as
/// lengths, and move a surface by at most the turning radius per radian.
struct Coordinates {
  std::size_t n;
  std::vector<std::int64_t> column;
  std::vector<double> radians_per_length, turning_radius;
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

  /// `which_turn` (N,) tells which particles contacts can rotate.
  BasePoses(Coordinates names, std::vector<char> which_turn) :
      coordinates(std::move(names)), turning(std::move(which_turn))
  {
  }

  std::size_t n_particles() const { return turning.size(); }
  /// Whether contacts can rotate a particle.
  bool turns(std::size_t i) const { return turning[i]; }

  /// Whether any of the coordinates is a rotation.
  bool any_turns() const
  {
    for (std::size_t k = 0; k < coordinates.column.size(); ++k) {
      if (k % BLOCK >= D && coordinates.column[k] >= 0) return true;
    }
    return false;
  }

  /// Calls `then` with each coordinate, and whether it is a rotation.
  template <class Then> void each_coordinate(const Then &then) const
  {
    for (std::size_t k = 0; k < coordinates.column.size(); ++k) {
      if (coordinates.column[k] >= 0) then(coordinates.column[k], k % BLOCK >= D);
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
    for (int k = 0; k < D; ++k) by[k] = component(at, i, k);
    return by;
  }

  /// Rotation vector of a particle, in space coordinates.
  Torque<D> turn(const Displacement &at, std::size_t i) const
  {
    Torque<D> by;
    for (int k = 0; k < ROTATIONS<D>; ++k) {
      by[k] = component(at, i, D + k) * coordinates.radians_per_length[i];
    }
    if constexpr (D == 3) {
      if (along_bodies && turns(i)) {
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
    double most = 0.0;
    for (std::size_t i = 0; i < n_particles(); ++i) {
      double force = 0.0, torque = 0.0;
      for (int k = 0; k < BLOCK; ++k) {
        const double value = component({vector, 0.0}, i, k);
        (k < D ? force : torque) += value * value;
      }
      most = std::max({most, force, torque});
    }
    return std::sqrt(most);
  }

 private:
  /// Largest rotation of nearly round particles in one step, if their surface stays within its
  /// bound.
  static constexpr double WIDE = 1.0;

  std::vector<char> turning;

  double component(const Displacement &at, std::size_t i, int k) const
  {
    const std::int64_t c = coordinates.column[BLOCK * i + k];
    return c < 0 ? 0.0 : at.x[c];
  }

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
