#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/upper.hpp"
#include "contact/math/vec.hpp"

namespace jamshape {

/// Bretherton parameter for each body axis, how strongly the host's strain rotates a particle about
/// it, from the mean squared distances from the axes (moments over area or volume): 0 for shapes
/// that are round about the axis, and for axes without rotation.
inline Vec<3> bretherton_parameters(const Vec<3> &moment)
{
  Vec<3> found{};
  for (int k = 0; k < 3; ++k) {
    // M_l - M_m of the other two axes, from the moments about them.
    if (moment[k] > 0.0) {
      found[k] = (moment[(k + 2) % 3] - moment[(k + 1) % 3]) / moment[k];
    }
  }
  return found;
}

/// Angular velocity of a torque-free particle in a host of velocity gradient G: the drag on its
/// surface elements balances for <s x G s> over <s^2 - (s.e)^2> about each body axis e, s from its
/// centre. This is Jeffery's equation, half the vorticity plus a fraction B of the strain rate,
/// with the Bretherton parameter B = (M_2 - M_3) / (M_2 + M_3) about axis 1, M_k the mean of s_k^2.
template <int D>
Torque<D> host_spin(const Upper &gradient, const Vec<3> &bretherton, const Quaternion &q)
{
  const Upper &g = gradient;
  if constexpr (D == 2) {
    const Vec<2> u = long_axis<2>(q);
    const double stretch = (g.diagonal[1] - g.diagonal[0]) * u[0] * u[1];
    const double shear = 0.5 * g.xy * (u[0] - u[1]) * (u[0] + u[1]);
    return {{-0.5 * g.xy + bretherton[2] * (stretch + shear)}};
  } else {
    Vec<3> spin{{-0.5 * g.yz, 0.5 * g.xz, -0.5 * g.xy}};
    Vec<3> axis[3], moved[3];
    for (int k = 0; k < 3; ++k) {
      axis[k] = body_axis(q, k);
      moved[k] = g * axis[k];
    }
    for (int k = 0; k < 3; ++k) {
      const int l = (k + 1) % 3, m = (k + 2) % 3;
      const double strain = 0.5 * (dot(axis[l], moved[m]) + dot(axis[m], moved[l]));
      spin += (bretherton[k] * strain) * axis[k];
    }
    return spin;
  }
}

}  // namespace jamshape
