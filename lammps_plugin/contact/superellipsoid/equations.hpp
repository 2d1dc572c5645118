#pragma once

#include "contact/math/vec.hpp"
#include "contact/superellipsoid/shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace jamshape {

/// Tangency of two bodies scaled by `scale` about their centres. The centre of the first is at r
/// from that of the second; n.r > 0.
template <int D, class S> struct Tangency {
  S scale;
  Vec<D, S> normal;   // of any length, along r
  Vec<D, S> point_i;  // on the surface of i scaled, its normal n; r = point_i + point_j
  Vec<D, S> point_j;
};

namespace detail {

template <int M, class T> struct Matrix {
  T row[M][M];
};

/// Solves a x = b by elimination with pivoting; b of any scalar. A singular matrix gives non-finite
/// results.
template <int M, class T, class S> Vec<M, S> solved(Matrix<M, T> a, Vec<M, S> b)
{
  for (int k = 0; k < M; ++k) {
    for (int row = k + 1; row < M; ++row) {
      const Truth<T> larger = abs(a.row[row][k]) > abs(a.row[k][k]);
      if (!any(larger)) continue;
      for (int col = k; col < M; ++col) exchange(larger, a.row[k][col], a.row[row][col]);
      exchange(larger, b[k], b[row]);
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

/// The same for a symmetric positive definite matrix, of which only the lower half is read.
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

/// In 3D by cofactors, with one division instead of three in sequence.
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

/// Two bodies that are both flat where they touch (face on face, tip on tip) make the matrix
/// singular; adding this fraction of its largest element, or of `unit` if that is larger, to its
/// diagonal keeps the step finite.
inline constexpr double FLAT = 1e-15;

template <int D, int M, class T> void lift_diagonal(Matrix<M, T> &a, const T &unit)
{
  T largest = unit;
  for (int k = 0; k < D; ++k) largest = most(largest, a.row[k][k]);
  constexpr auto SHORTER =
      std::numeric_limits<Common<T>>::epsilon() / Common<T>(std::numeric_limits<double>::epsilon());
  for (int k = 0; k < D; ++k) a.row[k][k] += T(FLAT * SHORTER) * largest;
}

template <int M, class T> struct Linearised {
  Vec<M, T> residual;
  Matrix<M, T> jacobian;
};

/// A symmetric positive definite matrix is well posed if the ratio of its largest to its smallest
/// eigenvalue is at most this: rounding in the equations of contact then rotates a normal by about
/// 1e-9 at most. (Times up to D^2: the test compares sums of eigenvalues and of their products.)
inline constexpr double WELL_POSED = 1e6;

template <class T> Truth<T> is_well_posed(const Matrix<2, T> &a)
{
  const T trace = a.row[0][0] + a.row[1][1];
  const T determinant = a.row[0][0] * a.row[1][1] - a.row[1][0] * a.row[1][0];
  return trace * trace < T(WELL_POSED) * determinant;
}
template <class T> Truth<T> is_well_posed(const Matrix<3, T> &a)
{
  const T xx = a.row[0][0], yx = a.row[1][0], yy = a.row[1][1];
  const T zx = a.row[2][0], zy = a.row[2][1], zz = a.row[2][2];
  const T c_xx = yy * zz - zy * zy, c_yy = xx * zz - zx * zx, c_zz = xx * yy - yx * yx;
  const T trace = xx + yy + zz, minors = c_xx + c_yy + c_zz;
  const T determinant = xx * c_xx - yx * (yx * zz - zx * zy) + zx * (yx * zy - zx * yy);
  // If two eigenvalues are lost in rounding, only the first condition detects it.
  return (trace * trace < T(WELL_POSED) * minors) & (trace * minors < T(WELL_POSED) * determinant);
}

/// Representation of a body in the equations: by the normal n of a plane, its support function
/// being smooth, by a point of its surface, its gauge being smooth, or, if neither is since one
/// exponent is below 2 and the other above, by coordinates of both kinds (see mixed.hpp).
enum class Coordinates { NORMAL, POINT, MIXED };

template <class Body> Coordinates coordinates_of(const Body &body)
{
  if (body.p <= 1.0 && body.p_across <= 1.0) return Coordinates::NORMAL;
  return body.p >= 1.0 && body.p_across >= 1.0 ? Coordinates::POINT : Coordinates::MIXED;
}
template <class Body> bool is_by_normal(const Body &body)
{
  return coordinates_of(body) == Coordinates::NORMAL;
}

template <class T> T smooth_exponent(double p)
{
  return p <= 1.0 ? 1 / (2 * T(p) - 1) : 2 * T(p) - 1;
}
template <class T, class Body> Powers<T> smooth_powers(const Body &body)
{
  return {smooth_exponent<T>(body.p), smooth_exponent<T>(body.p_across)};
}

/// Two bodies, r = x_i - x_j, and the powers (those of PowerNorm in the norm that is smooth) of
/// the equations below: continuation to the bodies' own exponents passes through others.
template <int D, class S> struct TangencyProblem {
  const SuperellipsoidBody<D, S> &i, &j;
  Vec<D, S> r;
  Powers<Common<ValueOf<S>>> powers_i, powers_j;

  /// The problem with the bodies' own exponents.
  static TangencyProblem of(const SuperellipsoidBody<D, S> &i, const SuperellipsoidBody<D, S> &j,
                            const Vec<D, S> &r)
  {
    using Power = Common<ValueOf<S>>;
    return {i, j, r, smooth_powers<Power>(i), smooth_powers<Power>(j)};
  }
};

/// Both bodies by their support functions, p <= 1, where these are smooth. With F = h_i + h_j, the
/// scale at which two bodies touch is the largest r.n / F(n); the n with F(n) = r.n / F(n)
/// minimises the convex F^2 / 2 - r.n, that is, F grad F = r, and eta = F there.
template <int D, class S> class ByNormal {
 public:
  static constexpr int M = D;
  using T = ValueOf<S>;

  explicit ByNormal(const TangencyProblem<D, S> &p) :
      r(p.r), h_i(PowerNorm<D, S>::support(p.i, p.powers_i)),
      h_j(PowerNorm<D, S>::support(p.j, p.powers_j))
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
    lift_diagonal<D>(at.jacobian, T(0.0));
    return at;
  }

  static Vec<M, T> step(const Linearised<M, T> &at)
  {
    return solved_symmetric(at.jacobian, at.residual);
  }

  /// The size of the terms of which the residual is a difference.
  T unit(const Linearised<M, T> &) const { return norm(r); }

  /// Tips make the matrix nearly singular: many normals share their point.
  static constexpr bool MAY_BE_ILL_POSED = true;
  static Truth<T> is_well_posed(const Matrix<M, T> &jacobian)
  {
    return detail::is_well_posed(jacobian);
  }

  /// Scales n to the length that minimises F^2 / 2 - r.n.
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

  T unit(const Linearised<M, T> &) const { return norm(r); }

  static Vec<M, T> step(const Linearised<M, T> &at)
  {
    return solved_symmetric(at.jacobian, at.residual);
  }

  /// Exact for two identical ellipsoids: then F^2 = 2 n.(A_i + A_j) n.
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
      r(p.r), g_i(PowerNorm<D, S>::gauge(p.i, p.powers_i)),
      h_j(PowerNorm<D, S>::support(p.j, p.powers_j))
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

  T unit(const Linearised<M, T> &) const { return norm(r); }

  /// A tip determines the point and a face the normal.
  static constexpr bool MAY_BE_ILL_POSED = false;

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

/// Both bodies by their gauges, p > 1. Unknowns are the point y on i and a weight w: the point
/// where max(g_i(y), g_j(r - y)) is least satisfies w grad g_i = (1 - w) grad g_j and g_i = g_j.
template <int D, class S> class ByPoint {
 public:
  static constexpr int M = D + 1;
  using T = ValueOf<S>;

  explicit ByPoint(const TangencyProblem<D, S> &p) :
      r(p.r), length(value_of(norm(p.r))), g_i(PowerNorm<D, S>::gauge(p.i, p.powers_i)),
      g_j(PowerNorm<D, S>::gauge(p.j, p.powers_j))
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
    lift_diagonal<D>(at.jacobian, unit(at) / length);
    return at;
  }

  static Vec<M, T> step(const Linearised<M, T> &at) { return solved(at.jacobian, at.residual); }

  T unit(const Linearised<M, T> &at) const
  {
    T square = 0;
    for (int a = 0; a < D; ++a) square += at.jacobian.row[D][a] * at.jacobian.row[D][a];
    return sqrt(square);
  }

  /// Faces leave the point undetermined, but they determine the normal.
  static constexpr bool MAY_BE_ILL_POSED = false;

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
  T length;  // gives all equations the same unit
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

/// End of Newton's method: a step so short that it leaves an error of its square, a residual that
/// is rounding, which determines the unknowns only as far as the matrix does, or neither.
enum class NewtonEnd { SHORT_STEP, ROUNDING, FAILED };

/// Newton's method with steps shortened until the residual decreases. A step shorter than
/// `tolerance` times the unknowns is taken and is the last. On request, also returns the matrix of
/// the last step.
template <class Equations, int M, class T>
NewtonEnd newton(const Equations &equations, Vec<M, T> &z, T tolerance, int &iterations,
                 Matrix<M, T> *matrix = nullptr)
{
  constexpr int LONGEST = sizeof(T) > 8 ? 200 : 60;
  constexpr T ROUNDING = 16 * std::numeric_limits<T>::epsilon();
  auto at = equations.linearised(z);
  T size = norm_sq(at.residual);
  for (int n = 0; n < LONGEST; ++n) {
    const Vec<M, T> step = equations.step(at);
    const T step_sq = norm_sq(step);
    if (!(step_sq < std::numeric_limits<T>::max())) break;
    ++iterations;
    if (step_sq <= tolerance * tolerance * norm_sq(z)) {
      z -= step;
      if (matrix != nullptr) *matrix = at.jacobian;
      return NewtonEnd::SHORT_STEP;
    }
    T fraction = 1;
    const T smallest = T(1e-4) * std::min(T(1), T(sqrt(norm_sq(z) / step_sq)));
    bool is_shorter = false;
    for (; !is_shorter && fraction >= smallest; fraction *= T(0.5)) {
      const Vec<M, T> trial = z - fraction * step;
      const auto next = equations.linearised(trial);
      const T next_size = norm_sq(next.residual);
      is_shorter = next_size <= (1 - T(0.2) * fraction) * size;
      if (!is_shorter) continue;
      z = trial;
      at = next;
      size = next_size;
    }
    if (!is_shorter) break;
  }
  const T rounding = ROUNDING * equations.unit(at);
  return size <= rounding * rounding ? NewtonEnd::ROUNDING : NewtonEnd::FAILED;
}

/// The same for all lanes of a pack that are `sought`, without shortening of steps: true for those
/// that full steps lead to convergence. Converged lanes wait.
template <class Equations, int M, class T>
Truth<T> newton_in_lanes(const Equations &equations, Vec<M, T> &z, double tolerance,
                         const Truth<T> &sought, Matrix<M, T> *matrix = nullptr)
{
  constexpr int LONGEST = 12;
  Truth<T> found = sought & !sought, open = sought;
  if (!any(open)) return found;
  auto at = equations.linearised(z);
  for (int n = 0; n < LONGEST; ++n) {
    const Vec<M, T> step = equations.step(at);
    const Truth<T> last = open & (norm_sq(step) <= tolerance * tolerance * norm_sq(z));
    z = chosen(open, z - step, z);
    found = found | last;
    open = open & !last;
    if (!any(open)) break;
    const auto next = equations.linearised(z);
    open = open & (norm_sq(next.residual) <= 0.8 * norm_sq(at.residual));
    at = next;
  }
  if (matrix != nullptr) *matrix = at.jacobian;
  return found;
}

}  // namespace detail

}  // namespace jamshape
