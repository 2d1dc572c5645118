#pragma once

#include "contact/contact.hpp"
#include "contact/contact_block.hpp"
#include "contact/extended.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"
#include "contact/packs.hpp"
#include "contact/pair_derivatives.hpp"

#include "packing/laws.hpp"
#include "packing/split.hpp"
#include "packing/team.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace jamshape {

/// Poses of N particles in a periodic box, every coordinate a double-double: overlaps are
/// differences of coordinates, and a double of 40 diameters has lost their last eight digits.
/// Row-major views: [0] the doubles, [1] the low parts. Box and positions are strained.
struct SplitPoses {
  using View = std::array<const double *, 2>;
  View position;     // (N, D)
  View orientation;  // (N,) angles in 2D, (N, 4) quaternions w i j k in 3D
  View cell;         // (D, D) cell vectors of the box as columns, upper triangular
  double strain = 0.0;
};

/// An element of such a view.
inline Split at(const SplitPoses::View &view, std::size_t index)
{
  return {view[0][index], view[1][index]};
}

/// Pairs that may touch: (M, 2) particles and (M, D) cell vectors to add to the second one's
/// position.
struct PairList {
  std::size_t n;
  const std::int64_t *particles;
  const std::int64_t *shift;
};

/// x_i - x_j of a pair in the scalar T, without rounding errors except that of T itself.
template <int D, class T>
Vec<D, T> separation_of(const SplitPoses &poses, const PairList &list, std::size_t p)
{
  const std::size_t i = list.particles[2 * p], j = list.particles[2 * p + 1];
  Split apart[D];
  for (int k = 0; k < D; ++k) {
    apart[k] = difference(at(poses.position, D * i + k), at(poses.position, D * j + k));
  }
  for (int m = 0; m < D; ++m) {
    const std::int64_t turns = list.shift[D * p + m];  // zero for most pairs
    for (int k = 0; k <= m && turns != 0; ++k) {
      apart[k] = difference(apart[k], at(poses.cell, D * k + m), static_cast<double>(turns));
    }
  }
  Vec<D, T> r;
  for (int k = 0; k < D; ++k) {
    if constexpr (std::is_same_v<T, double>) {
      r[k] = apart[k].value + (apart[k].rest + poses.strain * apart[k].value);
    } else {
      r[k] = (T(1) + poses.strain) * joined(apart[k]);
    }
  }
  return r;
}

namespace detail {

/// Computes a contact in doubles, starting from the pair's previous one if that is given and the
/// shape supports starts.
template <class Body, class Law, class Start>
auto contact_begun(const Body &i, const Body &j, const Law &law, Start *start)
{
  if constexpr (!std::is_same_v<Start, NoStart>) {
    if (start != nullptr) return contact_of(i, j, law, *start);
  }
  return contact_of(i, j, law);
}

}  // namespace detail

/// Type of the starts of contacts in the scalar S: long doubles, which settle the last bits, never
/// use one.
template <class Model, int D, class S>
using StartIn =
    std::conditional_t<std::is_same_v<S, double>, typename Model::template Start<D>, NoStart>;

/// Particles as bodies at the origin, their pairs and laws, in the scalar S. Derived classes pose
/// the bodies, and have the members `separation(p)`, x_i - x_j; `fill(range, block, number)`, which
/// adds those that may touch to a block; `turned(n, first)`, a body rotated by its rotation
/// variables; and `pair_in_long(p)`, the same pair in long doubles.
template <class ModelOf, int DIMENSION, class Scalar> class BodyPairs {
 public:
  using Model = ModelOf;
  using S = Scalar;
  static constexpr int D = DIMENSION;
  using Body = typename Model::template Body<D, S>;
  using Start = StartIn<Model, D, S>;

  BodyPairs(const std::vector<typename Model::Shape> &particle_shapes, const PairList &list,
            const Laws<typename Model::Law> &contact_laws) :
      shapes(particle_shapes), pairs(list), common(contact_laws.any()),
      mixed(contact_laws.is_one() ? nullptr : &contact_laws)
  {
    body.reserve(shapes.size());
    around.reserve(shapes.size());
    for (const typename Model::Shape &shape : shapes) {
      around.push_back(WIDER * Model::template outer_radius<D>(shape));
      has_turning = has_turning || Model::template turns<D>(shape);
      if constexpr (PacksOf<Model, D>::EXIST) {
        fits_packs = fits_packs && PacksOf<Model, D>::take(shape, shapes.front());
      }
      body.push_back(Model::template body<D, S>(shape));
    }
  }

  std::size_t size() const { return pairs.n; }
  std::size_t n_particles() const { return shapes.size(); }
  /// The law of a pair.
  const typename Model::Law &law(std::size_t p) const
  {
    return mixed == nullptr ? common : mixed->of(first(p), second(p));
  }
  /// One of the laws, which differ in k_e only.
  const typename Model::Law &any_law() const { return common; }
  std::size_t first(std::size_t p) const { return pairs.particles[2 * p]; }
  std::size_t second(std::size_t p) const { return pairs.particles[2 * p + 1]; }

  /// Whether the bounding spheres of a pair of this separation touch, or their gap is smaller than
  /// a margin: excludes most pairs of a list at a tenth of the cost of a contact.
  bool may_touch(std::size_t p, const Vec<D, S> &r) const { return may_be_closer(p, r, 0.0); }
  bool may_be_closer(std::size_t p, const Vec<D, S> &r, double margin) const
  {
    const double reach = around[first(p)] + around[second(p)] + margin;
    return norm_sq(r) < S(reach) * reach;
  }

  /// The bodies of a pair of this separation, the second at the origin.
  Body first_body(std::size_t p, const Vec<D, S> &r) const
  {
    Body body_i = body[first(p)];
    body_i.centre = r;
    return body_i;
  }
  const Body &second_body(std::size_t p) const { return body[second(p)]; }

  /// Whether packs support all of these particles.
  bool packs_take_all() const { return fits_packs; }

  /// All bodies, at the origin.
  const Body *bodies() const { return body.data(); }

  /// Whether contacts can rotate any particle, this one, or either of a pair.
  bool any_turns() const { return has_turning; }
  bool turns(std::size_t n) const { return Model::template turns<D>(shapes[n]); }
  bool pair_turns(std::size_t p) const { return turns(first(p)) || turns(second(p)); }

 protected:
  /// Margin that prevents rounding from hiding a contact of tips.
  static constexpr double WIDER = 1.0 + 1e-14;

  const std::vector<typename Model::Shape> &shapes;
  PairList pairs;
  typename Model::Law common;
  const Laws<typename Model::Law> *mixed;  // null if one law is that of all pairs
  std::vector<Body> body;                  // at the origin
  std::vector<double> around;              // radii of the bounding spheres
  bool has_turning = false, fits_packs = PacksOf<Model, D>::EXIST;
};

/// Pairs of posed particles. Separations have no rounding errors except that of S itself.
template <class Model, int D, class S> class PosedPairs : public BodyPairs<Model, D, S> {
 public:
  using Long = long double;
  using Base = BodyPairs<Model, D, S>;
  using Base::first;
  using Base::second;

  PosedPairs(const std::vector<typename Model::Shape> &particle_shapes, const SplitPoses &at,
             const PairList &list, const Laws<typename Model::Law> &contact_laws) :
      Base(particle_shapes, list, contact_laws), poses(at)
  {
    for (std::size_t n = 0; n < shapes.size(); ++n) {
      if (this->turns(n)) Model::template turn_to<D, S>(this->body[n], orientation_of(n));
    }
  }

  /// x_i - x_j.
  Vec<D, S> separation(std::size_t p) const { return separation_in<S>(p); }

  template <class T> Vec<D, T> separation_in(std::size_t p) const
  {
    return separation_of<D, T>(poses, this->pairs, p);
  }

  /// Adds to a block, until it is full, those of a range of pairs whose bounding spheres may be
  /// closer than a margin, without k_e; and the number of each. Returns where to resume.
  std::size_t fill(const Range &from, ContactBlock<D> &block, int *number,
                   double margin = 0.0) const
  {
    std::size_t p = from.first;
    for (; p < from.last && block.n < block.MOST; ++p) {
      const Vec<D, S> r = separation(p);
      block.put(static_cast<int>(first(p)), static_cast<int>(second(p)), r);
      number[block.n] = static_cast<int>(p);
      block.n += this->may_be_closer(p, r, margin);  // a branch would be unpredictable
    }
    return p;
  }

  /// The reference for errors of a contact.
  [[gnu::noinline, gnu::cold]] PosedPair<Model, D, Long> pair_in_long(std::size_t p) const
  {
    const std::size_t i = first(p), j = second(p);
    return {shapes[i],
            shapes[j],
            separation_in<Long>(p),
            orientation_in<Long>(i),
            orientation_in<Long>(j),
            this->law(p)};
  }

  /// Whether the gap between two surfaces may be smaller than a margin.
  bool are_closer(std::size_t p, double margin) const
  {
    return Model::template closer_than<D>(margin, this->first_body(p, separation(p)),
                                          this->second_body(p));
  }

  /// Whether the particles share more than a point.
  bool overlap(std::size_t p) const
  {
    return are_overlapping(this->first_body(p, separation(p)), this->second_body(p));
  }

  /// A body rotated by its rotation variables, from `first` on.
  auto turned(std::size_t n, int first_variable) const
  {
    return turned_body<Model, D, S>(shapes[n], orientation_of(n), first_variable);
  }

 private:
  using Base::shapes;
  SplitPoses poses;

  QuaternionOf<S> orientation_of(std::size_t n) const { return orientation_in<S>(n); }

  template <class T> QuaternionOf<T> orientation_in(std::size_t n) const
  {
    const auto component = [&](std::size_t k) { return joined(at(poses.orientation, k)); };
    if constexpr (D == 2) {
      const T half = 0.5 * static_cast<T>(component(n));
      return {std::cos(half), T(0.0), T(0.0), std::sin(half)};
    } else {
      const auto q = normalized(QuaternionOf<Long>{component(4 * n), component(4 * n + 1),
                                                   component(4 * n + 2), component(4 * n + 3)});
      return {static_cast<T>(q.w), static_cast<T>(q.i), static_cast<T>(q.j), static_cast<T>(q.k)};
    }
  }
};

/// A contact of a pair, in plain or in dual numbers, in long doubles where S is not precise enough.
template <class Pairs, class Found>
Found to_its_digits(const Pairs &pairs, std::size_t p, const Found &found)
{
  if constexpr (std::is_same_v<typename Pairs::S, double>) {
    return to_its_digits<typename Pairs::Model, Pairs::D>(found,
                                                          [&] { return pairs.pair_in_long(p); });
  } else {
    return found;
  }
}

/// The contact of a pair of this separation, starting from its previous one if given.
template <class Pairs>
ContactOf<typename Pairs::Model, Pairs::D, typename Pairs::S>
contact_in(const Pairs &pairs, std::size_t p, const Vec<Pairs::D, typename Pairs::S> &r,
           typename Pairs::Start *start = nullptr)
{
  const auto found =
      detail::contact_begun(pairs.first_body(p, r), pairs.second_body(p), pairs.law(p), start);
  return to_its_digits(pairs, p, found);
}

/// The bodies of pairs in dual numbers, each once as the first and once as the second of a pair.
template <class Pairs> class TurnedBodies {
 public:
  using Model = typename Pairs::Model;
  using S = typename Pairs::S;
  static constexpr int D = Pairs::D;

  explicit TurnedBodies(const Pairs &posed) : pairs(posed)
  {
    as_i.reserve(pairs.n_particles());
    as_j.reserve(pairs.n_particles());
    for (std::size_t n = 0; n < pairs.n_particles(); ++n) {
      as_i.push_back(pairs.turned(n, FIRST_OF_I<D>));
      as_j.push_back(pairs.turned(n, FIRST_OF_J<D>));
    }
  }

  /// The contact of a pair of this separation, starting from its previous one if given.
  ContactOf<Model, D, Dual<PAIR_VARIABLES<D>, S>>
  contact(std::size_t p, const Vec<D, S> &r, typename Pairs::Start *start = nullptr) const
  {
    auto body_i = as_i[pairs.first(p)];
    body_i.centre = as_variables<D, S>(r);
    const auto found = detail::contact_begun(body_i, as_j[pairs.second(p)], pairs.law(p), start);
    return to_its_digits(pairs, p, found);
  }

  /// The same on one smooth piece of the energy.
  ContactOf<Model, D, Dual<PAIR_VARIABLES<D>, S>> contact_on(int piece, std::size_t p,
                                                             const Vec<D, S> &r) const
  {
    auto body_i = as_i[pairs.first(p)];
    body_i.centre = as_variables<D, S>(r);
    return contact_of(body_i, as_j[pairs.second(p)], Model::on_piece(pairs.law(p), piece));
  }

 private:
  const Pairs &pairs;
  std::vector<typename Model::template Body<D, Dual<PAIR_VARIABLES<D>, S>>> as_i, as_j;
};

/// Sums over all pairs.
template <int D, class S> struct PairSums {
  S energy = 0.0;
  std::vector<Vec<D, S>> force;
  std::vector<Torque<D, S>> torque;
  Vec<D * D, S> virial{};  // sum of r (x) force on i, if there is any
  bool has_virial = true;
  S bond_force = 0.0;  // sum of the magnitudes
  std::size_t n_bonds = 0;
  std::int64_t crossing = -1;     // the first pair of this status, -1 for none
  std::int64_t unconverged = -1;  // likewise

  /// Sets all to zero, of N particles; torques only if contacts can rotate any of them.
  void clear(std::size_t N, bool any_turns, bool with_virial)
  {
    has_virial = with_virial;
    energy = bond_force = 0.0;
    virial = {};
    n_bonds = 0;
    crossing = unconverged = -1;
    force.assign(N, Vec<D, S>{});
    torque.assign(any_turns ? N : 0, Torque<D, S>{});
  }

  /// The torque on a particle.
  Torque<D, S> torque_on(std::size_t n) const
  {
    return torque.empty() ? Torque<D, S>{} : torque[n];
  }

  /// The contact of the p-th pair.
  template <class Pairs, class Found>
  void add(const Pairs &pairs, std::size_t p, const Vec<D, S> &r, const Found &contact)
  {
    if (contact.status == ContactStatus::APART) return;
    if (contact.status != ContactStatus::TOUCHING) {
      const bool is_crossing = contact.status == ContactStatus::CROSSING;
      std::int64_t &first = is_crossing ? crossing : unconverged;
      if (first < 0) first = static_cast<std::int64_t>(p);
      return;
    }
    energy += contact.energy;
    add_force(pairs.first(p), pairs.second(p), contact.force);
    if (has_virial) add_virial(r, contact.force, virial);
    if (!torque.empty()) {
      add_torques(pairs.first(p), pairs.second(p), contact.torque_i, contact.torque_j);
    }
    for (int b = 0; b < contact.n_bonds; ++b) bond_force += norm(contact.bond[b].force);
    n_bonds += contact.n_bonds;
  }

  /// The contacts of a block that touch and are not alone. Sums of all pairs stay in registers:
  /// in memory each addition would wait for the one before.
  void add(const ContactBlock<D> &block)
  {
    if (has_virial) {
      add_block<true>(block);
    } else {
      add_block<false>(block);
    }
  }

  /// Adds the sums over the pairs that follow.
  void add(const PairSums &next)
  {
    energy += next.energy;
    for (std::size_t n = 0; n < force.size(); ++n) force[n] += next.force[n];
    for (std::size_t n = 0; n < torque.size(); ++n) torque[n] += next.torque[n];
    virial += next.virial;
    bond_force += next.bond_force;
    n_bonds += next.n_bonds;
    if (crossing < 0) crossing = next.crossing;
    if (unconverged < 0) unconverged = next.unconverged;
  }

 private:
  /// Inlined: evaluations of spheres were slower with a call for each block (iteration_cost.py).
  template <bool VIRIAL> [[gnu::always_inline]] void add_block(const ContactBlock<D> &block)
  {
    const std::uint64_t bits = block.touching & ~block.alone;
    const bool any_turns = !torque.empty();
    S energy_so_far = energy, bond_force_so_far = bond_force;
    Vec<D * D, S> virial_so_far = virial;
    block.for_each(bits, [&](int k) {
      const int i = block.i[k], j = block.j[k];
      energy_so_far += block.energy[k];
      bond_force_so_far += block.bond_force[k];
      const Vec<D> on_i = block.force_of(k);
      add_force(i, j, on_i);
      if constexpr (VIRIAL) add_virial(block.separation_of(k), on_i, virial_so_far);
      if (any_turns) add_torques(i, j, block.torque_i_of(k), block.torque_j_of(k));
    });
    energy = energy_so_far;
    bond_force = bond_force_so_far;
    virial = virial_so_far;
    n_bonds += __builtin_popcountll(bits) + __builtin_popcountll(bits & block.two_bonds);
  }

  void add_torques(std::size_t i, std::size_t j, const Torque<D, S> &on_i, const Torque<D, S> &on_j)
  {
    torque[i] += on_i;
    torque[j] += on_j;
  }

  void add_force(std::size_t i, std::size_t j, const Vec<D, S> &on_i)
  {
    force[i] += on_i;
    force[j] -= on_i;
  }

  static void add_virial(const Vec<D, S> &r, const Vec<D, S> &on_i, Vec<D * D, S> &to)
  {
    for (int a = 0; a < D; ++a) {
      for (int b = 0; b < D; ++b) to[D * a + b] += r[a] * on_i[b];
    }
  }
};

/// The function that finds the contacts of these pairs in packs; null if pairs are evaluated one by
/// one, as without shortcuts.
template <class Pairs> FindContacts<typename Pairs::Model, Pairs::D> *packs_for(const Pairs &pairs)
{
  if (!pairs.any_law().shortcuts || !pairs.packs_take_all()) return nullptr;
  return PacksOf<typename Pairs::Model, Pairs::D>::of(required_instruction_set());
}

/// Near pairs of a list, in a block, with the number of each.
template <class Pairs> class NumberedBlock {
 public:
  using Model = typename Pairs::Model;
  using Start = typename Pairs::Start;
  static constexpr int D = Pairs::D;
  static constexpr bool HAS_START = !std::is_same_v<Start, NoStart>;

  /// Contacts start from the previous ones, and store where they end, if `starts` is given.
  NumberedBlock(const Pairs &posed, Start *of_pairs) :
      pairs(posed), starts(posed.any_turns() ? of_pairs : nullptr)
  {
    block.turns = posed.any_turns();
  }

  bool is_empty() const { return block.n == 0; }

  /// Takes as many near pairs as fit from the first on, within a margin if given; returns where to
  /// resume.
  template <class... Margin> std::size_t fill(const Range &from, Margin... margin)
  {
    block.n = 0;
    const std::size_t next = pairs.fill(from, block, number, margin...);
    for (int k = 0; k < block.n; ++k) block.k_e[k] = pairs.law(number[k]).bond.k_e;
    if constexpr (HAS_START) {
      for (int k = 0; starts != nullptr && k < block.n; ++k) block.set_start(k, starts[number[k]]);
    }
    return next;
  }

  /// Calls `keep(p)` in order for those whose surfaces may be closer than a margin.
  template <class Keep>
  void each_closer(double margin, FindContacts<Model, D> &find, const Keep &keep)
  {
    block.margin = margin;
    find(pairs.bodies(), Model::law({1.0}, Sides::ONE), block);
    block.for_each(block.touching, [&](int k) { keep(number[k]); });
  }

  void add_to(PairSums<D, double> &sums, FindContacts<Model, D> &find)
  {
    find(pairs.bodies(), pairs.any_law(), block);
    sums.add(block);
    if constexpr (HAS_START) {
      for (int k = 0; starts != nullptr && k < block.n; ++k) starts[number[k]] = block.start_of(k);
    }
    block.for_each(block.alone, [&](int k) {
      const std::size_t p = number[k];
      const Vec<D> r = block.separation_of(k);
      sums.add(pairs, p, r, contact_in(pairs, p, r, starts == nullptr ? nullptr : starts + p));
    });
  }

 private:
  const Pairs &pairs;
  Start *starts;
  ContactBlock<D> block;
  int number[ContactBlock<D>::MOST];
};

/// Calls `keep(p)` in order for the pairs whose surfaces may be closer than a margin.
template <class Pairs, class Keep>
void each_closer(const Pairs &posed, double margin, const Keep &keep)
{
  if constexpr (PacksOf<typename Pairs::Model, Pairs::D>::CHOOSE) {
    if (auto *const find = packs_for(posed)) {
      NumberedBlock<Pairs> block(posed, nullptr);
      for (std::size_t p = 0; p < posed.size();) {
        p = block.fill({p, posed.size()}, margin);
        if (!block.is_empty()) block.each_closer(margin, *find, keep);
      }
      return;
    }
  }
  for (std::size_t p = 0; p < posed.size(); ++p) {
    if (posed.are_closer(p, margin)) keep(p);
  }
}

/// Sums over a range of pairs. Contacts start from the previous ones of these pairs, if given.
template <class Pairs>
void sum_part(PairSums<Pairs::D, typename Pairs::S> &sums, const Pairs &pairs, bool with_virial,
              typename Pairs::Start *starts, const Range &part)
{
  sums.clear(pairs.n_particles(), pairs.any_turns(), with_virial);
  if constexpr (std::is_same_v<typename Pairs::S, double> &&
                PacksOf<typename Pairs::Model, Pairs::D>::EXIST) {
    if (auto *const find = packs_for(pairs)) {
      NumberedBlock<Pairs> block(pairs, starts);
      for (std::size_t p = part.first; p < part.last;) {
        p = block.fill({p, part.last});
        if (!block.is_empty()) block.add_to(sums, *find);
      }
      return;
    }
  }
  for (std::size_t p = part.first; p < part.last; ++p) {
    const auto r = pairs.separation(p);
    if (!pairs.may_touch(p, r)) continue;
    sums.add(pairs, p, r, contact_in(pairs, p, r, starts == nullptr ? nullptr : starts + p));
  }
}

/// Sums over all pairs, by a team if there is one: in parts, added in their order. `parts` is work
/// space, kept from call to call; the first of them is the result.
template <class Pairs>
const PairSums<Pairs::D, typename Pairs::S> &
sum_over(std::vector<PairSums<Pairs::D, typename Pairs::S>> &parts, const Pairs &pairs,
         bool with_virial = true, typename Pairs::Start *starts = nullptr, Team *team = nullptr)
{
  parts.resize(parts_of(team));
  in_parts(team, pairs.size(), [&](std::size_t k, const Range &part) {
    sum_part(parts[k], pairs, with_virial, starts, part);
  });
  for (std::size_t k = 1; k < parts.size(); ++k) parts[0].add(parts[k]);
  return parts[0];
}

}  // namespace jamshape
