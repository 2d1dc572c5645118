#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include "packing/pair_sum.hpp"
#include "packing/split.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace jamshape {

/// Numbers of an orientation: an angle in the plane, a quaternion in space.
template <int D> inline constexpr int TURN_NUMBERS = D == 2 ? 1 : 4;

/// Poses of N particles and the box, in double-double: [0] the doubles, [1] the low parts.
struct Poses {
  using Numbers = std::vector<double>[2];
  Numbers position;     // (N, D)
  Numbers orientation;  // (N,) angles in the plane, (N, 4) quaternions in space
  Numbers cell;         // (D, D) cell vectors as columns, upper triangular

  static Split get(const Numbers &of, std::size_t k) { return {of[0][k], of[1][k]}; }
  static void set(Numbers &of, std::size_t k, const Split &to)
  {
    of[0][k] = to.value;
    of[1][k] = to.rest;
  }

  /// A view to be strained.
  SplitPoses view(double strain) const
  {
    const auto parts = [](const Numbers &of) { return std::array{of[0].data(), of[1].data()}; };
    return {parts(position), parts(orientation), parts(cell), strain};
  }

  /// Displaces a particle.
  template <int D> void shift(std::size_t i, const Vec<D> &by)
  {
    for (int k = 0; k < D; ++k) add(position, D * i + k, by[k]);
  }

  /// Rotates a particle by a rotation vector.
  template <int D> void turn(std::size_t i, const Torque<D> &by)
  {
    if constexpr (D == 2) {
      add(orientation, i, by[0]);
    } else {
      if (norm_sq(by) == 0.0) return;
      const auto at = [&](int k) { return joined(get(orientation, TURN_NUMBERS<D> * i + k)); };
      const QuaternionOf<long double> found = turned(
          QuaternionOf<long double>{at(0), at(1), at(2), at(3)}, constants_of<long double>(by));
      const long double parts[] = {found.w, found.i, found.j, found.k};
      for (int k = 0; k < TURN_NUMBERS<D>; ++k) {
        set(orientation, TURN_NUMBERS<D> * i + k, split(parts[k]));
      }
    }
  }

  /// Maps positions and cell vectors by an upper triangular matrix, rows (D, D).
  template <int D> void map(const std::vector<long double> &matrix)
  {
    for (std::size_t first = 0; first < position[0].size(); first += D) {
      map_vector<D>(position, first, 1, matrix);
    }
    for (int column = 0; column < D; ++column) map_vector<D>(cell, column, D, matrix);
  }

  /// Strains the box, and rounds all numbers to long doubles, as they are stored.
  template <int D> void settle(double strain)
  {
    const long double stretch = 1.0L + strain;
    for (Numbers *lengths : {&position, &cell}) {
      if (strain == 0.0) {
        round_to_long(*lengths);
        continue;
      }
      for (std::size_t k = 0; k < (*lengths)[0].size(); ++k) {
        set(*lengths, k, split(stretch * joined(get(*lengths, k))));
      }
    }
    if constexpr (D == 2) {  // full turns would cost digits
      constexpr long double TURN = 2.0L * 3.14159265358979323846264338327950288L;
      for (std::size_t i = 0; i < orientation[0].size(); ++i) {
        const double near = orientation[0][i];
        if (std::abs(near) <= static_cast<double>(0.5L * TURN)) continue;
        const long double whole = std::rint(near / static_cast<double>(TURN));
        const long double angle = joined(get(orientation, i));
        set(orientation, i, split(angle - TURN * whole));
      }
      round_to_long(orientation);
    }
  }

 private:
  static void add(Numbers &to, std::size_t k, double by)
  {
    const Split sum = two_sum(to[0][k], by);
    set(to, k, {sum.value, sum.rest + to[1][k]});
  }

  /// Maps the vector of every `stride`-th number from `first` on.
  template <int D>
  static void map_vector(Numbers &of, std::size_t first, std::size_t stride,
                         const std::vector<long double> &matrix)
  {
    for (int k = 0; k < D; ++k) {  // later components are still unmodified
      long double sum = 0.0L;
      for (int m = k; m < D; ++m) sum += matrix[D * k + m] * joined(get(of, first + stride * m));
      set(of, first + stride * k, split(sum));
    }
  }

  static void round_to_long(Numbers &numbers)
  {
    double *const value = numbers[0].data(), *const rest = numbers[1].data();
    for (std::size_t k = 0; k < numbers[0].size(); ++k) {
      const Split rounded = rounded_to_long({value[k], rest[k]});
      value[k] = rounded.value;
      rest[k] = rounded.rest;
    }
  }
};

}  // namespace jamshape
