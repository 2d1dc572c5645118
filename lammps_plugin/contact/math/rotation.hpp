#pragma once

#include "contact/math/vec.hpp"

#include <cmath>
#include <type_traits>

namespace jamshape {

/// Unit quaternion, w first as in LAMMPS; rotates body coordinates into space coordinates.
template <class S> struct QuaternionOf {
  S w, i, j, k;
};
using Quaternion = QuaternionOf<double>;

template <class S> QuaternionOf<S> operator*(const QuaternionOf<S> &p, const QuaternionOf<S> &q)
{
  return {
      p.w * q.w - p.i * q.i - p.j * q.j - p.k * q.k, p.w * q.i + p.i * q.w + p.j * q.k - p.k * q.j,
      p.w * q.j - p.i * q.k + p.j * q.w + p.k * q.i, p.w * q.k + p.i * q.j - p.j * q.i + p.k * q.w};
}

template <class S> QuaternionOf<S> normalized(const QuaternionOf<S> &q)
{
  const S inverse = 1.0 / sqrt(q.w * q.w + q.i * q.i + q.j * q.j + q.k * q.k);
  return {inverse * q.w, inverse * q.i, inverse * q.j, inverse * q.k};
}

/// The same for a quaternion whose length is off by rounding: its series needs neither a root nor a
/// division.
template <class S> QuaternionOf<S> renormalized(const QuaternionOf<S> &q)
{
  const S excess = q.w * q.w + q.i * q.i + q.j * q.j + q.k * q.k - 1.0;
  if (!(abs(excess) < 1e-8)) return normalized(q);
  const S inverse = 1.0 - excess * (0.5 - 0.375 * excess);
  return {inverse * q.w, inverse * q.i, inverse * q.j, inverse * q.k};
}

/// Body axis `b` (0, 1, 2 for x, y, z) in space coordinates.
template <class S> Vec<3, S> body_axis(const QuaternionOf<S> &q, int b)
{
  switch (b) {
    case 0:
      return {{q.w * q.w + q.i * q.i - q.j * q.j - q.k * q.k, 2.0 * (q.i * q.j + q.w * q.k),
               2.0 * (q.i * q.k - q.w * q.j)}};
    case 1:
      return {{2.0 * (q.i * q.j - q.w * q.k), q.w * q.w - q.i * q.i + q.j * q.j - q.k * q.k,
               2.0 * (q.j * q.k + q.w * q.i)}};
    default:
      return {{2.0 * (q.i * q.k + q.w * q.j), 2.0 * (q.j * q.k - q.w * q.i),
               q.w * q.w - q.i * q.i - q.j * q.j + q.k * q.k}};
  }
}

/// The long axis of a particle: the body's x. In 2D the quaternion is a rotation about z only.
template <int D, class S> Vec<D, S> long_axis(const QuaternionOf<S> &q)
{
  if constexpr (D == 2) {
    return {{(q.w - q.k) * (q.w + q.k), 2.0 * q.w * q.k}};
  } else {
    return body_axis(q, 0);
  }
}

template <class S> struct CosSin {
  S cosine, sine;
};

/// Cosine and sine together; the rotations of one step of a slow flow are so small that a series is
/// exact to double precision.
template <class S> CosSin<S> cos_sin(S x)
{
  if (!std::is_same_v<S, double> || std::abs(x) > 0.01) return {std::cos(x), std::sin(x)};
  const S y = x * x;
  return {1.0 - y * (1.0 / 2 - y * (1.0 / 24 - y * (1.0 / 720))),
          x * (1.0 - y * (1.0 / 6 - y * (1.0 / 120 - y * (1.0 / 5040))))};
}

/// Rotation by the angle |v| about v, in space coordinates.
template <class S> QuaternionOf<S> rotation_by(const Vec<3, S> &v)
{
  const S angle = norm(v);
  const CosSin<S> half = cos_sin(S(0.5) * angle);
  const S factor = angle > 0.0 ? half.sine / angle : S(0.5);
  return {half.cosine, factor * v[0], factor * v[1], factor * v[2]};
}
template <class S> QuaternionOf<S> rotation_by(const Vec<1, S> &v)
{
  const CosSin<S> half = cos_sin(S(0.5) * v[0]);
  return {half.cosine, S(0.0), S(0.0), half.sine};
}

/// `q` rotated by the rotation vector `v`. A rotation of zero returns `q` exactly.
template <int M, class S> QuaternionOf<S> turned(const QuaternionOf<S> &q, const Vec<M, S> &v)
{
  if (norm_sq(v) == 0.0) return q;
  return renormalized(rotation_by(v) * q);
}
/// In the plane, where q is a rotation about z.
template <class S> QuaternionOf<S> turned(const QuaternionOf<S> &q, const Vec<1, S> &v)
{
  if (v[0] == 0.0) return q;
  const CosSin<S> half = cos_sin(S(0.5) * v[0]);
  return renormalized(QuaternionOf<S>{half.cosine * q.w - half.sine * q.k, S(0.0), S(0.0),
                                      half.cosine * q.k + half.sine * q.w});
}

/// Inverse of rotation_by: the rotation vector of `q`, of length at most pi.
inline Vec<3> rotation_vector(const Quaternion &q)
{
  const Vec<3> v = q.w < 0.0 ? Vec<3>{{-q.i, -q.j, -q.k}} : Vec<3>{{q.i, q.j, q.k}};
  const double half_sine = norm(v);
  const double half_angle = std::atan2(half_sine, std::abs(q.w));
  return (half_sine > 1e-8 ? 2.0 * half_angle / half_sine : 2.0) * v;
}

/// Derivative of an energy with respect to the rotation vector v of the orientation, from the
/// torque there: J(v)^T torque, J the left Jacobian of SO(3).
inline Vec<3> torque_on_rotation_vector(const Vec<3> &v, const Vec<3> &torque)
{
  const double angle = norm(v);
  // Near zero the closed forms lose all digits to cancellation; their series do not.
  const double first = angle > 1e-4 ? (1.0 - std::cos(angle)) / (angle * angle) : 0.5;
  const double second = angle > 1e-2 ? (angle - std::sin(angle)) / (angle * angle * angle)
                                     : 1.0 / 6.0 - angle * angle / 120.0;
  const Vec<3> once = cross(v, torque);
  return torque - first * once + second * cross(v, once);
}

}  // namespace jamshape
