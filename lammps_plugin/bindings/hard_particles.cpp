#include "packing/hard_particles.hpp"

#include "contact/superellipsoid/superellipsoid.hpp"

#include "bindings/arrays.hpp"

#include <utility>

namespace jamshape {

namespace {

/// Arguments as they come from Python.
struct HardArrays {
  const Array2<double> &diameters;    // (N, 3)
  const Array1<double> &exponent;     // (N,)
  const Array2<double> &position;     // (N, D)
  const Array2<double> &orientation;  // (N, 1) or (N, 4)
  const Array1<double> &edges;        // (D,)

  std::size_t n() const { return diameters.shape(0); }

  void check() const
  {
    const std::size_t D = edges.shape(0);
    require(D == 2 || D == 3, "edges have no shape (2,) or (3,).");
    require(diameters.shape(1) == 3 && exponent.shape(0) == n(),
            "diameters and exponent have no shapes (N, 3) and (N,).");
    require(position.shape(0) == n() && position.shape(1) == D, "position has no shape (N, D).");
    require(orientation.shape(0) == n() && orientation.shape(1) == (D == 2 ? 1 : 4),
            "orientation has no shape (N, 1) in 2D or (N, 4) in 3D.");
  }

  template <int D> Quaternion orientation_of(std::size_t i) const
  {
    const double *q = orientation.data() + i * orientation.shape(1);
    if (D == 2) return {std::cos(0.5 * q[0]), 0.0, 0.0, std::sin(0.5 * q[0])};
    return normalized(Quaternion{q[0], q[1], q[2], q[3]});
  }
};

template <int D>
nb::dict sweeps(const HardArrays &arrays, const Moves &moves, std::size_t n_sweeps,
                std::uint64_t seed)
{
  using Model = SuperellipsoidModel;
  std::vector<Model::Body<D>> bodies;
  std::vector<Quaternion> at;
  for (std::size_t i = 0; i < arrays.n(); ++i) {
    const auto shape = Model::shape_from(0.5 * read_vec<3>(arrays.diameters.data() + 3 * i),
                                         arrays.exponent.data()[i]);
    require(shape.has_value(),
            std::string("a particle is no such shape: ") + Model::SHAPE_RULE + ".");
    at.push_back(arrays.orientation_of<D>(i));
    bodies.push_back(Model::body<D>(*shape));
    Model::turn_to<D>(bodies.back(), at.back());
    bodies.back().centre = read_vec<D>(arrays.position.data() + D * i);
  }
  HardParticles<Model, D> particles(std::move(bodies), std::move(at),
                                    read_vec<D>(arrays.edges.data()), seed);
  require(particles.has_room(),
          "the box is shorter than two particles, expected at least that for Monte Carlo.");
  require(!particles.any_overlap(), "particles overlap, expected a start without overlaps.");
  Tally tally;
  for (std::size_t n = 0; n < n_sweeps; ++n) tally += particles.sweep(moves);

  NewArray<double> position({arrays.n(), D}), orientation({arrays.n(), D == 2 ? 1u : 4u});
  for (std::size_t i = 0; i < arrays.n(); ++i) {
    write_vec(particles.body(i).centre, position.row(i));
    const Quaternion &q = particles.pose(i);
    if (D == 2) {
      orientation.row(i)[0] = 2.0 * std::atan2(q.k, q.w);
    } else {
      write_vec(Vec<4>{{q.w, q.i, q.j, q.k}}, orientation.row(i));
    }
  }
  nb::dict result;
  result["position"] = position.release();
  result["orientation"] = orientation.release();
  result["tried"] = tally.tried;
  result["accepted"] = tally.accepted;
  return result;
}

nb::dict superellipsoid_sweeps(const Array2<double> &diameters, const Array1<double> &exponent,
                               const Array2<double> &position, const Array2<double> &orientation,
                               const Array1<double> &edges, double shift, double turn,
                               std::size_t n_sweeps, std::uint64_t seed)
{
  const HardArrays arrays{diameters, exponent, position, orientation, edges};
  arrays.check();
  return edges.shape(0) == 2 ? sweeps<2>(arrays, {shift, turn}, n_sweeps, seed)
                             : sweeps<3>(arrays, {shift, turn}, n_sweeps, seed);
}

}  // namespace

void export_hard_particles(nb::module_ &m)
{
  using namespace nb::literals;
  m.def(
      "superellipsoid_sweeps", &superellipsoid_sweeps, "diameters"_a, "exponent"_a, "position"_a,
      "orientation"_a, "edges"_a, "shift"_a, "turn"_a, "n_sweeps"_a, "seed"_a,
      "Monte Carlo sweeps of N hard superellipsoids in a periodic box: diameters (N, 3), exponent\n"
      "(N,), position (N, D), orientation (N, 1) angles or (N, 4) quaternions, edges (D,); moves "
      "of\n"
      "at most `shift` along each axis and `turn` radians. Returns a dict: position (in the box\n"
      "[0, edges)), orientation, and how many moves were tried and accepted.");
}

}  // namespace jamshape
