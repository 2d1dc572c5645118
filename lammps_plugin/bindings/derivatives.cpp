#include "contact/pair_derivatives.hpp"
#include "contact/shapes.hpp"

#include "bindings/shape.hpp"

#include <vector>

namespace jamshape {

namespace {

/// The second derivatives of n contacts as NumPy arrays (n, ...), of their bonds (n, BONDS, ...).
template <class Model, int D, class S> class DerivativeArrays {
 public:
  explicit DerivativeArrays(std::size_t n) :
      pair({n}), n_bonds({n}), kind({n}), energy({n}), separation({n, D}), force({n, D}),
      stiffness({n, BONDS}), coupling({n, BONDS}), distance({n, BONDS}), bond_force({n, BONDS}),
      gradient({n, BONDS, N}), curvature({n, N, N}), on_side({n, BONDS, 2}), on_face({n, BONDS, 2})
  {
  }

  void set(std::size_t c, const PosedPairs<Model, D, S> &pairs, std::size_t p,
           const ContactDerivatives<Model, D, S> &found)
  {
    const Vec<D, S> r = pairs.separation(p);
    const ContactOf<Model, D, S> &contact = found.contact;
    pair[c] = static_cast<std::int64_t>(p);
    n_bonds[c] = contact.n_bonds;
    kind[c] = static_cast<int>(contact.kind);
    energy[c] = static_cast<double>(contact.energy);
    write_vec(r, separation.row(c));
    write_vec(contact.force, force.row(c));
    for (int b = 0; b < contact.n_bonds; ++b) {
      const Bond<D, S> &bond = contact.bond[b];
      stiffness.row(c)[b] = static_cast<double>(bond.own_stiffness);
      coupling.row(c)[b] = static_cast<double>(bond.coupling);
      distance.row(c)[b] = static_cast<double>(bond.distance);
      on_side.row(c)[2 * b] = bond.on_side_i;
      on_side.row(c)[2 * b + 1] = bond.on_side_j;
      const OnFaces on = Model::on_faces(contact, b, pairs.first_body(p, r), pairs.second_body(p));
      on_face.row(c)[2 * b] = on.i;
      on_face.row(c)[2 * b + 1] = on.j;
      bond_force.row(c)[b] = static_cast<double>(norm(bond.force));
      for (int k = 0; k < N; ++k) {
        gradient.row(c)[b * N + k] = static_cast<double>(found.gradient[b][k]);
      }
    }
    for (int k = 0; k < N * N; ++k) {
      curvature.row(c)[k] = static_cast<double>(found.curvature[k / N][k % N]);
    }
  }

  nb::dict release()
  {
    nb::dict result;
    result["pair"] = pair.release();
    result["n_bonds"] = n_bonds.release();
    result["kind"] = kind.release();
    result["energy"] = energy.release();
    result["separation"] = separation.release();
    result["force"] = force.release();
    result["stiffness"] = stiffness.release();
    result["coupling"] = coupling.release();
    result["distance"] = distance.release();
    result["bond_force"] = bond_force.release();
    result["on_side"] = on_side.release();
    result["on_face"] = on_face.release();
    result["gradient"] = gradient.release();
    result["curvature"] = curvature.release();
    return result;
  }

 private:
  static constexpr int N = PAIR_VARIABLES<D>, BONDS = Model::MOST_BONDS;

  NewArray<std::int64_t> pair;
  NewArray<int> n_bonds, kind;
  NewArray<double> energy, separation, force, stiffness, coupling, distance, bond_force, gradient,
      curvature;
  NewArray<bool> on_side, on_face;
};

/// Kept as a separate function: compilers limit inlining by the size of a function.
template <class Model, int D, class S>
[[gnu::noinline]] nb::dict derivatives_in(const ShapeOf<Model> &of, const PairArrays &arrays)
{
  const PosedPairs<Model, D, S> pairs = of.template posed<D, S>(arrays);
  const TurnedBodies<PosedPairs<Model, D, S>> turned(pairs);
  std::vector<std::size_t> touching;
  std::vector<ContactDerivatives<Model, D, S>> found;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const Vec<D, S> r = pairs.separation(p);
    const ContactOf<Model, D, S> contact = contact_in(pairs, p, r);
    if (contact.status != ContactStatus::TOUCHING) continue;
    touching.push_back(p);
    found.emplace_back();
    found.back().contact = contact;
    const auto dual = turned.contact(p, r);
    if (dual.status == ContactStatus::TOUCHING) {
      read_uncoupled<D, S, Model::MOST_BONDS>(dual, found.back());
    }
  }
  DerivativeArrays<Model, D, S> derivatives(found.size());
  for (std::size_t c = 0; c < found.size(); ++c) {
    derivatives.set(c, pairs, touching[c], found[c]);
  }
  return derivatives.release();
}

}  // namespace

void export_derivatives()
{
  Shapes::each([](auto model) {
    using Model = decltype(model);
    def_in_precision(
        class_of<Model>(), "derivatives",
        [](auto D, auto s, const auto &of, const PairArrays &arrays) {
          return derivatives_in<Model, D, decltype(s)>(of, arrays);
        },
        "Second derivatives of the C touching pairs, arguments as in `sums`. The variables are\n"
        "r_i - r_j and the rotations of i and j, n = 4 in 2D, 9 in 3D. Returns a dict: pair (C,)\n"
        "rows of pairs; n_bonds, kind, energy (C,); separation, force (C, D); of up to most_bonds\n"
        "bonds B stiffness, coupling, distance, bond_force (C, B), on_side, on_face (C, B, 2) and\n"
        "gradient (C, B, n) of the distance; curvature (C, n, n), all but the sum over bonds of\n"
        "stiffness gradient (x) gradient and v (x) v, v the sum of coupling gradient.");
  });
}

}  // namespace jamshape
