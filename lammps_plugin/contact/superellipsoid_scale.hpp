#pragma once

#include "contact/superellipsoid_shape.hpp"
#include "contact/vec.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace jamshape {

/// Where two bodies scaled by `scale` about their centres touch. The one's centre is at r from the
/// other's; n.r > 0.
template <int D, class S> struct Tangency {
  S scale;
  Vec<D, S> normal;   // of any length, along r
  Vec<D, S> point_i;  // on the surface of i scaled, its normal n; r = point_i + point_j
  Vec<D, S> point_j;
};

/// A tangency found by iteration: eta lies in scale (1 +- gap), whatever the iteration did.
template <int D, class T> struct FoundTangency {
  Tangency<D, T> at;
  T gap;
  int iterations;
  bool is_fallback;
  bool is_apart;  // decided by a separating plane; the tangency was not sought then
};

/// What is asked of a pair: r = x_i - x_j, whether "apart" is answer enough where a plane divides
/// the bodies, and a normal to begin with (or null).
template <int D, class T> struct TangencyWish {
  Vec<D, T> r;
  bool may_stop_apart;
  const Vec<D, T> *last;
};

namespace detail {

template <int M, class T> struct Matrix {
  T row[M][M];
};

/// a x = b by elimination with pivots; b of any scalar. A singular matrix gives what is not finite.
template <int M, class T, class S> Vec<M, S> solved(Matrix<M, T> a, Vec<M, S> b)
{
  for (int k = 0; k < M; ++k) {
    int pivot = k;
    for (int row = k + 1; row < M; ++row) {
      if (abs(a.row[row][k]) > abs(a.row[pivot][k])) pivot = row;
    }
    if (pivot != k) {
      std::swap(a.row[k], a.row[pivot]);
      std::swap(b[k], b[pivot]);
    }
    const T inverse = 1 / a.row[k][k];
    for (int row = k + 1; row < M; ++row) {
      const T factor = a.row[row][k] * inverse;
      for (int col = k + 1; col < M; ++col) a.row[row][col] -= factor * a.row[k][col];
      b[row] -= S(factor) * b[k];
    }
  }
  for (int k = M - 1; k >= 0; --k) {
    for (int col = k + 1; col < M; ++col) b[k] -= S(a.row[k][col]) * b[col];
    b[k] *= S(1 / a.row[k][k]);
  }
  return b;
}

/// The same for a symmetric positive definite matrix, of which the lower half is read.
template <int M, class T> Vec<M, T> solved_symmetric(Matrix<M, T> a, Vec<M, T> b)
{
  T inverse[M];
  for (int k = 0; k < M; ++k) {
    inverse[k] = 1 / a.row[k][k];
    for (int row = k + 1; row < M; ++row) {
      const T factor = a.row[row][k] * inverse[k];
      for (int col = k + 1; col <= row; ++col) a.row[row][col] -= factor * a.row[col][k];
      b[row] -= factor * b[k];
    }
  }
  for (int k = M - 1; k >= 0; --k) {
    b[k] *= inverse[k];
    for (int row = 0; row < k; ++row) b[row] -= a.row[k][row] * b[k];
  }
  return b;
}

/// In 3D by cofactors: one division instead of three in a row.
template <class T> Vec<3, T> solved_symmetric(const Matrix<3, T> &a, const Vec<3, T> &b)
{
  const T xx = a.row[0][0], yx = a.row[1][0], yy = a.row[1][1];
  const T zx = a.row[2][0], zy = a.row[2][1], zz = a.row[2][2];
  const T c_xx = yy * zz - zy * zy, c_xy = zx * zy - yx * zz, c_xz = yx * zy - zx * yy;
  const T c_yy = xx * zz - zx * zx, c_yz = zx * yx - xx * zy, c_zz = xx * yy - yx * yx;
  const T inverse = 1 / (xx * c_xx + yx * c_xy + zx * c_xz);
  return {{inverse * (c_xx * b[0] + c_xy * b[1] + c_xz * b[2]),
           inverse * (c_xy * b[0] + c_yy * b[1] + c_yz * b[2]),
           inverse * (c_xz * b[0] + c_yz * b[1] + c_zz * b[2])}};
}

/// Two bodies that are both flat where they touch (face on face, tip on tip) leave a matrix
/// singular; this much of its largest element on its diagonal keeps the step finite.
inline constexpr double FLAT = 1e-15;

template <int D, int M, class T> void lift_diagonal(Matrix<M, T> &a)
{
  T largest = 0;
  for (int k = 0; k < D; ++k) largest = std::max(largest, a.row[k][k]);
  for (int k = 0; k < D; ++k) a.row[k][k] += T(FLAT) * largest;
}

template <int M, class T> struct Linearised {
  Vec<M, T> residual;
  Matrix<M, T> jacobian;
};

/// Two bodies, r = x_i - x_j, and the exponents (those of PowerNorm in the norm that is smooth) to
/// which the equations below are posed: on the way to the bodies' own they pass through others.
template <int D, class S> struct TangencyProblem {
  const SuperellipsoidBody<D, S> &i, &j;
  Vec<D, S> r;
  ValueOf<S> exponent_i, exponent_j;
};

/// Both bodies by their support functions, p <= 1, where these are smooth. With F = h_i + h_j the
/// scale at which two bodies touch is the largest r.n / F(n); the n with F(n) = r.n / F(n)
/// minimises the convex F^2 / 2 - r.n, that is F grad F = r, and eta = F there.
template <int D, class S> class ByNormal {
 public:
  static constexpr int M = D;
  using T = ValueOf<S>;

  explicit ByNormal(const TangencyProblem<D, S> &p) :
      r(p.r), h_i(PowerNorm<D, S>::support(p.i, p.exponent_i)),
      h_j(PowerNorm<D, S>::support(p.j, p.exponent_j))
  {
  }

  Vec<M, S> residual(const Vec<M, S> &n) const
  {
    const auto i = h_i.at(n), j = h_j.at(n);
    return (i.value + j.value) * (i.gradient + j.gradient) - r;
  }

  Linearised<M, T> linearised(const Vec<M, T> &n) const
  {
    const auto i = h_i.curved_at(n), j = h_j.curved_at(n);
    const T F = i.value + j.value;
    const Vec<D, T> slope = i.gradient + j.gradient;
    Linearised<M, T> at;
    at.residual = F * slope - r;
    for (int a = 0; a < D; ++a) {
      for (int b = 0; b < D; ++b) {
        at.jacobian.row[a][b] = slope[a] * slope[b] + F * (i.hessian[a][b] + j.hessian[a][b]);
      }
    }
    lift_diagonal<D>(at.jacobian);
    return at;
  }

  static Vec<M, T> step(const Linearised<M, T> &at)
  {
    return solved_symmetric(at.jacobian, at.residual);
  }

  /// Of all lengths of n the one that makes F^2 / 2 - r.n least.
  Vec<M, T> start(const Tangency<D, T> &from) const
  {
    const T F = h_i.value(from.normal) + h_j.value(from.normal);
    return (dot(r, from.normal) / (F * F)) * from.normal;
  }

  Tangency<D, S> tangency(const Vec<M, S> &n) const
  {
    const auto i = h_i.at(n), j = h_j.at(n);
    const S scale = dot(r, n) / (i.value + j.value);
    return {scale, n, scale * i.gradient, scale * j.gradient};
  }

 private:
  Vec<D, S> r;
  PowerNorm<D, S> h_i, h_j;
};

/// ByNormal for two ellipsoids, whose support functions are sqrt(n.A n), A = sum a_k^2 u_k (x) u_k.
template <int D, class T> class ByNormalOfEllipsoids {
 public:
  static constexpr int M = D;

  template <class Body>
  ByNormalOfEllipsoids(const Body &i, const Body &j, const Vec<D, T> &separation) :
      r(separation), A_i(matrix_of(i)), A_j(matrix_of(j))
  {
  }

  Linearised<M, T> linearised(const Vec<M, T> &n) const
  {
    const Half i(A_i, n), j(A_j, n);
    const T F = i.h + j.h, over_i = F / i.h, over_j = F / j.h;
    const Vec<D, T> slope = i.point + j.point;
    Linearised<M, T> at;
    at.residual = F * slope - r;
    for (int a = 0; a < D; ++a) {
      for (int b = 0; b <= a; ++b) {
        at.jacobian.row[a][b] = slope[a] * slope[b] +
                                over_i * (A_i.row[a][b] - i.point[a] * i.point[b]) +
                                over_j * (A_j.row[a][b] - j.point[a] * j.point[b]);
      }
    }
    return at;
  }

  static Vec<M, T> step(const Linearised<M, T> &at)
  {
    return solved_symmetric(at.jacobian, at.residual);
  }

  /// Exact where the two are alike: F^2 = 2 n.(A_i + A_j) n then.
  Vec<M, T> start() const
  {
    Matrix<D, T> sum;
    for (int a = 0; a < D; ++a) {
      for (int b = 0; b <= a; ++b) sum.row[a][b] = A_i.row[a][b] + A_j.row[a][b];
    }
    return scaled(solved_symmetric(sum, r));
  }

  Vec<M, T> scaled(const Vec<M, T> &n) const
  {
    const T F = Half(A_i, n).h + Half(A_j, n).h;
    return (dot(r, n) / (F * F)) * n;
  }

  Tangency<D, T> tangency(const Vec<M, T> &n) const
  {
    const Half i(A_i, n), j(A_j, n);
    const T scale = dot(r, n) / (i.h + j.h);
    return {scale, n, scale * i.point, scale * j.point};
  }

 private:
  Vec<D, T> r;
  Matrix<D, T> A_i, A_j;

  struct Half {
    T h;
    Vec<D, T> point;  // grad h
    Half(const Matrix<D, T> &A, const Vec<D, T> &n)
    {
      for (int a = 0; a < D; ++a) {
        point[a] = 0;
        for (int b = 0; b < D; ++b) point[a] += A.row[a][b] * n[b];
      }
      h = sqrt(dot(n, point));
      point = (1 / h) * point;
    }
  };

  template <class Body> static Matrix<D, T> matrix_of(const Body &body)
  {
    Matrix<D, T> A{};
    for (int k = 0; k < D; ++k) {
      const T square = T(body.semi_axes[k]) * body.semi_axes[k];
      for (int a = 0; a < D; ++a) {
        const T term = square * body.axis[k][a];
        for (int b = 0; b <= a; ++b) A.row[a][b] += term * body.axis[k][b];
      }
    }
    for (int a = 0; a < D; ++a) {
      for (int b = 0; b < a; ++b) A.row[b][a] = A.row[a][b];
    }
    return A;
  }
};

/// i by its gauge (p > 1), j by its support function (p <= 1). The unknown is the point y on i: its
/// normal is grad g_i, the point of j with this normal is eta grad h_j, eta = g_i(y), and the two
/// add up to r.
template <int D, class S> class ByPointAndNormal {
 public:
  static constexpr int M = D;
  using T = ValueOf<S>;

  explicit ByPointAndNormal(const TangencyProblem<D, S> &p) :
      r(p.r), g_i(PowerNorm<D, S>::gauge(p.i, p.exponent_i)),
      h_j(PowerNorm<D, S>::support(p.j, p.exponent_j))
  {
  }

  Vec<M, S> residual(const Vec<M, S> &y) const
  {
    const auto i = g_i.at(y);
    return y + i.value * h_j.at(i.gradient).gradient - r;
  }

  Linearised<M, T> linearised(const Vec<M, T> &y) const
  {
    const auto i = g_i.curved_at(y);
    const auto j = h_j.curved_at(i.gradient);
    Linearised<M, T> at;
    at.residual = y + i.value * j.gradient - r;
    for (int a = 0; a < D; ++a) {
      for (int b = 0; b < D; ++b) {
        T sum = 0;
        for (int c = 0; c < D; ++c) sum += j.hessian[a][c] * i.hessian[c][b];
        at.jacobian.row[a][b] = T(a == b) + j.gradient[a] * i.gradient[b] + i.value * sum;
      }
    }
    return at;
  }

  static Vec<M, T> step(const Linearised<M, T> &at) { return solved(at.jacobian, at.residual); }

  Vec<M, T> start(const Tangency<D, T> &from) const { return from.point_i; }

  Tangency<D, S> tangency(const Vec<M, S> &y) const
  {
    const Vec<D, S> n = g_i.at(y).gradient;  // h_i(n) = 1
    const S scale = dot(r, n) / (T(1) + h_j.at(n).value);
    return {scale, n, y, r - y};
  }

 private:
  Vec<D, S> r;
  PowerNorm<D, S> g_i, h_j;
};

/// Both bodies by their gauges, p > 1. Unknowns are the point y on i and a weight w: of the point
/// where max(g_i(y), g_j(r - y)) is least the conditions w grad g_i = (1 - w) grad g_j and
/// g_i = g_j.
template <int D, class S> class ByPoint {
 public:
  static constexpr int M = D + 1;
  using T = ValueOf<S>;

  explicit ByPoint(const TangencyProblem<D, S> &p) :
      r(p.r), length(value_of(norm(p.r))), g_i(PowerNorm<D, S>::gauge(p.i, p.exponent_i)),
      g_j(PowerNorm<D, S>::gauge(p.j, p.exponent_j))
  {
  }

  Vec<M, S> residual(const Vec<M, S> &z) const
  {
    const auto i = g_i.at(point(z)), j = g_j.at(r - point(z));
    return residual_of(z[D], i, j);
  }

  Linearised<M, T> linearised(const Vec<M, T> &z) const
  {
    const T w = z[D];
    const auto i = g_i.curved_at(point(z)), j = g_j.curved_at(r - point(z));
    Linearised<M, T> at;
    at.residual = residual_of(w, i, j);
    for (int a = 0; a < D; ++a) {
      for (int b = 0; b < D; ++b) {
        at.jacobian.row[a][b] = length * (w * i.hessian[a][b] + (1 - w) * j.hessian[a][b]);
      }
      at.jacobian.row[a][D] = at.jacobian.row[D][a] = length * (i.gradient[a] + j.gradient[a]);
    }
    at.jacobian.row[D][D] = 0;
    lift_diagonal<D>(at.jacobian);
    return at;
  }

  static Vec<M, T> step(const Linearised<M, T> &at) { return solved(at.jacobian, at.residual); }

  Vec<M, T> start(const Tangency<D, T> &from) const
  {
    Vec<M, T> z;
    for (int k = 0; k < D; ++k) z[k] = from.point_i[k];
    const T i = norm(g_i.at(from.point_i).gradient), j = norm(g_j.at(from.point_j).gradient);
    z[D] = j / (i + j);
    return z;
  }

  Tangency<D, S> tangency(const Vec<M, S> &z) const
  {
    const Vec<D, S> y = point(z), other = r - y;
    const auto i = g_i.at(y), j = g_j.at(other);
    return {z[D] * i.value + (T(1) - z[D]) * j.value, i.gradient, y, other};
  }

 private:
  Vec<D, S> r;
  T length;  // makes the equations of one unit
  PowerNorm<D, S> g_i, g_j;

  static Vec<D, S> point(const Vec<M, S> &z)
  {
    Vec<D, S> y;
    for (int k = 0; k < D; ++k) y[k] = z[k];
    return y;
  }

  template <class Norm> Vec<M, S> residual_of(const S &w, const Norm &i, const Norm &j) const
  {
    Vec<M, S> residual;
    for (int k = 0; k < D; ++k) {
      residual[k] = length * (w * i.gradient[k] - (T(1) - w) * j.gradient[k]);
    }
    residual[D] = length * (i.value - j.value);
    return residual;
  }
};

/// Newton's method with steps cut until the residual falls. True when a step was shorter than
/// `tolerance` of the unknowns: that step is taken and leaves an error of its square.
template <class Equations, int M, class T>
bool newton(const Equations &equations, Vec<M, T> &z, T tolerance, int &iterations)
{
  constexpr int LONGEST = 60;
  auto at = equations.linearised(z);
  T size = norm_sq(at.residual);
  for (int n = 0; n < LONGEST; ++n) {
    const Vec<M, T> step = equations.step(at);
    const T step_sq = norm_sq(step);
    if (!(step_sq < std::numeric_limits<T>::max())) return false;
    ++iterations;
    if (step_sq <= tolerance * tolerance * norm_sq(z)) {
      z -= step;
      return true;
    }
    T fraction = 1;
    for (;; fraction *= T(0.5)) {
      if (fraction < T(1e-4)) return false;
      const Vec<M, T> trial = z - fraction * step;
      const auto next = equations.linearised(trial);
      const T next_size = norm_sq(next.residual);
      if (next_size <= (1 - T(0.2) * fraction) * size) {
        z = trial;
        at = next;
        size = next_size;
        break;
      }
    }
  }
  return false;
}

/// Whether the normal n of a plane is what the equations know of a body, or a point of its surface.
inline bool is_by_normal(double p) { return p <= 1.0; }

template <class T> T smooth_exponent(double p)
{
  return is_by_normal(p) ? 1 / (2 * T(p) - 1) : 2 * T(p) - 1;
}

}  // namespace detail

/// Finds the tangency of two bodies in plain numbers T. From the ellipsoids of the same axes, where
/// Newton's method takes four steps, it follows the solution as the exponents grow, in stages of
/// one to a few Newton steps each. Where a stage fails it starts again with finer ones. Method and
/// measurements: analysis/contact_error.py.
template <int D, class T> class TangencySearch {
 public:
  using Body = SuperellipsoidBody<D, T>;

  /// Bodies are symmetric about their centres, so exchanging them leaves r as it is.
  TangencySearch(const Body &body_i, const Body &body_j, const TangencyWish<D, T> &wish) :
      r(wish.r), may_stop_apart(wish.may_stop_apart),
      is_swapped(detail::is_by_normal(body_i.p) && !detail::is_by_normal(body_j.p)),
      i(is_swapped ? body_j : body_i), j(is_swapped ? body_i : body_j)
  {
  }

  /// Relative gap at which a tangency is found: the bounds then agree to their own rounding.
  static constexpr T GAP = 64 * std::numeric_limits<T>::epsilon();

  FoundTangency<D, T> find() const
  {
    FoundTangency<D, T> found{};
    const detail::ByNormalOfEllipsoids<D, T> ellipsoids(i, j, r);
    Vec<D, T> n = ellipsoids.start();
    if (are_ellipsoids()) return of_ellipsoids(ellipsoids, n);
    newton(ellipsoids, n, ROUGH, found.iterations);
    found.at = ellipsoids.tangency(n);
    if (may_stop_apart && separates(n)) return apart(found, n);
    follow(found);
    return ordered(found);
  }

  /// From a normal near the one sought; where that leads nowhere, without it.
  FoundTangency<D, T> find_from(const Vec<D, T> &n) const
  {
    using Norm = PowerNorm<D, T>;
    FoundTangency<D, T> found{};
    if (!(dot(r, n) > T(0))) return find();
    if (are_ellipsoids()) {
      const detail::ByNormalOfEllipsoids<D, T> ellipsoids(i, j, r);
      found = of_ellipsoids(ellipsoids, ellipsoids.scaled(n));
      return found.gap <= GAP ? found : find();
    }
    if (may_stop_apart && separates(n)) return apart(found, n);
    const auto h_i = Norm::support(i).at(n), h_j = Norm::support(j).at(n);
    const T scale = dot(r, n) / (h_i.value + h_j.value);
    found.at = {scale, n, scale * h_i.gradient, scale * h_j.gradient};
    if (to_own_exponents(found, 1.0)) {
      certify(found);
      if (found.gap <= GAP) return ordered(found);
    }
    return find();
  }

  /// Whether the scale is below 1; a point inside both bodies ends it early, as a plane between
  /// them.
  bool is_overlap() const
  {
    if (separates(r)) return false;
    FoundTangency<D, T> found{};
    const detail::ByNormalOfEllipsoids<D, T> ellipsoids(i, j, r);
    Vec<D, T> n = ellipsoids.start();
    for (const T tolerance : {T(1), ROUGH}) {
      newton(ellipsoids, n, tolerance, found.iterations);
      const Vec<D, T> point = ellipsoids.tangency(n).point_i;
      if (reach_of(point) < 1) return true;
      if (separates(n)) return false;
    }
    return find().at.scale < 1;
  }

  /// From a tangency near the one sought, found before or in fewer digits; false if it leads
  /// nowhere.
  bool improve(FoundTangency<D, T> &found) const
  {
    found = ordered(found);
    const bool is_improved = to_own_exponents(found, 1.0);
    if (is_improved) certify(found);
    found = ordered(found);
    return is_improved && found.gap <= GAP;
  }

  /// Bounds of the scale, |scale - eta| / scale < gap: the plane with normal n gives the lower
  /// one, r.n / (h_i + h_j), a point y the upper, max(g_i(y), g_j(r - y)). The equations have met
  /// one half of each by how the tangency follows from their unknowns.
  void certify(FoundTangency<D, T> &found) const
  {
    using Norm = PowerNorm<D, T>;
    const Tangency<D, T> &at = found.at;
    const bool i_by_normal = detail::is_by_normal(i.p), j_by_normal = detail::is_by_normal(j.p);
    const T g_i = i_by_normal ? at.scale : Norm::gauge(i).value(at.point_i);
    const T above = std::max(g_i, Norm::gauge(j).value(r - at.point_i));
    const T below =
        j_by_normal ? at.scale : dot(r, at.normal) / (T(1) + Norm::support(j).value(at.normal));
    const T gap = std::max(above - at.scale, at.scale - below) / at.scale;
    const bool is_bound = std::isfinite(above) && std::isfinite(below) && at.scale > T(0);
    found.gap = is_bound ? std::max(gap, T(0)) : std::numeric_limits<T>::infinity();
  }

 private:
  Vec<D, T> r;
  bool may_stop_apart, is_swapped;
  const Body &i, &j;  // a body with p > 1 comes first

  static constexpr T TOLERANCE = sizeof(T) > 8 ? T(1e-11) : T(1e-9);
  static constexpr T ROUGH = T(1e-2);
  static constexpr double RATIOS[] = {3.0, 1.5, 1.15, 1.04};  // of exponents, stage to stage

  bool are_ellipsoids() const { return i.p == 1.0 && j.p == 1.0; }

  FoundTangency<D, T> of_ellipsoids(const detail::ByNormalOfEllipsoids<D, T> &ellipsoids,
                                    Vec<D, T> n) const
  {
    FoundTangency<D, T> found{};
    // At this length of n a plane between the bodies has r.n >= 1.
    if (may_stop_apart && dot(r, n) >= T(1)) return apart(found, n);
    newton(ellipsoids, n, TOLERANCE, found.iterations);
    found.at = ellipsoids.tangency(n);
    certify(found);
    return found;
  }

  T widths(const Vec<D, T> &n) const
  {
    using Norm = PowerNorm<D, T>;
    return Norm::support(i).value(n) + Norm::support(j).value(n);
  }

  /// The scale at which both bodies contain a point.
  T reach_of(const Vec<D, T> &from_i) const
  {
    using Norm = PowerNorm<D, T>;
    return std::max(Norm::gauge(i).value(from_i), Norm::gauge(j).value(r - from_i));
  }

  bool separates(const Vec<D, T> &n) const { return dot(r, n) >= widths(n); }

  static FoundTangency<D, T> apart(FoundTangency<D, T> found, const Vec<D, T> &n)
  {
    found.is_apart = true;
    found.at.normal = n;
    found.at.scale = std::numeric_limits<T>::infinity();
    return found;
  }

  FoundTangency<D, T> ordered(FoundTangency<D, T> found) const
  {
    if (is_swapped) std::swap(found.at.point_i, found.at.point_j);
    return found;
  }

  /// The first attempt that ends in a short step and within bounds; else, where both bodies are so
  /// flat that steps stay long, the one of the closest bounds.
  void follow(FoundTangency<D, T> &found) const
  {
    const Tangency<D, T> start = found.at;
    FoundTangency<D, T> best = found;
    best.gap = std::numeric_limits<T>::infinity();
    for (const double ratio : RATIOS) {
      found.at = start;
      const bool is_converged = to_own_exponents(found, ratio);
      certify(found);
      if (is_converged && found.gap <= GAP) return;
      if (found.gap < best.gap) best = found;
      found.is_fallback = true;
    }
    found.at = best.at;
    found.gap = best.gap;
  }

  /// In stages of this ratio, or at once for ratio 1.
  bool to_own_exponents(FoundTangency<D, T> &found, double ratio) const
  {
    if (detail::is_by_normal(i.p)) return in_stages<detail::ByNormal<D, T>>(found, ratio);
    if (detail::is_by_normal(j.p)) return in_stages<detail::ByPointAndNormal<D, T>>(found, ratio);
    return in_stages<detail::ByPoint<D, T>>(found, ratio);
  }

  template <class Equations> bool in_stages(FoundTangency<D, T> &found, double ratio) const
  {
    const T e_i = detail::smooth_exponent<T>(i.p), e_j = detail::smooth_exponent<T>(j.p);
    int last = 1;
    const T most = ratio > 1.0 ? std::max(e_i, e_j) * T(1 - 1e-9) : T(1);
    for (T reached = T(ratio); reached < most; reached *= T(ratio)) ++last;
    Vec<Equations::M, T> z{};
    bool is_converged = false;
    for (int stage = 1; stage <= last; ++stage) {
      const T share = T(stage) / last;
      const Equations equations(
          detail::TangencyProblem<D, T>{i, j, r, stage < last ? between(e_i, share) : e_i,
                                        stage < last ? between(e_j, share) : e_j});
      if (stage == 1) z = equations.start(found.at);
      is_converged = newton(equations, z, stage < last ? ROUGH : TOLERANCE, found.iterations);
      if (stage == last) found.at = equations.tangency(z);
    }
    return is_converged;
  }

  /// Whole powers cost no logarithm.
  static T between(T exponent, T share)
  {
    const T power = std::pow(exponent, share);
    return exponent > 4 && share < 1 && std::round(power) > 1 ? std::round(power) : power;
  }
};

/// In plain numbers T, without derivatives.
template <class T, int D, class S> Vec<D, T> plain(const Vec<D, S> &v)
{
  Vec<D, T> values;
  for (int k = 0; k < D; ++k) values[k] = static_cast<T>(value_of(v[k]));
  return values;
}

template <class T, int D, class S>
SuperellipsoidBody<D, T> plain(const SuperellipsoidBody<D, S> &body)
{
  SuperellipsoidBody<D, T> of;
  of.centre = plain<T>(body.centre);
  for (int k = 0; k < D; ++k) of.axis[k] = plain<T>(body.axis[k]);
  of.semi_axes = body.semi_axes;
  of.p = body.p;
  of.bounding_radius = body.bounding_radius;
  return of;
}

template <class T, int D, class S> Tangency<D, T> plain(const Tangency<D, S> &at)
{
  return {static_cast<T>(at.scale), plain<T>(at.normal), plain<T>(at.point_i),
          plain<T>(at.point_j)};
}

/// The tangency of two bodies, or that they are apart where this is all the caller wants; begun at
/// the normal `last` where that is given (the pair's, a moment before).
template <int D>
FoundTangency<D, double> tangency_of(const SuperellipsoidBody<D, double> &i,
                                     const SuperellipsoidBody<D, double> &j,
                                     const TangencyWish<D, double> &wish)
{
  const TangencySearch<D, double> search(i, j, wish);
  return wish.last == nullptr ? search.find() : search.find_from(*wish.last);
}

/// Long doubles are reached from the solution in doubles by a step or two.
template <int D>
FoundTangency<D, long double> tangency_of(const SuperellipsoidBody<D, long double> &i,
                                          const SuperellipsoidBody<D, long double> &j,
                                          const TangencyWish<D, long double> &wish)
{
  const SuperellipsoidBody<D, double> short_i = plain<double>(i), short_j = plain<double>(j);
  const auto begun =
      tangency_of(short_i, short_j, TangencyWish<D, double>{plain<double>(wish.r), false, nullptr});
  FoundTangency<D, long double> found{plain<long double>(begun.at), begun.gap, begun.iterations,
                                      begun.is_fallback, false};
  const TangencySearch<D, long double> search(i, j, wish);
  return search.improve(found) ? found : search.find();
}

/// The tangency in the scalar S of the bodies: one more Newton step from the one found in plain
/// numbers, its residual in S, its matrix plain. In dual numbers this is the implicit function
/// theorem, and the derivatives are exact.
template <int D, class S> class TangencyIn {
 public:
  using T = ValueOf<S>;
  using Body = SuperellipsoidBody<D, S>;
  using PlainBody = SuperellipsoidBody<D, T>;

  TangencyIn(const Body &body_i, const Body &body_j, const Vec<D, S> &separation) :
      i(body_i), j(body_j), r(separation)
  {
  }

  Tangency<D, S> from(const Tangency<D, T> &found) const
  {
    if (detail::is_by_normal(i.p) && !detail::is_by_normal(j.p)) {
      const Tangency<D, T> other{found.scale, found.normal, found.point_j, found.point_i};
      Tangency<D, S> at = TangencyIn(j, i, r).from(other);
      std::swap(at.point_i, at.point_j);
      return at;
    }
    using namespace detail;
    if (is_by_normal(i.p)) return step<ByNormal<D, S>, ByNormal<D, T>>(found);
    if (is_by_normal(j.p)) return step<ByPointAndNormal<D, S>, ByPointAndNormal<D, T>>(found);
    return step<ByPoint<D, S>, ByPoint<D, T>>(found);
  }

 private:
  const Body &i, &j;
  Vec<D, S> r;

  template <class InS, class Plain> Tangency<D, S> step(const Tangency<D, T> &found) const
  {
    const T e_i = detail::smooth_exponent<T>(i.p), e_j = detail::smooth_exponent<T>(j.p);
    const PlainBody plain_i = plain<T>(i), plain_j = plain<T>(j);
    const Plain equations({plain_i, plain_j, plain<T>(r), e_i, e_j});
    const InS in_s({i, j, r, e_i, e_j});
    const auto z = equations.start(found);
    Vec<Plain::M, S> at;
    for (int k = 0; k < Plain::M; ++k) at[k] = z[k];
    const auto jacobian = equations.linearised(z).jacobian;
    at -= detail::solved(jacobian, in_s.residual(at));
    return in_s.tangency(at);
  }
};

}  // namespace jamshape
