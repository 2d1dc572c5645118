#pragma once

#include "contact/math/vec.hpp"
#include "contact/superellipsoid/equations.hpp"
#include "contact/superellipsoid/shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace jamshape {

namespace detail {

/// The slow but certain way to a tangency, for any exponents: the least t with a point y in both
/// bodies scaled by t. With q = 2p and x_k the components of y over the semi-axes, g(y) <= t if
/// there are u_k with
///     |x_k| <= u_k^(1/q) t^(1 - 1/q),    sum u_k <= t,
/// all of them convex cones with self-concordant barriers B (Chares 2009 for the power cone). If
/// NESTED, for two exponents, the x_k across z meet the same conditions with a scale s in place of
/// t, and s and the component along z those with t.
/// Newton's method on t / mu + B with steps damped by 1 / (1 + decrement) then converges from every
/// interior point (Nesterov & Nemirovskii 1994), for flat faces and sharp tips alike, and the t
/// reached exceeds the least by at most mu times the barrier's parameter.
template <int D, class T, bool NESTED> class ConeBarrier {
 public:
  static constexpr int OF_ONE = NESTED ? D + 2 : D;  // u, and s at the end
  static constexpr int M = D + 1 + 2 * OF_ONE;       // y, t, those of i, those of j

  template <class Body>
  ConeBarrier(const Body &i, const Body &j, const Vec<D, T> &separation) :
      r(separation), of_i(i), of_j(j)
  {
    const Vec<D, T> y = T(0.5) * r, x_i = of_i.components(y), x_j = of_j.components(y);
    z[D] = mu = 2 * std::max(of_i.gauge(x_i), of_j.gauge(x_j));
    for (int k = 0; k < D; ++k) z[k] = y[k];
    of_i.share(x_i, z[D], &z[D + 1]);
    of_j.share(x_j, z[D], &z[D + 1 + OF_ONE]);
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
      const Link link = Half::link(k);
      const T top = link.is_inner ? z[D + OF_ONE] : z[D];
      n += Cone(of_i.alpha[k], x[k], z[D + 1 + link.u], top).slope[0] * of_i.row[k];
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

  /// The u and the scale, s or t, of the cone of component k; k = D is that of s.
  struct Link {
    int u;
    bool is_inner;
  };

  struct Half {
    static constexpr int CONES = NESTED ? D + 1 : D;

    Vec<D, T> row[D];  // x_k = row_k . y
    T alpha[CONES];

    static Link link(int k) { return {k, NESTED && k < D - 1}; }

    template <class Body> explicit Half(const Body &body)
    {
      for (int k = 0; k < D; ++k) {
        row[k] = (1 / T(body.semi_axes[k])) * body.axis[k];
        alpha[k] = 1 / (2 * T(NESTED && k < D - 1 ? body.p_across : body.p));
      }
      if (NESTED) alpha[CONES - 1] = alpha[D - 1];
    }

    Vec<D, T> components(const Vec<D, T> &y) const
    {
      Vec<D, T> x;
      for (int k = 0; k < D; ++k) x[k] = dot(row[k], y);
      return x;
    }

    T gauge(const Vec<D, T> &x) const
    {
      if (!NESTED) return norm_of<D>(x, alpha[0]);
      const T across = norm_of<2>(x, alpha[0]);
      return norm_of<2>(Vec<2, T>{{across, x[D - 1]}}, alpha[D - 1]);
    }

    /// Values of u, and of s, well inside their cones.
    void share(const Vec<D, T> &x, T t, T *u) const
    {
      if (!NESTED) return share_of<D>(x, alpha[0], t, D + 1, u);
      const T across = norm_of<2>(x, alpha[0]);
      T shares[2];
      share_of<2>(Vec<2, T>{{across, x[D - 1]}}, alpha[D - 1], t, 4, shares);
      u[OF_ONE - 1] = t * pow(shares[0] / t, alpha[D - 1]);
      share_of<2>(x, alpha[0], u[OF_ONE - 1], 3, u);
      const T room = (t - shares[0] - shares[1]) / 3;
      u[D] = shares[0] + room;
      u[D - 1] = shares[1] + room;
    }

    bool is_inside(const Vec<D, T> &x, T t, const T *u) const
    {
      const T s = NESTED ? u[OF_ONE - 1] : t;
      T sum = 0, inner = 0;
      for (int k = 0; k < CONES; ++k) {
        const T along = k < D ? x[k] : s, top = link(k).is_inner ? s : t;
        if (!(u[k] > 0) || !(top > 0) || !(abs(along) < top * pow(u[k] / top, alpha[k])))
          return false;
        (link(k).is_inner ? inner : sum) += u[k];
      }
      return sum < t && inner < s;
    }

   private:
    template <int K, class Components> static T norm_of(const Components &x, T alpha)
    {
      T most = 0, sum = 0;
      for (int k = 0; k < K; ++k) most = std::max(most, abs(x[k]));
      if (most == 0) return 0;
      for (int k = 0; k < K; ++k) sum += pow(abs(x[k]) / most, 1 / alpha);
      return most * pow(sum, alpha);
    }

    /// Divides the remainder of t into `parts`, one for each u.
    template <int K, class Components>
    static void share_of(const Components &x, T alpha, T t, int parts, T *u)
    {
      T sum = 0;
      for (int k = 0; k < K; ++k) sum += u[k] = pow(abs(x[k]) / t, 1 / alpha);
      for (int k = 0; k < K; ++k) u[k] = t * (u[k] + (1 - sum) / parts);
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
           of_j.is_inside(of_j.components(r - y), z[D], &z.c[D + 1 + OF_ONE]);
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
    add(of_j, of_j.components(r - y), -1, D + 1 + OF_ONE, at);
    return at;
  }

  void add(const Half &half, const Vec<D, T> &x, int sign, int first, Linearised<M, T> &at) const
  {
    const int inner = first + OF_ONE - 1;  // of s, if NESTED
    for (int k = 0; k < Half::CONES; ++k) {
      const int u = first + k, top = Half::link(k).is_inner ? inner : D;
      const Cone cone(half.alpha[k], k < D ? x[k] : z[inner], z[u], z[top]);
      T to[M][3]{};  // derivatives of (x, u, t) with respect to the unknowns
      for (int a = 0; a < D && k < D; ++a) to[a][0] = sign * half.row[k][a];
      if (k == D) to[inner][0] = 1;
      to[u][1] = to[top][2] = 1;
      const auto touches = [&](int a) { return a <= D || a == u || (NESTED && a == inner); };
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
    add_room(false, D, first, at);
    if (NESTED) add_room(true, inner, first, at);
  }

  /// The barrier of sum u <= t, or of the inner ones and s.
  void add_room(bool is_inner, int top, int first, Linearised<M, T> &at) const
  {
    const auto counts = [&](int k) { return Half::link(k).is_inner == is_inner; };
    T room = z[top];
    for (int k = 0; k < Half::CONES; ++k) {
      if (counts(k)) room -= z[first + k];
    }
    T of_room[M]{};
    of_room[top] = 1 / room;
    for (int k = 0; k < Half::CONES; ++k) {
      if (counts(k)) of_room[first + k] = -1 / room;
    }
    for (int a = 0; a < M; ++a) {
      at.residual[a] -= of_room[a];
      for (int b = 0; b <= a; ++b) at.jacobian.row[a][b] += of_room[a] * of_room[b];
    }
  }
};

}  // namespace detail

}  // namespace jamshape
