#pragma once

#include "contact/contact.hpp"
#include "contact/math/dual.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace jamshape {

/// A pair's energy depends on r = x_i - x_j and on the rotation vectors of i and of j (space
/// coordinates, about the present pose), in this order: 4 variables in 2D, 9 in 3D.
template <int D> inline constexpr int PAIR_VARIABLES = D + 2 * ROTATIONS<D>;

/// Shape, orientation and law of a pair, and r.
template <class Model, int D, class S> struct PosedPair {
  typename Model::Shape shape_i, shape_j;
  Vec<D, S> r;
  QuaternionOf<S> orientation_i, orientation_j;
  typename Model::Law law;
};

/// Second derivatives of a contact's energy, in two parts: the sum over bonds of own_stiffness *
/// gradient (x) gradient, and `curvature`, all that comes from the forces themselves (Marschall &
/// Teitel 2018, Eqs. 38-40: H and -S). They are kept apart because the second is smaller by a
/// factor of the overlap and would be lost in their sum. If bonds share an energy that is not the
/// sum of theirs, v (x) v is added, v being the sum over bonds of coupling * gradient.
template <int D, class S, int BONDS> struct SecondDerivatives {
  static constexpr int N = PAIR_VARIABLES<D>;
  S gradient[BONDS][N];  // of each bond's distance
  S curvature[N][N];
};

/// Sets the derivatives together with the contact.
template <class Model, int D, class S>
struct ContactDerivatives : SecondDerivatives<D, S, Model::MOST_BONDS> {
  ContactOf<Model, D, S> contact;
};

namespace detail {

/// In 2D, where q.i = q.j = 0.
template <int N, class S>
QuaternionOf<Dual<N, S>> turned_by_variables(const QuaternionOf<S> &q, const Vec<1, int> &first)
{
  QuaternionOf<Dual<N, S>> turned{q.w, q.i, q.j, q.k};
  turned.w.set_derivative(first[0], -0.5 * q.k);
  turned.k.set_derivative(first[0], 0.5 * q.w);
  return turned;
}

template <int N, class S>
QuaternionOf<Dual<N, S>> turned_by_variables(const QuaternionOf<S> &q, const Vec<3, int> &first)
{
  const auto half = [&](int k) { return 0.5 * Dual<N, S>::variable(0.0, first[k]); };
  const QuaternionOf<Dual<N, S>> turn{Dual<N, S>(1.0), half(0), half(1), half(2)};
  return turn * QuaternionOf<Dual<N, S>>{q.w, q.i, q.j, q.k};
}

/// ROTATIONS<D> variables from `first` on.
template <int D> Torque<D, int> variables_from(int first)
{
  Torque<D, int> index;
  for (int k = 0; k < ROTATIONS<D>; ++k) index[k] = first + k;
  return index;
}

}  // namespace detail

/// The bodies of a pair, the second at the origin.
template <class Model, int D, class S> struct PosedBodies {
  typename Model::template Body<D, S> i, j;

  explicit PosedBodies(const PosedPair<Model, D, S> &pair) :
      i(posed(pair.shape_i, pair.orientation_i)), j(posed(pair.shape_j, pair.orientation_j))
  {
    i.centre = pair.r;
  }

 private:
  static typename Model::template Body<D, S> posed(const typename Model::Shape &shape,
                                                   const QuaternionOf<S> &orientation)
  {
    auto body = Model::template body<D, S>(shape);
    if (Model::template turns<D>(shape)) Model::template turn_to<D, S>(body, orientation);
    return body;
  }
};

/// The contact of a pair, with energy and forces only.
template <class Model, int D, class S>
ContactOf<Model, D, S> contact_at(const PosedPair<Model, D, S> &pair)
{
  const PosedBodies<Model, D, S> bodies(pair);
  return contact_of(bodies.i, bodies.j, pair.law);
}

/// A body rotated by its own rotation variables, from `first` on, so that the force code can run on
/// dual numbers.
template <class Model, int D, class S>
typename Model::template Body<D, Dual<PAIR_VARIABLES<D>, S>>
turned_body(const typename Model::Shape &shape, const QuaternionOf<S> &orientation, int first)
{
  using Number = Dual<PAIR_VARIABLES<D>, S>;
  auto body = Model::template body<D, Number>(shape);
  const auto variables = detail::variables_from<D>(first);
  Model::template turn_to<D, Number>(
      body, detail::turned_by_variables<PAIR_VARIABLES<D>, S>(orientation, variables));
  return body;
}

/// Index of the first rotation variable of i and of j.
template <int D> inline constexpr int FIRST_OF_I = D;
template <int D> inline constexpr int FIRST_OF_J = D + ROTATIONS<D>;

/// r as the first D variables.
template <int D, class S> Vec<D, Dual<PAIR_VARIABLES<D>, S>> as_variables(const Vec<D, S> &r)
{
  Vec<D, Dual<PAIR_VARIABLES<D>, S>> variables;
  for (int k = 0; k < D; ++k) variables[k] = Dual<PAIR_VARIABLES<D>, S>::variable(r[k], k);
  return variables;
}

/// Extracts the second derivatives from a touching contact, without the coupling of its bonds.
template <int D, class S, int BONDS>
void read_uncoupled(const Contact<D, Dual<PAIR_VARIABLES<D>, S>, BONDS> &dual,
                    SecondDerivatives<D, S, BONDS> &result)
{
  constexpr int N = PAIR_VARIABLES<D>, M = ROTATIONS<D>;
  for (int b = 0; b < dual.n_bonds; ++b) {
    const auto &bond = dual.bond[b];
    for (int k = 0; k < D; ++k) result.gradient[b][k] = value_of(bond.normal[k]);
    for (int k = 0; k < M; ++k) result.gradient[b][D + k] = value_of(bond.lever_i[k]);
    for (int k = 0; k < M; ++k) result.gradient[b][D + M + k] = value_of(bond.lever_j[k]);
  }
  for (int col = 0; col < N; ++col) {
    for (int k = 0; k < D; ++k) result.curvature[k][col] = -dual.force[k].derivative(col);
    for (int k = 0; k < M; ++k) result.curvature[D + k][col] = -dual.torque_i[k].derivative(col);
    for (int k = 0; k < M; ++k)
      result.curvature[D + M + k][col] = -dual.torque_j[k].derivative(col);
  }
  // Rotations in space do not commute: the derivative of the torque with respect to a rotation
  // vector is that of the energy plus an antisymmetric part.
  for (int row = 0; row < N; ++row) {
    for (int col = 0; col < row; ++col) {
      const S mean = 0.5 * (result.curvature[row][col] + result.curvature[col][row]);
      result.curvature[row][col] = result.curvature[col][row] = mean;
    }
  }
}

/// All second derivatives: the coupling of bonds is included in the curvature, limited to `most`
/// times their own stiffness.
template <int D, class S, int BONDS>
void read_derivatives(const Contact<D, Dual<PAIR_VARIABLES<D>, S>, BONDS> &dual,
                      SecondDerivatives<D, S, BONDS> &result, S most = INFINITY)
{
  constexpr int N = PAIR_VARIABLES<D>;
  read_uncoupled<D, S, BONDS>(dual, result);
  S along[N]{}, part = 1.0;
  bool is_coupled = false;
  for (int b = 0; b < dual.n_bonds; ++b) {
    const S coupling = value_of(dual.bond[b].coupling), own = value_of(dual.bond[b].own_stiffness);
    if (coupling == 0.0) continue;
    is_coupled = true;
    if (coupling * coupling > most * own) part = std::min(part, most * own / (coupling * coupling));
    for (int k = 0; k < N; ++k) along[k] += coupling * result.gradient[b][k];
  }
  for (int row = 0; is_coupled && row < N; ++row) {
    for (int col = 0; col < N; ++col) result.curvature[row][col] += part * along[row] * along[col];
  }
}

/// A square matrix.
template <int N, class S = double> using Square = std::array<std::array<S, N>, N>;

/// Second derivatives with respect to r of the energy of a touching contact of two particles that
/// no contact can rotate, in closed form. V depends on |r| alone, through the overlap 1 -
/// (|r|/d)^m: the bonds' stiffness along n = r/|r|, and from the force F a curvature -F/|r| (1 + (m
/// - 2) n n).
template <class Model, int D, class S>
Square<D, S> central_hessian(const ContactOf<Model, D, S> &contact, const Vec<D, S> &r)
{
  const S distance = norm(r), bend = -norm(contact.force) / distance;
  S along = (Model::OVERLAP_POWER - 2) * bend;
  for (int b = 0; b < contact.n_bonds; ++b) along += contact.bond[b].own_stiffness;
  along /= distance * distance;
  Square<D, S> found;
  for (int k = 0; k < D; ++k) {
    for (int l = 0; l < D; ++l) found[k][l] = along * r[k] * r[l] + (k == l ? bend : S(0));
  }
  return found;
}

/// Largest stiffness of coupled bonds in relaxation rates, over their own. The coupling of two
/// bonds about to appear on rods is unbounded; beyond this limit an integrator sees a kink, which
/// it jumps over, not a spring.
inline constexpr double STIFFEST_COUPLING = 4.0;

/// The contact in dual numbers: the force code, run on them, gives second derivatives.
template <class Model, int D, class S>
ContactOf<Model, D, Dual<PAIR_VARIABLES<D>, S>>
turned_contact_at(const PosedPair<Model, D, S> &pair)
{
  auto body_i = turned_body<Model, D, S>(pair.shape_i, pair.orientation_i, FIRST_OF_I<D>);
  const auto body_j = turned_body<Model, D, S>(pair.shape_j, pair.orientation_j, FIRST_OF_J<D>);
  body_i.centre = as_variables<D, S>(pair.r);
  return contact_of(body_i, body_j, pair.law);
}

}  // namespace jamshape
