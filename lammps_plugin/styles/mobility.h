#pragma once

#include "contact/host_spin.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include "atom.h"
#include "domain.h"
#include "pointers.h"

#include <vector>

namespace jamshape {

class PairContact;

/// Velocity and angular velocity of a particle relative to the affine motion, in space coordinates;
/// in 2D without the components that are zero.
template <int D> struct RateIn {
  Vec<D> shift;
  Torque<D> turn;
};
using Rate = RateIn<3>;

/// Rates as rows of 3 numbers in 2D, 6 in 3D.
inline int rate_width(int dimension) { return dimension == 2 ? 3 : 6; }
template <int D> RateIn<D> read_rate(const double *from)
{
  RateIn<D> rate;
  for (int k = 0; k < D; ++k) rate.shift[k] = from[k];
  for (int k = 0; k < ROTATIONS<D>; ++k) rate.turn[k] = from[D + k];
  return rate;
}
template <int D> void write_rate(double *to, const RateIn<D> &rate)
{
  for (int k = 0; k < D; ++k) to[k] = rate.shift[k];
  for (int k = 0; k < ROTATIONS<D>; ++k) to[D + k] = rate.turn[k];
}
/// The same if the dimension is known at run time only.
Rate read_rate(const double *from, int dimension);
void write_rate(double *to, const Rate &rate, int dimension);

/// Motion of the particles of this rank due to forces against the drag of the substrate (Marschall
/// & Teitel 2018, Eqs. 8-12).
class Mobilities : protected LAMMPS_NS::Pointers {
 public:
  Mobilities(LAMMPS_NS::LAMMPS *lmp, double k_d) :
      Pointers(lmp), drag(k_d), is_plane(domain->dimension == 2), pair(nullptr)
  {
  }

  /// Mobility of one kind of particle.
  struct Mobility {
    double shift;
    Vec<3> turn;        // per body axis
    Vec<3> bretherton;  // per body axis: response to the host's strain, 0 if round about the axis
    double shortest;    // semi-axis, or the rim if that is narrower
    double longest;     // largest distance of the surface from the centre
    double gyration;    // length that one radian stands for
  };

  /// Reads the sizes of own atoms; after every exchange of atoms. Stops with an error at an atom
  /// without a shape, which may have been added meanwhile.
  void measure(const PairContact &of);
  const Mobility &operator[](int i) const { return kinds[kind[i]]; }
  const std::vector<Mobility> &all_kinds() const { return kinds; }
  int n_measured() const { return static_cast<int>(kind.size()); }

  /// The rate due to a force and torque, the rate due to the present ones, and the force and torque
  /// (stored as a rate) that cause a rate.
  Rate times(int i, const Vec<3> &force, const Vec<3> &torque) const
  {
    const Mobility &m = (*this)[i];
    if (is_plane) return {m.shift * force, {{0.0, 0.0, m.turn[2] * torque[2]}}};
    return {m.shift * force, turn_in_space(i, torque)};
  }
  Rate present_rate(int i) const
  {
    const double *const f = atom->f[i], *const t = atom->torque[i];
    return times(i, {{f[0], f[1], f[2]}}, {{t[0], t[1], t[2]}});
  }
  template <int D> RateIn<D> present_rate_in(int i) const
  {
    if constexpr (D == 3) {
      return present_rate(i);
    } else {
      const Mobility &m = (*this)[i];
      const double *const f = atom->f[i];
      return {{{m.shift * f[0], m.shift * f[1]}}, {{m.turn[2] * atom->torque[i][2]}}};
    }
  }
  Rate resistance_times(int i, const Rate &rate) const;

  double memory_usage() const;

 private:
  const double drag;
  const bool is_plane;
  const PairContact *pair;
  std::vector<Mobility> kinds;
  std::vector<int> kind;  // of own atoms

  Vec<3> turn_in_space(int i, const Vec<3> &torque) const;
  Mobility mobility_of(const Vec<3> &semi_axes, int type) const;
};

}  // namespace jamshape
