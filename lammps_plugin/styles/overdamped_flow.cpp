#include "overdamped_flow.h"

#include "contact/math/dimension.hpp"

#include "atom.h"
#include "comm.h"
#include "compat.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "memory.h"
#include "modify.h"
#include "neighbor.h"
#include "pair_contact.h"
#include "refusal.h"
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

/// Largest displacement of a particle in one step, over its shortest semi-axis or its rim; beyond
/// it particles could pass through contacts.
constexpr double LARGEST_STEP = 0.5;

double step_limit(const Mobilities::Mobility &of) { return LARGEST_STEP * of.shortest; }

/// The same, over LARGEST_STEP, if a shorter step may be tried instead.
constexpr double LARGEST_TRIAL = 0.5;

/// LAMMPS's flag of a virial by pairs.
constexpr int VIRIAL_OF_PAIRS = 1;

/// Coordinates that agree with the atom's position to this fraction of the box are valid.
constexpr double SAME_POSITION = 1e-13;

/// The same within a run, where rounding and image counts grow.
constexpr double UNTOUCHED = 1e-10;

}  // namespace

/// Data stored per particle, in order: coordinates, rates of the stored stage, orientation at the
/// step's start, registers.
template <int D> struct OverdampedFlow::Row {
  static constexpr int N_RATES = D + ROTATIONS<D>, N_TURNS = D == 2 ? 2 : 4;

  double *values;

  Vec<D> coordinates() const
  {
    Vec<D> y;
    for (int k = 0; k < D; ++k) y[k] = values[k];
    return y;
  }
  void set_coordinates(const Vec<D> &y) const { std::copy_n(y.c, D, values); }

  RateIn<D> stored_rate() const { return read_rate<D>(values + D); }
  void store_rate(const RateIn<D> &rate) const { write_rate<D>(values + D, rate); }

  Quaternion orientation() const
  {
    const double *const q = values + D + N_RATES;
    if constexpr (D == 2) {
      return {q[0], 0.0, 0.0, q[1]};
    } else {
      return {q[0], q[1], q[2], q[3]};
    }
  }
  void set_orientation(const Quaternion &q) const
  {
    double *const to = values + D + N_RATES;
    to[0] = q.w;
    if constexpr (D == 2) {
      to[1] = q.k;
    } else {
      to[1] = q.i;
      to[2] = q.j;
      to[3] = q.k;
    }
  }

  /// Displacement of the last move (0) or of the one before it.
  RateIn<D> displacement(int which) const
  {
    return read_rate<D>(values + D + N_RATES + N_TURNS + which * N_RATES);
  }
  void push_displacement(const RateIn<D> &moved) const
  {
    double *const last = values + D + N_RATES + N_TURNS;
    std::copy_n(last, N_RATES, last + N_RATES);
    write_rate<D>(last, moved);
  }
};

OverdampedFlow::OverdampedFlow(LAMMPS_NS::LAMMPS *lmp, double k_d, const AffineBox &affine_box,
                               LAMMPS_NS::Fix *owner, int registers) :
    Pointers(lmp), box(affine_box), dimension(domain->dimension), n_rates(rate_width(dimension)),
    n_turns(dimension == 2 ? 2 : 4), n_registers(registers), pair(nullptr), control_of_box(nullptr),
    values(nullptr), can_retry(false), farthest(0.0), turned_so_far(0.0), seen(0.0),
    largest_difference(0.0), evaluations(0), rebuilds(0), mobilities(lmp, k_d),
    relaxation(lmp, owner, mobilities)
{
}

OverdampedFlow::~OverdampedFlow() { memory->sfree(values); }

/* ----------------------------------------------------------------------
   set-up
------------------------------------------------------------------------- */

bool OverdampedFlow::begin_run()
{
  pair = &PairContact::of(lmp, "fix overdamped/affine");
  if (control_of_box) control_of_box->begin_run(*pair);
  measure_particles();
  double moved = 0.0;
  in_dimension(dimension, [&](auto D) {
    const auto present = box.deformed<D>(box.deformation(box.reached()));
    for (int i = 0; i < atom->nlocal; ++i) {
      if (is_at<D>(i, present, SAME_POSITION)) continue;
      set(i);
      moved = 1.0;
    }
  });
  return sum(moved) == 0.0;
}

/// Whether atom i is at the position of its coordinates, to this fraction of the box.
template <int D>
bool OverdampedFlow::is_at(int i, const AffineBox::Deformed<D> &present, double tolerance) const
{
  const Vec<D> expected = present.position(Row<D>{row(i)}.coordinates(), atom->image[i]);
  bool same = true;
  for (int k = 0; k < D; ++k) {
    same = same && std::abs(expected[k] - atom->x[i][k]) <= tolerance * domain->prd[k];
  }
  return same;
}

bool OverdampedFlow::is_moving(int i) const
{
  const Vec<3> v = vec3(atom->v[i]), spin = atom->angmom ? vec3(atom->angmom[i]) : Vec<3>{};
  return norm_sq(v) + norm_sq(spin) != 0.0;
}

bool OverdampedFlow::stop_particles()
{
  double found = 0.0;
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!is_moving(i)) continue;
    std::fill_n(atom->v[i], 3, 0.0);
    if (atom->angmom) std::fill_n(atom->angmom[i], 3, 0.0);
    found = 1.0;
  }
  return sum(found) > 0.0;
}

bool OverdampedFlow::knows_particles() const
{
  const bool is_known = pair && pair == PairContact::find(lmp);
  return sum(is_known && mobilities.n_measured() == atom->nlocal ? 0.0 : 1.0) == 0.0;
}

void OverdampedFlow::require_untouched() const
{
  const auto refuse_it = [&](int i, const char *what) {
    refuse(lmp, FLERR,
           "fix overdamped/affine found that something else " + std::string(what) + " atom " +
               std::to_string(atom->tag[i]) +
               " in the last steps, expected no other fix that moves particles: use 'unfix', or "
               "run that fix before or after the flow.");
  };
  in_dimension(dimension, [&](auto D) {
    const auto present = box.deformed<D>(box.deformation(box.reached()));
    for (int i = 0; i < atom->nlocal; ++i) {
      if (!is_at<D>(i, present, UNTOUCHED)) refuse_it(i, "moved");
      if (is_moving(i)) refuse_it(i, "gave a velocity to");
    }
  });
}

double OverdampedFlow::largest_strain() const
{
  double mine = INFINITY, all;
  for (const auto &m : mobilities.all_kinds()) mine = std::min(mine, step_limit(m) / m.longest);
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_MIN, world);
  return all;
}

/* ----------------------------------------------------------------------
   stages
------------------------------------------------------------------------- */

namespace {

template <int D> void add(RateIn<D> &to, double weight, const RateIn<D> &rate)
{
  to.shift += weight * rate.shift;
  to.turn += weight * rate.turn;
}

}  // namespace

/// Rotation of particles due to the host alone, at their present orientations: nothing is computed
/// if it rotates none.
template <int D> struct OverdampedFlow::Spins {
  const bool exist;
  const int first;
  Torque<D> of[ParticleView::BLOCK];

  Spins(const OverdampedFlow &flow, int begin, int end) : exist(flow.host_turns()), first(begin)
  {
    if (!exist) return;
    const Upper &gradient = flow.box.state().rate;
    flow.pair->particle_view().for_each_orientation(begin, end, [&](int i, const Quaternion &q) {
      of[i - first] = host_spin<D>(gradient, flow.mobilities[i].bretherton, q);
    });
  }

  /// A rate plus the rotation of atom i by the host.
  RateIn<D> added_to(RateIn<D> rate, int i) const
  {
    if (exist) rate.turn += of[i - first];
    return rate;
  }
};

bool OverdampedFlow::host_turns() const { return pair->particles_turn() && !box.is_isotropic(); }

void OverdampedFlow::hold_start(const Upper &deformation)
{
  const Upper inverse = divided(1.0, deformation);
  in_dimension(dimension, [&](auto D) {
    ParticleView::in_blocks(atom->nlocal,
                            [&](int begin, int end) { hold<D>(begin, end, inverse); });
  });
}

/// Stores the start for at most a block of particles.
template <int D> void OverdampedFlow::hold(int begin, int end, const Upper &inverse)
{
  if (pair->particles_turn()) {
    pair->particle_view().for_each_orientation(
        begin, end, [&](int i, const Quaternion &q) { Row<D>{row(i)}.set_orientation(q); });
  }
  const Spins<D> spins(*this, begin, end);
  for (int i = begin; i < end; ++i) {
    const RateIn<D> rate = spins.added_to(mobilities.present_rate_in<D>(i), i);
    Row<D>{row(i)}.store_rate({inverse * rate.shift, rate.turn});
  }
}

/// Coefficients of a move, computed without a division per particle.
struct OverdampedFlow::Weights {
  double stored;
  Upper present_shift;
  double present, last, before;

  explicit Weights(const Move &m) :
      stored(m.stored), present_shift(divided(m.present, m.from)), present(m.present), last(m.last),
      before(m.before)
  {
  }
};

/// Displacement in coordinates of the box of strain 0 and rotation vector.
template <int D>
[[gnu::always_inline]] inline RateIn<D> OverdampedFlow::sum_of(const Row<D> &of, const Weights &m,
                                                               RateIn<D> present) const
{
  const RateIn<D> stored = of.stored_rate();
  RateIn<D> sum{m.stored * stored.shift, m.stored * stored.turn};
  if (m.present != 0.0) {
    if constexpr (D == 3) {
      // The rate of a rotation vector differs from the angular velocity at first order in the
      // vector.
      if (n_registers > 0) present.turn += -0.5 * cross(of.displacement(0).turn, present.turn);
    }
    sum.shift += m.present_shift * present.shift;
    sum.turn += m.present * present.turn;
  }
  if (m.last != 0.0) add(sum, m.last, of.displacement(0));
  if (m.before != 0.0) add(sum, m.before, of.displacement(1));
  return sum;
}

template <int D>
[[gnu::always_inline]] inline void OverdampedFlow::require_small(int i, const RateIn<D> &moved,
                                                                 const Upper &deformation)
{
  const Mobilities::Mobility &of = mobilities[i];
  const double limit = step_limit(of);
  if (can_retry) {
    const double reached = norm(deformation * moved.shift) + of.longest * norm(moved.turn);
    const double ratio = reached / (LARGEST_TRIAL * limit);
    farthest = ratio <= farthest ? farthest : ratio;  // also for NaN
    return;
  }
  const double distance_sq = norm_sq(deformation * moved.shift);
  if (!(distance_sq <= limit * limit)) stop_at_long_step(i, std::sqrt(distance_sq));
}

void OverdampedFlow::stop_at_long_step(int i, double distance) const
{
  refuse(lmp, FLERR,
         "fix overdamped/affine found that one step moves atom " + std::to_string(atom->tag[i]) +
             " by " + shown(distance) +
             ", expected at most half its radius: use a smaller timestep.");
}

template <int D> void OverdampedFlow::move_in(const Move &m, Pass pass)
{
  const Weights weights(m);
  const auto target = box.deformed<D>(m.to);
  const Upper back = divided(1.0, m.from);
  const bool is_last = pass == Pass::FINISH, compares = !can_retry && m.present != 0.0;
  double largest_sq = 0.0;
  farthest = 0.0;
  const auto place = [&](int i, const Spins<D> &spins) {
    const Row<D> its{row(i)};
    const RateIn<D> present =
        m.present != 0.0 ? spins.added_to(mobilities.present_rate_in<D>(i), i) : RateIn<D>{};
    if (compares) {
      const Vec<D> change = present.shift - m.to * its.stored_rate().shift;
      largest_sq = std::max(largest_sq, norm_sq(change));
    }
    const RateIn<D> moved = sum_of<D>(its, weights, present);
    require_small<D>(i, moved, m.to);
    if (n_registers > 0 && !is_last) its.push_displacement(moved);
    const Vec<D> coordinates = its.coordinates() + moved.shift;
    const Vec<D> x = target.position(coordinates, atom->image[i]);
    for (int k = 0; k < D; ++k) atom->x[i][k] = x[k];
    if (is_last) its.set_coordinates(coordinates);
    return moved.turn;
  };
  ParticleView::in_blocks(atom->nlocal, [&](int begin, int end) {
    if (pass == Pass::START) hold<D>(begin, end, back);
    const Spins<D> spins(*this, begin, m.present != 0.0 ? end : begin);
    // Two loops, so that many of the square roots and divisions of `turned` overlap.
    Torque<D> turns[ParticleView::BLOCK];
    for (int i = begin; i < end; ++i) turns[i - begin] = place(i, spins);
    if (!pair->particles_turn()) return;
    if (is_last) {
      for (int i = begin; i < end; ++i) turned_so_far += turns[i - begin][ROTATIONS<D> - 1];
    }
    pair->particle_view().set_orientations(
        begin, end, [&](int i) { return turned(Row<D>{row(i)}.orientation(), turns[i - begin]); });
  });
  if (!can_retry) largest_difference = std::max(0.0, m.present * std::sqrt(largest_sq));
}

void OverdampedFlow::move(const Move &m, Pass pass)
{
  in_dimension(dimension, [&](auto D) { move_in<D>(m, pass); });
}

bool OverdampedFlow::was_small() const
{
  if (!can_retry) return true;
  const double too_far = farthest <= 1.0 ? 0.0 : 1.0;
  return sum(too_far) == 0.0;
}

bool OverdampedFlow::move_by(const Move &m)
{
  move(m, Pass::MOVE);
  return was_small();
}

bool OverdampedFlow::start_by(const Move &m)
{
  move(m, Pass::START);
  return was_small();
}

void OverdampedFlow::finish_step(const Move &m) { move(m, Pass::FINISH); }

template <int D>
double OverdampedFlow::length_of(int i, const RateIn<D> &of, const Upper &deformation) const
{
  const Vec<D> shift = deformation * of.shift;
  const Torque<D> turn = mobilities[i].gyration * of.turn;
  return std::sqrt(dot(shift, shift) + dot(turn, turn));
}

template <int D> void OverdampedFlow::add_lengths(const Move &m, double *sums)
{
  const Weights weights(m);
  const Upper back = divided(1.0, m.from);
  const auto add_one = [&](int i, const Spins<D> &spins) {
    const Row<D> its{row(i)};
    const RateIn<D> stored = its.stored_rate();
    if (norm(stored.shift) == 0.0 && norm(vec3(atom->f[i])) == 0.0) return;
    const RateIn<D> present = spins.added_to(mobilities.present_rate_in<D>(i), i);
    const double length = length_of<D>(i, sum_of<D>(its, weights, present), m.to);
    largest_difference = std::max(largest_difference, length);
    sums[0] += length * length;
    sums[1] += 1.0;
    if (n_registers == 0) return;
    RateIn<D> change{back * present.shift, present.turn};
    add(change, -1.0, stored);
    sums[2] += length * length_of<D>(i, change, m.to);
    sums[3] += length * length_of<D>(i, its.displacement(0), m.to);
  };
  ParticleView::in_blocks(atom->nlocal, [&](int begin, int end) {
    const Spins<D> spins(*this, begin, end);
    for (int i = begin; i < end; ++i) add_one(i, spins);
  });
}

double OverdampedFlow::rms_of(const Move &m)
{
  double mine[4] = {0.0, 0.0, 0.0, 0.0}, all[4];
  largest_difference = 0.0;
  in_dimension(dimension, [&](auto D) { add_lengths<D>(m, mine); });
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

/// Like LAMMPS's own step: exchanges atoms, ghosts and lists.
void OverdampedFlow::rebuild_lists()
{
  modify->pre_exchange();
  if (domain->triclinic) domain->x2lamda(atom->nlocal);
  domain->pbc();
  if (domain->box_change) {
    domain->reset_box();
    comm->setup();
    if (neighbor->style) neighbor->setup_bins();
  }
  comm->exchange();
  comm->borders();
  if (domain->triclinic) domain->lamda2x(atom->nlocal + atom->nghost);
  modify->pre_neighbor();
  neighbor->build(1);
  modify->post_neighbor();
  ++rebuilds;
}

void OverdampedFlow::evaluate_forces()
{
  ++neighbor->ago;  // 0 signals a new list to the pair style
  if (neighbor->check_distance()) {
    rebuild_lists();
  } else {
    comm->forward_comm();
  }
  clear_forces();
  const int no_energy = 0, virial = control_of_box ? VIRIAL_OF_PAIRS : 0, no_virial = 0;
  modify->pre_force(no_virial);
  force->pair->compute(no_energy, virial);
  if (force->newton) comm->reverse_comm();
  if (control_of_box) control_of_box->follow();
  modify->post_force(no_virial);
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
    // Without newton both ranks have the bond.
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

double OverdampedFlow::power_of_host() const
{
  double mine = 0.0;
  if (!host_turns()) return 0.0;
  const Upper &gradient = box.state().rate;
  pair->particle_view().for_each_orientation(atom->nlocal, [&](int i, const Quaternion &q) {
    const Vec<3> torque = vec3(atom->torque[i]);
    in_dimension(dimension, [&](auto D) {
      const Torque<D> spin = host_spin<D>(gradient, mobilities[i].bretherton, q);
      for (int k = 0; k < ROTATIONS<D>; ++k) mine += spin[k] * torque[3 - ROTATIONS<D> + k];
    });
  });
  return sum(mine);
}

double OverdampedFlow::mean_turn() const
{
  return sum(turned_so_far) / static_cast<double>(atom->natoms);
}

void OverdampedFlow::set_mean_turn(double angle)
{
  turned_so_far = comm->me == 0 ? angle * static_cast<double>(atom->natoms) : 0.0;
}

double OverdampedFlow::stage_difference() const
{
  double all;
  MPI_Allreduce(&largest_difference, &all, 1, MPI_DOUBLE, MPI_MAX, world);
  return all;
}

void OverdampedFlow::change_reference(const Upper &factor)
{
  in_dimension(dimension, [&](auto D) {
    for (int i = 0; i < atom->nlocal; ++i) {
      const Row<D> its{row(i)};
      its.set_coordinates(factor * its.coordinates());
    }
  });
}

void OverdampedFlow::follow_images()
{
  for (int i = 0; i < atom->nlocal; ++i) {
    double *const y = coordinates(i);
    Vec<3> at{};
    std::copy_n(y, dimension, at.c);
    const Vec<3> added = box.recounted(at, atom->image[i]);
    for (int k = 0; k < dimension; ++k) y[k] += added[k];
  }
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
  const Vec<3> y = box.reference(atom->x[i], atom->image[i], box.deformation(box.reached()));
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
