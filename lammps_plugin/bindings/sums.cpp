#include "contact/shapes.hpp"

#include "bindings/shape.hpp"

namespace jamshape {

namespace {

/// Kept as a separate function: compilers limit inlining by the size of a function.
template <class Model, int D, class S>
[[gnu::noinline]] nb::dict sums_in(const ShapeOf<Model> &of, const PairArrays &arrays)
{
  std::vector<PairSums<D, S>> parts;
  const PairSums<D, S> &sums = sum_over(parts, of.template posed<D, S>(arrays));
  NewArray<double> force({of.n(), D}), torque({of.n(), ROTATIONS<D>});
  for (std::size_t n = 0; n < of.n(); ++n) {
    write_vec(sums.force[n], force.row(n));
    write_vec(sums.torque_on(n), torque.row(n));
  }
  NewArray<double> virial({D, D});
  write_vec(sums.virial, virial.row(0));
  nb::dict result;
  result["energy"] = static_cast<double>(sums.energy);
  result["force"] = force.release();
  result["torque"] = torque.release();
  result["virial"] = virial.release();
  result["bond_force"] = static_cast<double>(sums.bond_force);
  result["n_bonds"] = sums.n_bonds;
  result["crossing"] = sums.crossing;
  result["unconverged"] = sums.unconverged;
  return result;
}

}  // namespace

void export_sums()
{
  Shapes::each([](auto model) {
    using Model = decltype(model);
    def_in_precision(
        class_of<Model>(), "sums",
        [](auto D, auto s, const auto &of, const PairArrays &arrays) {
          return sums_in<Model, D, decltype(s)>(of, arrays);
        },
        "Sums over M pairs. Position (2, N, D), orientation (2, N, 1) angles or (2, N, 4)\n"
        "quaternions and cell (2, D, D), the box's cell vectors as columns, in double-double;\n"
        "pairs (M, 2), shift (M, D) cell vectors to add to the second; extended: in\n"
        "long double. Returns a dict: energy, force (N, D), torque (N, 1 or 3), virial (D, D),\n"
        "bond_force (sum of magnitudes), n_bonds, crossing and unconverged (a pair of this "
        "status,\n"
        "or -1).");
  });
}

}  // namespace jamshape
