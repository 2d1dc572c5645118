#pragma once

#include "contact/math/vec.hpp"
#include "contact/superellipsoid/equations.hpp"
#include "contact/superellipsoid/shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace jamshape {

namespace detail {

/// The slow but certain way to a tangency, for any two exponents: the least t with a point y in
/// both bodies scaled by t. With q = 2p and x_k the components of y over the semi-axes, g(y) <= t
/// if there are u_k with
///     |x_k| <= u_k^(1/q) t^(1 - 1/q),    sum u_k <= t,
/// all of them convex cones with self-concordant barriers B (Chares 2009 for the power cone).
/// Newton's method on t / mu + B with steps damped by 1 / (1 + decrement) then converges from every
/// interior point (Nesterov & Nemirovskii 1994), for flat faces and sharp tips alike, and the t
/// reached exceeds the least by at most mu times the barrier's parameter.
template <int D, class T> class ConeBarrier {
 public:
  static constexpr int M = 3 * D + 1;  // y, t, u of i, u of j

  template <class Body>
  ConeBarrier(const Body &i, const Body &j, const Vec<D, T> &separation) :
      r(separation), of_i(i), of_j(j)
  {
    const Vec<D, T> y = T(0.5) * r, x_i = of_i.components(y), x_j = of_j.components(y);
    z[D] = mu = 2 * std::max(of_i.gauge(x_i), of_j.gauge(x_j));
    for (int k = 0; k < D; ++k) z[k] = y[k];
    of_i.share(x_i, z[D], &z[D + 1]);
    of_j.share(x_j, z[D], &z[2 * D + 1]);
  }

  /// Follows the central path down to mu = `last` t; false if rounding spoiled a step.
  bool follow(T last, int &iterations)
  {
    for (bool is_last = false; !is_last;) {
      is_last = mu <= last * z[D];
      if (!centre(is_last ? T(1e-5) : NEAR, iterations)) return false;
      if (!is_last) mu *= RATIO;
    }
    return true;
  }

  /// A normal, and a point with a scale of at most t.
  Tangency<D, T> tangency() const
  {
    const Vec<D, T> y = point(), x = of_i.components(y);
    Vec<D, T> n{};
    for (int k = 0; k < D; ++k) {
      n += Cone(of_i.alpha[k], x[k], z[D + 1 + k], z[D]).slope[0] * of_i.row[k];
    }
    return {z[D], n, y, r - y};
  }

 private:
  /// |x| <= u^alpha t^(1 - alpha): gradient and second derivatives of its barrier with respect to
  /// (x, u, t).
  struct Cone {
    T slope[3], bend[3][3];

    Cone(T alpha, T x, T u, T t)
    {
      const T beta = 1 - alpha, mean = t * pow(u / t, alpha);
      const T over[2] = {1 / (mean - x), 1 / (mean + x)};
      const T by_u = alpha * mean / u, by_t = beta * mean / t;
      const T bent = alpha * beta * mean * (over[0] + over[1]);
      slope[0] = over[0] - over[1];
      slope[1] = -(over[0] + over[1]) * by_u - beta / u;
      slope[2] = -(over[0] + over[1]) * by_t - alpha / t;
      const T d[2][3] = {{-over[0], over[0] * by_u, over[0] * by_t},
                         {over[1], over[1] * by_u, over[1] * by_t}};
      for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) bend[a][b] = d[0][a] * d[0][b] + d[1][a] * d[1][b];
      }
      bend[1][1] += (bent + beta) / (u * u);
      bend[2][2] += (bent + alpha) / (t * t);
      bend[1][2] -= bent / (u * t);
      bend[2][1] -= bent / (u * t);
    }
  };

  struct Half {
    Vec<D, T> row[D];  // x_k = row_k . y
    T alpha[D];

    template <class Body> explicit Half(const Body &body)
    {
      for (int k = 0; k < D; ++k) {
        row[k] = (1 / T(body.semi_axes[k])) * body.axis[k];
        alpha[k] = 1 / (2 * T(body.p));
      }
    }

    Vec<D, T> components(const Vec<D, T> &y) const
    {
      Vec<D, T> x;
      for (int k = 0; k < D; ++k) x[k] = dot(row[k], y);
      return x;
    }

    T gauge(const Vec<D, T> &x) const
    {
      T most = 0, sum = 0;
      for (int k = 0; k < D; ++k) most = std::max(most, abs(x[k]));
      if (most == 0) return 0;
      for (int k = 0; k < D; ++k) sum += pow(abs(x[k]) / most, 1 / alpha[k]);
      return most * pow(sum, alpha[0]);
    }

    void share(const Vec<D, T> &x, T t, T *u) const
    {
      T sum = 0;
      for (int k = 0; k < D; ++k) sum += u[k] = pow(abs(x[k]) / t, 1 / alpha[k]);
      for (int k = 0; k < D; ++k) u[k] = t * (u[k] + (1 - sum) / (D + 1));
    }

    bool is_inside(const Vec<D, T> &x, T t, const T *u) const
    {
      T sum = 0;
      for (int k = 0; k < D; ++k) {
        if (!(u[k] > 0) || !(abs(x[k]) < t * pow(u[k] / t, alpha[k]))) return false;
        sum += u[k];
      }
      return sum < t;
    }
  };

  Vec<D, T> r;
  Half of_i, of_j;
  Vec<M, T> z{};
  T mu;

  static constexpr T NEAR = T(0.3);   // decrement below which full steps are taken
  static constexpr T RATIO = T(0.3);  // of successive mu

  Vec<D, T> point() const
  {
    Vec<D, T> y;
    for (int k = 0; k < D; ++k) y[k] = z[k];
    return y;
  }

  bool is_inside() const
  {
    const Vec<D, T> y = point();
    return z[D] > 0 && of_i.is_inside(of_i.components(y), z[D], &z.c[D + 1]) &&
           of_j.is_inside(of_j.components(r - y), z[D], &z.c[2 * D + 1]);
  }

  bool centre(T tolerance, int &iterations)
  {
    constexpr int LONGEST = 60;
    for (int n = 0; n < LONGEST; ++n) {
      const Linearised<M, T> at = linearised();
      const Vec<M, T> step = solved_symmetric(at.jacobian, at.residual), before = z;
      const T decrement = sqrt(dot(step, at.residual));
      ++iterations;
      z -= (decrement < NEAR ? T(1) : 1 / (1 + decrement)) * step;
      if (!is_inside()) {  // also rejects NaN
        z = before;
        return false;
      }
      if (decrement < tolerance) return true;
    }
    return false;
  }

  Linearised<M, T> linearised() const
  {
    Linearised<M, T> at{};
    at.residual[D] = 1 / mu;
    const Vec<D, T> y = point();
    add(of_i, of_i.components(y), 1, D + 1, at);
    add(of_j, of_j.components(r - y), -1, 2 * D + 1, at);
    return at;
  }

  void add(const Half &half, const Vec<D, T> &x, int sign, int first, Linearised<M, T> &at) const
  {
    const T t = z[D];
    T room = t;
    for (int k = 0; k < D; ++k) room -= z[first + k];
    for (int k = 0; k < D; ++k) {
      const Cone cone(half.alpha[k], x[k], z[first + k], t);
      T to[M][3]{};  // derivatives of (x, u, t) with respect to the unknowns
      for (int a = 0; a < D; ++a) to[a][0] = sign * half.row[k][a];
      to[first + k][1] = to[D][2] = 1;
      const auto touches = [&](int a) { return a <= D || a == first + k; };
      for (int a = 0; a < M; ++a) {
        if (!touches(a)) continue;
        T by[3]{};
        for (int m = 0; m < 3; ++m) {
          at.residual[a] += to[a][m] * cone.slope[m];
          for (int l = 0; l < 3; ++l) by[m] += to[a][l] * cone.bend[l][m];
        }
        for (int b = 0; b <= a; ++b) {
          if (!touches(b)) continue;
          for (int m = 0; m < 3; ++m) at.jacobian.row[a][b] += by[m] * to[b][m];
        }
      }
    }
    T of_room[M]{};
    of_room[D] = 1 / room;
    for (int k = 0; k < D; ++k) of_room[first + k] = -1 / room;
    for (int a = 0; a < M; ++a) {
      at.residual[a] -= of_room[a];
      for (int b = 0; b <= a; ++b) at.jacobian.row[a][b] += of_room[a] * of_room[b];
    }
  }
};

}  // namespace detail

}  // namespace jamshape
