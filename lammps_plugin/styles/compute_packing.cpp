#include "compute_packing.h"

#include "contact/math/symmetric_eigen.hpp"

#include "atom.h"
#include "comm.h"
#include "compat.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "modify.h"
#include "packing/rattlers.hpp"
#include "update.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <mpi.h>
#include <optional>
#include <unordered_map>

namespace jamshape {

namespace {

enum Value {
  PHI,
  U,
  P,
  Z,
  S_2,
  S_4,
  F_MAX,
  F_RMS,
  Z_SINGLE,
  RATTLERS,
  BONDS,
  OVERLAP,
  T_MAX,
  C_4,
  N_1,
  P_XY,
  SIGMA,
  MU,
  P_XZ,
  P_YZ,
  N_2,
  DIRECTOR
};

/// The cubatic order tries the axes of at most this many particles as directions.
constexpr LAMMPS_NS::bigint MOST_TRIED = 512;

/// An edge of the contact network as ranks exchange it; as bytes over MPI, since all ranks run the
/// same program.
struct SharedEdge {
  LAMMPS_NS::tagint itag, jtag;
  Vec<3> normal;
  int n_bonds, n_contacts;
  OnFaces on_faces;
};

/// The contacts of this rank, from their bonds, which come contact by contact: one edge each, or
/// one per bond if bonds are contacts of their own.
std::vector<SharedEdge> edges_of(const std::vector<LocalBond> &bonds, const LAMMPS_NS::tagint *tag,
                                 const PairContact &pair, bool is_plane)
{
  std::vector<SharedEdge> edges;
  for (const LocalBond &bond : bonds) {
    const bool is_first = bond.number == 0;
    if (is_first || pair.bonds_are_contacts()) {
      edges.push_back({tag[bond.i], tag[bond.j], bond.normal, 1, is_first ? 1 : 0, bond.on_faces});
    } else {
      ++edges.back().n_bonds;
      edges.back().on_faces.i |= bond.on_faces.i;
      edges.back().on_faces.j |= bond.on_faces.j;
    }
    // In 2D such a contact counts as two even if it carries one force (`sides one`); in 3D skew
    // rods touch side to side at one point.
    if (is_plane && bond.kind == ContactKind::SIDE_TO_SIDE) edges.back().n_bonds = 2;
  }
  return edges;
}

template <class T> std::vector<T> gather(const std::vector<T> &mine, MPI_Comm world)
{
  int n_ranks, bytes = static_cast<int>(mine.size() * sizeof(T));
  MPI_Comm_size(world, &n_ranks);
  std::vector<int> counts(n_ranks), offsets(n_ranks + 1, 0);
  MPI_Allgather(&bytes, 1, MPI_INT, counts.data(), 1, MPI_INT, world);
  for (int r = 0; r < n_ranks; ++r) offsets[r + 1] = offsets[r] + counts[r];
  std::vector<T> all(offsets[n_ranks] / sizeof(T));
  MPI_Allgatherv(mine.data(), bytes, MPI_BYTE, all.data(), counts.data(), offsets.data(), MPI_BYTE,
                 world);
  return all;
}

}  // namespace

ComputePacking::ComputePacking(LAMMPS_NS::LAMMPS *lmp, int narg, char **arg) :
    Compute(lmp, narg, arg), pair(nullptr)
{
  if (igroup != 0)
    error->all(FLERR, std::string("compute packing found a group other than all, expected 'all'."));
  if (narg != 3) error->all(FLERR, std::string("compute packing found arguments, expected none."));
  vector_flag = 1;
  size_vector = N_VALUES;
  extvector = 0;
  peflag = pressflag = timeflag = 1;  // LAMMPS then tallies energy and virial on the required steps
  vector = new double[N_VALUES]();
}

ComputePacking::~ComputePacking() { delete[] vector; }

void ComputePacking::init() { PairContact::of(lmp, "compute packing"); }

double ComputePacking::sum(double mine) const
{
  double all;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

double ComputePacking::largest(double mine) const
{
  double all;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_MAX, world);
  return all;
}

void ComputePacking::compute_vector()
{
  invoked_vector = update->ntimestep;
  if (update->vflag_global != invoked_vector || update->eflag_global != invoked_vector) {
    error->all(
        FLERR,
        std::string(
            "compute packing found that energy and virial were not tallied on this step, "
            "expected them: use it in thermo output or in a fix that requests it a step ahead."));
  }
  pair = &PairContact::evaluated(lmp, "compute packing");
  const std::vector<LocalBond> bonds = pair->reported_bonds();
  compute_density_and_stress();
  compute_order();
  compute_cubatic_order();
  compute_contacts(bonds);
}

void ComputePacking::compute_density_and_stress()
{
  const int d = domain->dimension;
  double volume = 1.0, measure = 0.0, trace = 0.0, sums[6];
  for (int k = 0; k < d; ++k) volume *= domain->prd[k];
  for (int i = 0; i < atom->nlocal; ++i) {
    measure += pair->drag(pair->particle_view().semi_axes(i), atom->type[i]).measure;
  }
  vector[PHI] = sum(measure) / volume;
  vector[U] = sum(pair->eng_vdwl) / volume;
  MPI_Allreduce(pair->virial, sums, 6, MPI_DOUBLE, MPI_SUM, world);
  for (double &component : sums) component *= force->nktv2p;  // 1 with `units lj`
  for (int k = 0; k < d; ++k) trace += sums[k];
  vector[P] = trace / (d * volume);
  vector[N_1] = (sums[0] - sums[1]) / volume;
  vector[N_2] = d == 3 ? (sums[1] - sums[2]) / volume : 0.0;
  vector[P_XY] = sums[3] / volume;
  vector[P_XZ] = sums[4] / volume;
  vector[P_YZ] = sums[5] / volume;
  vector[SIGMA] = std::hypot(0.5 * vector[N_1], vector[P_XY]);
  vector[MU] = vector[P] > 0.0 ? vector[SIGMA] / vector[P] : 0.0;
}

void ComputePacking::compute_order()
{
  const ParticleView &view = pair->particle_view();
  std::vector<Vec<3>> axes;  // of particles with a director
  for (int i = 0; i < atom->nlocal; ++i) {
    const std::optional<int> along = pair->director(view.semi_axes(i), atom->type[i]);
    if (along) axes.push_back(body_axis(view.orientation(i), *along));
  }
  const double n = sum(static_cast<double>(axes.size()));
  vector[S_2] = vector[S_4] = vector[DIRECTOR] = 0.0;
  if (n == 0.0) return;

  if (domain->dimension == 2) {
    double mine[4] = {}, all[4];
    for (const Vec<3> &axis : axes) {
      const double cos_2 = axis[0] * axis[0] - axis[1] * axis[1], sin_2 = 2.0 * axis[0] * axis[1];
      mine[0] += cos_2;
      mine[1] += sin_2;
      mine[2] += cos_2 * cos_2 - sin_2 * sin_2;
      mine[3] += 2.0 * cos_2 * sin_2;
    }
    MPI_Allreduce(mine, all, 4, MPI_DOUBLE, MPI_SUM, world);
    vector[S_2] = std::hypot(all[0], all[1]) / n;
    vector[S_4] = std::hypot(all[2], all[3]) / n;
    vector[DIRECTOR] = 0.5 * std::atan2(all[1], all[0]);
    return;
  }

  double mine[6] = {}, all[6];
  for (const Vec<3> &axis : axes) {
    int m = 0;
    for (int a = 0; a < 3; ++a) {
      for (int b = a; b < 3; ++b) mine[m++] += 1.5 * axis[a] * axis[b] - (a == b ? 0.5 : 0.0);
    }
  }
  MPI_Allreduce(mine, all, 6, MPI_DOUBLE, MPI_SUM, world);
  const SymmetricEigen nematic =
      largest_eigenpair({all[0], all[1], all[2], all[3], all[4], all[5]});
  vector[S_2] = nematic.value / n;
  double tetratic = 0.0;
  for (const Vec<3> &axis : axes) {
    const double c_sq = std::pow(dot(nematic.vector, axis), 2);
    tetratic += 0.125 * (c_sq * (35.0 * c_sq - 30.0) + 3.0);
  }
  vector[S_4] = sum(tetratic) / n;
}

/// The largest mean of P_4(t.u_i) over directions t, u_i being the axis of i nearest to t.
void ComputePacking::compute_cubatic_order()
{
  vector[C_4] = 0.0;
  if (domain->dimension == 2 || !pair->has_three_axes()) return;
  std::vector<Vec<3>> axes, mine;
  const LAMMPS_NS::bigint stride = 1 + (atom->natoms - 1) / MOST_TRIED;
  pair->particle_view().for_each_orientation(atom->nlocal, [&](int i, const Quaternion &q) {
    for (int k = 0; k < 3; ++k) axes.push_back(body_axis(q, k));
    if (atom->tag[i] % stride == 0) mine.insert(mine.end(), axes.end() - 3, axes.end());
  });
  const std::vector<Vec<3>> tried = gather(mine, world);
  std::vector<double> sums(tried.size(), 0.0), all(tried.size());
  for (std::size_t t = 0; t < tried.size(); ++t) {
    for (std::size_t n = 0; n < axes.size(); n += 3) {
      double c_sq = 0.0;
      for (int k = 0; k < 3; ++k) c_sq = std::max(c_sq, std::pow(dot(tried[t], axes[n + k]), 2));
      sums[t] += 0.125 * (c_sq * (35.0 * c_sq - 30.0) + 3.0);
    }
  }
  MPI_Allreduce(sums.data(), all.data(), static_cast<int>(all.size()), MPI_DOUBLE, MPI_SUM, world);
  for (const double each : all) {
    vector[C_4] = std::max(vector[C_4], each / static_cast<double>(atom->natoms));
  }
}

void ComputePacking::compute_contacts(const std::vector<LocalBond> &bonds)
{
  double force_sum = 0.0, overlap = 0.0;
  for (const LocalBond &bond : bonds) {
    force_sum += norm(bond.force);
    overlap = std::max(overlap, (bond.reach - bond.distance) / bond.reach);
  }
  const double n_forces = sum(static_cast<double>(bonds.size()));
  const double mean_force = n_forces > 0.0 ? sum(force_sum) / n_forces : 0.0;
  vector[OVERLAP] = largest(overlap);
  compute_residuals(mean_force);
  count_contacts(bonds);
}

void ComputePacking::count_contacts(const std::vector<LocalBond> &bonds)
{
  const int d = domain->dimension;
  const std::vector<SharedEdge> shared = gather(edges_of(bonds, atom->tag, *pair, d == 2), world);
  // IDs need not be consecutive; particles without a contact are rattlers by definition.
  std::unordered_map<LAMMPS_NS::tagint, std::size_t> index;
  std::vector<ContactEdge> edges;
  for (const SharedEdge &c : shared) {
    const std::size_t i = index.emplace(c.itag, index.size()).first->second;
    const std::size_t j = index.emplace(c.jtag, index.size()).first->second;
    edges.push_back({i, j, c.normal, c.on_faces.i, c.on_faces.j});
  }
  const std::vector<char> is_rattler = RattlerSearch(index.size(), edges, d).find();
  const double backbone =
      static_cast<double>(std::count(is_rattler.begin(), is_rattler.end(), char(0)));
  double held_bonds = 0.0, held_contacts = 0.0;
  vector[BONDS] = 0.0;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    vector[BONDS] += shared[e].n_bonds;
    if (is_rattler[edges[e].i] || is_rattler[edges[e].j]) continue;
    held_bonds += shared[e].n_bonds;
    held_contacts += shared[e].n_contacts;
  }
  vector[Z] = backbone > 0.0 ? 2.0 * held_bonds / backbone : 0.0;
  vector[Z_SINGLE] = backbone > 0.0 ? 2.0 * held_contacts / backbone : 0.0;
  vector[RATTLERS] = static_cast<double>(atom->natoms) - backbone;
}

void ComputePacking::compute_residuals(double mean_bond_force)
{
  double sum_sq = 0.0, largest_sq = 0.0, largest_torque = 0.0;
  for (int i = 0; i < atom->nlocal; ++i) {
    const double *f = atom->f[i], *t = atom->torque[i];
    const double force_sq = f[0] * f[0] + f[1] * f[1] + f[2] * f[2];
    sum_sq += force_sq;
    largest_sq = std::max(largest_sq, force_sq);
    const Vec<3> moment = pair->drag(pair->particle_view().semi_axes(i), atom->type[i]).moment;
    const double gyration = std::sqrt(std::max({moment[0], moment[1], moment[2]}));
    largest_torque =
        std::max(largest_torque, std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]) / gyration);
  }
  const double scale = mean_bond_force > 0.0 ? 1.0 / mean_bond_force : 0.0;
  vector[F_MAX] = scale * std::sqrt(largest(largest_sq));
  vector[F_RMS] = scale * std::sqrt(sum(sum_sq) / static_cast<double>(atom->natoms));
  vector[T_MAX] = scale * largest(largest_torque);
}

}  // namespace jamshape
