#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"
#include "contact/pair_derivatives.hpp"

#include "packing/pair_sum.hpp"
#include "packing/split.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace jamshape {

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
};

/// Pairs whose surfaces were closer than `skin` at some poses, and centres closer than `reach`.
struct NearPairs {
  std::vector<std::int64_t> particles, shift;  // (M, 2), (M, D)
  Poses then;
  double skin, reach;
  // From `then` to the base: the box's strain (D, D), upper triangular, and apart from it (N, D)
  // displacements and (N,) angles, in 3D (N, 4) quaternions.
  std::vector<double> strain{}, moved{}, turned{};

  PairList list() const { return {particles.size() / 2, particles.data(), shift.data()}; }
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
  MovedPairs(const std::vector<Shape> &particle_shapes, const NearPairs &list,
             const Laws<typename Model::Law> &contact_laws,
             std::function<InLong(std::size_t)> exact_pair) :
      Base(particle_shapes, list.list(), contact_laws), exact(std::move(exact_pair)),
      shift(particle_shapes.size()),
      orientation(particle_shapes.size(), Quaternion{1.0, 0.0, 0.0, 0.0})
  {
    const SplitPoses then = list.then.view(0.0);
    for (std::size_t p = 0; p < this->size(); ++p) {
      const double reach = this->around[first(p)] + this->around[second(p)];
      reach_sq.push_back(reach * reach);
      before.push_back(separation_of<D, long double>(then, this->pairs, p));
    }
    apart.resize(before.size());
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
        apart[p].value[k] = parts.value;
        apart[p].rest[k] = parts.rest;
      }
    }
  }

  /// Strain of the separations of moved particles.
  double strain = 0.0;

  /// Displaces a particle, apart from the box's strain.
  void displace(std::size_t n, const Vec<D> &by) { shift[n] = by; }
  void turn(std::size_t n, const Quaternion &to)
  {
    orientation[n] = to;
    Model::template turn_to<D>(this->body[n], to);
  }

  Vec<D> separation(std::size_t p) const
  {
    const auto &[value, rest] = apart[p];
    const Vec<D> small = rest + (shift[first(p)] - shift[second(p)]);
    return value + (small + strain * (value + small));  // one rounding of the size of r
  }

  bool may_touch(std::size_t p, const Vec<D> &r) const { return norm_sq(r) < reach_sq[p]; }

  InLong pair_in_long(std::size_t p) const { return exact(p); }

  auto turned(std::size_t n, int first_variable) const
  {
    return turned_body<Model, D, double>(this->shapes[n], orientation[n], first_variable);
  }

 private:
  std::function<InLong(std::size_t)> exact;
  struct Apart {
    Vec<D> value, rest;
  };
  std::vector<Vec<D, long double>> before;  // separations then
  std::vector<Apart> apart;                 // the same with the box's strain
  std::vector<double> strained_by;
  std::vector<double> reach_sq;  // squared distances at which bounding spheres touch
  std::vector<Vec<D>> shift;
  std::vector<Quaternion> orientation;
};

}  // namespace jamshape
