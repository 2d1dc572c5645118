#include "overdamped_flow.h"

#include "contact/contact.hpp"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "memory.h"
#include "modify.h"
#include "neighbor.h"
#include "pair_contact.h"
#include "text.hpp"
#include "update.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <mpi.h>
#include <tuple>

namespace jamshape {

using LAMMPS_NS::bigint;

namespace {

Vec<3> vec3(const double *from) { return {{from[0], from[1], from[2]}}; }

/// A particle may move at most this fraction of its shortest semi-axis in one step; beyond it
/// contacts would be passed through.
constexpr double LARGEST_STEP = 0.5;

/// And this part of that where a shorter step may be tried instead.
constexpr double LARGEST_TRIAL = 0.5;

/// Coordinates that agree with the atom's position to this fraction of the box are its own.
constexpr double SAME_POSITION = 1e-13;

constexpr int LANCZOS_STEPS = 30, LANCZOS_STEPS_AT_LEAST = 6;

/// A direction shorter than this against the first is rounding: all eigenvalues have been found.
constexpr double EXHAUSTED = 1e-12;

}  // namespace

OverdampedFlow::OverdampedFlow(LAMMPS_NS::LAMMPS *lmp, double k_d, const AffineBox &affine_box,
                               LAMMPS_NS::Fix *owner, int registers) :
    Pointers(lmp), drag(k_d), box(affine_box), dimension(domain->dimension),
    n_rates(dimension == 2 ? 3 : 6), n_turns(dimension == 2 ? 2 : 4), n_registers(registers),
    pair(nullptr), values(nullptr), can_retry(false), farthest(0.0), seen(0.0),
    largest_difference(0.0), evaluations(0), rebuilds(0), fix(owner)
{
}

OverdampedFlow::~OverdampedFlow() { memory->sfree(values); }

/* ----------------------------------------------------------------------
   set-up
------------------------------------------------------------------------- */

bool OverdampedFlow::begin_run()
{
  pair = dynamic_cast<PairContact *>(force->pair);
  if (!pair) {
    error->all(FLERR,
               std::string("fix overdamped/affine found pair_style ") +
                   (force->pair_style ? force->pair_style : "none") +
                   ", expected one of this plugin's: use 'pair_style spherocylinder/harmonic'.");
  }
  measure_particles();
  const double scale = box.scale(update->ntimestep);
  double moved = 0.0;
  for (int i = 0; i < atom->nlocal; ++i) {
    const Vec<3> expected = box.position(read_coordinates(i), atom->image[i], scale);
    bool same = true;
    for (int k = 0; k < dimension; ++k) {
      same = same && std::abs(expected[k] - atom->x[i][k]) <= SAME_POSITION * domain->prd[k];
    }
    if (same) continue;
    set(i);
    moved = 1.0;
  }
  return sum(moved) == 0.0;
}

double OverdampedFlow::largest_strain() const
{
  double mine = INFINITY, all;
  for (const Mobility &m : mobilities) mine = std::min(mine, m.step_limit / m.longest);
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_MIN, world);
  return all;
}

void OverdampedFlow::measure_particles()
{
  std::map<std::tuple<int, double, double, double>, std::size_t> number_of;
  mobilities.clear();
  resize_closely(kind, static_cast<std::size_t>(atom->nlocal));
  for (int i = 0; i < atom->nlocal; ++i) {
    const Vec<3> axes = pair->particle_view().semi_axes(i);
    const auto found = number_of.emplace(std::make_tuple(atom->type[i], axes[0], axes[1], axes[2]),
                                         mobilities.size());
    if (found.second) mobilities.push_back(mobility_of(axes, atom->type[i]));
    kind[i] = static_cast<int>(found.first->second);
  }
}

OverdampedFlow::Mobility OverdampedFlow::mobility_of(const Vec<3> &semi_axes, int type) const
{
  const SubstrateDrag of_particle = pair->drag(semi_axes, type);
  Mobility m;
  m.shift = 1.0 / (drag * of_particle.measure);
  for (int k = 0; k < 3; ++k) {
    const double moment = of_particle.moment[k];
    m.turn[k] = moment > 0.0 ? m.shift / moment : 0.0;
  }
  m.step_limit = LARGEST_STEP * *std::min_element(semi_axes.c, semi_axes.c + dimension);
  m.longest = *std::max_element(semi_axes.c, semi_axes.c + dimension);
  const Vec<3> &moment = of_particle.moment;
  m.gyration = std::sqrt(*std::max_element(moment.c, moment.c + 3));
  return m;
}

/* ----------------------------------------------------------------------
   rates
------------------------------------------------------------------------- */

Rate OverdampedFlow::mobility_times(int i, const Vec<3> &force, const Vec<3> &torque) const
{
  const Mobility &m = mobilities[kind[i]];
  if (dimension == 2) return {m.shift * force, {{0.0, 0.0, m.turn[2] * torque[2]}}};
  if (!pair->particles_turn()) return {m.shift * force, {}};
  Vec<3> turn{};
  const Quaternion q = pair->particle_view().orientation(i);
  for (int b = 0; b < 3; ++b) {
    const Vec<3> axis = body_axis(q, b);
    turn += (m.turn[b] * dot(axis, torque)) * axis;
  }
  return {m.shift * force, turn};
}

Rate OverdampedFlow::resistance_times(int i, const Rate &rate) const
{
  const Mobility &m = mobilities[kind[i]];
  const auto per = [](double value, double of) { return of > 0.0 ? value / of : 0.0; };
  const Vec<3> force = (1.0 / m.shift) * rate.shift;
  if (dimension == 2) return {force, {{0.0, 0.0, per(rate.turn[2], m.turn[2])}}};
  if (!pair->particles_turn()) return {force, {}};
  Vec<3> torque{};
  const Quaternion q = pair->particle_view().orientation(i);
  for (int b = 0; b < 3; ++b) {
    const Vec<3> axis = body_axis(q, b);
    torque += per(dot(axis, rate.turn), m.turn[b]) * axis;
  }
  return {force, torque};
}

Rate OverdampedFlow::present_rate(int i) const
{
  return mobility_times(i, vec3(atom->f[i]), vec3(atom->torque[i]));
}

namespace {

Rate read_rate(const double *from, int dimension)
{
  if (dimension == 2) return {{{from[0], from[1], 0.0}}, {{0.0, 0.0, from[2]}}};
  return {vec3(from), vec3(from + 3)};
}

void add(Rate &to, double weight, const Rate &rate)
{
  to.shift += weight * rate.shift;
  to.turn += weight * rate.turn;
}

}  // namespace

Rate OverdampedFlow::stored_rate(int i) const { return read_rate(row(i) + dimension, dimension); }

Rate OverdampedFlow::register_of(int i, int which) const
{
  return read_rate(row(i) + dimension + n_rates + n_turns + which * n_rates, dimension);
}

Vec<3> OverdampedFlow::read_coordinates(int i) const
{
  return {{row(i)[0], row(i)[1], dimension == 2 ? 0.0 : row(i)[2]}};
}

Quaternion OverdampedFlow::orientation_at_start(int i) const
{
  const double *q = row(i) + dimension + n_rates;
  if (dimension == 2) return {q[0], 0.0, 0.0, q[1]};
  return {q[0], q[1], q[2], q[3]};
}

/* ----------------------------------------------------------------------
   stages
------------------------------------------------------------------------- */

void OverdampedFlow::hold_start()
{
  if (!pair->particles_turn()) return;
  pair->particle_view().for_each_orientation(atom->nlocal, [&](int i, const Quaternion &q) {
    double *to = row(i) + dimension + n_rates;
    to[0] = q.w;
    if (dimension == 2) {
      to[1] = q.k;
    } else {
      to[1] = q.i;
      to[2] = q.j;
      to[3] = q.k;
    }
  });
}

/// Without the components that are zero in the plane.
void OverdampedFlow::write_rate(double *to, const Rate &rate) const
{
  to = std::copy_n(rate.shift.c, dimension, to);
  if (dimension == 2) {
    *to = rate.turn[2];
  } else {
    std::copy_n(rate.turn.c, 3, to);
  }
}

void OverdampedFlow::store_rate(int i, const Rate &rate) { write_rate(row(i) + dimension, rate); }

void OverdampedFlow::store_rates(double scale)
{
  for (int i = 0; i < atom->nlocal; ++i) {
    const Rate rate = present_rate(i);
    store_rate(i, {(1.0 / scale) * rate.shift, rate.turn});
  }
}

/// Displacement in coordinates of the box of strain 0 and rotation vector.
Rate OverdampedFlow::sum_of(int i, const Move &m) const
{
  const Rate stored = stored_rate(i);
  Rate sum{m.stored * stored.shift, m.stored * stored.turn};
  if (m.present != 0.0) {
    Rate present = present_rate(i);
    if (n_registers > 0 && dimension == 3) {
      // The rate of a rotation vector is not the angular velocity, to first order in the vector.
      present.turn += -0.5 * cross(register_of(i, 0).turn, present.turn);
    }
    sum.shift += (m.present / m.from) * present.shift;
    sum.turn += m.present * present.turn;
  }
  if (m.last != 0.0) add(sum, m.last, register_of(i, 0));
  if (m.before != 0.0) add(sum, m.before, register_of(i, 1));
  return sum;
}

void OverdampedFlow::require_small(int i, const Rate &moved, double scale)
{
  const double limit = mobilities[kind[i]].step_limit, distance = scale * norm(moved.shift);
  if (can_retry) {
    const double ratio =
        (distance + mobilities[kind[i]].longest * norm(moved.turn)) / (LARGEST_TRIAL * limit);
    farthest = ratio <= farthest ? farthest : ratio;  // NaN too
    return;
  }
  if (distance <= limit) return;  // false for NaN
  error->one(FLERR, "fix overdamped/affine found that one step moves atom " +
                        std::to_string(atom->tag[i]) + " by " + shown(distance) +
                        ", expected at most half its radius: use a smaller timestep.");
}

/// Returns the distance from where the stored rates alone lead.
double OverdampedFlow::place(int i, const Move &m, bool is_last)
{
  const Rate moved = sum_of(i, m);
  require_small(i, moved, m.to);
  double difference = 0.0;
  if (!can_retry && m.present != 0.0) {
    difference = m.present * norm(present_rate(i).shift - m.to * stored_rate(i).shift);
  }
  if (n_registers > 0 && !is_last) {
    double *const last = row(i) + dimension + n_rates + n_turns;
    std::copy_n(last, n_rates, last + n_rates);
    write_rate(last, moved);
  }
  const Vec<3> coordinates = read_coordinates(i) + moved.shift;
  const Vec<3> x = box.position(coordinates, atom->image[i], m.to);
  for (int k = 0; k < dimension; ++k) {
    atom->x[i][k] = x[k];
    if (is_last) row(i)[k] = coordinates[k];
  }
  if (!pair->particles_turn()) return difference;
  const Quaternion q = orientation_at_start(i);
  pair->particle_view().set_orientation(i, dimension == 2 ? turned(q, Vec<1>{{moved.turn[2]}})
                                                          : turned(q, moved.turn));
  return difference;
}

void OverdampedFlow::move(const Move &m, bool is_last)
{
  double largest = 0.0;
  farthest = 0.0;
  for (int i = 0; i < atom->nlocal; ++i) largest = std::max(largest, place(i, m, is_last));
  if (!can_retry) largest_difference = largest;
}

bool OverdampedFlow::move_by(const Move &m)
{
  move(m, false);
  if (!can_retry) return true;
  const double too_far = farthest <= 1.0 ? 0.0 : 1.0;
  return sum(too_far) == 0.0;
}

void OverdampedFlow::finish_step(const Move &m) { move(m, true); }

double OverdampedFlow::length_of(int i, const Rate &of, double scale) const
{
  const Vec<3> shift = scale * of.shift, turn = mobilities[kind[i]].gyration * of.turn;
  return std::sqrt(dot(shift, shift) + dot(turn, turn));
}

double OverdampedFlow::rms_of(const Move &m)
{
  double mine[4] = {0.0, 0.0, 0.0, 0.0}, all[4];
  largest_difference = 0.0;
  for (int i = 0; i < atom->nlocal; ++i) {
    const Rate stored = stored_rate(i);
    if (norm(stored.shift) == 0.0 && norm(vec3(atom->f[i])) == 0.0) continue;
    const double length = length_of(i, sum_of(i, m), m.to);
    largest_difference = std::max(largest_difference, length);
    mine[0] += length * length;
    mine[1] += 1.0;
    if (n_registers == 0) continue;
    Rate change = present_rate(i);
    change.shift = (1.0 / m.from) * change.shift;
    add(change, -1.0, stored);
    mine[2] += length * length_of(i, change, m.to);
    mine[3] += length * length_of(i, register_of(i, 0), m.to);
  }
  MPI_Allreduce(mine, all, 4, MPI_DOUBLE, MPI_SUM, world);
  seen = all[3] > 0.0 ? all[2] / all[3] : 0.0;
  return all[1] > 0.0 ? std::sqrt(all[0] / all[1]) : 0.0;
}

/// Of all atoms from the first one on.
void OverdampedFlow::clear_forces(int first)
{
  const int end = atom->nlocal + (force->newton ? atom->nghost : 0);
  if (first >= end) return;
  const std::size_t n = end - first;
  std::memset(&atom->f[first][0], 0, 3 * n * sizeof(double));
  std::memset(&atom->torque[first][0], 0, 3 * n * sizeof(double));
}

/// As LAMMPS's own step: atoms change ranks, ghosts and lists are made anew.
void OverdampedFlow::rebuild_lists()
{
  if (modify->n_pre_exchange) modify->pre_exchange();
  domain->pbc();
  if (domain->box_change) {
    domain->reset_box();
    comm->setup();
    if (neighbor->style) neighbor->setup_bins();
  }
  comm->exchange();
  comm->borders();
  if (modify->n_pre_neighbor) modify->pre_neighbor();
  neighbor->build(1);
  if (modify->n_post_neighbor) modify->post_neighbor();
  ++rebuilds;
}

void OverdampedFlow::evaluate_forces()
{
  ++neighbor->ago;  // 0 tells the pair style that the list is new
  if (neighbor->check_distance()) {
    rebuild_lists();
  } else {
    comm->forward_comm();
  }
  clear_forces(0);
  const int no_energy = 0, no_virial = 0;
  if (modify->n_pre_force) modify->pre_force(no_virial);
  force->pair->compute(no_energy, no_virial);
  if (force->newton) comm->reverse_comm();
  if (modify->n_post_force) modify->post_force(no_virial);
  ++evaluations;
}

/* ----------------------------------------------------------------------
   numbers about the flow
------------------------------------------------------------------------- */

namespace {

/// Largest eigenvalue of a symmetric tridiagonal matrix, by bisection; 0 for an empty one.
double largest_eigenvalue(const std::vector<double> &diagonal,
                          const std::vector<double> &off_diagonal)
{
  double low = 0.0, high = 0.0;
  for (const double d : diagonal) high = std::max(high, d);
  if (!off_diagonal.empty()) {
    high += 2.0 * *std::max_element(off_diagonal.begin(), off_diagonal.end());
  }
  const auto is_below_all = [&](double x) {  // all pivots of the matrix minus x are negative
    double pivot = -1.0;
    for (std::size_t k = 0; k < diagonal.size() && pivot < 0.0; ++k) {
      const double coupling = k ? off_diagonal[k - 1] : 0.0;
      pivot = diagonal[k] - x - coupling * coupling / pivot;
    }
    return pivot >= 0.0;
  };
  for (double middle = 0.5 * high; low < middle && middle < high; middle = 0.5 * (low + high)) {
    (is_below_all(middle) ? low : high) = middle;
  }
  return low;
}

/// A number in (-1, 1) that depends on the atom's ID only, so that ranks and orders do not matter.
double hashed(std::uint64_t tag, std::uint64_t component)
{
  std::uint64_t z = 6 * tag + component + 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  z ^= z >> 31;
  return 2.0 * static_cast<double>(z >> 11) * 0x1.0p-53 - 1.0;
}

}  // namespace

double OverdampedFlow::sum(double mine) const
{
  double all;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

int OverdampedFlow::pack_direction(int n, const int *list, double *buf) const
{
  for (int k = 0; k < n; ++k) buf = std::copy_n(&directions[n_rates * list[k]], n_rates, buf);
  return n * n_rates;
}

void OverdampedFlow::unpack_direction(int n, int first, const double *buf)
{
  std::copy_n(buf, n_rates * n, &directions[n_rates * first]);
}

Rate OverdampedFlow::direction(int i) const
{
  return read_rate(&directions[n_rates * i], dimension);
}

/// To ghosts, whose forces are cleared: what follows adds to them.
void OverdampedFlow::send_direction()
{
  comm->forward_comm_fix(fix, n_rates);
  clear_forces(atom->nlocal);
}

void OverdampedFlow::add_load(int i, const Vec<3> &force_on, const Vec<3> &torque_on)
{
  for (int k = 0; k < 3; ++k) {
    atom->f[i][k] += force_on[k];
    atom->torque[i][k] += torque_on[k];
  }
}

/// Adds the stiffness of all bonds times the direction to the force arrays of own atoms.
void OverdampedFlow::add_bonds_times_direction()
{
  ++evaluations;
  send_direction();
  pair->for_each_bond([&](const LocalBond &b) {
    const Rate of_i = direction(b.i), of_j = direction(b.j);
    const Vec<3> lever_i = cross(b.arm_i, b.normal), lever_j = cross(b.arm_j, b.normal);
    const double opening =
        dot(b.normal, of_i.shift - of_j.shift) + dot(lever_i, of_i.turn) - dot(lever_j, of_j.turn);
    const double tension = b.stiffness * opening;
    add_load(b.i, tension * b.normal, tension * lever_i);
    if (force->newton_pair || b.j < atom->nlocal) {
      add_load(b.j, -tension * b.normal, -tension * lever_j);
    }
  });
  if (force->newton) comm->reverse_comm();
}

OverdampedFlow::Curvatures OverdampedFlow::curvatures()
{
  evaluations += pair->curvature_cost();
  Curvatures all;
  pair->for_each_curvature([&](const LocalCurvature &c) {
    all.i.push_back(c.i);
    all.j.push_back(c.j);
    all.triangles.insert(all.triangles.end(), c.triangle.begin(), c.triangle.end());
  });
  return all;
}

void OverdampedFlow::add_curvatures_times_direction(const Curvatures &of)
{
  send_direction();
  dimension == 2 ? add_curvatures_times<2>(of) : add_curvatures_times<3>(of);
  if (force->newton) comm->reverse_comm();
}

template <int D> void OverdampedFlow::add_curvatures_times(const Curvatures &of)
{
  constexpr int TURNS = D == 2 ? 1 : 3, N = D + 2 * TURNS, FIRST_AXIS = 3 - TURNS;
  const double *entry = of.triangles.data();
  for (std::size_t c = 0; c < of.i.size(); ++c) {
    const int i = of.i[c], j = of.j[c];
    const Rate of_i = direction(i), of_j = direction(j);
    double x[N], y[N] = {};
    for (int k = 0; k < D; ++k) x[k] = of_i.shift[k] - of_j.shift[k];
    for (int k = 0; k < TURNS; ++k) {
      x[D + k] = of_i.turn[FIRST_AXIS + k];
      x[D + TURNS + k] = of_j.turn[FIRST_AXIS + k];
    }
    for (int row = 0; row < N; ++row) {
      for (int col = 0; col < row; ++col, ++entry) {
        y[row] += *entry * x[col];
        y[col] += *entry * x[row];
      }
      y[row] += *entry++ * x[row];
    }
    Vec<3> pull{}, turn_i{}, turn_j{};
    std::copy_n(y, D, pull.c);
    std::copy_n(y + D, TURNS, turn_i.c + FIRST_AXIS);
    std::copy_n(y + D + TURNS, TURNS, turn_j.c + FIRST_AXIS);
    add_load(i, pull, turn_i);
    if (force->newton_pair || j < atom->nlocal) add_load(j, -1.0 * pull, turn_j);
  }
}

/// Force and torque on i without the components that are zero in the plane, and back.
void OverdampedFlow::pack_force(int i, double *to) const
{
  to = std::copy_n(atom->f[i], dimension, to);
  std::copy_n(atom->torque[i] + (dimension == 2 ? 2 : 0), n_rates - dimension, to);
}

void OverdampedFlow::unpack_force(int i, const double *from)
{
  std::copy_n(from, dimension, atom->f[i]);
  std::copy_n(from + dimension, n_rates - dimension, atom->torque[i] + (dimension == 2 ? 2 : 0));
}

/// The force and torque that belong to a rate, times a factor: as those of i, or added to them.
void OverdampedFlow::set_force(int i, double factor, const Rate &rate)
{
  for (double *const of : {atom->f[i], atom->torque[i]}) std::fill_n(of, 3, 0.0);
  add_force(i, factor, rate);
}

void OverdampedFlow::add_force(int i, double factor, const Rate &rate)
{
  const Rate load = resistance_times(i, rate);
  for (int k = 0; k < 3; ++k) {
    atom->f[i][k] += factor * load.shift[k];
    atom->torque[i][k] += factor * load.turn[k];
  }
}

double OverdampedFlow::largest_rate_of_bonds()
{
  return largest_eigenvalue_of([&] { add_bonds_times_direction(); }, 0.0);
}

double OverdampedFlow::largest_rate(double tolerance)
{
  if (!pair->has_smooth_forces()) {
    return largest_eigenvalue_of([&] { add_bonds_times_direction(); }, tolerance);
  }
  const Curvatures all = curvatures();
  return largest_eigenvalue_of([&] { add_curvatures_times_direction(all); }, tolerance);
}

double OverdampedFlow::largest_eigenvalue_of(const std::function<void()> &add_stiffness_times,
                                             double tolerance)
{
  const int nlocal = atom->nlocal;
  // Forces wait in the places of the stored rates, which are free between steps.
  directions.resize(n_rates * (nlocal + static_cast<std::size_t>(atom->nghost)));
  for (int i = 0; i < nlocal; ++i) {
    pack_force(i, row(i) + dimension);
    double start[6];
    for (int k = 0; k < n_rates; ++k) start[k] = hashed(atom->tag[i], k);
    unpack_force(i, start);
  }

  // Lanczos' method in the metric of the drag, in which mobility times stiffness is symmetric. Each
  // direction is the rate of a force; what is left of the next one is in the force arrays.
  std::vector<double> diagonal, off_diagonal;
  double found = 0.0, size = 0.0;
  for (int step = 0; step < LANCZOS_STEPS; ++step) {
    double mine = 0.0;
    for (int i = 0; i < nlocal; ++i) {
      const Rate rate = present_rate(i);
      mine += dot(rate.shift, vec3(atom->f[i])) + dot(rate.turn, vec3(atom->torque[i]));
    }
    const double length = std::sqrt(sum(mine));
    if (step > 0) {
      if (!(length > EXHAUSTED * size)) break;
      off_diagonal.push_back(length);
    }
    for (int i = 0; i < nlocal; ++i) {
      const Rate before = direction(i), rate = present_rate(i);
      write_rate(&directions[n_rates * i],
                 {(1.0 / length) * rate.shift, (1.0 / length) * rate.turn});
      set_force(i, step == 0 ? 0.0 : -length, before);
    }
    add_stiffness_times();
    mine = 0.0;
    for (int i = 0; i < nlocal; ++i) {
      const Rate rate = direction(i);
      mine += dot(rate.shift, vec3(atom->f[i])) + dot(rate.turn, vec3(atom->torque[i]));
    }
    diagonal.push_back(sum(mine));
    size = std::max(size, std::abs(diagonal.back()));
    if (tolerance > 0.0) {
      const double better = largest_eigenvalue(diagonal, off_diagonal);
      if (step >= LANCZOS_STEPS_AT_LEAST && better <= (1.0 + tolerance) * found) break;
      found = better;
    }
    for (int i = 0; i < nlocal; ++i) {
      add_force(i, -diagonal.back(), direction(i));
    }
  }
  for (int i = 0; i < nlocal; ++i) unpack_force(i, row(i) + dimension);
  directions = {};
  return largest_eigenvalue(diagonal, off_diagonal);
}

OverdampedFlow::Touching OverdampedFlow::touching()
{
  ++evaluations;
  double mine[4] = {0.0, 0.0, 0.0, 0.0}, all[4];
  pair->for_each_bond([&](const LocalBond &b) {
    // Without newton both ranks see the bond.
    const double share = force->newton_pair || b.j < atom->nlocal ? 1.0 : 0.5;
    mine[0] += share;
    mine[1] += share * std::max(b.reach - b.distance, 0.0);
    mine[2] += share * b.reach;
    mine[3] += share * 2.0 * b.stiffness * mobilities[kind[b.i]].shift;
  });
  MPI_Allreduce(mine, all, 4, MPI_DOUBLE, MPI_SUM, world);
  if (!(all[0] > 0.0)) return {0.0, 0.0, 0.0, 0.0};
  return {all[0], all[1] / all[0], all[2] / all[0], all[3] / all[0]};
}

double OverdampedFlow::largest_edge() const
{
  return *std::max_element(domain->prd, domain->prd + dimension);
}

void OverdampedFlow::stop(const std::string &found) const
{
  error->all(FLERR, "fix overdamped/affine " + found);
}

double OverdampedFlow::dissipated_power() const
{
  double mine = 0.0;
  for (int i = 0; i < atom->nlocal; ++i) {
    const Rate rate = present_rate(i);
    mine += dot(rate.shift, vec3(atom->f[i])) + dot(rate.turn, vec3(atom->torque[i]));
  }
  return sum(mine);
}

double OverdampedFlow::stage_difference() const
{
  double all;
  MPI_Allreduce(&largest_difference, &all, 1, MPI_DOUBLE, MPI_MAX, world);
  return all;
}

/* ----------------------------------------------------------------------
   storage
------------------------------------------------------------------------- */

void OverdampedFlow::grow(int nmax)
{
  const bigint size = static_cast<bigint>(sizeof(double)) * width() * nmax;
  values = static_cast<double *>(memory->srealloc(values, size, "overdamped/affine:values"));
}

void OverdampedFlow::copy(int from, int to) { std::copy_n(row(from), width(), row(to)); }

void OverdampedFlow::set(int i)
{
  const Vec<3> y = box.reference(atom->x[i], atom->image[i], box.scale(update->ntimestep));
  std::fill_n(row(i), width(), 0.0);
  std::copy_n(y.c, dimension, row(i));
}

int OverdampedFlow::pack(int i, double *buf) const
{
  std::copy_n(row(i), width(), buf);
  return width();
}

int OverdampedFlow::unpack(int i, const double *buf)
{
  std::copy_n(buf, width(), row(i));
  return width();
}

double OverdampedFlow::memory_usage() const
{
  return static_cast<double>(atom->nmax * width() * sizeof(double) +
                             mobilities.capacity() * sizeof(Mobility) +
                             kind.capacity() * sizeof(int));
}

}  // namespace jamshape
