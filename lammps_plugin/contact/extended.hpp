#pragma once

#include "contact/contact.hpp"
#include "contact/errors.hpp"
#include "contact/math/dual.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"
#include "contact/pair_derivatives.hpp"

#include <cmath>

namespace jamshape {

/// A long double rounded to a double.
inline double rounded(long double x) { return static_cast<double>(x); }
template <int N> Dual<N> rounded(const Dual<N, long double> &x)
{
  Dual<N> y(static_cast<double>(x.value));
  for (int k = 0; k < N; ++k) y.set_derivative(k, static_cast<double>(x.derivative(k)));
  return y;
}

template <int D, class Long> auto rounded(const Vec<D, Long> &v)
{
  Vec<D, decltype(rounded(v[0]))> values;
  for (int k = 0; k < D; ++k) values[k] = rounded(v[k]);
  return values;
}

template <int D, class Long> auto rounded(const Bond<D, Long> &of)
{
  return Bond<D, decltype(rounded(of.reach))>{
      rounded(of.normal),    rounded(of.force),         rounded(of.arm_i),    rounded(of.lever_i),
      rounded(of.lever_j),   rounded(of.distance),      rounded(of.reach),    rounded(of.energy),
      rounded(of.stiffness), rounded(of.own_stiffness), rounded(of.coupling), of.on_side_i,
      of.on_side_j};
}

template <int D, class Long, int BONDS> auto rounded(const Contact<D, Long, BONDS> &of)
{
  Contact<D, decltype(rounded(of.energy)), BONDS> contact;
  contact.status = of.status;
  contact.kind = of.kind;
  contact.n_bonds = of.n_bonds;
  contact.gap = of.gap;
  contact.needs_digits = false;
  for (int b = 0; b < of.n_bonds; ++b) contact.bond[b] = rounded(of.bond[b]);
  contact.energy = rounded(of.energy);
  contact.force = rounded(of.force);
  contact.torque_i = rounded(of.torque_i);
  contact.torque_j = rounded(of.torque_j);
  return contact;
}

/// The same pair in higher precision: exactly that of the doubles, except for quaternions, whose
/// length rounding leaves slightly off 1.
template <class Model, int D>
PosedPair<Model, D, long double> in_long(const PosedPair<Model, D, double> &pair)
{
  const auto unit = [](const Quaternion &q) {
    return normalized(QuaternionOf<long double>{q.w, q.i, q.j, q.k});
  };
  return {pair.shape_i,
          pair.shape_j,
          constants_of<long double>(pair.r),
          unit(pair.orientation_i),
          unit(pair.orientation_j),
          pair.law};
}

/// The contact of a pair in long doubles, and the one in dual numbers: kept out of the code of the
/// many pairs that need neither, so that it is not inlined there.
template <class Model, int D>
[[gnu::noinline, gnu::cold]] ContactOf<Model, D>
contact_in_long(const PosedPair<Model, D, long double> &pair)
{
  return rounded(contact_at(pair));
}
template <class Model, int D>
[[gnu::noinline, gnu::cold]] ContactOf<Model, D, Dual<PAIR_VARIABLES<D>>>
turned_contact_in_long(const PosedPair<Model, D, long double> &pair)
{
  return rounded(turned_contact_at(pair));
}

/// Returns a contact, recomputed from `pair()` in long doubles in the rare case that its precision
/// is not sufficient; `pair()` is called only then.
template <class Model, int D, class PairInLong>
ContactOf<Model, D> to_its_digits(const ContactOf<Model, D> &found, const PairInLong &pair)
{
  if constexpr (IS_SEARCHED<Model, D>) {
    if (found.needs_digits) return contact_in_long<Model, D>(pair());
  }
  return found;
}

/// The same in dual numbers.
template <class Model, int D, class PairInLong>
ContactOf<Model, D, Dual<PAIR_VARIABLES<D>>>
to_its_digits(const ContactOf<Model, D, Dual<PAIR_VARIABLES<D>>> &found, const PairInLong &pair)
{
  if constexpr (IS_SEARCHED<Model, D>) {
    if (found.needs_digits) return turned_contact_in_long<Model, D>(pair());
  }
  return found;
}

/// A contact with its second derivatives; the coupling of bonds is limited as in relaxation rates.
template <class Model, int D>
ContactDerivatives<Model, D, double> derivatives_at(const PosedPair<Model, D, double> &pair)
{
  const auto longer = [&] { return in_long(pair); };
  ContactDerivatives<Model, D, double> result{};
  result.contact = to_its_digits<Model, D>(contact_at(pair), longer);
  const auto dual = to_its_digits<Model, D>(turned_contact_at(pair), longer);
  if (dual.status == ContactStatus::TOUCHING)
    read_derivatives<D, double, Model::MOST_BONDS>(dual, result, STIFFEST_COUPLING);
  return result;
}

/// Bounds of the errors of a contact, from the same pair in long doubles; NaN if either of the two
/// does not touch.
template <class Model, int D>
ContactErrors errors_at(const ContactOf<Model, D> &contact,
                        const PosedPair<Model, D, long double> &pair)
{
  const PosedBodies<Model, D, long double> bodies(pair);
  const ContactOf<Model, D, long double> wide = contact_of(bodies.i, bodies.j, pair.law);
  if (contact.status != ContactStatus::TOUCHING || wide.status != ContactStatus::TOUCHING)
    return {NAN, NAN, NAN};
  return errors_of(bodies.i, bodies.j, contact, wide, pair.law.bond);
}

}  // namespace jamshape
