// Compiled once for each instruction set, JAMSHAPE_SET.

#include "contact/contact_block.hpp"
#include "contact/math/vec.hpp"
#include "contact/spherocylinder/spherocylinder.hpp"
#include "contact/spheropolygon/spheropolygon.hpp"

#include <array>

namespace jamshape {
namespace {

/// Pairs of sides of the polygons of a block, which are rods.
class SidePairs {
 public:
  SidePairs(FindContacts<SpherocylinderModel, 2> &find, const SpherocylinderLaw &of,
            ContactBlock<2> &to) : find_rods(find), law(of), block(to)
  {
  }

  /// Adds the sides a of i and b of j, the bodies of pair k, at these spines.
  void add(int k, const SpheropolygonBody<2> &i, int a, const SpheropolygonBody<2> &j, int b,
           const SpinePair<2> &spines)
  {
    if (rods.n == rods.MOST) find();
    const int n = rods.n;
    spine[2 * n] = {{}, spines.u_i, spines.A_i, i.radius()};
    spine[2 * n + 1] = {{}, spines.u_j, spines.A_j, j.radius()};
    pair[n] = k;
    middle_i[n] = i.middle(a);
    middle_j[n] = j.middle(b);
    rods.add(2 * n, 2 * n + 1, spines.r, block.k_e[k]);
  }

  /// Finds the contacts of the pairs of sides, and keeps those of the largest energies.
  void find()
  {
    if (rods.n == 0) return;
    find_rods(spine.data(), law, rods);
    block.alone |= of_pairs(rods.alone);
    rods.for_each(rods.touching & ~rods.alone, [&](int n) {
      if (rods.energy[n] > block.energy[pair[n]]) take(n);
    });
    rods.n = 0;
  }

 private:
  FindContacts<SpherocylinderModel, 2> &find_rods;
  const SpherocylinderLaw &law;
  ContactBlock<2> &block, rods;
  std::array<SpherocylinderBody<2>, 2 * ContactBlock<2>::MOST> spine;
  std::array<int, ContactBlock<2>::MOST> pair;
  std::array<Vec<2>, ContactBlock<2>::MOST> middle_i, middle_j;

  std::uint64_t of_pairs(std::uint64_t of_sides) const
  {
    std::uint64_t found = 0;
    rods.for_each(of_sides, [&](int n) { found |= std::uint64_t{1} << pair[n]; });
    return found;
  }

  void take(int n)
  {
    const int k = pair[n];
    const std::uint64_t bit = std::uint64_t{1} << k;
    const Vec<2> force = rods.force_of(n);
    block.touching |= bit;
    block.two_bonds = (block.two_bonds & ~bit) | (rods.two_bonds >> n & 1) << k;
    block.energy[k] = rods.energy[n];
    block.bond_force[k] = rods.bond_force[n];
    for (int a = 0; a < 2; ++a) block.force[a][k] = force[a];
    block.torque_i[0][k] = rods.torque_i[0][n] + cross(middle_i[n], force)[0];
    block.torque_j[0][k] = rods.torque_j[0][n] - cross(middle_j[n], force)[0];
  }
};

}  // namespace

template <InstructionSet SET>
void find_polygon_contacts(const SpheropolygonBody<2> *bodies, const SpherocylinderLaw &law,
                           ContactBlock<2> &block)
{
  SidePairs sides(find_rod_contacts<SET, 2>, law, block);
  block.touching = block.alone = block.two_bonds = 0;
  for (int k = 0; k < block.n; ++k) {
    block.energy[k] = 0.0;
    SpheropolygonBody<2> i = bodies[block.i[k]], j = bodies[block.j[k]];
    i.centre = block.separation_of(k);
    j.centre = {};
    const auto add = [&](int a, int b, const SpinePair<2> &spines) {
      sides.add(k, i, a, j, b, spines);
      return true;
    };
    if (!each_two_sides<2, double>(i, j, i.radius() + j.radius(), add))
      block.alone |= std::uint64_t{1} << k;
  }
  sides.find();
  block.touching |= block.alone;
}

template FindContacts<SpheropolygonModel, 2> find_polygon_contacts<InstructionSet::JAMSHAPE_SET>;

}  // namespace jamshape
