#pragma once

#include "contact/contact.hpp"
#include "contact/math/dual.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>

namespace jamshape {

/// Shapes with b^2 = ac to this are neither long nor flat.
inline constexpr double SELF_DUAL = 1e-9;

/// The surface |x/a|^2p + |y/b|^2p + |z/c|^2p = 1 (Yuan et al. 2019, Eq. 1); in 2D the first two
/// axes alone. p = 1 is an ellipsoid, p > 1 tends to a box, p < 1 to an octahedron.
struct Superellipsoid {
  Vec<3> semi_axes;
  double p;

  /// A disc or a sphere: in 2D the third axis does not count.
  template <int D> bool is_round() const
  {
    for (int k = 1; k < D; ++k) {
      if (semi_axes[k] != semi_axes[0]) return false;
    }
    return p == 1.0;
  }

  /// Axis of symmetry of a spheroid, whose two other axes are equal; other exponents have corners
  /// or edges about every axis.
  std::optional<int> symmetry_axis() const
  {
    for (int k = 0; k < 3; ++k) {
      if (p == 1.0 && semi_axes[(k + 1) % 3] == semi_axes[(k + 2) % 3]) return k;
    }
    return std::nullopt;
  }

  /// The longest axis of long particles and the shortest of flat ones (Yuan et al. 2019, Sec. 2.4);
  /// the first one if they are equal, as in cubes.
  template <int D> std::optional<int> director() const
  {
    if (is_round<D>()) return std::nullopt;
    const double *const begin = semi_axes.c, *const end = begin + D;
    const auto range = std::minmax_element(begin, end);
    const double shortest = *range.first, longest = *range.second;
    bool is_long = true;
    if (D == 3 && shortest != longest) {
      const double middle = semi_axes[0] + semi_axes[1] + semi_axes[2] - shortest - longest;
      is_long = shortest * longest > (1.0 + SELF_DUAL) * middle * middle;
    }
    return static_cast<int>(std::find(begin, end, is_long ? longest : shortest) - begin);
  }

  /// Largest distance of a point of the surface from the centre: by Hoelder's inequality for p > 1,
  /// the longest semi-axis otherwise.
  template <int D> double bounding_radius() const
  {
    double longest = 0.0, sum = 0.0;
    for (int k = 0; k < D; ++k) longest = std::max(longest, semi_axes[k]);
    if (p <= 1.0) return longest;
    for (int k = 0; k < D; ++k) sum += std::pow(semi_axes[k] / longest, 2.0 * p / (p - 1.0));
    return longest * std::pow(sum, (p - 1.0) / (2.0 * p));
  }
};

/// The exponent, 1 if it is not given.
struct SuperellipsoidForm {
  double p = 1.0;

  /// Returns nothing unless particles of this exponent are strictly convex.
  static std::optional<SuperellipsoidForm> from(const FormNumbers &numbers, int /*dimension*/)
  {
    if (numbers.empty()) return SuperellipsoidForm{};
    const bool is_one = numbers.size() == 1 && numbers[0] > 0.5 && std::isfinite(numbers[0]);
    return is_one ? std::optional<SuperellipsoidForm>({numbers[0]}) : std::nullopt;
  }
};

/// Returns nothing unless the semi-axes are positive lengths.
inline std::optional<Superellipsoid> superellipsoid_from(const Vec<3> &semi_axes, double p)
{
  for (int k = 0; k < 3; ++k) {
    if (!(semi_axes[k] > 0.0) || !std::isfinite(semi_axes[k])) return std::nullopt;
  }
  return Superellipsoid{semi_axes, p};
}

/// Volume (area in 2D) and moments, Dirichlet's integral: with m = 1/2p the volume is prod 2 a_k
/// G(1 + m)^D / G(1 + D m) and the mean of x_k^2 is a_k^2 G(3 m) G(1 + D m) / (G(m) G(1 + (D + 2)
/// m)).
template <int D> SubstrateDrag substrate_drag(const Superellipsoid &shape)
{
  const double m = 0.5 / shape.p, all = std::lgamma(1.0 + D * m);
  double volume = std::exp(D * std::lgamma(1.0 + m) - all);
  for (int k = 0; k < D; ++k) volume *= 2.0 * shape.semi_axes[k];
  const double ratio =
      std::exp(std::lgamma(3.0 * m) - std::lgamma(m) + all - std::lgamma(1.0 + (D + 2) * m));
  Vec<3> mean_sq{};
  for (int k = 0; k < D; ++k) mean_sq[k] = ratio * shape.semi_axes[k] * shape.semi_axes[k];
  const double about_z = mean_sq[0] + mean_sq[1];
  if (D == 2) return {volume, {{mean_sq[1], mean_sq[0], about_z}}};
  return {volume, {{mean_sq[1] + mean_sq[2], mean_sq[0] + mean_sq[2], about_z}}};
}

/// Shape and pose of one particle, as the pair loops read it; in packs, of several with the same
/// exponent.
template <int D, class S = double> struct SuperellipsoidBody {
  Vec<D, S> centre;
  Vec<D, S> axis[D];
  Vec<D, Plain<S>> semi_axes;
  double p;
  Plain<S> bounding_radius;
};

/// Whether a body is a disc or a sphere.
template <int D, class S> bool is_round(const SuperellipsoidBody<D, S> &body)
{
  if (body.p != 1.0) return false;
  for (int k = 1; k < D; ++k) {
    if (body.semi_axes[k] != body.semi_axes[0]) return false;
  }
  return true;
}

/// The surface is a face where its curvature is below this fraction of that of the ellipsoid of the
/// same axes: the point of contact then moves ten times as far when the particle rotates.
inline constexpr double FACE_CURVATURE = 0.1;

/// Whether the surface is flat in all directions at a point, relative to the centre, or at that of
/// a scaled body. Near the end of axis k its curvature along axis l is (2p-1) |x_l/a_l|^(2p-2)
/// times the ellipsoid's a_k / a_l^2.
template <int D, class S>
bool is_flat_at(const SuperellipsoidBody<D, S> &body, const Vec<D, S> &point)
{
  if (!(body.p > 1.0)) return false;
  double along[D];  // coordinates over semi-axes
  int facing = 0;
  for (int k = 0; k < D; ++k) {
    along[k] = std::abs(static_cast<double>(dot(body.axis[k], point))) / body.semi_axes[k];
    if (along[k] > along[facing]) facing = k;
  }
  for (int k = 0; k < D; ++k) {
    const double bend =
        (2.0 * body.p - 1.0) * std::pow(along[k] / along[facing], 2.0 * body.p - 2.0);
    if (k != facing && !(bend < FACE_CURVATURE)) return false;
  }
  return true;
}

/// x^e for x >= 0. Small integer powers, which the usual shapes need, are products; so are
/// half-integer ones of scalars without derivatives (the square root of a dual number has no
/// derivative at 0, but x^1.5 has).
template <class T> class Exponent {
 public:
  explicit Exponent(T exponent) : e(exponent), halves(halves_in(exponent)) {}

  T value() const { return e; }

  template <class S> S operator()(const S &x) const
  {
    if (halves >= 0 && halves % 2 == 0) return product(x, halves / 2);
    if constexpr (std::is_same_v<S, ValueOf<S>>) {
      if (halves >= 0) return product(sqrt(x), halves);
    }
    return pow(x, e);
  }

 private:
  T e;
  int halves;  // 2e, or -1

  static int halves_in(T exponent)
  {
    const T twice = 2 * exponent;
    return twice == floor(twice) && exponent <= T(32) ? static_cast<int>(twice) : -1;
  }

  template <class S> static S product(const S &x, int times)
  {
    S power = 1.0, square = x;
    for (int left = times; left > 0; left >>= 1) {
      if (left & 1) power *= square;
      if (left > 1) square *= square;
    }
    return power;
  }
};

/// A norm at a vector: its value N, its gradient and its second derivatives.
template <int D, class S> struct NormAt {
  S value;
  Vec<D, S> gradient;
};
template <int D, class T> struct CurvedNormAt {
  T value;
  Vec<D, T> gradient;
  T hessian[D][D];
};

/// N(v) = (sum |s_k v_k|^(e+1))^(1/(e+1)), v_k along the body's axes. Both norms of a
/// superellipsoid have this form, each the dual of the other:
///     the gauge g of a point, 1 on the surface:     s_k = 1 / a_k, e = 2p - 1
///     the support function h of a direction:        s_k = a_k,     e = 1 / (2p - 1)
/// The gradient of g at a point is a normal there; the gradient of h is the point with that normal.
template <int D, class S> class PowerNorm {
 public:
  using T = ValueOf<S>;
  using Power = Common<T>;

  static PowerNorm gauge(const SuperellipsoidBody<D, S> &body, Power exponent)
  {
    Vec<D, T> scale;
    for (int k = 0; k < D; ++k) scale[k] = 1 / T(body.semi_axes[k]);
    return PowerNorm(body, scale, exponent);
  }
  static PowerNorm gauge(const SuperellipsoidBody<D, S> &body)
  {
    return gauge(body, 2 * Power(body.p) - 1);
  }

  static PowerNorm support(const SuperellipsoidBody<D, S> &body, Power exponent)
  {
    Vec<D, T> scale;
    for (int k = 0; k < D; ++k) scale[k] = body.semi_axes[k];
    return PowerNorm(body, scale, exponent);
  }
  static PowerNorm support(const SuperellipsoidBody<D, S> &body)
  {
    return support(body, 1 / (2 * Power(body.p) - 1));
  }

  S value(const Vec<D, S> &v) const { return at(v).value; }

  NormAt<D, S> at(const Vec<D, S> &v) const
  {
    const Components c = components<false>(v);
    NormAt<D, S> norm{c.norm, {}};
    for (int k = 0; k < D; ++k) norm.gradient += c.gradient[k] * body->axis[k];
    return norm;
  }

  /// Not available for dual numbers.
  CurvedNormAt<D, T> curved_at(const Vec<D, T> &v) const
  {
    const Components c = components<true>(v);
    CurvedNormAt<D, T> norm{c.norm, {}, {}};
    for (int k = 0; k < D; ++k) norm.gradient += c.gradient[k] * body->axis[k];
    const T bend = e.value() / c.norm;
    for (int row = 0; row < D; ++row) {
      for (int col = 0; col <= row; ++col) {
        T sum = -norm.gradient[row] * norm.gradient[col];
        for (int k = 0; k < D; ++k) sum += c.bend[k] * body->axis[k][row] * body->axis[k][col];
        norm.hessian[row][col] = norm.hessian[col][row] = bend * sum;
      }
    }
    return norm;
  }

 private:
  const SuperellipsoidBody<D, S> *body;
  Vec<D, T> scale;
  Exponent<Power> e, e_minus_one;

  PowerNorm(const SuperellipsoidBody<D, S> &of, const Vec<D, T> &scales, Power exponent) :
      body(&of), scale(scales), e(exponent), e_minus_one(exponent - 1)
  {
  }

  struct Components {
    S norm;
    S gradient[D];
    T bend[D];  // s_k^2 (|s_k v_k| / N)^(e-1), where CURVED
  };

  /// Second derivatives require plain numbers and e >= 1, where the norm is smooth.
  template <bool CURVED> Components components(const Vec<D, S> &v) const
  {
    S t[D], largest = 0.0;
    for (int k = 0; k < D; ++k) {
      t[k] = scale[k] * dot(body->axis[k], v);
      largest = most(largest, S(abs(t[k])));
    }
    const S inverse = T(1) / largest;
    Components c;
    S sum = T(0), power[D];
    T lower_power[D]{};
    for (int k = 0; k < D; ++k) {  // no over- or underflow: the largest ratio is 1
      const S ratio = abs(t[k]) * inverse;
      if constexpr (CURVED) {
        lower_power[k] = e_minus_one(ratio);
        power[k] = ratio * lower_power[k];
      } else {
        power[k] = e(ratio);
      }
      sum += ratio * power[k];
    }
    const S grown = root(sum);
    c.norm = largest * grown;
    const S shrink = grown / sum;  // (largest / N)^e
    const T shrink_lower = value_of(shrink) * value_of(grown);
    for (int k = 0; k < D; ++k) {
      c.gradient[k] = copysign(scale[k] * power[k] * shrink, t[k]);
      c.bend[k] = scale[k] * scale[k] * lower_power[k] * shrink_lower;
    }
    return c;
  }

  S root(const S &sum) const
  {
    if (e.value() == 1) return sqrt(sum);
    if (e.value() == 3) return sqrt(sqrt(sum));
    return pow(sum, 1 / (e.value() + 1));
  }
};

}  // namespace jamshape
