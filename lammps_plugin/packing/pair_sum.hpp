#pragma once

#include "contact/contact.hpp"
#include "contact/contact_block.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"
#include "contact/packs.hpp"
#include "contact/pair_derivatives.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace jamshape {

/// Poses of N particles in a periodic box, every coordinate the sum of a double and its small rest:
/// overlaps are differences of coordinates, and a double of 40 diameters has lost their last eight
/// digits. Row-major views: [0] the doubles, [1] the rests.
struct SplitPoses {
  const double *position[2];     // (N, D)
  const double *orientation[2];  // (N,) angles in 2D, (N, 4) quaternions w i j k in 3D
  const double *edges[2];        // (D,)
};

/// Pairs that may touch: (M, 2) particles and (M, D) box edges to add to the second one's position.
struct PairList {
  std::size_t n;
  const std::int64_t *particles;
  const std::int64_t *shift;
};

/// Pairs of posed particles, in the scalar S. Separations are taken in long double whatever S is.
template <class Model, int D, class S> class PosedPairs {
 public:
  PosedPairs(const std::vector<typename Model::Shape> &particle_shapes, const SplitPoses &at,
             const PairList &list, const typename Model::Law &contact_law) :
      shapes(particle_shapes), poses(at), pairs(list), law(contact_law)
  {
    body.reserve(shapes.size());
    orientation.reserve(shapes.size());
    for (std::size_t n = 0; n < shapes.size(); ++n) {
      orientation.push_back(orientation_of(n));
      body.push_back(Model::template body<D, S>(shapes[n]));
      if (Model::template turns<D>(shapes[n]))
        Model::template turn_to<D, S>(body[n], orientation[n]);
    }
  }

  std::size_t size() const { return pairs.n; }
  std::size_t n_particles() const { return shapes.size(); }
  const typename Model::Law &contact_law() const { return law; }
  std::size_t first(std::size_t p) const { return pairs.particles[2 * p]; }
  std::size_t second(std::size_t p) const { return pairs.particles[2 * p + 1]; }

  /// x_i - x_j.
  Vec<D, S> separation(std::size_t p) const
  {
    const std::size_t i = first(p), j = second(p);
    Vec<D, S> r;
    for (int k = 0; k < D; ++k) {
      const Long turns = static_cast<Long>(pairs.shift[D * p + k]);
      Long difference = 0.0;
      for (int part = 0; part < 2; ++part) {
        const double *const x = poses.position[part];
        difference +=
            (static_cast<Long>(x[D * i + k]) - x[D * j + k]) - turns * poses.edges[part][k];
      }
      r[k] = static_cast<S>(difference);
    }
    return r;
  }

  /// The bodies of a pair of this separation, the second at the origin.
  typename Model::template Body<D, S> first_body(std::size_t p, const Vec<D, S> &r) const
  {
    auto body_i = body[first(p)];
    body_i.centre = r;
    return body_i;
  }
  const typename Model::template Body<D, S> &second_body(std::size_t p) const
  {
    return body[second(p)];
  }

  /// The contact of a pair of this separation.
  ContactOf<Model, D, S> contact(std::size_t p, const Vec<D, S> &r) const
  {
    return contact_of(first_body(p, r), second_body(p), law);
  }

  /// The same, begun where the pair's last one was.
  ContactOf<Model, D, S> contact(std::size_t p, const Vec<D, S> &r,
                                 typename Model::template Start<D> &start) const
  {
    return contact_from(first_body(p, r), second_body(p), law, start);
  }

  /// Whether packs know all of the shapes.
  bool packs_take_all() const
  {
    return std::all_of(shapes.begin(), shapes.end(), PacksOf<Model, D>::takes);
  }

  /// All at the origin.
  const typename Model::template Body<D, S> *bodies() const { return body.data(); }

  /// Whether surfaces may be closer than a margin.
  bool are_closer(std::size_t p, double margin) const
  {
    return Model::template closer_than<D>(margin, first_body(p, separation(p)), second_body(p));
  }

  /// Whether the particles share more than a point.
  bool overlap(std::size_t p) const
  {
    return are_overlapping(first_body(p, separation(p)), second_body(p));
  }

  /// A body that its rotation variables, from `first` on, turn.
  auto turned(std::size_t n, int first_variable) const
  {
    return turned_body<Model, D, S>(shapes[n], orientation[n], first_variable);
  }

 private:
  using Long = long double;
  const std::vector<typename Model::Shape> &shapes;
  SplitPoses poses;
  PairList pairs;
  typename Model::Law law;
  std::vector<QuaternionOf<S>> orientation;
  std::vector<typename Model::template Body<D, S>> body;  // at the origin

  QuaternionOf<S> orientation_of(std::size_t n) const
  {
    if constexpr (D == 2) {
      const S half = 0.5 * component<S>(n);
      return {std::cos(half), S(0.0), S(0.0), std::sin(half)};
    } else {
      const QuaternionOf<Long> q =
          normalized(QuaternionOf<Long>{component<Long>(4 * n), component<Long>(4 * n + 1),
                                        component<Long>(4 * n + 2), component<Long>(4 * n + 3)});
      return {static_cast<S>(q.w), static_cast<S>(q.i), static_cast<S>(q.j), static_cast<S>(q.k)};
    }
  }

  template <class T> T component(std::size_t index) const
  {
    return static_cast<T>(poses.orientation[0][index]) +
           static_cast<T>(poses.orientation[1][index]);
  }
};

/// The bodies of posed pairs in dual numbers, each once as the first and once as the second of a
/// pair.
template <class Model, int D, class S> class TurnedBodies {
 public:
  explicit TurnedBodies(const PosedPairs<Model, D, S> &posed) : pairs(posed)
  {
    as_i.reserve(pairs.n_particles());
    as_j.reserve(pairs.n_particles());
    for (std::size_t n = 0; n < pairs.n_particles(); ++n) {
      as_i.push_back(pairs.turned(n, FIRST_OF_I<D>));
      as_j.push_back(pairs.turned(n, FIRST_OF_J<D>));
    }
  }

  ContactOf<Model, D, Dual<PAIR_VARIABLES<D>, S>> contact(std::size_t p) const
  {
    auto body_i = as_i[pairs.first(p)];
    body_i.centre = as_variables<D, S>(pairs.separation(p));
    return contact_of(body_i, as_j[pairs.second(p)], pairs.contact_law());
  }

  /// The same, begun where the pair's last one was.
  ContactOf<Model, D, Dual<PAIR_VARIABLES<D>, S>>
  contact(std::size_t p, typename Model::template Start<D> &start) const
  {
    auto body_i = as_i[pairs.first(p)];
    body_i.centre = as_variables<D, S>(pairs.separation(p));
    return contact_from(body_i, as_j[pairs.second(p)], pairs.contact_law(), start);
  }

 private:
  const PosedPairs<Model, D, S> &pairs;
  std::vector<typename Model::template Body<D, Dual<PAIR_VARIABLES<D>, S>>> as_i, as_j;
};

/// Sums over all pairs.
template <int D, class S> struct PairSums {
  S energy = 0.0;
  std::vector<Vec<D, S>> force;
  std::vector<Torque<D, S>> torque;
  Vec<D * D, S> virial{};  // sum of r (x) force on i
  S bond_force = 0.0;      // sum of the magnitudes
  std::size_t n_bonds = 0;
  double error = 0.0;             // the largest of a contact
  std::int64_t crossing = -1;     // the first pair of this status, -1 for none
  std::int64_t unconverged = -1;  // likewise

  /// The contact of the p-th pair.
  template <class Model>
  void add(const PosedPairs<Model, D, S> &pairs, std::size_t p, const Vec<D, S> &r,
           const ContactOf<Model, D, S> &contact)
  {
    if (contact.status == ContactStatus::APART) return;
    if (contact.status != ContactStatus::TOUCHING) {
      const bool is_crossing = contact.status == ContactStatus::CROSSING;
      std::int64_t &first = is_crossing ? crossing : unconverged;
      if (first < 0) first = static_cast<std::int64_t>(p);
      return;
    }
    energy += contact.energy;
    add_force(pairs.first(p), pairs.second(p), r, contact.force);
    torque[pairs.first(p)] += contact.torque_i;
    torque[pairs.second(p)] += contact.torque_j;
    for (int b = 0; b < contact.n_bonds; ++b) bond_force += norm(contact.bond[b].force);
    n_bonds += contact.n_bonds;
    error = std::max(error, contact.error);
  }

  /// The k-th contact of a block, one that touches and is not alone.
  void add(const ContactBlock<D> &block, int k)
  {
    const int i = block.i[k], j = block.j[k];
    energy += block.energy[k];
    add_force(i, j, block.separation_of(k), block.force_of(k));
    torque[i] += block.torque_i_of(k);
    torque[j] += block.torque_j_of(k);
    bond_force += block.bond_force[k];
    n_bonds += 1 + (block.two_bonds >> k & 1);
    error = std::max(error, block.error[k]);
  }

 private:
  void add_force(std::size_t i, std::size_t j, const Vec<D, S> &r, const Vec<D, S> &on_i)
  {
    force[i] += on_i;
    force[j] -= on_i;
    for (int a = 0; a < D; ++a) {
      for (int b = 0; b < D; ++b) virial[D * a + b] += r[a] * on_i[b];
    }
  }
};

/// What finds the contacts of these pairs many at once; nothing where they go one by one.
template <class Model, int D>
FindContacts<Model, D> *packs_for(const PosedPairs<Model, D, double> &pairs)
{
  if (!pairs.packs_take_all()) return nullptr;
  return PacksOf<Model, D>::of(required_instruction_set());
}

/// Adds contacts many at once, from `starts` where they are given.
template <class Model, int D>
void add_blocks(PairSums<D, double> &sums, const PosedPairs<Model, D, double> &pairs,
                FindContacts<Model, D> &find, typename Model::template Start<D> *starts)
{
  constexpr bool HAS_START = !std::is_same_v<typename Model::template Start<D>, NoStart>;
  const typename Model::Law &law = pairs.contact_law();
  ContactBlock<D> block;
  for (std::size_t begin = 0; begin < pairs.size(); begin += block.MOST) {
    const std::size_t end = std::min(begin + block.MOST, pairs.size());
    block.n = 0;
    for (std::size_t p = begin; p < end; ++p) {
      const auto i = static_cast<int>(pairs.first(p)), j = static_cast<int>(pairs.second(p));
      if constexpr (HAS_START) {
        if (starts != nullptr) block.set_start(block.n, starts[p]);
      }
      block.add(i, j, pairs.separation(p), Model::k_e(law));
    }
    find(pairs.bodies(), law, block);
    block.for_each(block.touching & ~block.alone, [&](int k) { sums.add(block, k); });
    block.for_each(block.alone, [&](int k) {
      const std::size_t p = begin + k;
      const Vec<D> r = block.separation_of(k);
      sums.add(pairs, p, r, starts ? pairs.contact(p, r, starts[p]) : pairs.contact(p, r));
      if constexpr (HAS_START) {
        if (starts != nullptr) block.set_start(k, starts[p]);
      }
    });
    if constexpr (HAS_START) {
      for (int k = 0; starts != nullptr && k < block.n; ++k) starts[begin + k] = block.start_of(k);
    }
  }
}

/// Contacts begin where the last ones of these pairs were, if that is given (in doubles).
template <class Model, int D, class S>
PairSums<D, S> sum_over(const PosedPairs<Model, D, S> &pairs, std::size_t n_particles,
                        std::vector<typename Model::template Start<D>> *starts = nullptr)
{
  PairSums<D, S> sums;
  sums.force.assign(n_particles, Vec<D, S>{});
  sums.torque.assign(n_particles, Torque<D, S>{});
  if constexpr (std::is_same_v<S, double> && PacksOf<Model, D>::EXIST) {
    if (auto *const find = packs_for(pairs)) {
      add_blocks<Model, D>(sums, pairs, *find, starts == nullptr ? nullptr : starts->data());
      return sums;
    }
  }
  const auto contact_at = [&](std::size_t p, const Vec<D, S> &r) {
    if constexpr (std::is_same_v<S, double>) {
      if (starts != nullptr) return pairs.contact(p, r, (*starts)[p]);
    }
    return pairs.contact(p, r);
  };
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const Vec<D, S> r = pairs.separation(p);
    sums.add(pairs, p, r, contact_at(p, r));
  }
  return sums;
}

}  // namespace jamshape
