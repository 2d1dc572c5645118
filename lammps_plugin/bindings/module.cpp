#include "contact/instruction_set.hpp"

#include "bindings/arrays.hpp"
#include "packing/box_times.hpp"

namespace jamshape {
namespace {

nb::list instruction_sets()
{
  nb::list names;
  for (const NamedSet &known : INSTRUCTION_SETS) {
    if (machine_has(known.set)) names.append(known.name);
  }
  return names;
}

/// The default time of a box that yields, and the viscosity of the host.
nb::tuple box_times(double drag, double measure, double stiffness, int dimension)
{
  const double viscosity = host_viscosity(drag, measure, dimension);
  return nb::make_tuple(default_box_time(viscosity, measure, stiffness), viscosity);
}

}  // namespace

void export_shapes(nanobind::module_ &m);
void export_sums();
void export_derivatives();
void export_starts();
void export_sweeps();
void export_local_energy_model(nanobind::module_ &m);
void export_stages(nanobind::module_ &m);
void export_descent(nanobind::module_ &m);
void export_rattlers(nanobind::module_ &m);
void export_sparse_product(nanobind::module_ &m);
void export_probes(nanobind::module_ &m);
}  // namespace jamshape

NB_MODULE(_contact, m)
{
  m.doc() = "Contact geometry and energies: arrays in, arrays out, over lammps_plugin/contact/.";
  jamshape::export_shapes(m);
  jamshape::export_sums();
  jamshape::export_derivatives();
  jamshape::export_starts();
  jamshape::export_sweeps();
  jamshape::export_local_energy_model(m);
  jamshape::export_stages(m);
  jamshape::export_descent(m);
  jamshape::export_rattlers(m);
  jamshape::export_sparse_product(m);
  jamshape::export_probes(m);
  m.def(
      "box_times", &jamshape::box_times, nanobind::arg("drag"), nanobind::arg("measure"),
      nanobind::arg("stiffness"), nanobind::arg("dimension"),
      "Default time in which a box yields, and the viscosity of the host, from the drag k_d, the\n"
      "mean measure of the particles, k_e and the dimension.");
  m.def("instruction_sets", &jamshape::instruction_sets,
        "Instruction sets of this machine that contacts in packs are compiled for, as the\n"
        "environment variable JAMSHAPE_SIMD names them, best last; with 'scalar' pairs go one by\n"
        "one.");
}
