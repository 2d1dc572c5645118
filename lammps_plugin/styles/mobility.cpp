#include "mobility.h"

#include "contact/contact.hpp"
#include "contact/math/rotation.hpp"

#include "atom.h"
#include "pair_contact.h"
#include "refusal.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <tuple>

namespace jamshape {

Rate read_rate(const double *from, int dimension)
{
  if (dimension == 3) return read_rate<3>(from);
  const RateIn<2> in_plane = read_rate<2>(from);
  return {{{in_plane.shift[0], in_plane.shift[1], 0.0}}, {{0.0, 0.0, in_plane.turn[0]}}};
}

void write_rate(double *to, const Rate &rate, int dimension)
{
  if (dimension == 3) return write_rate<3>(to, rate);
  write_rate<2>(to, {{{rate.shift[0], rate.shift[1]}}, {{rate.turn[2]}}});
}

void Mobilities::measure(const PairContact &of)
{
  pair = &of;
  std::map<std::tuple<int, double, double, double>, std::size_t> number_of;
  kinds.clear();
  resize_closely(kind, static_cast<std::size_t>(atom->nlocal));
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!pair->particle_view().has_shape(i)) {
      refuse(lmp, FLERR,
             "fix overdamped/affine found atom " + std::to_string(atom->tag[i]) +
                 " without a shape, expected an ellipsoid: list it in the data file's Ellipsoids "
                 "section or use 'set atom ... shape'.");
    }
    const Vec<3> axes = pair->particle_view().semi_axes(i);
    const auto found =
        number_of.emplace(std::make_tuple(atom->type[i], axes[0], axes[1], axes[2]), kinds.size());
    if (found.second) kinds.push_back(mobility_of(axes, atom->type[i]));
    kind[i] = static_cast<int>(found.first->second);
  }
}

Mobilities::Mobility Mobilities::mobility_of(const Vec<3> &semi_axes, int type) const
{
  const SubstrateDrag of_particle = pair->drag(semi_axes, type);
  const Vec<3> &moment = of_particle.moment;
  Mobility m;
  m.shift = 1.0 / (drag * of_particle.measure);
  for (int k = 0; k < 3; ++k) {
    m.turn[k] = moment[k] > 0.0 ? m.shift / moment[k] : 0.0;
  }
  m.bretherton = bretherton_parameters(moment);
  m.shortest = std::min(*std::min_element(semi_axes.c, semi_axes.c + domain->dimension),
                        pair->rim(semi_axes, type));
  m.longest = *std::max_element(semi_axes.c, semi_axes.c + domain->dimension);
  m.gyration = std::sqrt(*std::max_element(moment.c, moment.c + 3));
  return m;
}

Vec<3> Mobilities::turn_in_space(int i, const Vec<3> &torque) const
{
  Vec<3> turn{};
  if (!pair->particles_turn()) return turn;
  const Quaternion q = pair->particle_view().orientation(i);
  for (int b = 0; b < 3; ++b) {
    const Vec<3> axis = body_axis(q, b);
    turn += ((*this)[i].turn[b] * dot(axis, torque)) * axis;
  }
  return turn;
}

Rate Mobilities::resistance_times(int i, const Rate &rate) const
{
  const Mobility &m = (*this)[i];
  const auto per = [](double value, double of) { return of > 0.0 ? value / of : 0.0; };
  const Vec<3> force = (1.0 / m.shift) * rate.shift;
  if (is_plane) return {force, {{0.0, 0.0, per(rate.turn[2], m.turn[2])}}};
  if (!pair->particles_turn()) return {force, {}};
  Vec<3> torque{};
  const Quaternion q = pair->particle_view().orientation(i);
  for (int b = 0; b < 3; ++b) {
    const Vec<3> axis = body_axis(q, b);
    torque += per(dot(axis, rate.turn), m.turn[b]) * axis;
  }
  return {force, torque};
}

double Mobilities::memory_usage() const
{
  return static_cast<double>(kinds.capacity() * sizeof(Mobility) + kind.capacity() * sizeof(int));
}

}  // namespace jamshape
