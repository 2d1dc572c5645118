#include "bindings/arrays.hpp"

namespace jamshape {
void export_spherocylinder(nanobind::module_ &m);
void export_superellipsoid(nanobind::module_ &m);
void export_rattlers(nanobind::module_ &m);
void export_hard_particles(nanobind::module_ &m);
void export_vicinity(nanobind::module_ &m);
}  // namespace jamshape

NB_MODULE(_contact, m)
{
  m.doc() = "Contact geometry and energies: arrays in, arrays out, over lammps_plugin/contact/.";
  jamshape::export_spherocylinder(m);
  jamshape::export_superellipsoid(m);
  jamshape::export_rattlers(m);
  jamshape::export_hard_particles(m);
  jamshape::export_vicinity(m);
}
