#include "contact/shapes.hpp"

#include "bindings/shape.hpp"
#include "packing/hard_particles.hpp"
#include "packing/orientation.hpp"

#include <utility>

namespace jamshape {

namespace {

/// Poses as Python passes them.
struct HardPoses {
  const Array2<double> &position;     // (N, D)
  const Array2<double> &orientation;  // (N, 1) or (N, 4)
  const Array1<double> &edges;        // (D,)

  void check(std::size_t N, std::size_t D) const
  {
    require(edges.shape(0) == D, "edges do not have the shape (D,).");
    require(position.shape(0) == N && position.shape(1) == D,
            "position does not have the shape (N, D).");
    require(orientation.shape(0) == N && orientation.shape(1) == (D == 2 ? 1 : 4),
            "orientation does not have the shape (N, 1) in 2D or (N, 4) in 3D.");
    require_finite(position, "position");
    require_orientations(orientation.data(), N, D);
    require_edges(edges.data(), D);
  }
};

template <class Model, int D>
HardParticles<Model, D> placed(const ShapeOf<Model> &of, const HardPoses &poses, std::uint64_t seed)
{
  poses.check(of.n(), D);
  std::vector<Vec<D>> centres;
  std::vector<Quaternion> orientations;
  for (std::size_t i = 0; i < of.n(); ++i) {
    centres.push_back(read_vec<D>(poses.position.data() + D * i));
    const double *const at = poses.orientation.data() + i * poses.orientation.shape(1);
    orientations.push_back(orientation_from<D>(at));
  }
  HardParticles<Model, D> particles(of.shapes(), centres, std::move(orientations),
                                    read_vec<D>(poses.edges.data()), seed);
  require(particles.has_room(),
          "the box is shorter than two particles, expected at least that for Monte Carlo.");
  require(!particles.any_overlap(), "particles overlap, expected a start without overlaps.");
  return particles;
}

/// Throws unless moves are at most as long as the shortest edge of the box.
template <int D> void require_moves(const Moves &moves, const Vec<D> &edges)
{
  const double shortest = *std::min_element(edges.c, edges.c + D);
  require(moves.shift >= 0.0 && moves.shift <= shortest,
          "shift is " + shown(moves.shift) + ", expected at most the shortest edge of the box, " +
              shown(shortest) + ".");
  require_finite(moves.turn, "turn");
}

template <class Model, int D>
nb::dict poses_of(const HardParticles<Model, D> &particles, std::size_t N)
{
  NewArray<double> position({N, D}), orientation({N, D == 2 ? 1u : 4u});
  for (std::size_t i = 0; i < N; ++i) {
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
  return result;
}

}  // namespace

void export_sweeps()
{
  using namespace nb::literals;
  Shapes::each([](auto model) {
    using Model = decltype(model);
    class_of<Model>().def(
        "sweeps",
        [](const ShapeOf<Model> &of, const Array2<double> &position,
           const Array2<double> &orientation, const Array1<double> &edges, double shift,
           double turn, std::size_t n_sweeps, std::uint64_t seed) {
          return of.in_space([&](auto D) {
            auto particles = placed<Model, D>(of, {position, orientation, edges}, seed);
            require_moves({shift, turn}, read_vec<D>(edges.data()));
            Tally tally;
            for (std::size_t n = 0; n < n_sweeps; ++n) tally += particles.sweep({shift, turn});
            nb::dict result = poses_of<Model, D>(particles, of.n());
            result["tried"] = tally.tried;
            result["accepted"] = tally.accepted;
            return result;
          });
        },
        "position"_a, "orientation"_a, "edges"_a, "shift"_a, "turn"_a, "n_sweeps"_a, "seed"_a,
        "Monte Carlo sweeps of the particles, hard, in a periodic box: position (N, D),\n"
        "orientation (N, 1) angles or (N, 4) quaternions, edges (D,); moves of at most `shift`\n"
        "along each axis and `turn` radians. Returns a dict: position (in the box [0, edges)),\n"
        "orientation, and how many moves were tried and accepted.");
  });
}

}  // namespace jamshape
