#include "overdamped_flow.h"

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
#include <cstring>
#include <mpi.h>

namespace jamshape {

using LAMMPS_NS::bigint;

namespace {

Vec<3> vec3(const double *from) { return {{from[0], from[1], from[2]}}; }

/// A particle may move at most this fraction of its shortest semi-axis in one step; beyond it
/// contacts would be passed through.
constexpr double LARGEST_STEP = 0.5;

double step_limit(const Mobilities::Mobility &of) { return LARGEST_STEP * of.shortest; }

/// And this part of that where a shorter step may be tried instead.
constexpr double LARGEST_TRIAL = 0.5;

/// Coordinates that agree with the atom's position to this fraction of the box are its own.
constexpr double SAME_POSITION = 1e-13;

}  // namespace

OverdampedFlow::OverdampedFlow(LAMMPS_NS::LAMMPS *lmp, double k_d, const AffineBox &affine_box,
                               LAMMPS_NS::Fix *owner, int registers) :
    Pointers(lmp), box(affine_box), dimension(domain->dimension), n_rates(rate_width(dimension)),
    n_turns(dimension == 2 ? 2 : 4), n_registers(registers), pair(nullptr), values(nullptr),
    can_retry(false), farthest(0.0), seen(0.0), largest_difference(0.0), evaluations(0),
    rebuilds(0), mobilities(lmp, k_d), relaxation(lmp, owner, mobilities)
{
}

OverdampedFlow::~OverdampedFlow() { memory->sfree(values); }

/* ----------------------------------------------------------------------
   set-up
------------------------------------------------------------------------- */

bool OverdampedFlow::begin_run()
{
  pair = &PairContact::of(lmp, "fix overdamped/affine");
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
  for (const auto &m : mobilities.all_kinds()) mine = std::min(mine, step_limit(m) / m.longest);
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_MIN, world);
  return all;
}

/* ----------------------------------------------------------------------
   rates
------------------------------------------------------------------------- */

namespace {

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

void OverdampedFlow::store_rate(int i, const Rate &rate)
{
  write_rate(row(i) + dimension, rate, dimension);
}

void OverdampedFlow::store_rates(double scale)
{
  for (int i = 0; i < atom->nlocal; ++i) {
    const Rate rate = mobilities.present_rate(i);
    store_rate(i, {(1.0 / scale) * rate.shift, rate.turn});
  }
}

/// Displacement in coordinates of the box of strain 0 and rotation vector.
Rate OverdampedFlow::sum_of(int i, const Move &m) const
{
  const Rate stored = stored_rate(i);
  Rate sum{m.stored * stored.shift, m.stored * stored.turn};
  if (m.present != 0.0) {
    Rate present = mobilities.present_rate(i);
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
  const double limit = step_limit(mobilities[i]), distance = scale * norm(moved.shift);
  if (can_retry) {
    const double ratio =
        (distance + mobilities[i].longest * norm(moved.turn)) / (LARGEST_TRIAL * limit);
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
    difference = m.present * norm(mobilities.present_rate(i).shift - m.to * stored_rate(i).shift);
  }
  if (n_registers > 0 && !is_last) {
    double *const last = row(i) + dimension + n_rates + n_turns;
    std::copy_n(last, n_rates, last + n_rates);
    write_rate(last, moved, dimension);
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
  const Vec<3> shift = scale * of.shift, turn = mobilities[i].gyration * of.turn;
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
    Rate change = mobilities.present_rate(i);
    change.shift = (1.0 / m.from) * change.shift;
    add(change, -1.0, stored);
    mine[2] += length * length_of(i, change, m.to);
    mine[3] += length * length_of(i, register_of(i, 0), m.to);
  }
  MPI_Allreduce(mine, all, 4, MPI_DOUBLE, MPI_SUM, world);
  seen = all[3] > 0.0 ? all[2] / all[3] : 0.0;
  return all[1] > 0.0 ? std::sqrt(all[0] / all[1]) : 0.0;
}

void OverdampedFlow::clear_forces()
{
  const std::size_t n = atom->nlocal + (force->newton ? atom->nghost : 0);
  if (n == 0) return;
  std::memset(&atom->f[0][0], 0, 3 * n * sizeof(double));
  std::memset(&atom->torque[0][0], 0, 3 * n * sizeof(double));
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
  clear_forces();
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

double OverdampedFlow::sum(double mine) const
{
  double all;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
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
    mine[3] += share * 2.0 * b.stiffness * mobilities[b.i].shift;
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
    const Rate rate = mobilities.present_rate(i);
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
  return static_cast<double>(atom->nmax * width() * sizeof(double)) + mobilities.memory_usage();
}

}  // namespace jamshape
