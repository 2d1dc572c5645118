#pragma once

#include "contact/pair_derivatives.hpp"

#include "landscape/block_system.hpp"
#include "landscape/coordinates.hpp"
#include "landscape/kinks.hpp"
#include "landscape/near_pairs.hpp"
#include "packing/pair_sum.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <vector>

namespace jamshape {

/// Second derivatives of the energy of pairs near a base, by the coordinates and by the strain.
template <class Model, int D> class PairHessian {
 public:
  using Moved = MovedPairs<Model, D>;
  using Start = typename Model::template Start<D>;

  PairHessian(const BasePoses<D> &near_base, const NearPairs<D> &near_pairs) :
      near(near_base), pairs(near_pairs)
  {
    std::fill_n(strained.c, D, 1.0);
  }

  /// Differentiates at a point, with blocks for such fill-in. `used` returns which pairs (M,) these
  /// are for; contacts start from `starts` (M,), if there are any, in the threads of `by`.
  template <class Used>
  void differentiate(const Moved &posed, const Displacement &at, Fill with, const Start *starts,
                     Team *by, const Used &used)
  {
    std::unique_ptr<BlockSystem> &own = systems[with == Fill::COMPLETE];
    if (!own) own = block_system(used(), with);
    present = own.get();
    find_axes(at);
    if (add_pairs(posed, at.strain, starts, by)) return;
    own = block_system(used(), with);
    present = own.get();
    add_pairs(posed, at.strain, starts, by);
  }

  /// Forgets the blocks, which belong to the pairs.
  void forget()
  {
    for (const Fill fill : {Fill::NONE, Fill::COMPLETE}) forget(fill);
  }
  /// Forgets those for such fill-in.
  void forget(Fill fill)
  {
    present = nullptr;
    systems[fill == Fill::COMPLETE] = nullptr;
  }

  BlockSystem &blocks() { return *present; }
  const BlockSystem &blocks() const { return *present; }

  /// Second derivatives are those of the mixtures on these kinks from now on.
  void hold_kinks(const std::vector<Kink> &kinks) { held_kinks = kinks; }
  /// From now on those by the strain are about the strain of these axes (D,), 0 or 1 each.
  void strain_along(const std::vector<double> &axes_of_strain)
  {
    std::copy_n(axes_of_strain.begin(), D, strained.c);
  }
  /// (n,) derivative of the gradient with respect to the strain.
  const Eigen::VectorXd &coupling() const { return pulled; }
  /// Second derivative of the energy with respect to the strain.
  double strain_curvature() const { return pulled_back; }

 private:
  static constexpr int BLOCK = BasePoses<D>::BLOCK;
  static constexpr int VARIABLES = PAIR_VARIABLES<D>;
  static constexpr bool HAS_KINKS = Model::template HAS_KINKS<D>;
  using TurnMatrix = Eigen::Matrix<double, ROTATIONS<D>, ROTATIONS<D>>;
  using DualContact = ContactOf<Model, D, Dual<VARIABLES>>;
  using PairMatrix = Eigen::Matrix<double, VARIABLES, VARIABLES>;
  using PairRow = Eigen::Matrix<double, VARIABLES, 1>;

  /// The point of contact of two faces moves without limit as they rotate: no stiffness is counted
  /// above this multiple of the bond's.
  static constexpr double STIFFEST = 1e4;

  /// A touching pair, and second derivatives with respect to its variables; of those of particles
  /// that no contact can rotate only r is set.
  struct Curved {
    std::size_t p;
    Vec<D> r;
    bool turns;
    PairMatrix by;
  };

  const BasePoses<D> &near;
  const NearPairs<D> &pairs;
  std::unique_ptr<BlockSystem> systems[2];  // without fill-in and with it, once they are used
  BlockSystem *present = nullptr;           // the one last used
  std::vector<TurnMatrix> axes;  // (N,) of rotations in space by coordinates; empty if equal
  std::vector<Kink> held_kinks;
  Vec<D> strained;
  Eigen::VectorXd pulled;  // by the strain of these axes
  double pulled_back = 0.0;
  std::vector<std::vector<Curved>> curved;  // for each thread, empty between uses

  /// The block system of these pairs, with blocks of displacements alone if nothing can rotate.
  std::unique_ptr<BlockSystem> block_system(const std::vector<char> &used, Fill with) const
  {
    const bool is_complete = with == Fill::COMPLETE;
    const BlockPlan plan{near.coordinates.first,
                         pairs.particles,
                         used,
                         BLOCK,
                         with,
                         is_complete ? near.in_box() : std::vector<double>{}};
    if (near.any_turns()) return std::make_unique<BlockSystemOf<BLOCK, D>>(plan);
    return std::make_unique<BlockSystemOf<D, D>>(plan);
  }

  /// The derivatives of rotations in space by the coordinates at a point, in radians, if these are
  /// about body axes: there also the motion to the point counts.
  void find_axes(const Displacement &at)
  {
    if constexpr (D == 3) {
      if (!near.along_bodies) return;
      axes.assign(near.n_particles(), TurnMatrix::Identity());
      for (std::size_t i = 0; i < near.n_particles(); ++i) {
        const Vec<3> back = -1.0 * near.turn(at, i);
        for (int b = 0; b < 3 && near.turns(i); ++b) {
          const Vec<3> axis = torque_on_rotation_vector(back, near.axis_of(i, b));
          std::copy_n(axis.c, 3, axes[i].col(b).data());
        }
      }
    }
  }

  /// Second derivatives with respect to the variables of a touching pair; those of rotating faces
  /// in contact are bounded.
  PairMatrix by_variables(std::size_t p, const DualContact &dual) const
  {
    SecondDerivatives<D, double, Model::MOST_BONDS> found;
    read_derivatives(dual, found);
    const PairMatrix turning = Eigen::Map<const PairMatrix>(&found.curvature[0][0]);
    PairMatrix by = PairMatrix::Zero();
    double stiffest = 0.0;
    for (int b = 0; b < dual.n_bonds; ++b) {
      const double own = value_of(dual.bond[b].own_stiffness);
      const Eigen::Map<const PairRow> along(found.gradient[b]);
      by += own * along * along.transpose();
      stiffest += STIFFEST * own;
    }
    const PairRow part = per_length(p);
    const double largest = (part.asDiagonal() * turning * part.asDiagonal()).cwiseAbs().maxCoeff();
    if (!turning.allFinite()) return by;
    return by + std::min(1.0, stiffest / largest) * turning;
  }

  /// Second derivatives of the mixture on a kink, and its stiffness across.
  PairMatrix by_variables_on(const Kink &kink, std::size_t p, const DualContact &from,
                             const DualContact &to) const
  {
    PairMatrix by = PairMatrix::Zero();
    PairRow jump = PairRow::Zero();
    const auto add = [&](const DualContact &piece, double weight, double sign) {
      if (piece.status != ContactStatus::TOUCHING) return;
      by += weight * by_variables(p, piece);
      constexpr int M = ROTATIONS<D>;
      for (int k = 0; k < D; ++k) jump[k] -= sign * value_of(piece.force[k]);
      for (int k = 0; k < M; ++k) jump[D + k] -= sign * value_of(piece.torque_i[k]);
      for (int k = 0; k < M; ++k) jump[D + M + k] -= sign * value_of(piece.torque_j[k]);
    };
    add(from, 1.0 - kink.weight, -1.0);
    add(to, kink.weight, 1.0);
    return by + kink.stiffness * jump * jump.transpose();
  }

  /// Factors that convert a pair's variables into lengths at its surfaces.
  PairRow per_length(std::size_t p) const
  {
    PairRow part = PairRow::Ones();
    for (int side = 0; side < 2; ++side) {
      const double radius = near.coordinates.turning_radius[pairs.particles[2 * p + side]];
      const int first = side == 0 ? FIRST_OF_I<D> : FIRST_OF_J<D>;
      part.template segment<ROTATIONS<D>>(first).setConstant(radius > 0.0 ? 1.0 / radius : 0.0);
    }
    return part;
  }

  /// The variable of a pair for a coordinate of its first or second particle.
  static constexpr int variable(int side, int k)
  {
    return k < D || side == 0 ? k : k + ROTATIONS<D>;
  }

  template <class Then>
  void each_curved(const Moved &posed, const std::optional<TurnedBodies<Moved>> &turned_bodies,
                   const Range &part, const Start *starts, const Then &then) const
  {
    std::map<std::size_t, const Kink *> held_on;
    if constexpr (HAS_KINKS) {
      const auto numbers = numbers_of(pairs, held_kinks);
      for (std::size_t k = 0; k < numbers.size(); ++k) {
        if (numbers[k]) held_on[*numbers[k]] = &held_kinks[k];
      }
    }
    for (std::size_t p = part.first; p < part.last; ++p) {
      const Vec<D> r = posed.separation(p);
      Start start = starts ? starts[p] : Start{};
      if (!posed.may_touch(p, r)) continue;
      Curved found{p, r, posed.pair_turns(p), {}};
      if (found.turns) {
        const DualContact dual = turned_bodies->contact(p, r, &start);
        if (dual.status != ContactStatus::TOUCHING) continue;
        const auto held = held_on.find(p);
        if (held == held_on.end()) {
          found.by = by_variables(p, dual);
        } else if constexpr (HAS_KINKS) {
          const Kink &kink = *held->second;
          found.by = by_variables_on(kink, p, turned_bodies->contact_on(kink.from, p, r),
                                     turned_bodies->contact_on(kink.to, p, r));
        }
      } else {
        const ContactOf<Model, D> contact = contact_in(posed, p, r, &start);
        if (contact.status != ContactStatus::TOUCHING) continue;
        found.by.template topLeftCorner<D, D>() = Eigen::Map<const Eigen::Matrix<double, D, D>>(
            &central_hessian<Model>(contact, r)[0][0]);
      }
      then(found);
    }
  }

  /// Adds a pair of particles that no contact can rotate.
  void add_round(const Curved &pair, double stretch, const Vec<D> &apart)
  {
    const Eigen::Matrix<double, D, D> by =
        stretch * stretch * pair.by.template topLeftCorner<D, D>();
    present->add_shifts(pair.p, by.data());
    const Eigen::Map<const Eigen::Matrix<double, D, 1>> along(apart.c);
    add_pull(pair.p, 0, by * along / stretch);
    add_pull(pair.p, 1, -by * along / stretch);
  }

  /// Adds the force by which the strain pulls the first or second particle of a pair.
  template <class Pull> void add_pull(std::size_t p, int side, const Pull &pull)
  {
    const std::size_t i = pairs.particles[2 * p + side];
    const int n = std::min<int>(Pull::RowsAtCompileTime, near.coordinates.count(i));
    for (int k = 0; k < n; ++k) pulled[near.coordinates.first[i] + k] += pull[k];
  }

  /// Sets the Hessian and what the strain does to the sums over all pairs. False if its blocks lack
  /// one.
  bool add_pairs(const Moved &posed, double strain, const Start *starts, Team *by)
  {
    present->clear();
    pulled = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(near.coordinates.n()));
    pulled_back = 0.0;
    std::optional<TurnedBodies<Moved>> turned_bodies;
    if (near.any_turns()) turned_bodies.emplace(posed);
    bool has_all = true;
    const auto add = [&](const Curved &pair) {
      if (present->couples(pair.p)) {
        add_pair(pair, 1.0 + strain);
      } else {
        has_all = false;
      }
    };
    curved.resize(parts_of(by));
    in_parts(by, posed.size(), [&](std::size_t k, const Range &part) {
      each_curved(posed, turned_bodies, part, starts, [&](const Curved &pair) {
        if (by == nullptr) {
          add(pair);
        } else {
          curved[k].push_back(pair);
        }
      });
    });
    for (auto &part : curved) {
      for (const Curved &pair : part) add(pair);
      part.clear();
    }
    return has_all;
  }

  void add_pair(const Curved &pair, double stretch)
  {
    const auto &[p, r, turns, by] = pair;
    // The affine strain displaces i relative to j in proportion to r.
    Vec<D> apart;
    for (int d = 0; d < D; ++d) apart[d] = strained[d] * r[d];
    for (int a = 0; a < D; ++a) {
      for (int b = 0; b < D; ++b) pulled_back += apart[a] * by(a, b) * apart[b];
    }
    if (!turns) return add_round(pair, stretch, apart);
    double scale[2][BLOCK];
    for (int side = 0; side < 2; ++side) {
      const std::size_t particle = pairs.particles[2 * p + side];
      for (int k = 0; k < BLOCK; ++k) {
        scale[side][k] = k >= D ? near.coordinates.radians_per_length[particle]
                                : (side == 0 ? stretch : -stretch);
      }
    }
    Eigen::Matrix<double, 2 * BLOCK, 2 * BLOCK> scaled;
    for (int b = 0; b < 2 * BLOCK; ++b) {
      for (int a = 0; a < 2 * BLOCK; ++a) {
        scaled(a, b) = scale[a / BLOCK][a % BLOCK] * scale[b / BLOCK][b % BLOCK] *
                       by(variable(a / BLOCK, a % BLOCK), variable(b / BLOCK, b % BLOCK));
      }
    }
    Eigen::Matrix<double, BLOCK, 1> pull[2];
    for (int side = 0; side < 2; ++side) {
      for (int k = 0; k < BLOCK; ++k) {
        double along = 0.0;
        for (int d = 0; d < D; ++d) along += by(variable(side, k), d) * apart[d];
        pull[side][k] = scale[side][k] * along;
      }
      if (axes.empty()) continue;
      const TurnMatrix &to = axes[pairs.particles[2 * p + side]];
      constexpr int TURN = ROTATIONS<D>;
      const int first = BLOCK * side + D;
      pull[side].template tail<TURN>() = (to.transpose() * pull[side].template tail<TURN>()).eval();
      scaled.template middleRows<TURN>(first) =
          (to.transpose() * scaled.template middleRows<TURN>(first)).eval();
      scaled.template middleCols<TURN>(first) =
          (scaled.template middleCols<TURN>(first) * to).eval();
    }
    present->add(p, scaled.data());
    for (int side = 0; side < 2; ++side) add_pull(p, side, pull[side]);
  }
};

}  // namespace jamshape
