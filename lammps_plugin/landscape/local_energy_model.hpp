#pragma once

#include "contact/pair_derivatives.hpp"

#include "landscape/block_system.hpp"
#include "landscape/near_pairs.hpp"
#include "packing/near_particles.hpp"
#include "packing/pair_sum.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <vector>

namespace jamshape {

/// Layout of the coordinates: column (N, D + rotations), -1 for none; rotations are measured as
/// lengths, and move a surface by at most the turning radius per radian.
struct Coordinates {
  std::size_t n;
  std::vector<std::int64_t> column;
  std::vector<double> radians_per_length, turning_radius;
};

/// A point near the base: a displacement, then an affine strain of box and positions.
struct Displacement {
  const double *x;  // (n,) in the coordinates
  double strain;
};

/// A pair of particles whatever list it is in: both, and the cell vectors by which the second is
/// shifted.
using PairName = std::array<std::int64_t, 5>;

/// The energy of a pair near a kink is the larger of two smooth pieces. On the kink it may be any
/// mixture of both: (1 - weight) V_from + weight V_to, in which the state stays on the kink while
/// it is held there. `hold_kinks` adds a stiffness across, along the difference of the gradients:
/// (stiffness / 2) (V_to - V_from)^2.
struct Kink {
  PairName pair;
  int from, to;
  double weight, stiffness;
  bool is_held;
};

/// A kink seen from a point: V_to - V_from there, and by these coordinates (-1 for none) the
/// gradient of that difference, and of V_from minus the energy of the pair. It exists if the pair
/// touches.
struct KinkThere {
  static constexpr int MOST = 12;
  bool exists;
  double gap;
  std::array<std::int64_t, MOST> column;
  std::array<double, MOST> jump, change;

  /// Adds a multiple of a gradient to a vector (n,).
  void add(double part, const std::array<double, MOST> &gradient, Eigen::VectorXd &to) const
  {
    for (int k = 0; k < MOST; ++k) {
      if (column[k] >= 0) to[column[k]] += part * gradient[k];
    }
  }
  /// Change of the difference by a displacement (n,).
  double across(const Eigen::VectorXd &step) const
  {
    double sum = 0.0;
    for (int k = 0; k < MOST; ++k) {
      if (column[k] >= 0) sum += jump[k] * step[column[k]];
    }
    return sum;
  }
  double jump_squared() const
  {
    double sum = 0.0;
    for (int k = 0; k < MOST; ++k) sum += column[k] >= 0 ? jump[k] * jump[k] : 0.0;
    return sum;
  }
};

/// Largest displacement and rotation of a particle in one step.
struct StepBounds {
  double longest, widest;
};

/// Energy at a point and its derivatives. Two particles, else -1, that cross or whose contact is
/// unconverged invalidate it.
struct LandscapeSums {
  double energy;
  Eigen::VectorXd gradient;  // (n,), positions taken at the strained point
  double strain_gradient, bond_force;
  std::size_t n_bonds;
  std::array<std::int64_t, 2> crossing, unconverged;
  std::vector<double> virial;  // (D, D) sum of r (x) force, with the trace -strain_gradient

  bool crosses() const { return crossing[0] >= 0; }
  bool is_refused() const { return crosses() || unconverged[0] >= 0; }
};

/// Energy of a packing and its derivatives as functions of n coordinates about a base: the
/// interface of integrators and minimisers, which evaluate it thousands of times, for any shape.
/// First of all, `move_to` a base; then each point is one that pairs are renewed for.
class LocalEnergyModel {
 public:
  virtual ~LocalEnergyModel() = default;
  virtual int dimension() const = 0;
  virtual std::size_t n() const = 0;
  virtual std::size_t n_particles() const = 0;
  virtual bool has_base() const = 0;
  virtual const Poses &poses() const = 0;

  /// Sets the base of the coordinates.
  virtual void move_to(const Poses &poses) = 0;
  /// Moves the base to a nearby point.
  virtual void move(const Displacement &at) = 0;
  /// Stores the base, from which `deform` begins.
  virtual void hold() = 0;
  virtual bool has_held() const = 0;
  /// Moves the base to the image of the stored one: an upper triangular matrix, rows (D, D), maps
  /// positions and cell vectors, and rotation vectors (N, 1 or 3) rotate the particles that can
  /// rotate.
  virtual void deform(const std::vector<long double> &matrix, const double *turns) = 0;
  /// Renews the pairs if any that may touch at a point could be missing, before all else there.
  virtual void renew_pairs(const Displacement &at) = 0;
  /// Forgets all pairs, so that results depend on the base alone, to the last bit.
  virtual void forget_pairs() = 0;

  /// Whether contacts start from those of the previous point from now on, so that the last bits of
  /// results depend on the points before; for points that follow one another.
  virtual void remember(bool contacts) = 0;

  /// From now on rotations in 3D are about the axes of each body at the base, where its drag is
  /// diagonal, instead of those of space, and factors solve equations, by iteration where they are
  /// incomplete: for stages of a flow.
  virtual void follow_bodies() = 0;

  /// From now on `coupling` and `strain_curvature` are about the strain of these axes (D,), 0 or 1
  /// each, at fixed rotations; at first about that of all axes.
  virtual void strain_along(const std::vector<double> &axes) = 0;

  /// Sets the number of threads of sums over contacts, if there are enough: the last bits depend on
  /// this number, but on nothing else.
  virtual void share(std::size_t threads) = 0;

  virtual LandscapeSums evaluate(const Displacement &at, bool extended) const = 0;

  /// Whether energies have kinks whose two smooth pieces are known.
  virtual bool has_kinks() const = 0;
  /// The smooth piece on which each pair that may have a kink lies at a point.
  virtual std::map<PairName, int> pieces(const Displacement &at) const = 0;
  virtual std::vector<KinkThere> kinks_at(const Displacement &at, const std::vector<Kink> &kinks,
                                          bool extended) const = 0;
  /// Second derivatives are those of the mixtures on these kinks from now on.
  virtual void hold_kinks(const std::vector<Kink> &kinks) = 0;

  /// At most 1: the fraction of a step (n,) that keeps every particle within its bounds of
  /// displacement and rotation.
  virtual double part_within(const double *step, const StepBounds &bounds) const = 0;
  /// The largest magnitude of a particle's displacement, rotation, force or torque in a vector
  /// (n,).
  virtual double largest_part(const double *vector) const = 0;

  /// Computes second derivatives with respect to the base's coordinates, for the functions below,
  /// whose factors will have this fill-in. In 3D at points without rotations. Crossing
  /// spines contribute nothing.
  virtual void differentiate(const Displacement &at, Fill with) = 0;
  /// (n,) derivative of the gradient with respect to the strain, at that point.
  virtual const Eigen::VectorXd &coupling() const = 0;
  /// Second derivative of the energy with respect to the strain, at that point.
  virtual double strain_curvature() const = 0;
  /// (n,) diagonal of the Hessian at that point.
  virtual Eigen::VectorXd diagonal() const = 0;
  /// Product of that Hessian and a vector (n,).
  virtual Eigen::VectorXd times(const Eigen::Ref<const Eigen::VectorXd> &vector) const = 0;
  /// (n,) for displacements the largest of their diagonal elements, for rotations that of theirs:
  /// nearly round particles rotate far more easily than they move.
  virtual Eigen::VectorXd largest_of_kind() const = 0;
  /// Complete where such factors are always cheap.
  virtual Fill fill() const = 0;
  bool has_complete_factors() const { return fill() == Fill::COMPLETE; }
  /// Factors of that Hessian plus a diagonal (n,); null if a pivot is not positive.
  virtual std::shared_ptr<Factors> factors(const Eigen::VectorXd &diagonal) = 0;

  /// Factors at a point, with the smallest shift, in powers of ten, that makes all pivots positive;
  /// null for non-finite matrices.
  std::shared_ptr<Factors> factorise(const Displacement &at, const Eigen::VectorXd &added)
  {
    differentiate(at, fill());
    const Eigen::VectorXd sum = diagonal() + added;
    if (!sum.allFinite()) return nullptr;
    const double smallest = sum.size() > 0 ? sum.minCoeff() : 1.0;
    const double first =
        std::max(smallest, sum.size() > 0 ? LEAST_SHIFT * sum.cwiseAbs().maxCoeff() : 1.0);
    for (double shift = 0.0; std::isfinite(shift);) {
      const Eigen::VectorXd shifted = added.array() + shift;
      if (auto found = factors(shifted)) return found;
      shift = std::max(10.0 * shift, first);
    }
    return nullptr;
  }
};

/// LocalEnergyModel of one shape in D dimensions.
template <class Model, int D> class VicinityOf : public LocalEnergyModel {
 public:
  using Shape = typename Model::Shape;
  using Law = typename Model::Law;

  /// `skin_of_pairs` is the distance of surfaces within which pairs are listed.
  VicinityOf(std::vector<Shape> particle_shapes, Coordinates names, Laws<Law> contact_laws,
             double skin_of_pairs) :
      shapes(std::move(particle_shapes)), coordinates(std::move(names)), skin(skin_of_pairs),
      laws(std::move(contact_laws))
  {
    for (const Shape &shape : shapes) {
      reach = std::max(reach, 2.0 * Model::template outer_radius<D>(shape));
    }
  }

  int dimension() const override { return D; }
  std::size_t n() const override { return coordinates.n; }
  std::size_t n_particles() const override { return shapes.size(); }
  bool has_base() const override { return base.position[0].size() == D * shapes.size(); }
  const Poses &poses() const override { return base; }

  void move_to(const Poses &poses) override
  {
    base = poses;
    if (has_pairs()) measure_pairs();
  }

  void move(const Displacement &at) override
  {
    displace(base, at);
    settle(base, at.strain);
    if (has_pairs()) measure_pairs();
  }

  void hold() override { held = base; }
  bool has_held() const override { return !held.position[0].empty(); }

  void deform(const std::vector<long double> &matrix, const double *by) override
  {
    base = held;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      map_vector(base.position, D * i, 1, matrix);
      Torque<D> turning;
      for (int k = 0; k < ROTATIONS<D>; ++k) turning[k] = by[ROTATIONS<D> * i + k];
      if (turns(i)) turn_pose(base, turning, i);
    }
    for (int column = 0; column < D; ++column) map_vector(base.cell, column, D, matrix);
    settle(base, 0.0);
    if (has_pairs()) measure_pairs();
  }

  void renew_pairs(const Displacement &at) override
  {
    if (!has_pairs()) {
      const std::vector<double> origin(n());
      find({origin.data(), 0.0});
      choose({origin.data(), 0.0});
    }
    if (!is_beyond(pairs, at)) return;
    // Chosen at the same points whenever the wide ones were found: factors depend on the choice.
    measure(wide);
    if (is_beyond(wide, at, skin)) find(at);
    choose(at);
  }

  void forget_pairs() override { moved.reset(); }

  void remember(bool contacts) override
  {
    remembers = contacts;
    starts.assign(pairs.list().n, {});
  }

  void follow_bodies() override
  {
    along_bodies = true;
    forget_systems();
  }

  void strain_along(const std::vector<double> &axes_of_strain) override
  {
    std::copy_n(axes_of_strain.begin(), D, strained.c);
  }

  void share(std::size_t threads) override
  {
    team = threads > 1 ? std::make_unique<Team>(threads) : nullptr;
  }

  LandscapeSums evaluate(const Displacement &at, bool extended) const override
  {
    Team *const by = team_for(pairs.list().n);
    if (!extended) {
      return sums_of(sum_over(parts, moved_to(at), remembers ? starts.data() : nullptr, by), at);
    }
    std::vector<PairSums<D, long double>> in_long;
    return sums_of(sum_over(in_long, posed_at<long double>(pairs, at), nullptr, by), at);
  }

  bool has_kinks() const override { return HAS_KINKS; }

  std::map<PairName, int> pieces(const Displacement &at) const override
  {
    std::map<PairName, int> found;
    if constexpr (HAS_KINKS) {
      const Moved &posed = moved_to(at);
      for (std::size_t p = 0; p < posed.size(); ++p) {
        const Vec<D> r = posed.separation(p);
        if (!posed.may_touch(p, r)) continue;
        const int piece =
            Model::template piece<D>(posed.first_body(p, r), posed.second_body(p), posed.law(p));
        if (piece >= 0) found.emplace(name_of(p), piece);
      }
    }
    return found;
  }

  std::vector<KinkThere> kinks_at(const Displacement &at, const std::vector<Kink> &kinks,
                                  bool extended) const override
  {
    if (kinks.empty()) return {};
    if (!extended) return kinks_in(moved_to(at), kinks);
    return kinks_in(posed_at<long double>(pairs, at), kinks);
  }

  void hold_kinks(const std::vector<Kink> &kinks) override { held_kinks = kinks; }

  double part_within(const double *step, const StepBounds &bounds) const override
  {
    const Displacement by{step, 0.0};
    double farthest_sq = 0.0, excess = 1.0;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      farthest_sq = std::max(farthest_sq, norm_sq(shift(by, i)));
      if (!turns(i)) continue;
      const double widest =
          std::max(bounds.widest, std::min(WIDE, bounds.longest / coordinates.turning_radius[i]));
      excess = std::max(excess, std::abs(angle_of(turn(by, i))) / widest);
    }
    excess = std::max(excess, std::sqrt(farthest_sq) / bounds.longest);
    return 1.0 / excess;
  }

  double largest_part(const double *vector) const override
  {
    double most = 0.0;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      double force = 0.0, torque = 0.0;
      for (int k = 0; k < BLOCK; ++k) {
        const double value = component({vector, 0.0}, i, k);
        (k < D ? force : torque) += value * value;
      }
      most = std::max({most, force, torque});
    }
    return std::sqrt(most);
  }

  void differentiate(const Displacement &at, Fill with) override
  {
    const Moved &posed = moved_to(at);
    std::unique_ptr<BlockSystem> &own = systems[with == Fill::COMPLETE];
    if (!own || with == Fill::NONE) own = block_system(posed, at, with);
    hessian = own.get();
    find_axes(at);
    if (add_pairs(posed, at.strain)) return;
    own = block_system(posed, at, with);
    hessian = own.get();
    add_pairs(posed, at.strain);
  }

  const Eigen::VectorXd &coupling() const override { return pulled; }
  double strain_curvature() const override { return pulled_back; }
  Eigen::VectorXd diagonal() const override { return hessian->diagonal(); }

  Eigen::VectorXd largest_of_kind() const override
  {
    const Eigen::VectorXd own = diagonal();
    double largest[2] = {0.0, 0.0};
    each_coordinate([&](std::int64_t c, bool is_turn) {
      largest[is_turn] = std::max(largest[is_turn], std::abs(own[c]));
    });
    Eigen::VectorXd found(own.size());
    each_coordinate([&](std::int64_t c, bool is_turn) { found[c] = largest[is_turn]; });
    return found;
  }

  Eigen::VectorXd times(const Eigen::Ref<const Eigen::VectorXd> &vector) const override
  {
    return hessian->times(vector);
  }

  Fill fill() const override
  {
    return D == 2 || shapes.size() <= FEW ? Fill::COMPLETE : Fill::NONE;
  }

  std::shared_ptr<Factors> factors(const Eigen::VectorXd &added) override
  {
    return along_bodies && fill() == Fill::NONE ? hessian->iterated(added)
                                                : hessian->factors(added);
  }

 private:
  static constexpr bool HAS_KINKS = Model::template HAS_KINKS<D>;
  static constexpr int BLOCK = D + ROTATIONS<D>;
  static constexpr int VARIABLES = PAIR_VARIABLES<D>;
  static constexpr int TURNS = D == 2 ? 1 : 4;  // per orientation
  using TurnMatrix = Eigen::Matrix<double, ROTATIONS<D>, ROTATIONS<D>>;
  using DualContact = ContactOf<Model, D, Dual<VARIABLES>>;
  using Start = typename Model::template Start<D>;
  using PairMatrix = Eigen::Matrix<double, VARIABLES, VARIABLES>;
  using PairRow = Eigen::Matrix<double, VARIABLES, 1>;
  using Posed = PosedPairs<Model, D, double>;
  using Moved = MovedPairs<Model, D>;

  /// Largest rotation of nearly round particles in one step, if their surface stays within its
  /// bound.
  static constexpr double WIDE = 1.0;

  /// In 3D, elimination couples nearly all particles of a packing: up to this many it is cheaper
  /// than the iterations that avoid it.
  static constexpr std::size_t FEW = 150;

  /// Skin of the pairs from which those within the smaller one are chosen, over that.
  static constexpr double WIDER = 5.0;

  /// Gap of the pairs whose blocks are factorised completely, over the skin: wide enough that these
  /// pairs rarely change while a minimum is approached.
  static constexpr double CLOSE = 0.1;

  /// Fewer pairs are as fast in one thread.
  static constexpr std::size_t MANY = 2000;

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

  std::vector<Shape> shapes;
  Coordinates coordinates;
  double skin;
  double reach = 0.0;     // largest distance of the centres of touching particles
  NearPairs wide, pairs;  // `pairs` are those of `wide` that are within `skin`
  bool remembers = false, along_bodies = false;
  std::vector<TurnMatrix> axes;  // (N,) of the Hessian's rotations in space; empty if these are its
  mutable std::vector<Start> starts;  // (M,) of `pairs`
  Laws<Law> laws;
  Poses held;
  Poses base;
  mutable Poses there;                 // at the last point that needed extended precision
  mutable std::optional<Moved> moved;  // `pairs`, once they are chosen
  mutable Displacement last{};         // the point of `moved`
  mutable std::optional<Posed> exact;  // at that point, if any contact needed it
  mutable std::mutex guard;            // of `exact`
  mutable std::vector<PairSums<D, double>> parts;  // work space
  std::unique_ptr<BlockSystem> systems[2];  // without fill-in and with it, once they are used
  BlockSystem *hessian = nullptr;           // the one last used
  std::vector<Kink> held_kinks;
  Vec<D> strained = all_axes();
  Eigen::VectorXd pulled;  // by the strain of these axes
  double pulled_back = 0.0;
  std::unique_ptr<Team> team;
  std::vector<std::vector<Curved>> curved;  // for each thread, empty between uses

  bool has_pairs() const { return moved.has_value(); }

  Team *team_for(std::size_t n) const { return n < MANY ? nullptr : team.get(); }

  template <class S> LandscapeSums sums_of(const PairSums<D, S> &sums, const Displacement &at) const
  {
    S trace = 0.0;
    for (int k = 0; k < D; ++k) trace += sums.virial[(D + 1) * k];
    return {
        static_cast<double>(sums.energy),     gradient(sums, at),     static_cast<double>(-trace),
        static_cast<double>(sums.bond_force), sums.n_bonds,           particles_of(sums.crossing),
        particles_of(sums.unconverged),       doubles_of(sums.virial)};
  }

  template <class S> static std::vector<double> doubles_of(const Vec<D * D, S> &virial)
  {
    std::vector<double> found(D * D);
    for (int k = 0; k < D * D; ++k) found[k] = static_cast<double>(virial[k]);
    return found;
  }

  static Vec<D> all_axes()
  {
    Vec<D> found;
    for (double &each : found.c) each = 1.0;
    return found;
  }

  /// The pairs at a point, in doubles.
  const Moved &moved_to(const Displacement &at) const
  {
    if (!moved) throw std::runtime_error("There are no pairs, expected some that hold here.");
    last = at;
    exact.reset();
    moved->strain = at.strain;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      moved->displace(i, shift_since(pairs, at, i));
      if (turns(i)) moved->turn(i, orientation_at(at, i));
    }
    return *moved;
  }

  Quaternion orientation_at(const Displacement &at, std::size_t i) const
  {
    const double *const now = &base.orientation[0][TURNS * i];
    if constexpr (D == 2) {
      const double half = 0.5 * (now[0] + (base.orientation[1][i] + turn(at, i)[0]));
      return {std::cos(half), 0.0, 0.0, std::sin(half)};
    } else {
      return turned(normalized(Quaternion{now[0], now[1], now[2], now[3]}), turn(at, i));
    }
  }

  /// One of the pairs at the point of `moved`, in long doubles.
  PosedPair<Model, D, long double> exactly(std::size_t p) const
  {
    const std::lock_guard<std::mutex> lock(guard);
    if (!exact) exact.emplace(posed_at<double>(pairs, last));
    return exact->pair_in_long(p);
  }

  /// Pairs of a list at a point, valid until another point is evaluated.
  template <class S>
  PosedPairs<Model, D, S> posed_at(const NearPairs &list, const Displacement &at) const
  {
    there = base;
    displace(there, at);
    return {shapes, there.view(at.strain), list.list(), laws};
  }

  /// The particles of a pair, which may be -1 for none.
  std::array<std::int64_t, 2> particles_of(std::int64_t p) const
  {
    if (p < 0) return {-1, -1};
    return {pairs.particles[2 * p], pairs.particles[2 * p + 1]};
  }

  template <class S>
  Eigen::VectorXd gradient(const PairSums<D, S> &sums, const Displacement &at) const
  {
    Eigen::VectorXd found = Eigen::VectorXd::Zero(n());
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      Torque<D, S> turning{};
      if (turns(i)) turning = about_axes(i, by_turn(turn(at, i), sums.torque[i]));
      for (int k = 0; k < BLOCK; ++k) {
        const std::int64_t c = coordinates.column[BLOCK * i + k];
        if (c < 0) continue;
        const S by = k < D ? sums.force[i][k] : turning[k - D] * coordinates.radians_per_length[i];
        found[c] = static_cast<double>(-by);
      }
    }
    return found;
  }

  /// The torque with respect to the rotation vector of a particle that was rotated by it.
  template <class S> static Vec<1, S> by_turn(const Vec<1> &, const Vec<1, S> &torque)
  {
    return torque;
  }
  template <class S> static Vec<3, S> by_turn(const Vec<3> &vector, const Vec<3, S> &torque)
  {
    if (norm_sq(vector) == 0.0) return torque;
    return constants_of<S>(torque_on_rotation_vector(vector, doubles(torque)));
  }

  template <class S> static Vec<3> doubles(const Vec<3, S> &v)
  {
    return {{static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2])}};
  }

  /// Body axis of a particle at the base.
  Vec<3> axis_of(std::size_t i, int b) const
  {
    const double *const q = &base.orientation[0][TURNS * i];
    return body_axis(Quaternion{q[0], q[1], q[2], q[3]}, b);
  }

  /// Components of a torque in space along the axes of the rotations.
  template <class S> Torque<D, S> about_axes(std::size_t i, const Torque<D, S> &torque) const
  {
    if constexpr (D == 3) {
      if (along_bodies) {
        Torque<D, S> found;
        for (int b = 0; b < 3; ++b) found[b] = dot(constants_of<S>(axis_of(i, b)), torque);
        return found;
      }
    }
    return torque;
  }

  /// The derivatives of rotations in space by the coordinates at a point, in radians, if these are
  /// about body axes: there also the motion to the point counts.
  void find_axes(const Displacement &at)
  {
    if constexpr (D == 3) {
      if (!along_bodies) return;
      axes.assign(shapes.size(), TurnMatrix::Identity());
      for (std::size_t i = 0; i < shapes.size(); ++i) {
        const Vec<3> back = -1.0 * turn(at, i);
        for (int b = 0; b < 3 && turns(i); ++b) {
          const Vec<3> axis = torque_on_rotation_vector(back, axis_of(i, b));
          std::copy_n(axis.c, 3, axes[i].col(b).data());
        }
      }
    }
  }

  /// Strain of the box since a list was made: the map from its cell vectors then to those now,
  /// upper triangular like both, minus the identity.
  std::vector<double> strain_since(const NearPairs &list) const
  {
    const std::vector<double> &then = list.then.cell[0];
    std::vector<double> strain(D * D);
    for (int k = 0; k < D; ++k) {
      for (int m = k; m < D; ++m) {
        double left = rounded(joined(since(base.cell, list.then.cell, D * k + m)));
        for (int l = k; l < m; ++l) left -= strain[D * k + l] * then[D * l + m];
        strain[D * k + m] = left / then[D * m + m];
      }
    }
    return strain;
  }

  /// Change of a number.
  static Split since(const Poses::Numbers &now, const Poses::Numbers &then, std::size_t k)
  {
    return difference(Poses::get(now, k), Poses::get(then, k));
  }

  void measure_pairs()
  {
    measure(pairs);
    moved->strain_by(pairs.strain);
  }

  void measure(NearPairs &list) const
  {
    list.moved.resize(D * shapes.size());
    list.turned.resize(TURNS * shapes.size());
    list.strain = strain_since(list);
    const SplitPoses now = base.view(0.0), then = list.then.view(0.0);
    double *const moved_by = list.moved.data();
    for (std::size_t c = 0; c < list.moved.size(); ++c) {
      const Split change =
          difference(::jamshape::at(now.position, c), ::jamshape::at(then.position, c));
      moved_by[c] = change.value + change.rest;
    }
    const auto is_zero = [](double x) { return x == 0.0; };
    if (!std::all_of(list.strain.begin(), list.strain.end(), is_zero)) subtract_strain(list);
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      if (turns(i)) measure_turn(list, i);
    }
  }

  /// Subtracts the displacements with the box, in long doubles: they grow with its size.
  void subtract_strain(NearPairs &list) const
  {
    for (std::size_t c = 0; c < list.moved.size(); ++c) {
      const std::size_t k = c % D;
      long double own = joined(since(base.position, list.then.position, c));
      for (std::size_t m = k; m < D; ++m) {
        own -= list.strain[D * k + m] * joined(Poses::get(list.then.position, c - k + m));
      }
      list.moved[c] = rounded(own);
    }
  }

  void measure_turn(NearPairs &list, std::size_t i) const
  {
    const double *const now = &base.orientation[0][TURNS * i];
    const double *const then = &list.then.orientation[0][TURNS * i];
    if constexpr (D == 2) {
      list.turned[i] = now[0] - then[0];
    } else {
      const Quaternion q = Quaternion{now[0], now[1], now[2], now[3]} *
                           Quaternion{then[0], -then[1], -then[2], -then[3]};
      const double parts[] = {q.w, q.i, q.j, q.k};
      std::copy_n(parts, TURNS, &list.turned[TURNS * i]);
    }
  }

  /// Whether contacts can turn a particle.
  bool turns(std::size_t i) const { return Model::template turns<D>(shapes[i]); }

  /// An upper bound of the rotation angle of a particle at a point since a list was made.
  double turned_to(const NearPairs &list, const Displacement &at, std::size_t i) const
  {
    const double *const before = &list.turned[TURNS * i];
    if constexpr (D == 2) {
      const double angle = std::abs(before[0] + turn(at, i)[0]);
      return angle > M_PI ? std::abs(std::remainder(angle, 2.0 * M_PI)) : angle;
    } else {
      const Quaternion q =
          rotation_by(turn(at, i)) * Quaternion{before[0], before[1], before[2], before[3]};
      return std::min(M_PI, 2.0 * norm(Vec<3>{{q.i, q.j, q.k}}) / std::abs(q.w));  // its tangent
    }
  }

  static double angle_of(const Vec<1> &turn) { return turn[0]; }
  static double angle_of(const Vec<3> &turn) { return norm(turn); }

  /// Bound of the relative change of a vector by the box's strain and then by a stretch.
  static double box_strain(const NearPairs &list, double stretch)
  {
    double scaled = 0.0, sheared_sq = 0.0;
    for (int k = 0; k < D; ++k) {
      scaled = std::max(scaled, std::abs(stretch * (1.0 + list.strain[(D + 1) * k]) - 1.0));
      for (int m = k + 1; m < D; ++m) {
        const double sheared = stretch * list.strain[D * k + m];
        sheared_sq += sheared * sheared;
      }
    }
    return scaled + std::sqrt(sheared_sq);
  }

  /// Whether the gap of two surfaces may have shrunk by the skin, or by its remainder.
  bool is_beyond(const NearPairs &list, const Displacement &at, double kept = 0.0) const
  {
    double most = 0.0, most_sq = 0.0;
    const double stretch = 1.0 + at.strain;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const Vec<D> by = shift_since(list, at, i);
      if (turns(i)) {
        const double turned = coordinates.turning_radius[i] * turned_to(list, at, i);
        most = std::max(most, stretch * norm(by) + turned);
      } else {
        most_sq = std::max(most_sq, norm_sq(by));
      }
    }
    most = std::max(most, stretch * std::sqrt(most_sq));
    return 2.0 * most >= list.skin - kept - box_strain(list, stretch) * list.reach;
  }

  /// Displacement of a particle at a point since a list was made, apart from the box's strain.
  Vec<D> shift_since(const NearPairs &list, const Displacement &at, std::size_t i) const
  {
    Vec<D> by = shift(at, i);
    for (int k = 0; k < D; ++k) by[k] += list.moved[D * i + k];
    return by;
  }

  /// Finds the pairs of the wider skin at a point.
  void find(const Displacement &at)
  {
    there = base;
    displace(there, at);
    settle(there, at.strain);
    const double wider = WIDER * skin;
    ListedPairs found = near_particles<Model, D>(shapes, laws, there.view(0.0), wider);
    wide = {std::move(found.particles), std::move(found.shift), there, wider, reach + wider};
  }

  /// Chooses the wide pairs that are within the smaller skin at a point.
  void choose(const Displacement &at)
  {
    pairs = {{}, {}, {}, skin, reach + skin};
    const PosedPairs<Model, D, double> posed = posed_at<double>(wide, at);
    each_closer(posed, skin, [&](std::size_t p) {
      for (int k = 0; k < 2; ++k) pairs.particles.push_back(wide.particles[2 * p + k]);
      for (int k = 0; k < D; ++k) pairs.shift.push_back(wide.shift[D * p + k]);
    });
    pairs.then = there;
    settle(pairs.then, at.strain);
    moved.emplace(shapes, pairs, laws, [this](std::size_t p) { return exactly(p); });
    measure_pairs();
    starts.assign(pairs.list().n, {});
    forget_systems();
  }

  void forget_systems()
  {
    hessian = nullptr;
    for (auto &one : systems) one = nullptr;
  }

  template <class Then> void each_coordinate(const Then &then) const
  {
    for (std::size_t k = 0; k < coordinates.column.size(); ++k) {
      if (coordinates.column[k] >= 0) then(coordinates.column[k], k % BLOCK >= D);
    }
  }

  double component(const Displacement &at, std::size_t i, int k) const
  {
    const std::int64_t c = coordinates.column[BLOCK * i + k];
    return c < 0 ? 0.0 : at.x[c];
  }

  Vec<D> shift(const Displacement &at, std::size_t i) const
  {
    Vec<D> by;
    for (int k = 0; k < D; ++k) by[k] = component(at, i, k);
    return by;
  }

  /// Rotation vector of a particle, in space coordinates.
  Torque<D> turn(const Displacement &at, std::size_t i) const
  {
    Torque<D> by;
    for (int k = 0; k < ROTATIONS<D>; ++k) {
      by[k] = component(at, i, D + k) * coordinates.radians_per_length[i];
    }
    if constexpr (D == 3) {
      if (along_bodies && turns(i)) {
        return by[0] * axis_of(i, 0) + by[1] * axis_of(i, 1) + by[2] * axis_of(i, 2);
      }
    }
    return by;
  }

  /// Moves poses from the base to a point, without the strain there.
  void displace(Poses &poses, const Displacement &at) const
  {
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const Vec<D> by = shift(at, i);
      for (int k = 0; k < D; ++k) add(poses.position, D * i + k, by[k]);
      if (turns(i)) turn_pose(poses, turn(at, i), i);
    }
  }

  /// Maps the vector of every `stride`-th number from `first` on.
  static void map_vector(Poses::Numbers &of, std::size_t first, std::size_t stride,
                         const std::vector<long double> &matrix)
  {
    for (int k = 0; k < D; ++k) {  // later components are still unmodified
      long double sum = 0.0L;
      for (int m = k; m < D; ++m) {
        sum += matrix[D * k + m] * joined(Poses::get(of, first + stride * m));
      }
      Poses::set(of, first + stride * k, split(sum));
    }
  }

  static void add(Poses::Numbers &to, std::size_t k, double by)
  {
    const Split sum = two_sum(to[0][k], by);
    Poses::set(to, k, {sum.value, sum.rest + to[1][k]});
  }

  static void turn_pose(Poses &poses, const Torque<D> &by, std::size_t i)
  {
    if constexpr (D == 2) {
      add(poses.orientation, i, by[0]);
    } else {
      if (norm_sq(by) == 0.0) return;
      const auto at = [&](int k) { return joined(Poses::get(poses.orientation, TURNS * i + k)); };
      const QuaternionOf<long double> found = turned(
          QuaternionOf<long double>{at(0), at(1), at(2), at(3)}, constants_of<long double>(by));
      const long double parts[] = {found.w, found.i, found.j, found.k};
      for (int k = 0; k < TURNS; ++k) Poses::set(poses.orientation, TURNS * i + k, split(parts[k]));
    }
  }

  /// Strains displaced poses, and rounds their numbers to long doubles, as they are stored.
  static void settle(Poses &poses, double strain)
  {
    const long double stretch = 1.0L + strain;
    for (Poses::Numbers *lengths : {&poses.position, &poses.cell}) {
      if (strain == 0.0) {
        round_to_long(*lengths);
        continue;
      }
      for (std::size_t k = 0; k < (*lengths)[0].size(); ++k) {
        Poses::set(*lengths, k, split(stretch * joined(Poses::get(*lengths, k))));
      }
    }
    if constexpr (D == 2) {  // full turns would cost digits
      constexpr long double TURN = 2.0L * 3.14159265358979323846264338327950288L;
      for (std::size_t i = 0; i < poses.orientation[0].size(); ++i) {
        const double near = poses.orientation[0][i];
        if (std::abs(near) <= static_cast<double>(0.5L * TURN)) continue;
        const long double whole = std::rint(near / static_cast<double>(TURN));
        const long double angle = joined(Poses::get(poses.orientation, i));
        Poses::set(poses.orientation, i, split(angle - TURN * whole));
      }
      round_to_long(poses.orientation);
    }
  }

  static void round_to_long(Poses::Numbers &numbers)
  {
    double *const value = numbers[0].data(), *const rest = numbers[1].data();
    for (std::size_t k = 0; k < numbers[0].size(); ++k) {
      const Split rounded = rounded_to_long({value[k], rest[k]});
      value[k] = rounded.value;
      rest[k] = rounded.rest;
    }
  }

  /// The block system, with blocks of displacements alone if nothing can rotate. Pairs further
  /// apart than a small margin are left out, since they would multiply the fill-in; one without
  /// fill-in is made in no time, so that it leaves out all pairs that do not touch.
  std::unique_ptr<BlockSystem> block_system(const Moved &posed, const Displacement &at,
                                            Fill with) const
  {
    std::vector<char> used(posed.size());
    if (with == Fill::NONE) {
      for (std::size_t p = 0; p < used.size(); ++p) {
        used[p] = posed.may_touch(p, posed.separation(p));
      }
    } else {
      const Posed own = posed_at<double>(pairs, at);
      for (std::size_t p = 0; p < used.size(); ++p) used[p] = own.are_closer(p, CLOSE * skin);
    }
    const BlockPlan plan{coordinates.column, pairs.particles, used, shapes.size(), BLOCK, with};
    if (any_turns()) return std::make_unique<BlockSystemOf<BLOCK, D>>(plan);
    return std::make_unique<BlockSystemOf<D, D>>(plan);
  }

  /// Whether any of the coordinates is a rotation.
  bool any_turns() const
  {
    for (std::size_t k = 0; k < coordinates.column.size(); ++k) {
      if (k % BLOCK >= D && coordinates.column[k] >= 0) return true;
    }
    return false;
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

  PairName name_of(std::size_t p) const
  {
    PairName name{};
    std::copy_n(&pairs.particles[2 * p], 2, name.begin());
    std::copy_n(&pairs.shift[D * p], D, name.begin() + 2);
    return name;
  }

  /// The number of each of these pairs in the list, if it is there.
  std::vector<std::optional<std::size_t>> numbers_of(const std::vector<Kink> &kinks) const
  {
    std::vector<std::optional<std::size_t>> found(kinks.size());
    for (std::size_t p = 0; p < pairs.list().n; ++p) {
      for (std::size_t k = 0; k < kinks.size(); ++k) {
        if (pairs.particles[2 * p] == kinks[k].pair[0] && name_of(p) == kinks[k].pair) found[k] = p;
      }
    }
    return found;
  }

  template <class Pairs>
  std::vector<KinkThere> kinks_in(const Pairs &posed, const std::vector<Kink> &kinks) const
  {
    std::vector<KinkThere> found(kinks.size());
    if constexpr (HAS_KINKS) {
      const auto numbers = numbers_of(kinks);
      for (std::size_t k = 0; k < kinks.size(); ++k) {
        if (numbers[k]) found[k] = kink_in(posed, *numbers[k], kinks[k]);
      }
    }
    return found;
  }

  template <class Pairs>
  KinkThere kink_in(const Pairs &posed, std::size_t p, const Kink &kink) const
  {
    using S = typename Pairs::S;
    const Vec<D, S> r = posed.separation(p);
    const auto i = posed.first_body(p, r);
    const auto &j = posed.second_body(p);
    const auto whole = contact_of(i, j, posed.law(p));
    KinkThere found{};
    found.exists = whole.status == ContactStatus::TOUCHING;
    if (!found.exists) return found;
    const auto from = contact_of(i, j, Model::on_piece(posed.law(p), kink.from));
    const auto to = contact_of(i, j, Model::on_piece(posed.law(p), kink.to));
    found.gap = static_cast<double>(to.energy - from.energy);
    found.column.fill(-1);
    for (int side = 0; side < 2; ++side) {
      const std::size_t particle = pairs.particles[2 * p + side];
      const double scale = coordinates.radians_per_length[particle];
      for (int k = 0; k < BLOCK; ++k) {
        const int c = BLOCK * side + k;
        found.column[c] = coordinates.column[BLOCK * particle + k];
        const auto slope = [&](const auto &of) {
          if (k < D) return side == 0 ? -of.force[k] : of.force[k];
          return -scale * (side == 0 ? of.torque_i : of.torque_j)[k - D];
        };
        found.jump[c] = static_cast<double>(slope(to) - slope(from));
        found.change[c] = static_cast<double>(slope(from) - slope(whole));
      }
    }
    return found;
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
      const double radius = coordinates.turning_radius[pairs.particles[2 * p + side]];
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
                   const Range &part, const Then &then) const
  {
    std::map<std::size_t, const Kink *> kink_of;
    if constexpr (HAS_KINKS) {
      const auto numbers = numbers_of(held_kinks);
      for (std::size_t k = 0; k < numbers.size(); ++k) {
        if (numbers[k]) kink_of[*numbers[k]] = &held_kinks[k];
      }
    }
    for (std::size_t p = part.first; p < part.last; ++p) {
      const Vec<D> r = posed.separation(p);
      Start start = remembers ? starts[p] : Start{};
      if (!posed.may_touch(p, r)) continue;
      Curved found{p, r, posed.pair_turns(p), {}};
      if (found.turns) {
        const DualContact dual = turned_bodies->contact(p, r, &start);
        if (dual.status != ContactStatus::TOUCHING) continue;
        const auto held = kink_of.find(p);
        if (held == kink_of.end()) {
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
    hessian->add_shifts(pair.p, by.data());
    const Eigen::Map<const Eigen::Matrix<double, D, 1>> along(apart.c);
    add_pull(pair.p, 0, by * along / stretch);
    add_pull(pair.p, 1, -by * along / stretch);
  }

  /// Adds the force by which the strain pulls the first or second particle of a pair.
  template <class Pull> void add_pull(std::size_t p, int side, const Pull &pull)
  {
    const std::int64_t *const own = &coordinates.column[BLOCK * pairs.particles[2 * p + side]];
    for (int k = 0; k < Pull::RowsAtCompileTime; ++k) {
      if (own[k] >= 0) pulled[own[k]] += pull[k];
    }
  }

  /// Sets the Hessian and what the strain does to the sums over all pairs. False if its blocks lack
  /// one.
  bool add_pairs(const Moved &posed, double strain)
  {
    hessian->clear();
    pulled = Eigen::VectorXd::Zero(n());
    pulled_back = 0.0;
    std::optional<TurnedBodies<Moved>> turned_bodies;
    if (any_turns()) turned_bodies.emplace(posed);
    bool has_all = true;
    const auto add = [&](const Curved &pair) {
      if (hessian->couples(pair.p)) {
        add_pair(pair, 1.0 + strain);
      } else {
        has_all = false;
      }
    };
    Team *const by = team_for(posed.size());
    curved.resize(parts_of(by));
    in_parts(by, posed.size(), [&](std::size_t k, const Range &part) {
      each_curved(posed, turned_bodies, part, [&](const Curved &pair) {
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
        scale[side][k] =
            k >= D ? coordinates.radians_per_length[particle] : (side == 0 ? stretch : -stretch);
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
    hessian->add(p, scaled.data());
    for (int side = 0; side < 2; ++side) add_pull(p, side, pull[side]);
  }
};

}  // namespace jamshape
