#include "packing/rattlers.hpp"

#include "bindings/arrays.hpp"

namespace jamshape {

namespace {

nb::object find_rattlers(std::size_t n_particles, int dimension, const Array2<std::int64_t> &pairs,
                         const Array2<double> &normals, const Array2<bool> &flat)
{
  const std::size_t n_edges = pairs.shape(0);
  require(pairs.shape(1) == 2 && normals.shape(1) == 3 && flat.shape(1) == 2,
          "contacts need pairs (M, 2), normals (M, 3) and flat (M, 2).");
  require(normals.shape(0) == n_edges && flat.shape(0) == n_edges,
          "pairs, normals and flat differ in length.");
  require(dimension == 2 || dimension == 3,
          "dimension is " + std::to_string(dimension) + ", expected 2 or 3.");
  require_finite(normals, "normals");
  std::vector<ContactEdge> edges;
  for (std::size_t e = 0; e < n_edges; ++e) {
    const std::int64_t i = pairs.data()[2 * e], j = pairs.data()[2 * e + 1];
    const auto inside = [&](std::int64_t n) {
      return n >= 0 && static_cast<std::size_t>(n) < n_particles;
    };
    require(inside(i) && inside(j), "a contact names a particle that does not exist.");
    edges.push_back({static_cast<std::size_t>(i), static_cast<std::size_t>(j),
                     read_vec<3>(normals.data() + 3 * e), flat.data()[2 * e],
                     flat.data()[2 * e + 1]});
  }
  const std::vector<char> removed = RattlerSearch(n_particles, edges, dimension).find();
  NewArray<bool> is_rattler({n_particles});
  for (std::size_t n = 0; n < n_particles; ++n) is_rattler[n] = removed[n] != 0;
  return is_rattler.release();
}

}  // namespace

void export_rattlers(nb::module_ &m)
{
  using namespace nb::literals;
  m.def(
      "find_rattlers", &find_rattlers, "n_particles"_a, "dimension"_a, "pairs"_a, "normals"_a,
      "flat"_a,
      "Rattler flags (N,) of a contact network: pairs (M, 2) of indices, normals (M, 3) into the\n"
      "first, flat (M, 2) whether the contact lies on a face of each. One row per contact, or\n"
      "per bond if bonds are contacts of their own.");
}

}  // namespace jamshape
