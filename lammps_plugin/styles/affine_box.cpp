#include "affine_box.h"

#include "domain.h"
#include "update.h"

#include <cmath>

namespace jamshape {

using LAMMPS_NS::bigint;
using LAMMPS_NS::imageint;

AffineBox::AffineBox(LAMMPS_NS::LAMMPS *lmp, double kappa, Reference fixed_point) :
    Pointers(lmp), fixed(fixed_point), dimension(domain->dimension), now{}, started(false)
{
  now.rate = kappa;
}

void AffineBox::restore(const State &from)
{
  const double kappa = now.rate;
  now = from;
  started = true;
  if (kappa != from.rate) {
    now.strain_base = strain(update->ntimestep);
    now.step_base = update->ntimestep;
    now.rate = kappa;
  }
}

void AffineBox::begin_run()
{
  const bigint step = update->ntimestep;
  bool same_box = started;
  if (started) {
    double lo[3], hi[3];
    edges(scale(step), lo, hi);
    for (int k = 0; k < 3; ++k) {
      same_box = same_box && lo[k] == domain->boxlo[k] && hi[k] == domain->boxhi[k];
    }
  }
  if (!same_box) {
    for (int k = 0; k < 3; ++k) {
      now.lo[k] = domain->boxlo[k];
      now.hi[k] = domain->boxhi[k];
    }
    now.strain_base = 0.0;
    now.step_base = step;
  } else if (now.dt != update->dt) {
    now.strain_base = strain(step);
    now.step_base = step;
  }
  now.dt = update->dt;
  started = true;
}

double AffineBox::time(bigint step) const
{
  return static_cast<double>(step - now.step_base) * now.dt;
}

double AffineBox::strain(bigint step) const { return now.strain_base + now.rate * time(step); }

double AffineBox::scale(bigint step) const { return std::exp(-strain(step)); }

double AffineBox::scale(bigint step, double time_after) const
{
  return std::exp(-(now.strain_base + now.rate * (time(step) + time_after)));
}

void AffineBox::edges(double scale, double *lo, double *hi) const
{
  for (int k = 0; k < 3; ++k) {
    const bool shrinks = k < dimension;
    const double point = fixed_point(k);
    lo[k] = shrinks ? point + scale * (now.lo[k] - point) : now.lo[k];
    hi[k] = shrinks ? point + scale * (now.hi[k] - point) : now.hi[k];
  }
}

void AffineBox::set_box(double scale)
{
  edges(scale, domain->boxlo, domain->boxhi);
  domain->set_global_box();
  domain->set_local_box();
}

Vec<3> AffineBox::reference(const double *x, imageint image, double scale) const
{
  const Vec<3> images = image_counts(image);
  Vec<3> y{};
  for (int k = 0; k < dimension; ++k) {
    y[k] = (x[k] - fixed_point(k)) / scale + images[k] * edge_at_start(k);
  }
  return y;
}

}  // namespace jamshape
