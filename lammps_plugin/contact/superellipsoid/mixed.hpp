#pragma once

#include "contact/math/vec.hpp"
#include "contact/superellipsoid/equations.hpp"
#include "contact/superellipsoid/shape.hpp"

#include <algorithm>

namespace jamshape {

namespace detail {

/// The surface of a body in 3D, scaled, in coordinates u in which point and normal are both
/// smooth, and homogeneous: of degree 1 and 0. These are a point, or a normal, or, if one exponent
/// is below 2 and the other above, across z what belongs to a normal and along z what belongs to a
/// point, or the reverse. With rho the norm of (u_x, u_y) that is smooth, L that of (rho, u_z),
///     direct = (rho grad rho, u_z),    dual = grad L with (u_x, u_y) / rho in place of grad rho
/// are vectors of which one is the point and the other the normal.
template <class S> class SmoothSurface {
 public:
  using T = ValueOf<S>;
  using Power = Common<T>;
  using Body = SuperellipsoidBody<3, S>;

  SmoothSurface(const Body &of, const Powers<Power> &powers) :
      body(&of), by(coordinates_of(of)),
      whole(by == Coordinates::NORMAL ? PowerNorm<3, S>::support(of, powers)
                                      : PowerNorm<3, S>::gauge(of, powers)),
      is_direct_point(of.p > 1.0), axis(powers.axis), axis_less(powers.axis - 1),
      across(powers.across), across_less(powers.across - 1), dual_across(1 / powers.across),
      dual_across_less(1 / powers.across - 1)
  {
    for (int k = 0; k < 3; ++k) {
      const bool is_point = (k == 2) == is_direct_point;
      scale[k] = is_point ? 1 / T(of.semi_axes[k]) : T(of.semi_axes[k]);
    }
  }

  /// The body is scaled by `scale`; h(normal) = 1, normal.point = scale.
  struct At {
    S scale;
    Vec<3, S> point, normal;
  };
  At at(const Vec<3, S> &u) const
  {
    if (by == Coordinates::POINT) {
      const auto g = whole.at(u);
      return {g.value, u, g.gradient};
    }
    if (by == Coordinates::NORMAL) {
      const auto h = whole.at(u);
      return {h.value, h.value * h.gradient, (S(T(1.0)) / h.value) * u};
    }
    const Mixed<S> of = mixed<false, S>(components<S>(u));
    const Vec<3, S> direct = in_space(of.direct), dual = in_space(of.dual);
    if (is_direct_point) return {of.L, direct, dual};
    return {of.L, of.L * dual, (S(T(1.0)) / of.L) * direct};
  }

  /// First derivatives with respect to u, of plain numbers.
  struct Slopes {
    Vec<3, T> scale;
    Matrix<3, T> point, normal;
  };
  Slopes slopes_at(const Vec<3, T> &u) const
  {
    if (by == Coordinates::MIXED) return mixed_slopes(components<T>(u));
    const auto at = whole.curved_at(u);
    const Vec<3, T> &slope = at.gradient;
    Slopes of{slope, {}, {}};
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        const T unit = T(a == b);
        const bool is_point = by == Coordinates::POINT;
        of.point.row[a][b] = is_point ? unit : slope[a] * slope[b] + at.value * at.hessian[a][b];
        of.normal.row[a][b] =
            is_point ? at.hessian[a][b] : (unit - u[a] * slope[b] / at.value) / at.value;
      }
    }
    return of;
  }

  /// The coordinates of a point and its normal (of any length) on the body scaled by `scale`.
  Vec<3, T> start(const Vec<3, T> &point, const Vec<3, T> &normal, const T &of_scale) const
  {
    if (by == Coordinates::POINT) return point;
    const T length = of_scale / PowerNorm<3, T>::support(*body).value(normal);
    if (by == Coordinates::NORMAL) return length * normal;
    const Vec<3, T> x = components<T>(point), n = components<T>(length * normal);
    const Vec<3, T> &direct = is_direct_point ? x : n, &dual = is_direct_point ? n : x;
    const auto wanted = FlatNorm<2, T>::template at<false, true>(
        {direct[0] / scale[0], direct[1] / scale[1]}, {1 / scale[0], 1 / scale[1]}, dual_across,
        dual_across_less);
    const T rho = wanted.norm, found = inner<false, T>(dual).norm;
    Vec<3, T> u{{rho * wanted.gradient[0], rho * wanted.gradient[1], direct[2]}};
    if (found > T(VANISHING)) {
      for (int k = 0; k < 2; ++k) u[k] = rho / found * dual[k];
    }
    return in_space(u);
  }

 private:
  const Body *body;
  Coordinates by;
  PowerNorm<3, S> whole;
  bool is_direct_point;
  Exponent<Power> axis, axis_less, across, across_less, dual_across, dual_across_less;
  Vec<3, T> scale;

  template <class R> Vec<3, R> components(const Vec<3, R> &u) const
  {
    return {{dot(body->axis[0], u), dot(body->axis[1], u), dot(body->axis[2], u)}};
  }
  template <class R> Vec<3, R> in_space(const Vec<3, R> &v) const
  {
    return v[0] * body->axis[0] + v[1] * body->axis[1] + v[2] * body->axis[2];
  }

  template <bool CURVED, class R> FlatNorm<2, R> inner(const Vec<3, R> &v) const
  {
    const T scales[2] = {scale[0], scale[1]};
    return FlatNorm<2, R>::template at<CURVED, true>({scale[0] * v[0], scale[1] * v[1]}, scales,
                                                     across, across_less);
  }

  template <class R> struct Mixed {
    FlatNorm<2, R> inner, outer;
    R L;
    Vec<3, R> direct, dual;
  };

  template <bool CURVED, class R> Mixed<R> mixed(const Vec<3, R> &v) const
  {
    Mixed<R> of;
    of.inner = inner<CURVED, R>(v);
    const T scales[2] = {T(1.0), scale[2]};
    of.outer = FlatNorm<2, R>::template at<CURVED, false>({of.inner.norm, scale[2] * v[2]}, scales,
                                                          axis, axis_less);
    of.L = of.outer.norm;
    const R rho = of.inner.norm;
    for (int k = 0; k < 2; ++k) {
      of.direct[k] = rho * of.inner.gradient[k];
      of.dual[k] = of.outer.gradient[0] * (v[k] / rho);
    }
    if (vanishes(of)) {
      const Matrix<2, T> bend = bend_at_pole();
      for (int k = 0; k < 2; ++k) of.direct[k] = bend.row[k][0] * v[0] + bend.row[k][1] * v[1];
    }
    of.direct[2] = v[2];
    of.dual[2] = of.outer.gradient[1];
    return of;
  }

  template <class R> static bool vanishes(const Mixed<R> &of)
  {
    return value_of(of.inner.norm) <= T(2 * VANISHING);
  }

  /// Second derivatives of rho^2 / 2, which depend on the direction alone.
  Matrix<2, T> bend_of(const FlatNorm<2, T> &rho) const
  {
    const T e = across.value();
    Matrix<2, T> bend;
    for (int k = 0; k < 2; ++k) {
      for (int l = 0; l < 2; ++l) {
        bend.row[k][l] = (1 - e) * rho.gradient[k] * rho.gradient[l];
        if (k == l) bend.row[k][l] += e * rho.bend[k];
      }
    }
    return bend;
  }
  /// At the pole, where they are not defined: those between the axes, which are not singular.
  Matrix<2, T> bend_at_pole() const
  {
    return bend_of(inner<true, T>(Vec<3, T>{{1 / scale[0], 1 / scale[1], T(0.0)}}));
  }

  Slopes mixed_slopes(const Vec<3, T> &v) const
  {
    const Mixed<T> of = mixed<true, T>(v);
    const T e = axis.value(), L = of.L, rho = of.inner.norm;
    const Matrix<2, T> bend = vanishes(of) ? bend_at_pole() : bend_of(of.inner);
    const T by_rho = of.outer.gradient[0], share = of.outer.bend[0] / L;
    const Vec<3, T> slope{
        {by_rho * of.inner.gradient[0], by_rho * of.inner.gradient[1], of.outer.gradient[1]}};
    Matrix<3, T> direct{}, dual{};
    for (int k = 0; k < 2; ++k) {
      for (int l = 0; l < 2; ++l) {
        direct.row[k][l] = bend.row[k][l];
        dual.row[k][l] = share * (T(k == l) + (e - 1) * (v[k] / rho) * of.inner.gradient[l]);
      }
    }
    direct.row[2][2] = 1;
    dual.row[2][2] = e / L * of.outer.bend[1];
    for (int k = 0; k < 3; ++k) {
      for (int l = 0; l < 3; ++l) dual.row[k][l] -= e / L * of.dual[k] * slope[l];
    }
    Matrix<3, T> point = direct, normal = dual;
    if (!is_direct_point) {
      for (int k = 0; k < 3; ++k) {
        for (int l = 0; l < 3; ++l) {
          point.row[k][l] = of.dual[k] * slope[l] + L * dual.row[k][l];
          normal.row[k][l] = (direct.row[k][l] - of.direct[k] * slope[l] / L) / L;
        }
      }
    }
    return {in_space(slope), turned(point), turned(normal)};
  }

  Matrix<3, T> turned(const Matrix<3, T> &a) const
  {
    Matrix<3, T> in_space{};
    for (int k = 0; k < 3; ++k) {
      for (int l = 0; l < 3; ++l) {
        for (int row = 0; row < 3; ++row) {
          for (int col = 0; col < 3; ++col) {
            in_space.row[row][col] += body->axis[k][row] * a.row[k][l] * body->axis[l][col];
          }
        }
      }
    }
    return in_space;
  }
};

/// Two bodies in 3D, each in its own smooth coordinates. Unknowns are these and a weight w: points
/// of both bodies, at the same scale, add up to r, and w n_i = (1 - w) n_j.
template <class S> class ByBoth {
 public:
  static constexpr int M = 7;
  using T = ValueOf<S>;

  explicit ByBoth(const TangencyProblem<3, S> &p) :
      r(p.r), length(value_of(norm(p.r))), surface_i(p.i, p.powers_i), surface_j(p.j, p.powers_j)
  {
  }

  Vec<M, S> residual(const Vec<M, S> &z) const
  {
    return residual_of(z[M - 1], surface_i.at(half(z, 0)), surface_j.at(half(z, 3)));
  }

  Linearised<M, T> linearised(const Vec<M, T> &z) const
  {
    const auto i = surface_i.at(half(z, 0)), j = surface_j.at(half(z, 3));
    const auto by_i = surface_i.slopes_at(half(z, 0)), by_j = surface_j.slopes_at(half(z, 3));
    const T w = z[M - 1];
    Linearised<M, T> at{};
    at.residual = residual_of(w, i, j);
    auto &row = at.jacobian.row;
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        row[a][b] = by_i.point.row[a][b] / length;
        row[a][3 + b] = by_j.point.row[a][b] / length;
        row[3 + a][b] = length * w * by_i.normal.row[a][b];
        row[3 + a][3 + b] = -length * (1 - w) * by_j.normal.row[a][b];
      }
      row[3 + a][M - 1] = length * (i.normal[a] + j.normal[a]);
      row[M - 1][a] = by_i.scale[a];
      row[M - 1][3 + a] = -by_j.scale[a];
    }
    return at;
  }

  static Vec<M, T> step(const Linearised<M, T> &at) { return solved(at.jacobian, at.residual); }

  static T unit(const Linearised<M, T> &) { return T(1); }

  /// Faces leave points, and tips normals, undetermined, but each determines the other.
  static constexpr bool MAY_BE_ILL_POSED = false;

  Vec<M, T> start(const Tangency<3, T> &from) const
  {
    const Vec<3, T> i = surface_i.start(from.point_i, from.normal, from.scale),
                    j = surface_j.start(from.point_j, from.normal, from.scale);
    const T n_i = norm(surface_i.at(i).normal), n_j = norm(surface_j.at(j).normal);
    return {{i[0], i[1], i[2], j[0], j[1], j[2], n_j / (n_i + n_j)}};
  }

  /// The length of w n_i.
  T weighted_normal(const Vec<M, T> &z) const
  {
    return z[M - 1] * norm(surface_i.at(half(z, 0)).normal);
  }

  Tangency<3, S> tangency(const Vec<M, S> &z) const
  {
    const auto i = surface_i.at(half(z, 0)), j = surface_j.at(half(z, 3));
    const S w = z[M - 1], v = S(T(1.0)) - w;
    const Vec<3, S> point = S(T(0.5)) * (i.point + (r - j.point));
    return {w * i.scale + v * j.scale, w * i.normal + v * j.normal, point, r - point};
  }

 private:
  Vec<3, S> r;
  T length;
  SmoothSurface<S> surface_i, surface_j;

  template <class R> static Vec<3, R> half(const Vec<M, R> &z, int first)
  {
    return {{z[first], z[first + 1], z[first + 2]}};
  }

  /// Without units.
  template <class At> Vec<M, S> residual_of(const S &w, const At &i, const At &j) const
  {
    const Vec<3, S> points = S(1 / length) * (i.point + j.point - r),
                    normals = S(length) * (w * i.normal - (S(T(1.0)) - w) * j.normal);
    return {
        {points[0], points[1], points[2], normals[0], normals[1], normals[2], i.scale - j.scale}};
  }
};

template <class Body> bool is_mixed(const Body &i, const Body &j)
{
  return coordinates_of(i) == Coordinates::MIXED || coordinates_of(j) == Coordinates::MIXED;
}

}  // namespace detail

}  // namespace jamshape
