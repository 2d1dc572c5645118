#pragma once

#include "contact/pair_derivatives.hpp"
#include "contact/pair_sum.hpp"

#include "landscape/symmetric_factors.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace jamshape {

/// Poses of N particles in the plane and the edges of the box, in long double.
struct Poses {
  std::vector<long double> position;  // (N, 2)
  std::vector<long double> angle;     // (N,)
  Vec<2, long double> edges;
};

/// What coordinates are: column (N, 3) of x, y and rotation, -1 for none; rotations count as
/// lengths.
struct Coordinates {
  std::size_t n;
  std::vector<std::int64_t> column;
  std::vector<double> radians_per_length;
};

/// Pairs that were near each other at some poses, and as long as no surface has come nearer by
/// `skin`.
struct NearPairs {
  std::vector<std::int64_t> particles, shift;  // (M, 2)
  Poses then;
  double skin, reach;
  std::vector<double> turning_radius;

  PairList list() const { return {particles.size() / 2, particles.data(), shift.data()}; }
};

/// A point near the base: a displacement, then an affine strain of box and positions.
struct Displacement {
  const double *x;  // (n,) in the coordinates
  double strain;
};

/// Energy of a packing in the plane and its derivatives as functions of n coordinates about a base,
/// as long as a list of pairs holds: what an integrator asks for thousands of times.
template <class Model> class Vicinity {
 public:
  using Shape = typename Model::Shape;
  using Law = typename Model::Law;

  Vicinity(std::vector<Shape> particle_shapes, Coordinates names, NearPairs near,
           const Law &contact_law) :
      shapes(std::move(particle_shapes)), coordinates(std::move(names)), pairs(std::move(near)),
      law(contact_law), hessian(pattern())
  {
    move_to(pairs.then);
  }

  std::size_t n() const { return coordinates.n; }
  std::size_t n_particles() const { return shapes.size(); }

  /// From where coordinates count.
  void move_to(const Poses &poses)
  {
    base = poses;
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

  /// Whether two surfaces may have come closer by the skin.
  bool is_beyond(const Displacement &at) const
  {
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
      most = std::max(most, std::sqrt(x * x + y * y) + pairs.turning_radius[i] * turned);
    }
    return 2.0 * most >= pairs.skin - scaled * pairs.reach;
  }

  template <class S> PairSums<2, S> sums(const Displacement &at) const
  {
    const SplitArrays poses = displaced(at);
    return sum_over(PosedPairs<Model, 2, S>(shapes, poses.view(), pairs.list(), law),
                    shapes.size());
  }

  /// (n,) gradient of the energy by the coordinates, positions counted where they are then.
  template <class S> void gradient(const PairSums<2, S> &sums, double *to) const
  {
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const double *const per_length = &coordinates.radians_per_length[i];
      const S by[3] = {sums.force[i][0], sums.force[i][1], sums.torque[i][0] * *per_length};
      for (int k = 0; k < 3; ++k) {
        const std::int64_t c = coordinates.column[3 * i + k];
        if (c >= 0) to[c] = static_cast<double>(-by[k]);
      }
    }
  }

  /// Takes the Hessian by the base's coordinates, plus a diagonal (n,), for `factorised`. Spines
  /// that cross add nothing.
  void linearise(const Displacement &at, const double *diagonal)
  {
    fill_hessian(at);
    for (std::size_t c = 0; c < n(); ++c) on_diagonal(c) += diagonal[c];
  }

  /// Factors of that matrix plus a shift; nothing if it is singular.
  std::shared_ptr<SymmetricFactors> factorised(double shift)
  {
    for (std::size_t c = 0; c < n(); ++c) on_diagonal(c) += shift;
    std::shared_ptr<SymmetricFactors> found = spare();
    const bool is_regular = found->factorise(hessian);
    for (std::size_t c = 0; c < n(); ++c) on_diagonal(c) -= shift;
    return is_regular ? found : nullptr;
  }

  /// The largest diagonal element of that matrix, in magnitude.
  double largest_diagonal() const
  {
    double largest = 0.0;
    for (std::size_t c = 0; c < n(); ++c) largest = std::max(largest, std::abs(on_diagonal(c)));
    return largest;
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
  std::vector<int> slot;  // (M, BLOCK, BLOCK) in the values of `hessian`, -1 for none
  LowerTriangle hessian;
  std::vector<std::shared_ptr<SymmetricFactors>> factors;

  double &on_diagonal(std::size_t c) { return hessian.valuePtr()[hessian.outerIndexPtr()[c]]; }
  double on_diagonal(std::size_t c) const { return hessian.valuePtr()[hessian.outerIndexPtr()[c]]; }

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

  /// Columns of the coordinates of both particles of a pair: x, y, rotation of i, then of j.
  void columns_of(std::size_t p, std::int64_t (&to)[BLOCK]) const
  {
    for (int side = 0; side < 2; ++side) {
      const std::int64_t i = pairs.particles[2 * p + side];
      for (int k = 0; k < 3; ++k) to[3 * side + k] = coordinates.column[3 * i + k];
    }
  }

  /// The Hessian's pattern, its whole diagonal first in each column; fills `slot`.
  LowerTriangle pattern()
  {
    const std::size_t M = pairs.list().n;
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t c = 0; c < n(); ++c) entries.emplace_back(c, c, 0.0);
    std::int64_t column[BLOCK];
    const auto each_lower = [&](std::size_t p, const auto &then) {
      columns_of(p, column);
      for (int a = 0; a < BLOCK; ++a) {
        for (int b = 0; b < BLOCK; ++b) {
          if (column[a] >= column[b] && column[b] >= 0) then(a, b);
        }
      }
    };
    for (std::size_t p = 0; p < M; ++p) {
      each_lower(p, [&](int a, int b) { entries.emplace_back(column[a], column[b], 0.0); });
    }
    LowerTriangle matrix(n(), n());
    matrix.setFromTriplets(entries.begin(), entries.end());
    slot.assign(M * BLOCK * BLOCK, -1);
    for (std::size_t p = 0; p < M; ++p) {
      each_lower(p, [&](int a, int b) {
        const int *const rows = matrix.innerIndexPtr();
        const int *const begin = rows + matrix.outerIndexPtr()[column[b]];
        const int *const end = rows + matrix.outerIndexPtr()[column[b] + 1];
        const int *const found = std::lower_bound(begin, end, static_cast<int>(column[a]));
        slot[(p * BLOCK + a) * BLOCK + b] = static_cast<int>(found - rows);
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
    factors.push_back(std::make_shared<SymmetricFactors>(hessian));
    return factors.back();
  }
};

}  // namespace jamshape
