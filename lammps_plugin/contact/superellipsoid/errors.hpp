#pragma once

#include "contact/contact.hpp"
#include "contact/errors.hpp"
#include "contact/math/vec.hpp"
#include "contact/superellipsoid/equations.hpp"
#include "contact/superellipsoid/mixed.hpp"
#include "contact/superellipsoid/shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace jamshape {

namespace detail {

/// Matrices in the plane normal to a vector.
template <int D, class T> using AcrossMatrix = Matrix<D - 1, T>;

template <class T> Matrix<1, T> inverse(const Matrix<1, T> &a) { return {{{1 / a.row[0][0]}}}; }
template <class T> Matrix<2, T> inverse(const Matrix<2, T> &a)
{
  const T over = 1 / (a.row[0][0] * a.row[1][1] - a.row[0][1] * a.row[1][0]);
  return {{{over * a.row[1][1], -over * a.row[0][1]}, {-over * a.row[1][0], over * a.row[0][0]}}};
}

template <int M, class T> Matrix<M, T> product(const Matrix<M, T> &a, const Matrix<M, T> &b)
{
  Matrix<M, T> c{};
  for (int row = 0; row < M; ++row) {
    for (int col = 0; col < M; ++col) {
      for (int k = 0; k < M; ++k) c.row[row][col] += a.row[row][k] * b.row[k][col];
    }
  }
  return c;
}

template <int M, class T> Matrix<M, T> sum(Matrix<M, T> a, const Matrix<M, T> &b)
{
  for (int row = 0; row < M; ++row) {
    for (int col = 0; col < M; ++col) a.row[row][col] += b.row[row][col];
  }
  return a;
}

/// Upper bound of the norm of a matrix; infinite if it is NaN.
template <int M, class T> T size_of(const Matrix<M, T> &a)
{
  T square = 0;
  for (int row = 0; row < M; ++row) {
    for (int col = 0; col < M; ++col) square += a.row[row][col] * a.row[row][col];
  }
  const T size = sqrt(square);
  return size < std::numeric_limits<T>::max() ? size : std::numeric_limits<T>::infinity();
}

/// Bound of the change of |x|^power for a change of x by up to off.
template <class T> T power_off(const T &x, const T &off, const T &power)
{
  const T above = pow(x + off, power), below = pow(abs(x - off), power);
  return x > off ? above - below : above + below;
}

/// Bound of the change of s_k |x_k|^power.axis, a gradient of a FlatNorm, for changes of each x_k
/// by up to off_k, over the unit of x; with two exponents of that of the nested norm, rho^axis
/// (|x_k| / rho)^across across z, and its length.
template <int D, class T> struct PowerOff {
  Vec<D, T> x, off, unit;
  Powers<T> power;

  T change() const
  {
    T square = 0;
    for (int k = 0; k < D; ++k) {
      const T most = is_across(k) ? change_across(k) : power_off(x[k], off[k], power.axis);
      square += most * most * unit[k] * unit[k];
    }
    return sqrt(square);
  }
  T length() const
  {
    T square = 0;
    for (int k = 0; k < D; ++k) {
      const T one = unit[k] * (is_across(k) ? outer() * share(k) : pow(x[k], power.axis));
      square += one * one;
    }
    return sqrt(square);
  }

 private:
  bool is_across(int k) const { return D == 3 && k < 2 && power.across != power.axis; }
  T rho() const
  {
    const T e = power.across + 1, largest = std::max(x[0], x[1]);
    if (largest == 0) return 0;
    return largest * pow(pow(x[0] / largest, e) + pow(x[1] / largest, e), 1 / e);
  }
  T outer() const { return pow(rho(), power.axis); }
  T share(int k) const { return rho() > 0 ? pow(x[k] / rho(), power.across) : T(0); }

  /// Bound for a product of which the second factor, at most 1, is a power of a ratio. A norm
  /// changes by at most the sum of the changes.
  T change_across(int k) const
  {
    const T off_rho = off[0] + off[1], least = rho() - off_rho;
    const T by_outer = power_off(rho(), off_rho, power.axis);
    if (!(least > 0)) return outer() + by_outer;
    const T off_ratio = (off[k] + off_rho) / least;
    return by_outer + outer() * std::min(T(1), power_off(x[k] / rho(), off_ratio, power.across));
  }
};

/// One body at the point where another touches it, both scaled by eta: the dependence of normal and
/// point on each other. By normal, the latter is the smooth unknown and `bend` maps its changes to
/// those of the point; by point, it maps changes of the point to those of the normal.
template <int D, class T> class BodyAtPoint {
 public:
  using Body = SuperellipsoidBody<D, T>;

  BodyAtPoint(const Body &of, const Vec<D, T> &at, const Vec<D, T> &across, const T &eta) :
      body(of), scale(eta), width(PowerNorm<D, T>::support(of).value(across))
  {
    if (by_normal()) {
      const auto h = PowerNorm<D, T>::support(body).curved_at(across);
      normal = across;
      point = scale * h.gradient;
      set_bend(h.hessian, scale);
    } else {
      const auto g = PowerNorm<D, T>::gauge(body).curved_at(at);
      const T steepness = norm(g.gradient);
      normal = (1 / steepness) * g.gradient;
      point = at;
      set_bend(g.hessian, 1 / steepness);
    }
  }

  /// Both points lie within each of the bodies.
  T width_at_most() const { return 2 * scale * body.bounding_radius; }

  bool by_normal() const { return is_by_normal(body); }
  T exponent() const
  {
    const auto powers = smooth_powers<T>(body);
    return std::max(powers.axis, powers.across);
  }

  Vec<D, T> normal, point;  // each computed from the other
  AcrossMatrix<D, T> bend;

  /// Bound of the error of the normal for an error `off` of the point, and vice versa: also valid
  /// at a face or a tip, where `bend` is zero.
  T normal_off(const T &off) const
  {
    PowerOff<D, T> from{{}, {}, {}, {2 * T(body.p) - 1, 2 * T(body.p_across) - 1}};
    for (int k = 0; k < D; ++k) {
      const T length = scale * body.semi_axes[k];
      from.x[k] = abs(dot(body.axis[k], point)) / length;
      from.off[k] = off / length;
      from.unit[k] = 1 / T(body.semi_axes[k]);
    }
    return from.change() / from.length();
  }
  T point_off(const T &off) const
  {
    PowerOff<D, T> from{{}, {}, {}, {1 / (2 * T(body.p) - 1), 1 / (2 * T(body.p_across) - 1)}};
    for (int k = 0; k < D; ++k) {
      const T a = body.semi_axes[k];
      from.x[k] = abs(dot(body.axis[k], normal)) * a / width;
      from.off[k] = off * a / width;
      from.unit[k] = scale * a;
    }
    return from.change();
  }

 private:
  const Body &body;
  T scale, width;

  void set_bend(const T (&hessian)[D][D], const T &factor)
  {
    Vec<D, T> across[D - 1];
    set_across(across);
    for (int a = 0; a < D - 1; ++a) {
      for (int b = 0; b < D - 1; ++b) {
        T sum = 0;
        for (int row = 0; row < D; ++row) {
          for (int col = 0; col < D; ++col) {
            sum += across[a][row] * hessian[row][col] * across[b][col];
          }
        }
        bend.row[a][b] = factor * sum;
      }
    }
  }

  void set_across(Vec<2, T> (&across)[1]) const { across[0] = {{-normal[1], normal[0]}}; }
  void set_across(Vec<3, T> (&across)[2]) const
  {
    int least = 0;
    for (int k = 1; k < 3; ++k) {
      if (abs(normal[k]) < abs(normal[least])) least = k;
    }
    Vec<3, T> beside{};
    beside[least] = 1;
    across[0] = cross(normal, beside);
    across[0] = (1 / norm(across[0])) * across[0];
    across[1] = cross(normal, across[0]);
  }
};

/// Errors of the normal (of length 1) and of the point.
template <class T> struct OffByResidual {
  T normal, point;
};

/// Errors from the residual of the equations of contact, its rounding, and their conditioning: to
/// linear order, with a factor for the change of curvature on the way to the solution, and from how
/// normal and point of each body bound each other.
template <int D, class T> class Conditioning {
 public:
  using At = BodyAtPoint<D, T>;

  /// A body with p > 1 comes first.
  Conditioning(const At &first, const At &second, const Vec<D, T> &separation) :
      i(first), j(second), r(separation), steepest(std::max(i.exponent(), j.exponent())),
      b_i(size_of(i.bend)), b_j(size_of(j.bend))
  {
  }

  OffByResidual<T> off() const
  {
    OffByResidual<T> off = i.by_normal() ? of_normals() : j.by_normal() ? of_both() : of_points();
    return {std::min(off.normal, T(2)),
            std::min({off.point, i.width_at_most(), j.width_at_most()})};
  }

 private:
  const At &i, &j;
  Vec<D, T> r;
  T steepest, b_i, b_j;

  static constexpr T ROUNDING = 16 * std::numeric_limits<T>::epsilon();

  T lengths() const { return norm(r) + norm(i.point) + norm(j.point); }

  OffByResidual<T> of_normals() const
  {
    const T residual = norm(i.point + j.point - r) + ROUNDING * (lengths() + b_i + b_j);
    const auto inverse_sum = inverse(sum(i.bend, j.bend));
    const T point = residual * shared(inverse_sum);
    const T normal = std::min(
        {steepest * size_of(inverse_sum) * residual, i.normal_off(point), j.normal_off(point)});
    return {normal + ROUNDING, point};
  }

  OffByResidual<T> of_points() const
  {
    const T residual =
        norm(i.normal - j.normal) + ROUNDING * (1 + b_i * norm(i.point) + b_j * norm(j.point));
    const auto inverse_sum = inverse(sum(i.bend, j.bend));
    const T normal = residual * shared(inverse_sum);
    const T point = std::min(
        {steepest * size_of(inverse_sum) * residual, i.point_off(normal), j.point_off(normal)});
    return {normal, point + ROUNDING * lengths()};
  }

  OffByResidual<T> of_both() const
  {
    const T residual =
        norm(i.point + j.point - r) + ROUNDING * (lengths() + b_j * (1 + b_i * norm(i.point)));
    auto matrix = product(j.bend, i.bend);
    for (int k = 0; k < D - 1; ++k) matrix.row[k][k] += 1;
    const auto inverted = inverse(matrix);
    const T point = size_of(inverted) * residual;
    const T normal = size_of(product(i.bend, inverted)) * residual;
    // The distance of the point of j from that of this normal is the residual.
    return {std::min(steepest * normal, j.normal_off(point + residual)) + ROUNDING, point};
  }

  /// The larger fraction of a residual that one of the two bodies takes, at least 1; the smaller of
  /// two bounds.
  T shared(const AcrossMatrix<D, T> &inverse_sum) const
  {
    const T share =
        std::min(size_of(product(i.bend, inverse_sum)), size_of(product(j.bend, inverse_sum)));
    return 1 + (share < std::numeric_limits<T>::max() ? share : T(1));
  }
};

/// The same where a body has mixed coordinates, from those of both bodies: the response of points
/// and normals to the residual and its rounding, to linear order, with the same factor.
template <class T>
OffByResidual<T> off_of_both(const SuperellipsoidBody<3, T> &i, const SuperellipsoidBody<3, T> &j,
                             const Vec<3, T> &r, const Tangency<3, T> &at)
{
  constexpr int M = ByBoth<T>::M;
  constexpr T ROUNDING = 16 * std::numeric_limits<T>::epsilon();
  const auto problem = TangencyProblem<3, T>::of(i, j, r);
  const ByBoth<T> equations(problem);
  const Vec<M, T> z = equations.start(at);
  const auto by = equations.linearised(z);
  T change_sq[4]{};  // of both points over |r|, and of both normals times |r| and their weights
  for (int from = 0; from < M; ++from) {
    Vec<M, T> unit{};
    unit[from] = 1;
    const Vec<M, T> response = solved(by.jacobian, unit);
    T residual = abs(by.residual[from]) + ROUNDING;
    for (int b = 0; b < M; ++b) residual += ROUNDING * abs(by.jacobian.row[from][b] * z[b]);
    for (int a = 0; a < 6; ++a) {
      for (int body = 0; body < 2; ++body) {
        T change = 0;
        for (int b = 0; b < 3; ++b)
          change += by.jacobian.row[a][3 * body + b] * response[3 * body + b];
        change_sq[2 * (a / 3) + body] += M * change * change * residual * residual;
      }
    }
  }
  const auto powers = {problem.powers_i, problem.powers_j};
  T steepest = 1;
  for (const Powers<T> &of : powers) steepest = std::max({steepest, of.axis, of.across});
  const auto largest = [&](int from, const T &over) {
    const T size = steepest * sqrt(std::max(change_sq[from], change_sq[from + 1])) / over;
    return size < std::numeric_limits<T>::max() ? size : std::numeric_limits<T>::infinity();
  };
  const T length = norm(r), weighted = length * equations.weighted_normal(z);
  const T width = 2 * at.scale * std::min(i.bounding_radius, j.bounding_radius);
  return {std::min(largest(2, weighted), T(2)), std::min(largest(0, 1 / length), width)};
}

}  // namespace detail

/// Errors from the two bounds of the scale, and from Conditioning.
template <int D, class T>
ErrorsOfGeometry<T> errors_of_geometry(const SuperellipsoidBody<D, T> &i,
                                       const SuperellipsoidBody<D, T> &j,
                                       const Contact<D, T, 1> &contact)
{
  using namespace detail;
  using Norm = PowerNorm<D, T>;
  const Bond<D, T> &bond = contact.bond[0];
  const Vec<D, T> r = i.centre - j.centre, y = -bond.arm_i;
  const T eta = sqrt(bond.distance / bond.reach), along = dot(r, bond.normal);
  const T below =
      along / (Norm::support(i).value(bond.normal) + Norm::support(j).value(bond.normal));
  const T above = std::max(Norm::gauge(i).value(y), Norm::gauge(j).value(r - y));
  const T of_scale = std::max(eta - below, above - eta) + 16 * std::numeric_limits<T>::epsilon();
  const auto found = [&]() -> OffByResidual<T> {
    if constexpr (D == 3) {
      if (is_mixed(i, j)) return off_of_both(i, j, r, {eta, bond.normal, y, r - y});
    }
    const BodyAtPoint<D, T> at_i(i, y, bond.normal, eta), at_j(j, r - y, bond.normal, eta);
    const bool in_order = !at_i.by_normal() || at_j.by_normal();
    return in_order ? Conditioning<D, T>(at_i, at_j, r).off()
                    : Conditioning<D, T>(at_j, at_i, r).off();
  };
  const OffByResidual<T> off = found();
  const T overlap = (1 - eta) * (1 + eta);
  return {2 * of_scale / overlap, off.normal * (1 + norm(r) / along) + 2 * of_scale, off.point};
}

}  // namespace jamshape
