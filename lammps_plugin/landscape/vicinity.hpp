#pragma once

#include "landscape/coordinates.hpp"
#include "landscape/kinks.hpp"
#include "landscape/local_energy_model.hpp"
#include "landscape/near_pairs.hpp"
#include "landscape/pair_hessian.hpp"
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
#include <utility>
#include <vector>

namespace jamshape {

/// LocalEnergyModel of one shape in D dimensions.
template <class Model, int D> class VicinityOf : public LocalEnergyModel {
 public:
  using Shape = typename Model::Shape;
  using Law = typename Model::Law;

  /// `skin_of_pairs` is the distance of surfaces within which pairs are listed.
  VicinityOf(std::vector<Shape> particle_shapes, Laws<Law> contact_laws, double skin_of_pairs) :
      shapes(std::move(particle_shapes)), near(coordinates_of(shapes)), skin(skin_of_pairs),
      laws(std::move(contact_laws))
  {
    for (const Shape &shape : shapes) {
      reach = std::max(reach, 2.0 * Model::template outer_radius<D>(shape));
    }
  }
  VicinityOf(const VicinityOf &) = delete;
  VicinityOf &operator=(const VicinityOf &) = delete;

  int dimension() const override { return D; }
  std::size_t n() const override { return near.coordinates.n(); }
  std::size_t n_particles() const override { return shapes.size(); }
  bool has_base() const override { return near.base.position[0].size() == D * shapes.size(); }
  const Poses &poses() const override { return near.base; }

  void move_to(const Poses &poses) override
  {
    near.base = poses;
    if (has_pairs()) measure_pairs();
  }

  void move(const Displacement &at) override
  {
    near.displace(near.base, at);
    near.base.template settle<D>(at.strain);
    if (has_pairs()) measure_pairs();
  }

  bool adds_up() const override { return D == 2 || !near.any_turns(); }

  void hold() override { held = near.base; }
  bool has_held() const override { return !held.position[0].empty(); }

  void deform(const std::vector<long double> &matrix, const double *by) override
  {
    near.base = held;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      Torque<D> turning;
      for (int k = 0; k < ROTATIONS<D>; ++k) turning[k] = by[ROTATIONS<D> * i + k];
      if (near.turns(i)) near.base.template turn<D>(i, turning);
    }
    near.base.template map<D>(matrix);
    near.base.template settle<D>(0.0);
    if (has_pairs()) measure_pairs();
  }

  bool renew_pairs(const Displacement &at) override
  {
    if (!has_pairs()) {
      const std::vector<double> origin(n());
      find({origin.data(), 0.0});
      choose({origin.data(), 0.0});
    }
    if (!pairs.is_beyond(near, at)) return false;
    // Chosen at the same points whenever the wide ones were found: factors depend on the choice.
    wide.measure(near);
    if (wide.is_beyond(near, at, skin)) find(at);
    choose(at);
    return true;
  }

  void forget_pairs() override { moved.reset(); }

  void remember(bool contacts) override
  {
    remembers = contacts;
    starts.assign(pairs.list().n, {});
  }

  void follow_bodies() override
  {
    near.along_bodies = true;
    hessian.forget();
  }

  void strain_along(const std::vector<double> &axes) override { hessian.strain_along(axes); }

  void share(std::size_t threads) override
  {
    team = threads > 1 ? std::make_unique<Team>(threads) : nullptr;
  }

  LandscapeSums evaluate(const Displacement &at, const EvaluationOptions &with) const override
  {
    Team *const by = team_for(pairs.list().n);
    if (!with.extended) {
      Start *const from = remembers ? starts.data() : nullptr;
      return sums_of(sum_over(parts, moved_to(at), with.virial, from, by), at);
    }
    std::vector<PairSums<D, long double>> in_long;
    const auto posed = posed_at<long double>(pairs, at);
    return sums_of(sum_over(in_long, posed, with.virial, nullptr, by), at);
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
        if (piece >= 0) found.emplace(name_of(pairs, p), piece);
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

  void hold_kinks(const std::vector<Kink> &kinks) override { hessian.hold_kinks(kinks); }

  double part_within(const double *step, const StepBounds &bounds) const override
  {
    return near.part_within(step, bounds);
  }

  double largest_part(const double *vector) const override { return near.largest_part(vector); }

  void differentiate(const Displacement &at, Fill with) override
  {
    const Moved &posed = moved_to(at);
    if (!is_lasting(with)) hessian.forget(with);
    hessian.differentiate(posed, at, with, remembers ? starts.data() : nullptr,
                          team_for(posed.size()), [&] { return coupled(posed, at, with); });
  }

  const Eigen::VectorXd &coupling() const override { return hessian.coupling(); }
  double strain_curvature() const override { return hessian.strain_curvature(); }
  Eigen::VectorXd diagonal() const override { return hessian.blocks().diagonal(); }

  Eigen::VectorXd largest_of_kind() const override
  {
    const Eigen::VectorXd own = diagonal();
    double largest[2] = {0.0, 0.0};
    near.each_coordinate([&](std::int64_t c, bool is_turn) {
      largest[is_turn] = std::max(largest[is_turn], std::abs(own[c]));
    });
    Eigen::VectorXd found(own.size());
    near.each_coordinate([&](std::int64_t c, bool is_turn) { found[c] = largest[is_turn]; });
    return found;
  }

  Eigen::VectorXd times(const Eigen::Ref<const Eigen::VectorXd> &vector) const override
  {
    return hessian.blocks().times(vector);
  }

  Fill fill() const override
  {
    return D == 2 || shapes.size() <= FEW ? Fill::COMPLETE : Fill::NONE;
  }

  std::shared_ptr<Factors> factors(const Eigen::VectorXd &added) override
  {
    return near.along_bodies && fill() == Fill::NONE ? hessian.blocks().iterated(added)
                                                     : hessian.blocks().factors(added);
  }

 private:
  static constexpr bool HAS_KINKS = Model::template HAS_KINKS<D>;
  using Start = typename Model::template Start<D>;
  using Posed = PosedPairs<Model, D, double>;
  using Moved = MovedPairs<Model, D>;

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

  std::vector<Shape> shapes;
  BasePoses<D> near;
  double skin;
  double reach = 0.0;        // largest distance of the centres of touching particles
  NearPairs<D> wide, pairs;  // `pairs` are those of `wide` that are within `skin`
  bool remembers = false;
  mutable std::vector<Start> starts;  // (M,) of `pairs`
  Laws<Law> laws;
  Poses held;
  mutable Poses there;                 // at the last point that needed extended precision
  mutable std::optional<Moved> moved;  // `pairs`, once they are chosen
  mutable Displacement last{};         // the point of `moved`
  mutable std::optional<Posed> exact;  // at that point, if any contact needed it
  mutable std::mutex guard;            // of `exact`
  mutable std::vector<PairSums<D, double>> parts;  // work space
  PairHessian<Model, D> hessian{near, pairs};
  std::unique_ptr<Team> team;

  static Coordinates coordinates_of(const std::vector<Shape> &of)
  {
    Coordinates found;
    for (const Shape &shape : of) {
      found.add<D>(Model::template rotation_length<D>(shape),
                   Model::template turning_radius<D>(shape));
    }
    return found;
  }

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

  /// The pairs at a point, in doubles.
  const Moved &moved_to(const Displacement &at) const
  {
    if (!moved) throw std::runtime_error("There are no pairs, expected some that hold here.");
    last = at;
    exact.reset();
    moved->strain = at.strain;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      moved->displace(i, pairs.shift_to(near, at, i));
      if (near.turns(i)) moved->turn(i, near.orientation(at, i));
    }
    return *moved;
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
  PosedPairs<Model, D, S> posed_at(const NearPairs<D> &list, const Displacement &at) const
  {
    there = near.base;
    near.displace(there, at);
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
    Eigen::VectorXd found(static_cast<Eigen::Index>(n()));
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      double *const own = found.data() + near.coordinates.first[i];
      for (int k = 0; k < D; ++k) own[k] = static_cast<double>(-sums.force[i][k]);
      if (!near.turns(i)) continue;
      const Torque<D, S> turning = near.along_rotations(at, i, sums.torque[i]);
      for (int k = 0; k < ROTATIONS<D>; ++k) {
        own[D + k] = static_cast<double>(-turning[k] * near.coordinates.radians_per_length[i]);
      }
    }
    return found;
  }

  void measure_pairs()
  {
    pairs.measure(near);
    moved->strain_by(pairs.strain);
  }

  /// Finds the pairs of the wider skin at a point.
  void find(const Displacement &at)
  {
    there = near.base;
    near.displace(there, at);
    there.template settle<D>(at.strain);
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
    pairs.then.template settle<D>(at.strain);
    moved.emplace(shapes, pairs, laws, [this](std::size_t p) { return exactly(p); });
    measure_pairs();
    starts.assign(pairs.list().n, {});
    hessian.forget();
  }

  /// Whether a system of blocks serves for several points. Without fill-in it is made in no time,
  /// and fill-in in 3D takes far more time than a new system.
  bool is_lasting(Fill with) const { return with == Fill::COMPLETE && fill() == Fill::COMPLETE; }

  /// Flags of the pairs that have blocks: those that touch, for several points also those within a
  /// small margin, since more would multiply the fill-in.
  std::vector<char> coupled(const Moved &posed, const Displacement &at, Fill with) const
  {
    std::vector<char> used(posed.size());
    if (!is_lasting(with)) {
      for (std::size_t p = 0; p < used.size(); ++p) {
        used[p] = posed.may_touch(p, posed.separation(p));
      }
    } else {
      const Posed own = posed_at<double>(pairs, at);
      for (std::size_t p = 0; p < used.size(); ++p) used[p] = own.are_closer(p, CLOSE * skin);
    }
    return used;
  }

  template <class Pairs>
  std::vector<KinkThere> kinks_in(const Pairs &posed, const std::vector<Kink> &kinks) const
  {
    std::vector<KinkThere> found(kinks.size());
    if constexpr (HAS_KINKS) {
      const auto numbers = numbers_of(pairs, kinks);
      for (std::size_t k = 0; k < kinks.size(); ++k) {
        if (!numbers[k]) continue;
        const std::size_t p = *numbers[k];
        found[k] = kink_of<Model, D>(posed, p, &pairs.particles[2 * p], near.coordinates, kinks[k]);
      }
    }
    return found;
  }
};

}  // namespace jamshape
