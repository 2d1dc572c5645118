#pragma once

#include "contact/pair_derivatives.hpp"

#include "landscape/block_factors.hpp"
#include "packing/pair_sum.hpp"

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

/// Pairs whose surfaces were closer than `skin` at some poses, and centres than `reach`.
struct NearPairs {
  std::vector<std::int64_t> particles, shift;  // (M, 2)
  Poses then;
  double skin, reach;
  std::vector<double> to_base{};  // (N, 3) x, y and angle since `then`, apart from the box's strain

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
  bool has_pairs() const { return !pairs.to_base.empty(); }
  const Poses &poses() const { return base; }

  /// From where coordinates count.
  void move_to(const Poses &poses)
  {
    base = poses;
    for (NearPairs *list : {&wide, &pairs}) {
      if (!list->to_base.empty()) measure(*list);
    }
  }

  /// To a point near the base. Whole turns are left out: they would cost digits.
  void move(const Displacement &at)
  {
    constexpr long double TURN = 2.0L * 3.14159265358979323846264338327950288L;
    Poses poses = moved(at);
    for (long double &angle : poses.angle) angle -= TURN * std::rint(angle / TURN);
    move_to(poses);
  }

  /// Pairs of a wide skin, from which those within a smaller one are chosen again and again.
  void take(NearPairs wider, double smaller_skin)
  {
    wide = std::move(wider);
    measure(wide);
    skin = smaller_skin;
    choose({std::vector<double>(n()).data(), 0.0});
  }

  /// Whether the pairs that there are hold at a point, chosen anew if need be; if not, others are
  /// to be taken before anything is asked for there.
  bool holds(const Displacement &at)
  {
    if (!has_pairs()) return false;
    if (!is_beyond(pairs, at)) return true;
    const Eigen::Map<const Eigen::VectorXd> x(at.x, static_cast<Eigen::Index>(n()));
    if (is_beyond(wide, at, skin) || !x.allFinite()) return false;
    choose(at);
    return true;
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
  std::shared_ptr<BlockFactors> factorise(const Displacement &at, const double *diagonal)
  {
    fill_hessian(at);
    double first = 0.0, smallest = INFINITY;
    each_on_diagonal([&](std::int64_t c, double &value) {
      value += diagonal[c];
      first = std::max(first, LEAST_SHIFT * std::abs(value));
      smallest = std::min(smallest, diagonal[c]);
    });
    first = std::max(first, smallest);
    const std::shared_ptr<BlockFactors> found = spare();
    for (double shift = 0.0; std::isfinite(shift);) {
      if (found->factorise(hessian)) return found;
      const double next = std::max(10.0 * shift, first);
      each_on_diagonal([&](std::int64_t, double &value) { value += next - shift; });
      shift = next;
    }
    return nullptr;
  }

 private:
  static constexpr int VARIABLES = PAIR_VARIABLES<2>;
  using DualContact = ContactOf<Model, 2, Dual<VARIABLES>>;

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
  NearPairs wide, pairs;             // `pairs` are those of `wide` that are within `skin`
  std::vector<std::int64_t> chosen;  // (M,) which of them
  double skin = 0.0;
  Law law;
  Poses base;
  std::shared_ptr<const BlockPattern> pattern;
  std::vector<int> block;  // (M,) of each pair below the diagonal of `hessian`
  BlockMatrix hessian;
  std::vector<std::shared_ptr<BlockFactors>> factors;

  /// Each coordinate with its element on the Hessian's diagonal.
  template <class Then> void each_on_diagonal(const Then &then)
  {
    for (std::size_t k = 0; k < coordinates.column.size(); ++k) {
      const std::int64_t c = coordinates.column[k];
      const int own = static_cast<int>(k % BLOCK);
      if (c >= 0) then(c, hessian.diagonal[pattern->place[k / BLOCK]](own, own));
    }
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
            of_wide(sums.crossing),
            of_wide(sums.unconverged)};
  }

  /// The number of a pair, or -1, as whoever gave the pairs knows it.
  std::int64_t of_wide(std::int64_t p) const { return p < 0 ? p : chosen[p]; }

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

  void measure(NearPairs &list) const
  {
    list.to_base.resize(3 * shapes.size());
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      for (int k = 0; k < 2; ++k) {
        const long double scale = base.edges[k] / list.then.edges[k];
        list.to_base[3 * i + k] =
            static_cast<double>(base.position[2 * i + k] - scale * list.then.position[2 * i + k]);
      }
      list.to_base[3 * i + 2] = static_cast<double>(base.angle[i] - list.then.angle[i]);
    }
  }

  /// Whether two surfaces may have come closer by the skin, or by what is left of it.
  bool is_beyond(const NearPairs &list, const Displacement &at, double kept = 0.0) const
  {
    double most = 0.0, scaled = 0.0;
    const double stretch = 1.0 + at.strain;
    for (int k = 0; k < 2; ++k) {
      const double scale = stretch * static_cast<double>(base.edges[k] / list.then.edges[k]);
      scaled = std::max(scaled, std::abs(scale - 1.0));
    }
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const double x = stretch * (list.to_base[3 * i] + component(at, i, 0));
      const double y = stretch * (list.to_base[3 * i + 1] + component(at, i, 1));
      double turned = std::abs(list.to_base[3 * i + 2] + turn(at, i));
      if (turned > M_PI) turned = std::abs(std::remainder(turned, 2.0 * M_PI));
      most = std::max(most, std::sqrt(x * x + y * y) + coordinates.turning_radius[i] * turned);
    }
    return 2.0 * most >= list.skin - kept - scaled * list.reach;
  }

  /// Those of the wide pairs that are within the smaller skin at a point.
  void choose(const Displacement &at)
  {
    pairs = {{}, {}, moved(at), skin, wide.reach - wide.skin + skin};
    chosen.clear();
    const SplitArrays poses = displaced(at);
    const PosedPairs<Model, 2, double> posed(shapes, poses.view(), wide.list(), law);
    for (std::size_t p = 0; p < posed.size(); ++p) {
      if (!posed.are_closer(p, skin)) continue;
      chosen.push_back(static_cast<std::int64_t>(p));
      for (int k = 0; k < 2; ++k) {
        pairs.particles.push_back(wide.particles[2 * p + k]);
        pairs.shift.push_back(wide.shift[2 * p + k]);
      }
    }
    measure(pairs);
    pattern = nullptr;
    factors.clear();
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

  long double moved(const Displacement &at, std::size_t i, int k) const
  {
    return (1.0L + at.strain) * (base.position[2 * i + k] + component(at, i, k));
  }

  /// Poses at a point.
  Poses moved(const Displacement &at) const
  {
    Poses poses = base;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      for (int k = 0; k < 2; ++k) poses.position[2 * i + k] = moved(at, i, k);
      poses.angle[i] += turn(at, i);
    }
    for (int k = 0; k < 2; ++k) poses.edges[k] *= 1.0L + at.strain;
    return poses;
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
    for (std::size_t i = 0; i < N; ++i) {
      for (int k = 0; k < 2; ++k) {
        put(moved(at, i, k), split.position[0][2 * i + k], split.position[1][2 * i + k]);
      }
      put(base.angle[i] + turn(at, i), split.angle[0][i], split.angle[1][i]);
    }
    for (int k = 0; k < 2; ++k) {
      put((1.0L + at.strain) * base.edges[k], split.edges[0][k], split.edges[1][k]);
    }
    return split;
  }

  void find_blocks()
  {
    pattern = std::make_shared<BlockPattern>(coordinates.column, pairs.particles);
    block.clear();
    for (std::size_t p = 0; p < pairs.list().n; ++p) {
      const int i = place(p, 0), j = place(p, 1);
      block.push_back(pattern->find(std::min(i, j), std::max(i, j)));
    }
  }

  /// Row of a pair's first or second particle in `hessian`.
  int place(std::size_t p, int side) const { return pattern->place[pairs.particles[2 * p + side]]; }

  void fill_hessian(const Displacement &at)
  {
    if (!pattern) find_blocks();
    const SplitArrays poses = displaced(at);
    const PosedPairs<Model, 2, double> posed(shapes, poses.view(), pairs.list(), law);
    const TurnedBodies<Model, 2, double> turned(posed);
    clear_hessian();
    for (std::size_t p = 0; p < posed.size(); ++p) {
      const DualContact contact = turned.contact(p);
      if (contact.status == ContactStatus::TOUCHING) add_blocks(p, contact, 1.0 + at.strain);
    }
  }

  /// Zero, with 1 for each coordinate that a particle does not have.
  void clear_hessian()
  {
    hessian.diagonal.assign(shapes.size(), Block::Zero());
    hessian.below.assign(pattern->row.size(), Block::Zero());
    for (std::size_t k = 0; k < coordinates.column.size(); ++k) {
      const int own = static_cast<int>(k % BLOCK);
      if (coordinates.column[k] < 0) hessian.diagonal[pattern->place[k / BLOCK]](own, own) = 1.0;
    }
  }

  /// Second derivatives by the variables of a pair that touches.
  static Eigen::Matrix<double, VARIABLES, VARIABLES> by_variables(const DualContact &contact)
  {
    SecondDerivatives<2, double, Model::MOST_BONDS> found{};
    read_derivatives(contact, found);
    Eigen::Matrix<double, VARIABLES, VARIABLES> by;
    for (int a = 0; a < VARIABLES; ++a) {
      for (int b = 0; b < VARIABLES; ++b) {
        by(a, b) = found.curvature[a][b];
        for (int k = 0; k < contact.n_bonds; ++k) {
          by(a, b) +=
              value_of(contact.bond[k].own_stiffness) * found.gradient[k][a] * found.gradient[k][b];
        }
      }
    }
    return by;
  }

  void add_blocks(std::size_t p, const DualContact &contact, double stretch)
  {
    const auto by = by_variables(contact);
    constexpr int variable[2][BLOCK] = {{0, 1, 2}, {0, 1, 3}};
    double scale[2][BLOCK];
    for (int side = 0; side < 2; ++side) {
      const double along = side == 0 ? stretch : -stretch;
      scale[side][0] = scale[side][1] = along;
      scale[side][2] = coordinates.radians_per_length[pairs.particles[2 * p + side]];
    }
    const auto add = [&](Block &to, int rows, int columns) {
      for (int b = 0; b < BLOCK; ++b) {
        for (int a = 0; a < BLOCK; ++a) {
          to(a, b) +=
              scale[rows][a] * scale[columns][b] * by(variable[rows][a], variable[columns][b]);
        }
      }
    };
    const int i = place(p, 0), j = place(p, 1);
    add(hessian.diagonal[i], 0, 0);
    add(hessian.diagonal[j], 1, 1);
    if (i == j) {  // a particle and its own image
      add(hessian.diagonal[i], 0, 1);
      add(hessian.diagonal[i], 1, 0);
    } else {
      add(hessian.below[block[p]], i > j ? 0 : 1, i > j ? 1 : 0);
    }
  }

  /// Factors that nobody else holds.
  std::shared_ptr<BlockFactors> spare()
  {
    for (const auto &one : factors) {
      if (one.use_count() == 1) return one;
    }
    factors.push_back(std::make_shared<BlockFactors>(pattern));
    return factors.back();
  }
};

}  // namespace jamshape
