#include "relaxation_rate.h"

#include "atom.h"
#include "comm.h"
#include "compat.h"
#include "domain.h"
#include "force.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <mpi.h>

namespace jamshape {

namespace {

constexpr int STEPS = 30, STEPS_AT_LEAST = 6;

/// A direction shorter than this relative to the first is rounding: all eigenvalues have been
/// found.
constexpr double EXHAUSTED = 1e-12;

Vec<3> vec3(const double *from) { return {{from[0], from[1], from[2]}}; }

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

/// A number in (-1, 1) that depends on the atom's ID only, so that it is independent of ranks and
/// order.
double hashed(std::uint64_t tag, std::uint64_t component)
{
  std::uint64_t z = 6 * tag + component + 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  z ^= z >> 31;
  return 2.0 * static_cast<double>(z >> 11) * 0x1.0p-53 - 1.0;
}

}  // namespace

RelaxationRate::RelaxationRate(LAMMPS_NS::LAMMPS *lmp, LAMMPS_NS::Fix *owner,
                               const Mobilities &of) :
    Pointers(lmp), dimension(domain->dimension), n_rates(rate_width(dimension)), mobilities(of),
    fix(owner), evaluations(0)
{
}

double RelaxationRate::of_bonds(PairContact &pair, double tolerance)
{
  return largest_eigenvalue_of([&] { add_bonds_times_direction(pair); }, tolerance);
}

double RelaxationRate::largest(PairContact &pair, double tolerance)
{
  if (!pair.has_smooth_forces()) return of_bonds(pair, tolerance);
  const Curvatures all = curvatures(pair);
  return largest_eigenvalue_of([&] { add_curvatures_times_direction(all); }, tolerance);
}

/* ----------------------------------------------------------------------
   Lanczos' method in the metric of the drag, in which mobility times stiffness is symmetric. Each
   direction is the rate of a force; the remainder of the next one is in the force arrays.
------------------------------------------------------------------------- */

double RelaxationRate::largest_eigenvalue_of(const std::function<void()> &add_stiffness_times,
                                             double tolerance)
{
  begin();
  double found = 0.0, size = 0.0;
  for (int step = 0; step < STEPS; ++step) {
    if (!next_direction(size)) break;
    add_stiffness_times();
    diagonal.push_back(dot_with_forces([&](int i) { return direction(i); }));
    size = std::max(size, std::abs(diagonal.back()));
    if (tolerance > 0.0) {
      const double better = largest_eigenvalue(diagonal, off_diagonal);
      if (step >= STEPS_AT_LEAST && better <= (1.0 + tolerance) * found) break;
      found = better;
    }
    for (int i = 0; i < atom->nlocal; ++i) add_force(i, -diagonal.back(), direction(i));
  }
  end();
  return largest_eigenvalue(diagonal, off_diagonal);
}

/// Stores the present forces and replaces them by random ones.
void RelaxationRate::begin()
{
  const std::size_t nlocal = atom->nlocal, nghost = atom->nghost;
  diagonal.clear();
  off_diagonal.clear();
  directions.assign(n_rates * (nlocal + nghost), 0.0);
  forces.resize(n_rates * nlocal);
  for (int i = 0; i < atom->nlocal; ++i) {
    pack_force(i, &forces[n_rates * i]);
    double start[6];
    for (int k = 0; k < n_rates; ++k) start[k] = hashed(atom->tag[i], k);
    unpack_force(i, start);
  }
}

/// The rate of the remainder, of length 1; the forces become the term that keeps the next one
/// orthogonal to the previous direction. False if nothing is left.
bool RelaxationRate::next_direction(double size)
{
  const double length =
      std::sqrt(dot_with_forces([&](int i) { return mobilities.present_rate(i); }));
  const bool is_first = diagonal.empty();
  if (!is_first) {
    if (!(length > EXHAUSTED * size)) return false;
    off_diagonal.push_back(length);
  }
  for (int i = 0; i < atom->nlocal; ++i) {
    const Rate before = direction(i), rate = mobilities.present_rate(i);
    write_rate(&directions[n_rates * i], {(1.0 / length) * rate.shift, (1.0 / length) * rate.turn},
               dimension);
    for (double *const of : {atom->f[i], atom->torque[i]}) std::fill_n(of, 3, 0.0);
    add_force(i, is_first ? 0.0 : -length, before);
  }
  return true;
}

double RelaxationRate::dot_with_forces(const std::function<Rate(int)> &rate) const
{
  double mine = 0.0;
  for (int i = 0; i < atom->nlocal; ++i) {
    const Rate of = rate(i);
    mine += dot(of.shift, vec3(atom->f[i])) + dot(of.turn, vec3(atom->torque[i]));
  }
  return sum(mine);
}

void RelaxationRate::end()
{
  for (int i = 0; i < atom->nlocal; ++i) unpack_force(i, &forces[n_rates * i]);
  for (std::vector<double> *const of : {&directions, &forces}) std::vector<double>().swap(*of);
}

/* ----------------------------------------------------------------------
   stiffness times the direction, added to the force arrays
------------------------------------------------------------------------- */

void RelaxationRate::add_bonds_times_direction(PairContact &pair)
{
  ++evaluations;
  send_direction();
  pair.for_each_bond([&](const LocalBond &b) {
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

RelaxationRate::Curvatures RelaxationRate::curvatures(PairContact &pair)
{
  evaluations += pair.curvature_cost();
  Curvatures all;
  pair.for_each_curvature([&](const LocalCurvature &c) {
    all.i.push_back(c.i);
    all.j.push_back(c.j);
    all.triangles.insert(all.triangles.end(), c.triangle.begin(), c.triangle.end());
  });
  return all;
}

void RelaxationRate::add_curvatures_times_direction(const Curvatures &of)
{
  send_direction();
  dimension == 2 ? add_curvatures_times<2>(of) : add_curvatures_times<3>(of);
  if (force->newton) comm->reverse_comm();
}

template <int D> void RelaxationRate::add_curvatures_times(const Curvatures &of)
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

/// Sends the direction to ghosts, whose forces are cleared, because later contributions are added
/// to them.
void RelaxationRate::send_direction()
{
  compat::forward(comm, fix, n_rates);
  if (!force->newton) return;
  for (double **const of : {atom->f, atom->torque}) {
    if (atom->nghost > 0) std::memset(of[atom->nlocal], 0, 3 * atom->nghost * sizeof(double));
  }
}

void RelaxationRate::add_load(int i, const Vec<3> &force_on, const Vec<3> &torque_on)
{
  for (int k = 0; k < 3; ++k) {
    atom->f[i][k] += force_on[k];
    atom->torque[i][k] += torque_on[k];
  }
}

/// Adds the force and torque of a rate, times a factor.
void RelaxationRate::add_force(int i, double factor, const Rate &rate)
{
  const Rate load = mobilities.resistance_times(i, rate);
  add_load(i, factor * load.shift, factor * load.turn);
}

/// Copies force and torque on i without the components that are zero in 2D, and back.
void RelaxationRate::pack_force(int i, double *to) const
{
  write_rate(to, {vec3(atom->f[i]), vec3(atom->torque[i])}, dimension);
}

void RelaxationRate::unpack_force(int i, const double *from)
{
  std::copy_n(from, dimension, atom->f[i]);
  std::copy_n(from + dimension, n_rates - dimension, atom->torque[i] + (dimension == 2 ? 2 : 0));
}

double RelaxationRate::sum(double mine) const
{
  double all;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

int RelaxationRate::pack_direction(int n, const int *list, double *buf) const
{
  for (int k = 0; k < n; ++k) buf = std::copy_n(&directions[n_rates * list[k]], n_rates, buf);
  return n * n_rates;
}

void RelaxationRate::unpack_direction(int n, int first, const double *buf)
{
  std::copy_n(buf, n_rates * n, &directions[n_rates * first]);
}

}  // namespace jamshape
