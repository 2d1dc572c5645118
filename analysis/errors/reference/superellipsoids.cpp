// Contacts of superellipsoids to 33 digits: what analysis/errors/superellipsoid_error.py holds
// those of the library against.
//
//     superellipsoids 2|3 < pairs > contacts
//
// A pair is the rows of both bodies (as `superellipsoid_contacts` takes them, in 3D with two
// exponents) and a normal and a point of i (from its centre) to begin at, in doubles. A contact is
// energy, force, torque_i and torque_j, each number a double and its rest, and three doubles:
// bounds of the errors of these.

#include "contact/errors.hpp"
#include "contact/superellipsoid/superellipsoid.hpp"

#include "quad.hpp"

#include <cstdio>
#include <cstring>
#include <vector>

namespace jamshape {
namespace {

template <int D> constexpr int TURNS = D == 2 ? 1 : 4;
template <int D> constexpr int EXPONENTS = D == 2 ? 1 : 2;
template <int D> constexpr int COLUMNS = 2 * D + TURNS<D> + EXPONENTS<D>;

template <int D> SuperellipsoidBody<D, Quad> body_of(const double *row)
{
  const double *const turn = row + D, *const axes = turn + TURNS<D>;
  const Vec<3> semi_axes{{axes[0], axes[1], D == 2 ? axes[1] : axes[D - 1]}};
  const auto form = *SuperellipsoidForm::from({axes + D, axes + D + EXPONENTS<D>}, D);
  auto body = SuperellipsoidModel::body<D, Quad>(*superellipsoid_from(semi_axes, form));
  for (int k = 0; k < D; ++k) body.centre[k] = row[k];
  const Quad half = Quad(0.5) * Quad(turn[0]), zero = 0.0;
  QuaternionOf<Quad> q{cos(half), zero, zero, sin(half)};
  if (D == 3) q = normalized(QuaternionOf<Quad>{turn[0], turn[1], turn[2], turn[TURNS<D> - 1]});
  SuperellipsoidModel::turn_to<D, Quad>(body, q);
  return body;
}

template <int D> class Reference {
 public:
  static constexpr int NUMBERS = 2 * COLUMNS<D> + 2 * D;

  explicit Reference(const double *pair) :
      i(body_of<D>(pair)), j(body_of<D>(pair + COLUMNS<D>)), r(i.centre - j.centre)
  {
    const double *const begin = pair + 2 * COLUMNS<D>;
    for (int k = 0; k < D; ++k) {
      start.at.normal[k] = begin[k];
      start.at.point_i[k] = -begin[D + k];
    }
    start.at.point_j = r - start.at.point_i;
  }

  Contact<D, Quad, 1> contact() const
  {
    const TangencySearch<D, Quad> search(i, j, TangencyWish<D, Quad>{r, false, nullptr});
    FoundTangency<D, Quad> found = start;
    if (!search.improve(found)) found = search.find();
    const TangencyLoad<D, Quad> load(found.at, r, PowerLawOf<double>{1.0});
    auto contact = without_bonds<D, Quad, 1>(ContactStatus::TOUCHING);
    contact.n_bonds = 1;
    contact.energy = load.energy;
    contact.force = load.force;
    contact.torque_i = load.torque_i;
    contact.torque_j = load.torque_j;
    Bond<D, Quad> &bond = contact.bond[0];
    bond.reach = Quad(1.0) / norm(load.gradient);
    bond.normal = bond.reach * load.gradient;
    bond.distance = bond.reach * load.x;
    bond.arm_i = load.arm_i;
    return contact;
  }

  void write() const
  {
    const Contact<D, Quad, 1> found = contact();
    numbers.clear();
    put(found.energy);
    for (int k = 0; k < D; ++k) put(found.force[k]);
    for (int k = 0; k < ROTATIONS<D>; ++k) put(found.torque_i[k]);
    for (int k = 0; k < ROTATIONS<D>; ++k) put(found.torque_j[k]);
    const ContactErrors errors = errors_of(i, j, found, found, PowerLaw{1.0});
    numbers.insert(numbers.end(), {errors.energy, errors.force, errors.torque});
    std::fwrite(numbers.data(), sizeof(double), numbers.size(), stdout);
  }

 private:
  SuperellipsoidBody<D, Quad> i, j;
  Vec<D, Quad> r;
  FoundTangency<D, Quad> start{};
  mutable std::vector<double> numbers;

  void put(const Quad &x) const
  {
    const double leading = static_cast<double>(x);
    numbers.insert(numbers.end(), {leading, static_cast<double>(x - Quad(leading))});
  }
};

template <int D> void write_all()
{
  double pair[Reference<D>::NUMBERS];
  while (std::fread(pair, sizeof(pair), 1, stdin) == 1) Reference<D>(pair).write();
}

}  // namespace
}  // namespace jamshape

int main(int count, char **arguments)
{
  const bool is_flat = count == 2 && std::strcmp(arguments[1], "2") == 0;
  is_flat ? jamshape::write_all<2>() : jamshape::write_all<3>();
}
