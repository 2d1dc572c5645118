#pragma once

#include "contact/pair_derivatives.hpp"

#include "bindings/arrays.hpp"
#include "packing/pair_sum.hpp"

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

namespace jamshape {

/// Throws unless pairs (M, 2) and shift (M, D) are of N particles.
inline void require_pairs(const Array2<std::int64_t> &pairs, const Array2<std::int64_t> &shift,
                          std::size_t D, std::size_t N)
{
  require(pairs.shape(1) == 2 && shift.shape(1) == D && shift.shape(0) == pairs.shape(0),
          "pairs and shift have no shapes (M, 2) and (M, D).");
  const std::int64_t *const first = pairs.data(), *const last = first + pairs.size();
  require(std::all_of(first, last,
                      [&](std::int64_t i) { return i >= 0 && static_cast<std::size_t>(i) < N; }),
          "a pair names a particle that does not exist.");
}

/// From diameters (N, 3) and, of shapes that have them, exponents (N,).
template <class Model>
std::vector<typename Model::Shape> shapes_of(const Array2<double> &diameters,
                                             const Array1<double> *exponent)
{
  const std::size_t N = diameters.shape(0);
  require(diameters.shape(1) == 3, "diameters have no shape (N, 3).");
  require(exponent == nullptr || exponent->shape(0) == N, "exponent has no shape (N,).");
  std::vector<typename Model::Shape> result;
  result.reserve(N);
  for (std::size_t i = 0; i < N; ++i) {
    const double p = exponent == nullptr ? 1.0 : exponent->data()[i];
    const auto shape = Model::shape_from(0.5 * read_vec<3>(diameters.data() + 3 * i), p);
    require(shape.has_value(),
            "particle " + std::to_string(i) + " is no such shape: " + Model::SHAPE_RULE + ".");
    result.push_back(*shape);
  }
  return result;
}

/// Arguments of the functions over all pairs of a packing, as they come from Python.
struct PackingArrays {
  const Array2<double> &diameters;           // (N, 3)
  const Array3<double> &position;            // (2, N, D)
  const Array3<double> &orientation;         // (2, N, 1) or (2, N, 4)
  const Array2<double> &edges;               // (2, D)
  const Array2<std::int64_t> &pairs;         // (M, 2)
  const Array2<std::int64_t> &shift;         // (M, D)
  const Array1<double> *exponent = nullptr;  // (N,), of shapes that have one

  int dimension() const { return static_cast<int>(edges.shape(1)); }
  std::size_t n() const { return diameters.shape(0); }

  void check() const
  {
    const std::size_t D = edges.shape(1);
    require(edges.shape(0) == 2 && (D == 2 || D == 3), "edges have no shape (2, D).");
    require(position.shape(0) == 2 && position.shape(1) == n() && position.shape(2) == D,
            "position has no shape (2, N, D).");
    require(orientation.shape(0) == 2 && orientation.shape(1) == n() &&
                orientation.shape(2) == (D == 2 ? 1 : 4),
            "orientation has no shape (2, N, 1) in 2D or (2, N, 4) in 3D.");
    require_pairs(pairs, shift, D, n());
  }

  SplitPoses poses() const
  {
    const auto parts = [](const double *data, std::size_t size, const double *(&to)[2]) {
      to[0] = data;
      to[1] = data + size / 2;
    };
    SplitPoses split;
    parts(position.data(), position.size(), split.position);
    parts(orientation.data(), orientation.size(), split.orientation);
    parts(edges.data(), edges.size(), split.edges);
    return split;
  }

  PairList list() const { return {pairs.shape(0), pairs.data(), shift.data()}; }
};

template <class Model, int D, class S>
nb::dict sums_in(const PackingArrays &arrays, const typename Model::Law &law)
{
  const auto shapes = shapes_of<Model>(arrays.diameters, arrays.exponent);
  const auto sums =
      sum_over(PosedPairs<Model, D, S>(shapes, arrays.poses(), arrays.list(), law), shapes.size());
  NewArray<double> force({shapes.size(), D}), torque({shapes.size(), ROTATIONS<D>});
  for (std::size_t n = 0; n < shapes.size(); ++n) {
    write_vec(sums.force[n], force.row(n));
    write_vec(sums.torque[n], torque.row(n));
  }
  NewArray<double> virial({D, D});
  write_vec(sums.virial, virial.row(0));
  nb::dict result;
  result["energy"] = static_cast<double>(sums.energy);
  result["force"] = force.release();
  result["torque"] = torque.release();
  result["virial"] = virial.release();
  result["bond_force"] = static_cast<double>(sums.bond_force);
  result["n_bonds"] = sums.n_bonds;
  result["error"] = sums.error;
  result["crossing"] = sums.crossing;
  result["unconverged"] = sums.unconverged;
  return result;
}

template <class Model, int D, class S>
nb::dict derivatives_in(const PackingArrays &arrays, const typename Model::Law &law)
{
  constexpr int N = PAIR_VARIABLES<D>;
  const auto shapes = shapes_of<Model>(arrays.diameters, arrays.exponent);
  const PosedPairs<Model, D, S> pairs(shapes, arrays.poses(), arrays.list(), law);
  std::vector<std::size_t> touching;
  std::vector<ContactDerivatives<D, S>> found;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    if (pairs.contact(p, pairs.separation(p)).status != ContactStatus::TOUCHING) continue;
    touching.push_back(p);
    found.push_back(derivatives_at(pairs.at(p)));
  }
  const std::size_t n = found.size();
  NewArray<std::int64_t> pair({n});
  NewArray<int> n_bonds({n}), kind({n});
  NewArray<double> energy({n}), separation({n, D}), force({n, D}), stiffness({n, 2});
  NewArray<bool> on_side({n, 2, 2});
  NewArray<double> distance({n, 2}), bond_force({n, 2}), gradient({n, 2, N}), curvature({n, N, N});
  for (std::size_t c = 0; c < n; ++c) {
    const Contact<D, S> &contact = found[c].contact;
    pair[c] = static_cast<std::int64_t>(touching[c]);
    n_bonds[c] = contact.n_bonds;
    kind[c] = static_cast<int>(contact.kind);
    energy[c] = static_cast<double>(contact.energy);
    write_vec(pairs.at(touching[c]).r, separation.row(c));
    write_vec(contact.force, force.row(c));
    for (int b = 0; b < contact.n_bonds; ++b) {
      stiffness.row(c)[b] = static_cast<double>(contact.bond[b].own_stiffness);
      distance.row(c)[b] = static_cast<double>(contact.bond[b].distance);
      on_side.row(c)[2 * b] = contact.bond[b].on_side_i;
      on_side.row(c)[2 * b + 1] = contact.bond[b].on_side_j;
      bond_force.row(c)[b] = static_cast<double>(norm(contact.bond[b].force));
      for (int k = 0; k < N; ++k) {
        gradient.row(c)[b * N + k] = static_cast<double>(found[c].gradient[b][k]);
      }
    }
    for (int k = 0; k < N * N; ++k) {
      curvature.row(c)[k] = static_cast<double>(found[c].curvature[k / N][k % N]);
    }
  }
  nb::dict result;
  result["pair"] = pair.release();
  result["n_bonds"] = n_bonds.release();
  result["kind"] = kind.release();
  result["energy"] = energy.release();
  result["separation"] = separation.release();
  result["force"] = force.release();
  result["stiffness"] = stiffness.release();
  result["distance"] = distance.release();
  result["bond_force"] = bond_force.release();
  result["on_side"] = on_side.release();
  result["gradient"] = gradient.release();
  result["curvature"] = curvature.release();
  return result;
}

template <class Model>
nb::dict pair_sums(const PackingArrays &arrays, const typename Model::Law &law, bool extended)
{
  arrays.check();
  if (arrays.dimension() == 2) {
    return extended ? sums_in<Model, 2, long double>(arrays, law)
                    : sums_in<Model, 2, double>(arrays, law);
  }
  return extended ? sums_in<Model, 3, long double>(arrays, law)
                  : sums_in<Model, 3, double>(arrays, law);
}

template <class Model>
nb::dict pair_derivatives(const PackingArrays &arrays, const typename Model::Law &law,
                          bool extended)
{
  arrays.check();
  if (arrays.dimension() == 2) {
    return extended ? derivatives_in<Model, 2, long double>(arrays, law)
                    : derivatives_in<Model, 2, double>(arrays, law);
  }
  return extended ? derivatives_in<Model, 3, long double>(arrays, law)
                  : derivatives_in<Model, 3, double>(arrays, law);
}

}  // namespace jamshape
