#pragma once

#include "contact/contact.hpp"
#include "contact/pair_derivatives.hpp"
#include "contact/rotation.hpp"
#include "contact/vec.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
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
      shapes(particle_shapes), poses(at), pairs(list), law(contact_law),
      orientation(particle_shapes.size())
  {
    for (std::size_t n = 0; n < shapes.size(); ++n) orientation[n] = orientation_of(n);
  }

  std::size_t size() const { return pairs.n; }
  std::size_t first(std::size_t p) const { return pairs.particles[2 * p]; }
  std::size_t second(std::size_t p) const { return pairs.particles[2 * p + 1]; }

  PosedPair<Model, D, S> at(std::size_t p) const
  {
    const std::size_t i = first(p), j = second(p);
    return {shapes[i], shapes[j], separation(p), orientation[i], orientation[j], law};
  }

 private:
  using Long = long double;
  const std::vector<typename Model::Shape> &shapes;
  SplitPoses poses;
  PairList pairs;
  typename Model::Law law;
  std::vector<QuaternionOf<S>> orientation;

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

  QuaternionOf<S> orientation_of(std::size_t n) const
  {
    const auto component = [&](std::size_t index) {
      return static_cast<Long>(poses.orientation[0][index]) + poses.orientation[1][index];
    };
    if constexpr (D == 2) {
      const Long half = 0.5 * component(n);
      return {static_cast<S>(std::cos(half)), S(0.0), S(0.0), static_cast<S>(std::sin(half))};
    } else {
      const QuaternionOf<Long> q = normalized(QuaternionOf<Long>{
          component(4 * n), component(4 * n + 1), component(4 * n + 2), component(4 * n + 3)});
      return {static_cast<S>(q.w), static_cast<S>(q.i), static_cast<S>(q.j), static_cast<S>(q.k)};
    }
  }
};

/// Sums over all pairs.
template <int D, class S> struct PairSums {
  S energy = 0.0;
  std::vector<Vec<D, S>> force;
  std::vector<Torque<D, S>> torque;
  Vec<D * D, S> virial{};  // sum of r (x) force on i
  S bond_force = 0.0;      // sum of the magnitudes
  std::size_t n_bonds = 0;
  double error = 0.0;              // the largest of a contact
  std::size_t crossing = NONE;     // the first pair of this status
  std::size_t unconverged = NONE;  // likewise

  static constexpr std::size_t NONE = static_cast<std::size_t>(-1);
};

template <class Model, int D, class S>
PairSums<D, S> sum_over(const PosedPairs<Model, D, S> &pairs, std::size_t n_particles)
{
  PairSums<D, S> sums;
  sums.force.assign(n_particles, Vec<D, S>{});
  sums.torque.assign(n_particles, Torque<D, S>{});
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const PosedPair<Model, D, S> pair = pairs.at(p);
    const Contact<D, S> contact = contact_at(pair);
    if (contact.status == ContactStatus::APART) continue;
    if (contact.status != ContactStatus::TOUCHING) {
      const bool is_crossing = contact.status == ContactStatus::CROSSING;
      std::size_t &first = is_crossing ? sums.crossing : sums.unconverged;
      if (first == PairSums<D, S>::NONE) first = p;
      continue;
    }
    sums.energy += contact.energy;
    sums.force[pairs.first(p)] += contact.force;
    sums.force[pairs.second(p)] -= contact.force;
    sums.torque[pairs.first(p)] += contact.torque_i;
    sums.torque[pairs.second(p)] += contact.torque_j;
    for (int a = 0; a < D; ++a) {
      for (int b = 0; b < D; ++b) sums.virial[D * a + b] += pair.r[a] * contact.force[b];
    }
    for (int b = 0; b < contact.n_bonds; ++b) sums.bond_force += norm(contact.bond[b].force);
    sums.n_bonds += contact.n_bonds;
    sums.error = std::max(sums.error, contact.error);
  }
  return sums;
}

}  // namespace jamshape
