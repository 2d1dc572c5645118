#pragma once

#include "contact/math/vec.hpp"

#include <cstdint>

namespace jamshape {

/// Pairs of bodies whose contacts are computed together, in packs.
template <int D> struct ContactBlock {
  static constexpr int MOST = 64;

  /// Pair k: bodies i[k] and j[k], their separation and the k_e of their law.
  int n = 0, i[MOST], j[MOST];
  alignas(64) double separation[D][MOST];
  alignas(64) double k_e[MOST];
  double margin = 0.0;  // added to the distances of first touch, where only `touching` is needed
  bool turns = true;  // whether contacts can rotate any of the bodies: if not, torques may be unset

  /// One bit per pair: whether it touches, whether it is also `alone`, of a rare kind left to the
  /// code for single pairs, and whether it has two bonds. The members below are set for pairs that
  /// touch and are not alone.
  std::uint64_t touching, alone, two_bonds;
  alignas(64) double energy[MOST];
  alignas(64) double force[D][MOST];
  alignas(64) double torque_i[ROTATIONS<D>][MOST];
  alignas(64) double torque_j[ROTATIONS<D>][MOST];
  alignas(64) double bond_force[MOST];  // sum of the magnitudes

  /// Starts of the searches of all pairs, if given, and their ends, for shapes whose contacts need
  /// a search.
  bool has_starts = false;
  alignas(64) double start[D][MOST];

  void add(int first, int second, const Vec<D> &r, double stiffness)
  {
    put(first, second, r);
    k_e[n] = stiffness;
    ++n;
  }

  /// Writes what would be pair n except its k_e, without counting it.
  void put(int first, int second, const Vec<D> &r)
  {
    i[n] = first;
    j[n] = second;
    for (int a = 0; a < D; ++a) separation[a][n] = r[a];
  }

  /// Finds the contacts in packs of this many lanes: `lanes_of(block, first)` returns the
  /// lanes of the pairs of a block from `first` on, and each of `further_of` those of the
  /// pairs that the function before it left to it.
  template <class LanesOf, class... FurtherOf>
  void find(int lanes, const LanesOf &lanes_of, const FurtherOf &...further_of)
  {
    const std::uint64_t further = set_all(lanes, lanes_of);
    if constexpr (sizeof...(FurtherOf) > 0) {
      if (further == 0) return;
      ContactBlock others;
      for_each(further, [&](int k) { others.add(i[k], j[k], separation_of(k), k_e[k]); });
      others.find(lanes, further_of...);
      int from = 0;
      for_each(further, [&](int k) { copy(k, others, from++); });
    }
  }

  void set_start(int k, const Vec<D> &at)
  {
    has_starts = true;
    for (int a = 0; a < D; ++a) start[a][k] = at[a];
  }
  Vec<D> start_of(int k) const { return of_pair<D>(start, k); }

  Vec<D> separation_of(int k) const { return of_pair<D>(separation, k); }
  Vec<D> force_of(int k) const { return of_pair<D>(force, k); }
  Torque<D> torque_i_of(int k) const { return of_pair<ROTATIONS<D>>(torque_i, k); }
  Torque<D> torque_j_of(int k) const { return of_pair<ROTATIONS<D>>(torque_j, k); }

  /// Calls `visit(k)` for the pairs whose bits are set, in order.
  template <class Visit> static void for_each(std::uint64_t bits, const Visit &visit)
  {
    for (; bits != 0; bits &= bits - 1) visit(__builtin_ctzll(bits));
  }

 private:
  /// Returns the pairs left to a further function.
  template <class LanesOf> std::uint64_t set_all(int lanes, const LanesOf &lanes_of)
  {
    fill_up(lanes);
    std::uint64_t further = touching = alone = two_bonds = 0;
    for (int first = 0; first < n; first += lanes) {
      const auto found = lanes_of(*this, first);
      set(first, found);
      further |= std::uint64_t{bits_of(found.further)} << first;
    }
    const std::uint64_t asked = ~std::uint64_t{0} >> (MOST - n);
    touching &= asked;
    alone &= asked;
    return further & asked;
  }

  /// Repeats the last pair to fill the remaining lanes of a pack.
  void fill_up(int lanes)
  {
    for (int k = n; k % lanes != 0; ++k) {
      i[k] = i[n - 1];
      j[k] = j[n - 1];
      for (int a = 0; a < D; ++a) separation[a][k] = separation[a][n - 1];
      for (int a = 0; has_starts && a < D; ++a) start[a][k] = start[a][n - 1];
      k_e[k] = k_e[n - 1];
    }
  }

  template <class Lanes> void set(int first, const Lanes &found)
  {
    touching |= std::uint64_t{bits_of(found.touching)} << first;
    alone |= std::uint64_t{bits_of(found.alone)} << first;
    two_bonds |= std::uint64_t{bits_of(found.two_bonds)} << first;
    found.energy.store(energy + first);
    found.bond_force.store(bond_force + first);
    for (int a = 0; a < D; ++a) found.force[a].store(force[a] + first);
    if constexpr (Lanes::HAS_TORQUES) {
      for (int a = 0; a < ROTATIONS<D>; ++a) {
        found.torque_i[a].store(torque_i[a] + first);
        found.torque_j[a].store(torque_j[a] + first);
      }
    }
  }

  /// Takes pair k from another block.
  void copy(int k, const ContactBlock &other, int from)
  {
    const auto take = [&](std::uint64_t &bits, std::uint64_t of_other) {
      const std::uint64_t here = std::uint64_t{1} << k;
      bits = (bits & ~here) | ((of_other >> from & 1) << k);
    };
    take(touching, other.touching);
    take(alone, other.alone);
    take(two_bonds, other.two_bonds);
    energy[k] = other.energy[from];
    bond_force[k] = other.bond_force[from];
    for (int a = 0; a < D; ++a) force[a][k] = other.force[a][from];
    for (int a = 0; a < ROTATIONS<D>; ++a) {
      torque_i[a][k] = other.torque_i[a][from];
      torque_j[a][k] = other.torque_j[a][from];
    }
  }

  template <int N> static Vec<N> of_pair(const double (&values)[N][MOST], int k)
  {
    Vec<N> v;
    for (int a = 0; a < N; ++a) v[a] = values[a][k];
    return v;
  }
};

}  // namespace jamshape
