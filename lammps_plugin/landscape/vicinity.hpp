#pragma once

#include "contact/pair_derivatives.hpp"
#include "contact/pair_sum.hpp"

#include "landscape/symmetric_factors.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <memory>
#include <vector>

namespace jamshape {

/// Poses of N particles in the plane and the edges of the box, in long double.
struct Poses {
  std::vector<long double> position;  // (N, 2)
  std::vector<long double> angle;     // (N,)
  Vec<2, long double> edges;
};

/// What coordinates are: column (N, 3) of x, y and rotation, -1 for none; rotations count as
/// lengths, and move a surface by at most the turning radius per radian.
struct Coordinates {
  std::size_t n;
  std::vector<std::int64_t> column;
  std::vector<double> radians_per_length, turning_radius;
};

/// Pairs that were near each other at some poses, and as long as no surface has come nearer by
/// `skin`.
struct NearPairs {
  std::vector<std::int64_t> particles, shift;  // (M, 2)
  Poses then;
  double skin, reach;

  PairList list() const { return {particles.size() / 2, particles.data(), shift.data()}; }
};

/// A point near the base: a displacement, then an affine strain of box and positions.
struct Displacement {
  const double *x;  // (n,) in the coordinates
  double strain;
};

/// Energy at a point and its derivatives. A pair that crosses or is unconverged, or -1, refuses it.
struct LandscapeSums {
  double energy;
  Eigen::VectorXd gradient;  // (n,) by the coordinates, positions counted where they are then
  double strain_gradient, bond_force;
  std::size_t n_bonds;
  std::int64_t crossing, unconverged;

  bool is_refused() const { return crossing >= 0 || unconverged >= 0; }
};

/// Energy of a packing in the plane and its derivatives as functions of n coordinates about a base,
/// as long as a list of pairs holds: what an integrator asks for thousands of times.
template <class Model> class Vicinity {
 public:
  using Shape = typename Model::Shape;
  using Law = typename Model::Law;

  /// Before anything else, `move_to` a base and `take` pairs.
  Vicinity(std::vector<Shape> particle_shapes, Coordinates names, const Law &contact_law) :
      shapes(std::move(particle_shapes)), coordinates(std::move(names)), law(contact_law)
  {
  }

  std::size_t n() const { return coordinates.n; }
  std::size_t n_particles() const { return shapes.size(); }
  bool has_base() const { return base.position.size() == 2 * shapes.size(); }
  bool has_pairs() const { return !from_then.empty(); }

  /// From where coordinates count.
  void move_to(const Poses &poses)
  {
    base = poses;
    if (has_pairs()) measure_from_pairs();
  }

  /// Pairs that hold from now on.
  void take(NearPairs near)
  {
    pairs = std::move(near);
    measure_from_pairs();
    sort_rows();
    hessian = pattern();
    factors.clear();
  }

  /// Whether two surfaces may have come closer by the skin, or there are no pairs yet.
  bool is_beyond(const Displacement &at) const
  {
    if (!has_pairs()) return true;
    double most = 0.0, scaled = 0.0;
    const double stretch = 1.0 + at.strain;
    for (int k = 0; k < 2; ++k) {
      const double scale = stretch * static_cast<double>(base.edges[k] / pairs.then.edges[k]);
      scaled = std::max(scaled, std::abs(scale - 1.0));
    }
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const double x = stretch * (from_then[3 * i] + component(at, i, 0));
      const double y = stretch * (from_then[3 * i + 1] + component(at, i, 1));
      double turned = std::abs(from_then[3 * i + 2] + turn(at, i));
      if (turned > M_PI) turned = std::abs(std::remainder(turned, 2.0 * M_PI));
      most = std::max(most, std::sqrt(x * x + y * y) + coordinates.turning_radius[i] * turned);
    }
    return 2.0 * most >= pairs.skin - scaled * pairs.reach;
  }

  LandscapeSums evaluate(const Displacement &at, bool extended) const
  {
    return extended ? sums<long double>(at) : sums<double>(at);
  }

  /// (n,) by how much a coordinate moves its particle: 1 + strain, and 1 for rotations.
  Eigen::VectorXd stretch(double strain) const
  {
    Eigen::VectorXd found = Eigen::VectorXd::Constant(n(), 1.0 + strain);
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const std::int64_t c = coordinates.column[3 * i + 2];
      if (c >= 0) found[c] = 1.0;
    }
    return found;
  }

  /// At most 1: the part of a step (n,) that moves no particle too far and turns none too wide.
  double part_within(const double *step, double longest, double widest) const
  {
    const Displacement by{step, 0.0};
    double excess = 1.0;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const double x = component(by, i, 0), y = component(by, i, 1);
      excess =
          std::max({excess, std::sqrt(x * x + y * y) / longest, std::abs(turn(by, i)) / widest});
    }
    return 1.0 / excess;
  }

  /// Factors of the Hessian by the base's coordinates plus a diagonal (n,), with a shift, smallest
  /// by powers of ten, that leaves no negative pivot; nothing of what is not finite. Spines that
  /// cross add nothing.
  std::shared_ptr<SymmetricFactors> factorise(const Displacement &at, const double *diagonal)
  {
    fill_hessian(at);
    double first = 0.0, smallest = INFINITY;
    for (std::size_t c = 0; c < n(); ++c) {
      on_diagonal(c) += diagonal[c];
      first = std::max(first, LEAST_SHIFT * std::abs(on_diagonal(c)));
      smallest = std::min(smallest, diagonal[c]);
    }
    first = std::max(first, smallest);
    const std::shared_ptr<SymmetricFactors> found = spare();
    for (double shift = 0.0; std::isfinite(shift);) {
      if (found->factorise(hessian) && found->n_negative() == 0) return found;
      const double next = std::max(10.0 * shift, first);
      for (std::size_t c = 0; c < n(); ++c) on_diagonal(c) += next - shift;
      shift = next;
    }
    return nullptr;
  }

 private:
  static constexpr int VARIABLES = PAIR_VARIABLES<2>, BLOCK = 6;

  /// Doubles and their small rests.
  struct SplitArrays {
    std::vector<double> position[2], angle[2];
    double edges[2][2];

    SplitPoses view() const
    {
      return {{position[0].data(), position[1].data()},
              {angle[0].data(), angle[1].data()},
              {edges[0], edges[1]}};
    }
  };

  std::vector<Shape> shapes;
  Coordinates coordinates;
  NearPairs pairs;
  Law law;
  Poses base;
  std::vector<double> from_then;
  Order row;              // (n,) of each coordinate in `hessian`
  std::vector<int> slot;  // (M, BLOCK, BLOCK) in the values of `hessian`, -1 for none
  UpperTriangle hessian;
  std::vector<std::shared_ptr<SymmetricFactors>> factors;

  double &on_diagonal(std::size_t c)
  {
    return hessian.valuePtr()[hessian.outerIndexPtr()[row.indices()[c] + 1] - 1];
  }

  template <class S> LandscapeSums sums(const Displacement &at) const
  {
    const SplitArrays poses = displaced(at);
    const PairSums<2, S> sums =
        sum_over(PosedPairs<Model, 2, S>(shapes, poses.view(), pairs.list(), law), shapes.size());
    return {static_cast<double>(sums.energy),
            gradient(sums),
            static_cast<double>(-sums.virial[0] - sums.virial[3]),
            static_cast<double>(sums.bond_force),
            sums.n_bonds,
            sums.crossing,
            sums.unconverged};
  }

  template <class S> Eigen::VectorXd gradient(const PairSums<2, S> &sums) const
  {
    Eigen::VectorXd found = Eigen::VectorXd::Zero(n());
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const S turning = sums.torque[i][0] * coordinates.radians_per_length[i];
      const S by[3] = {sums.force[i][0], sums.force[i][1], turning};
      for (int k = 0; k < 3; ++k) {
        const std::int64_t c = coordinates.column[3 * i + k];
        if (c >= 0) found[c] = static_cast<double>(-by[k]);
      }
    }
    return found;
  }

  void measure_from_pairs()
  {
    from_then.resize(3 * shapes.size());
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      for (int k = 0; k < 2; ++k) {
        const long double scale = base.edges[k] / pairs.then.edges[k];
        from_then[3 * i + k] =
            static_cast<double>(base.position[2 * i + k] - scale * pairs.then.position[2 * i + k]);
      }
      from_then[3 * i + 2] = static_cast<double>(base.angle[i] - pairs.then.angle[i]);
    }
  }

  double component(const Displacement &at, std::size_t i, int k) const
  {
    const std::int64_t c = coordinates.column[3 * i + k];
    return c < 0 ? 0.0 : at.x[c];
  }

  double turn(const Displacement &at, std::size_t i) const
  {
    return component(at, i, 2) * coordinates.radians_per_length[i];
  }

  SplitArrays displaced(const Displacement &at) const
  {
    SplitArrays split;
    const std::size_t N = shapes.size();
    for (int part = 0; part < 2; ++part) {
      split.position[part].resize(2 * N);
      split.angle[part].resize(N);
    }
    const auto put = [](long double value, double &whole, double &rest) {
      whole = static_cast<double>(value);
      rest = static_cast<double>(value - whole);
    };
    const long double stretch = 1.0L + at.strain;
    for (std::size_t i = 0; i < N; ++i) {
      for (int k = 0; k < 2; ++k) {
        put(stretch * (base.position[2 * i + k] + component(at, i, k)),
            split.position[0][2 * i + k], split.position[1][2 * i + k]);
      }
      put(base.angle[i] + turn(at, i), split.angle[0][i], split.angle[1][i]);
    }
    for (int k = 0; k < 2; ++k) put(stretch * base.edges[k], split.edges[0][k], split.edges[1][k]);
    return split;
  }

  /// Particle by particle, in an order in which factors stay sparse.
  void sort_rows()
  {
    const std::size_t N = shapes.size();
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t i = 0; i < N; ++i) entries.emplace_back(i, i, 1.0);
    for (std::size_t p = 0; p < pairs.list().n; ++p) {
      const auto [low, high] = std::minmax(pairs.particles[2 * p], pairs.particles[2 * p + 1]);
      entries.emplace_back(low, high, 1.0);
    }
    UpperTriangle neighbours(N, N);
    neighbours.setFromTriplets(entries.begin(), entries.end());
    const Order particles = sparse_order(neighbours).inverse();
    row.resize(n());
    int next = 0;
    for (std::size_t place = 0; place < N; ++place) {
      for (int k = 0; k < 3; ++k) {
        const std::int64_t c = coordinates.column[3 * particles.indices()[place] + k];
        if (c >= 0) row.indices()[c] = next++;
      }
    }
  }

  /// Rows of the coordinates of both particles of a pair, -1 for none: x, y, rotation of i, then of
  /// j.
  void rows_of(std::size_t p, int (&to)[BLOCK]) const
  {
    for (int side = 0; side < 2; ++side) {
      const std::int64_t i = pairs.particles[2 * p + side];
      for (int k = 0; k < 3; ++k) {
        const std::int64_t c = coordinates.column[3 * i + k];
        to[3 * side + k] = c < 0 ? -1 : row.indices()[c];
      }
    }
  }

  /// The Hessian's pattern, its whole diagonal last in each column; fills `slot`.
  UpperTriangle pattern()
  {
    const std::size_t M = pairs.list().n;
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t c = 0; c < n(); ++c) entries.emplace_back(c, c, 0.0);
    int rows[BLOCK];
    const auto each_upper = [&](std::size_t p, const auto &then) {
      rows_of(p, rows);
      for (int a = 0; a < BLOCK; ++a) {
        for (int b = 0; b < BLOCK; ++b) {
          if (0 <= rows[a] && rows[a] <= rows[b]) then(a, b);
        }
      }
    };
    for (std::size_t p = 0; p < M; ++p) {
      each_upper(p, [&](int a, int b) { entries.emplace_back(rows[a], rows[b], 0.0); });
    }
    UpperTriangle matrix(n(), n());
    matrix.setFromTriplets(entries.begin(), entries.end());
    slot.assign(M * BLOCK * BLOCK, -1);
    for (std::size_t p = 0; p < M; ++p) {
      each_upper(p, [&](int a, int b) {
        const int *const first = matrix.innerIndexPtr();
        const int *const begin = first + matrix.outerIndexPtr()[rows[b]];
        const int *const end = first + matrix.outerIndexPtr()[rows[b] + 1];
        slot[(p * BLOCK + a) * BLOCK + b] =
            static_cast<int>(std::lower_bound(begin, end, rows[a]) - first);
      });
    }
    return matrix;
  }

  void fill_hessian(const Displacement &at)
  {
    using Number = Dual<VARIABLES>;
    const SplitArrays poses = displaced(at);
    const PosedPairs<Model, 2, double> posed(shapes, poses.view(), pairs.list(), law);
    const TurnedBodies<Model, 2, double> turned(posed);
    std::fill_n(hessian.valuePtr(), hessian.nonZeros(), 0.0);
    for (std::size_t p = 0; p < posed.size(); ++p) {
      const Contact<2, Number> contact = turned.contact(p);
      if (contact.status == ContactStatus::TOUCHING) add_block(p, contact, at);
    }
  }

  void add_block(std::size_t p, const Contact<2, Dual<VARIABLES>> &contact, const Displacement &at)
  {
    SecondDerivatives<2, double> found;
    read_derivatives<2, double>(contact, found);
    double by[VARIABLES][VARIABLES];
    for (int a = 0; a < VARIABLES; ++a) {
      for (int b = 0; b < VARIABLES; ++b) {
        by[a][b] = found.curvature[a][b];
        for (int k = 0; k < contact.n_bonds; ++k) {
          by[a][b] +=
              value_of(contact.bond[k].own_stiffness) * found.gradient[k][a] * found.gradient[k][b];
        }
      }
    }
    const double s = 1.0 + at.strain;
    const double turn_i = coordinates.radians_per_length[pairs.particles[2 * p]];
    const double turn_j = coordinates.radians_per_length[pairs.particles[2 * p + 1]];
    const double scale[BLOCK] = {s, s, turn_i, -s, -s, turn_j};
    constexpr int variable[BLOCK] = {0, 1, 2, 0, 1, 3};
    const int *slots = &slot[p * BLOCK * BLOCK];
    double *const values = hessian.valuePtr();
    for (int a = 0; a < BLOCK; ++a) {
      for (int b = 0; b < BLOCK; ++b, ++slots) {
        if (*slots >= 0) values[*slots] += scale[a] * scale[b] * by[variable[a]][variable[b]];
      }
    }
  }

  /// Factors that nobody else holds: their analysis of the pattern is worth several factorisations.
  std::shared_ptr<SymmetricFactors> spare()
  {
    for (const auto &one : factors) {
      if (one.use_count() == 1) return one;
    }
    factors.push_back(std::make_shared<SymmetricFactors>(hessian, row));
    return factors.back();
  }
};

}  // namespace jamshape
