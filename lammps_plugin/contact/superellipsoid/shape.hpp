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

/// The surface (|x/a|^2s + |y/b|^2s)^(p/s) + |z/c|^2p = 1, n1 = 2p and n2 = 2s in LAMMPS (Barr
/// 1981). With s = p it is |x/a|^2p + |y/b|^2p + |z/c|^2p = 1 (Yuan et al. 2019, Eq. 1), in 2D of
/// the first two axes alone: p = 1 is an ellipsoid, p > 1 tends to a box, p < 1 to an octahedron.
/// Sections across z have the exponent s: with s = 1 a large p tends to a cylinder.
struct Superellipsoid {
  Vec<3> semi_axes;
  double p, p_across;

  bool is_ellipsoid() const { return p == 1.0 && p_across == 1.0; }

  /// A disc or a sphere: in 2D the third axis does not count.
  template <int D> bool is_round() const
  {
    for (int k = 1; k < D; ++k) {
      if (semi_axes[k] != semi_axes[0]) return false;
    }
    return is_ellipsoid();
  }

  /// Axis of symmetry of a spheroid, whose two other axes are equal, and z of a body with round
  /// sections; other exponents have corners or edges about every axis.
  std::optional<int> symmetry_axis() const
  {
    for (int k = 0; k < 3; ++k) {
      const bool has_sections = is_ellipsoid() || (k == 2 && p_across == 1.0);
      if (has_sections && semi_axes[(k + 1) % 3] == semi_axes[(k + 2) % 3]) return k;
    }
    return std::nullopt;
  }

  /// The longest axis of long particles and the shortest of flat ones (Yuan et al. 2019, Sec. 2.4);
  /// the first one if they are equal, as in cubes; z if the two exponents alone distinguish it.
  template <int D> std::optional<int> director() const
  {
    if (is_round<D>()) return std::nullopt;
    if (D == 3 && p != p_across && semi_axes[0] == semi_axes[1]) return 2;
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

  /// Largest distance of a point of the surface from the centre; that of a section across z takes
  /// the place of its two axes.
  template <int D> double bounding_radius() const
  {
    if (D == 2 || p == p_across) return farthest<D>(semi_axes.c, p);
    const double both[2] = {farthest<2>(semi_axes.c, p_across), semi_axes[2]};
    return farthest<2>(both, p);
  }

 private:
  /// Largest distance for one exponent: by Hoelder's inequality for p > 1, the longest semi-axis
  /// otherwise.
  template <int M> static double farthest(const double *axes, double exponent)
  {
    double longest = 0.0, sum = 0.0;
    for (int k = 0; k < M; ++k) longest = std::max(longest, axes[k]);
    if (exponent <= 1.0) return longest;
    for (int k = 0; k < M; ++k)
      sum += std::pow(axes[k] / longest, 2.0 * exponent / (exponent - 1.0));
    return longest * std::pow(sum, (exponent - 1.0) / (2.0 * exponent));
  }
};

/// The exponents, 1 if they are not given.
struct SuperellipsoidForm {
  double p = 1.0, p_across = 1.0;

  /// Reads p, or n1 = 2p and n2, that of sections across z, which are all that counts in 2D.
  /// Returns nothing unless particles of these exponents are strictly convex.
  static std::optional<SuperellipsoidForm> from(const FormNumbers &numbers, int dimension)
  {
    if (numbers.size() > 2) return std::nullopt;
    SuperellipsoidForm form;
    if (numbers.size() == 1) form = {numbers[0], numbers[0]};
    if (numbers.size() == 2) form = {0.5 * numbers[dimension == 2 ? 1 : 0], 0.5 * numbers[1]};
    for (const double exponent : {form.p, form.p_across}) {
      if (!(exponent > 0.5) || !std::isfinite(exponent)) return std::nullopt;
    }
    return form;
  }
};

/// Returns nothing unless the semi-axes are positive lengths.
inline std::optional<Superellipsoid> superellipsoid_from(const Vec<3> &semi_axes,
                                                         const SuperellipsoidForm &form)
{
  for (int k = 0; k < 3; ++k) {
    if (!(semi_axes[k] > 0.0) || !std::isfinite(semi_axes[k])) return std::nullopt;
  }
  return Superellipsoid{semi_axes, form.p, form.p_across};
}

/// Logarithms of Dirichlet's integrals over the unit body of D axes with the exponent 1/m: of its
/// volume over 2^D, G(1 + m)^D / G(1 + D m), and of the mean of x_k^2,
/// G(3 m) G(1 + D m) / (G(m) G(1 + (D + 2) m)).
struct DirichletLogs {
  double volume, mean_sq;

  DirichletLogs(int D, double m)
  {
    const double all = std::lgamma(1.0 + D * m);
    volume = D * std::lgamma(1.0 + m) - all;
    mean_sq = std::lgamma(3.0 * m) - std::lgamma(m) + all - std::lgamma(1.0 + (D + 2) * m);
  }
};

/// Volume (area in 2D) and moments. The sections across z of a body with two exponents are those of
/// the body with p alone, with the area and the means of their own exponent (Jaklic, Leonardis &
/// Solina 2000, Eqs. 2.60 and 2.63).
template <int D> SubstrateDrag substrate_drag(const Superellipsoid &shape)
{
  const DirichletLogs all(D, 0.5 / shape.p), section(2, 0.5 / shape.p_across),
      other(2, 0.5 / shape.p);
  double volume = std::exp(all.volume) * std::exp(section.volume - other.volume);
  for (int k = 0; k < D; ++k) volume *= 2.0 * shape.semi_axes[k];
  const double along = std::exp(all.mean_sq),
               across = along * std::exp(section.mean_sq - other.mean_sq);
  Vec<3> mean_sq{};
  for (int k = 0; k < D; ++k) {
    mean_sq[k] = (k < 2 ? across : along) * shape.semi_axes[k] * shape.semi_axes[k];
  }
  const double about_z = mean_sq[0] + mean_sq[1];
  if (D == 2) return {volume, {{mean_sq[1], mean_sq[0], about_z}}};
  return {volume, {{mean_sq[1] + mean_sq[2], mean_sq[0] + mean_sq[2], about_z}}};
}

/// Shape and pose of one particle, as the pair loops read it; in packs, of several with the same
/// exponents.
template <int D, class S = double> struct SuperellipsoidBody {
  Vec<D, S> centre;
  Vec<D, S> axis[D];
  Vec<D, Plain<S>> semi_axes;
  double p, p_across;
  Plain<S> bounding_radius;

  bool is_ellipsoid() const { return p == 1.0 && p_across == 1.0; }
  bool has_two_exponents() const { return D == 3 && p != p_across; }
};

/// Whether a body is a disc or a sphere.
template <int D, class S> bool is_round(const SuperellipsoidBody<D, S> &body)
{
  if (!body.is_ellipsoid()) return false;
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
/// times the ellipsoid's a_k / a_l^2; with two exponents, at the end of z, that of a power p/s of
/// the sum of both.
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
  const auto bend_of = [&](int k) {
    if (!body.has_two_exponents())
      return (2.0 * body.p - 1.0) * std::pow(along[k] / along[facing], 2.0 * body.p - 2.0);
    const double n_1 = 2.0 * body.p, n_2 = 2.0 * body.p_across;
    if (facing < 2) {
      const double n = k < 2 ? n_2 : n_1;
      return (n - 1.0) * std::pow(along[k] / along[facing], n - 2.0);
    }
    const double across = std::pow(std::pow(along[0], n_2) + std::pow(along[1], n_2), 1.0 / n_2);
    if (across == 0.0) return 0.0;
    const double share = along[k] / across;
    return std::pow(across / along[facing], n_1 - 2.0) *
           ((n_2 - 1.0) * std::pow(share, n_2 - 2.0) +
            (n_1 - n_2) * std::pow(share, 2.0 * n_2 - 2.0));
  };
  for (int k = 0; k < D; ++k) {
    if (k != facing && !(bend_of(k) < FACE_CURVATURE)) return false;
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

/// The powers e of a norm: `axis` of all coordinates, or with two exponents of z and of the norm of
/// the section across it, which has the power `across`.
template <class T> struct Powers {
  T axis, across;
};

/// A vector shorter than this counts as 0; its inverse and derivatives of that are finite.
inline constexpr double VANISHING = 1e-150;

/// N = (sum |t_k|^(e+1))^(1/(e+1)), t_k = s_k v_k, of M coordinates and what its derivatives with
/// respect to v_k consist of. Second derivatives require plain numbers and e >= 1, where the norm
/// is smooth.
template <int M, class S> struct FlatNorm {
  using T = ValueOf<S>;

  S norm;
  S gradient[M];  // s_k (|t_k| / N)^e
  T bend[M];      // s_k^2 (|t_k| / N)^(e-1), where CURVED

  /// At the origin, which a section of a body may pass through, the derivatives are set to 0.
  template <bool CURVED, bool MAY_VANISH, class Power>
  static FlatNorm at(const S (&t)[M], const T (&scale)[M], const Exponent<Power> &e,
                     const Exponent<Power> &e_minus_one)
  {
    FlatNorm of;
    S largest = MAY_VANISH ? S(T(VANISHING)) : S(T(0.0));
    for (int k = 0; k < M; ++k) largest = most(largest, S(abs(t[k])));
    const S inverse = T(1) / largest;
    S sum = T(0), power[M];
    T lower_power[M]{};
    for (int k = 0; k < M; ++k) {  // no over- or underflow: the largest ratio is 1
      const S ratio = abs(t[k]) * inverse;
      if constexpr (CURVED) {
        lower_power[k] = e_minus_one(ratio);
        power[k] = ratio * lower_power[k];
      } else {
        power[k] = e(ratio);
      }
      sum += ratio * power[k];
    }
    if (MAY_VANISH) sum = most(sum, S(T(1.0)));
    const S grown = root(sum, e.value());
    of.norm = largest * grown;
    const S shrink = grown / sum;  // (largest / N)^e
    const T shrink_lower = value_of(shrink) * value_of(grown);
    for (int k = 0; k < M; ++k) {
      of.gradient[k] = copysign(scale[k] * power[k] * shrink, t[k]);
      of.bend[k] = scale[k] * scale[k] * lower_power[k] * shrink_lower;
    }
    return of;
  }

 private:
  template <class Power> static S root(const S &sum, Power e)
  {
    if (e == 1) return sqrt(sum);
    if (e == 3) return sqrt(sqrt(sum));
    return pow(sum, 1 / (e + 1));
  }
};

/// Both norms of a superellipsoid are FlatNorms of the components v_k along the body's axes, each
/// the dual of the other:
///     the gauge g of a point, 1 on the surface:     s_k = 1 / a_k, e = 2p - 1
///     the support function h of a direction:        s_k = a_k,     e = 1 / (2p - 1)
/// The gradient of g at a point is a normal there; the gradient of h is the point with that normal.
/// With two exponents they are norms of z and of the norm of x and y, and still duals.
template <int D, class S> class PowerNorm {
 public:
  using T = ValueOf<S>;
  using Power = Common<T>;

  /// Packs hold bodies with one exponent only, so that their code stays small.
  static constexpr bool MAY_BE_NESTED = D == 3 && std::is_same_v<T, Power>;

  static PowerNorm gauge(const SuperellipsoidBody<D, S> &body, const Powers<Power> &powers)
  {
    Vec<D, T> scale;
    for (int k = 0; k < D; ++k) scale[k] = 1 / T(body.semi_axes[k]);
    return PowerNorm(body, scale, powers);
  }
  static PowerNorm gauge(const SuperellipsoidBody<D, S> &body)
  {
    return gauge(body, {2 * Power(body.p) - 1, 2 * Power(body.p_across) - 1});
  }

  static PowerNorm support(const SuperellipsoidBody<D, S> &body, const Powers<Power> &powers)
  {
    Vec<D, T> scale;
    for (int k = 0; k < D; ++k) scale[k] = body.semi_axes[k];
    return PowerNorm(body, scale, powers);
  }
  static PowerNorm support(const SuperellipsoidBody<D, S> &body)
  {
    return support(body, {1 / (2 * Power(body.p) - 1), 1 / (2 * Power(body.p_across) - 1)});
  }

  S value(const Vec<D, S> &v) const { return at(v).value; }

  NormAt<D, S> at(const Vec<D, S> &v) const
  {
    if constexpr (MAY_BE_NESTED) {
      if (is_nested()) return gathered(Nested<false>(*this, along_axes(v)));
    }
    return gathered(flat<false>(v));
  }

  /// Not available for dual numbers.
  CurvedNormAt<D, T> curved_at(const Vec<D, T> &v) const
  {
    if constexpr (MAY_BE_NESTED) {
      if (is_nested()) {
        const Nested<true> c(*this, along_axes(v));
        const Vec<D, T> across = c.across[0] * body->axis[0] + c.across[1] * body->axis[1];
        return curved(c,
                      [&](int row, int col) { return c.bend_across * across[row] * across[col]; });
      }
    }
    return curved(flat<true>(v), [](int, int) { return T(0.0); });
  }

 private:
  const SuperellipsoidBody<D, S> *body;
  Vec<D, T> scale;
  Exponent<Power> e, e_minus_one;
  Power e_across;

  PowerNorm(const SuperellipsoidBody<D, S> &of, const Vec<D, T> &scales,
            const Powers<Power> &powers) :
      body(&of), scale(scales), e(powers.axis), e_minus_one(powers.axis - 1),
      e_across(powers.across)
  {
  }

  bool is_nested() const { return __builtin_expect(e_across != e.value(), 0); }

  struct Along {
    S t[D];
  };
  Along along_axes(const Vec<D, S> &v) const
  {
    Along of;
    for (int k = 0; k < D; ++k) of.t[k] = scale[k] * dot(body->axis[k], v);
    return of;
  }

  template <bool CURVED> FlatNorm<D, S> flat(const Vec<D, S> &v) const
  {
    return FlatNorm<D, S>::template at<CURVED, false>(along_axes(v).t, scale.c, e, e_minus_one);
  }

  /// The norm of z and the norm across it; the second derivatives also contain the square of the
  /// gradient of the latter.
  template <bool CURVED> struct Nested : FlatNorm<D, S> {
    T across[2], bend_across;

    // Not inlined, so that loops over bodies with one exponent stay small.
    [[gnu::noinline]] Nested(const PowerNorm &of, const Along &along)
    {
      const Exponent<Power> e_across(of.e_across), across_less(of.e_across - 1);
      const T scale_across[2] = {of.scale[0], of.scale[1]}, scale_outer[2] = {T(1.0), of.scale[2]};
      const auto inner = FlatNorm<2, S>::template at<CURVED, true>(
          {along.t[0], along.t[1]}, scale_across, e_across, across_less);
      const auto outer = FlatNorm<2, S>::template at<CURVED, false>(
          {inner.norm, along.t[2]}, scale_outer, of.e, of.e_minus_one);
      this->norm = outer.norm;
      this->gradient[2] = outer.gradient[1];
      this->bend[2] = outer.bend[1];
      const T share = of.e_across / of.e.value();
      for (int k = 0; k < 2; ++k) {
        this->gradient[k] = outer.gradient[0] * inner.gradient[k];
        this->bend[k] = share * outer.bend[0] * inner.bend[k];
        across[k] = value_of(inner.gradient[k]);
      }
      bend_across = (T(1.0) - share) * outer.bend[0];
    }
  };

  NormAt<D, S> gathered(const FlatNorm<D, S> &c) const
  {
    NormAt<D, S> norm{c.norm, {}};
    for (int k = 0; k < D; ++k) norm.gradient += c.gradient[k] * body->axis[k];
    return norm;
  }

  template <class More> CurvedNormAt<D, T> curved(const FlatNorm<D, T> &c, const More &more) const
  {
    CurvedNormAt<D, T> norm{c.norm, {}, {}};
    for (int k = 0; k < D; ++k) norm.gradient += c.gradient[k] * body->axis[k];
    const T bend = e.value() / c.norm;
    for (int row = 0; row < D; ++row) {
      for (int col = 0; col <= row; ++col) {
        T sum = more(row, col) - norm.gradient[row] * norm.gradient[col];
        for (int k = 0; k < D; ++k) sum += c.bend[k] * body->axis[k][row] * body->axis[k][col];
        norm.hessian[row][col] = norm.hessian[col][row] = bend * sum;
      }
    }
    return norm;
  }
};

}  // namespace jamshape
