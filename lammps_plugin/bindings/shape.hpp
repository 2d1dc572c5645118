#pragma once

#include "contact/contact.hpp"
#include "contact/math/dimension.hpp"

#include "bindings/arrays.hpp"
#include "bindings/pairs.hpp"
#include "text.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace jamshape {

/// Settings of the law of all contacts, from their Python arguments.
struct LawSettings {
  int sides;
  double power = HARMONIC;
};

/// The law of contacts from its Python arguments.
template <class Model> typename Model::Law law_of(double k_e, const LawSettings &with)
{
  require(k_e > 0.0 && std::isfinite(k_e),
          "k_e is " + shown(k_e) + ", expected a positive energy.");
  require(with.sides == 1 || with.sides == 2,
          "sides is " + std::to_string(with.sides) + ", expected 1 or 2.");
  require(with.power >= HARMONIC && std::isfinite(with.power),
          "power is " + shown(with.power) + ", expected a number from 2 on.");
  return Model::law({k_e, with.power}, static_cast<Sides>(with.sides));
}

/// The laws of contacts for k_e (T, T) and species (N,), numbered from 1.
template <class Model>
Laws<typename Model::Law> laws_of(const Array2<double> &k_e, const Array1<std::int64_t> &species,
                                  const LawSettings &with)
{
  const std::size_t n = k_e.shape(0);
  require(n > 0 && k_e.shape(1) == n, "k_e does not have the shape (T, T).");
  std::vector<typename Model::Law> table;
  for (std::size_t at = 0; at < n * n; ++at) {
    require(k_e.data()[at] == k_e.data()[at % n * n + at / n],
            "k_e is not symmetric, expected the same number for I J as for J I.");
    table.push_back(law_of<Model>(k_e.data()[at], with));
  }
  std::vector<std::size_t> kinds;
  for (std::size_t i = 0; i < species.size(); ++i) {
    const std::int64_t own = species.data()[i];
    require(own >= 1 && static_cast<std::size_t>(own) <= n,
            "species holds " + std::to_string(own) + ", expected numbers from 1 to " +
                std::to_string(n) + ", the rows of k_e.");
    kinds.push_back(static_cast<std::size_t>(own - 1));
  }
  return {n, std::move(table), std::move(kinds)};
}

/// N particles of one shape, each with its own size, and the laws of their contacts: the Python
/// class of a shape. Its methods are bound in shapes.cpp, sums.cpp, derivatives.cpp, sweeps.cpp and
/// local_energy_model.cpp, for every shape of shapes.hpp.
template <class Model> class ShapeOf {
 public:
  using Shape = typename Model::Shape;
  using Law = typename Model::Law;

  /// `form` is an Array2 (N, K) or, of exponents, an Array1 (N,), which shapes without ignore.
  template <class Numbers>
  ShapeOf(const Array2<double> &diameters, const Numbers &form, int dimension, double k_e,
          const LawSettings &with) :
      ShapeOf(diameters, rows_of(form), dimension, Laws<Law>(law_of<Model>(k_e, with)))
  {
  }

  /// k_e (T, T) by species (N,), numbered from 1.
  template <class Numbers>
  ShapeOf(const Array2<double> &diameters, const Numbers &form, int dimension,
          const Array2<double> &k_e, const Array1<std::int64_t> &species, const LawSettings &with) :
      ShapeOf(diameters, rows_of(form), dimension, laws_of<Model>(k_e, species, with))
  {
    require(species.size() == n(), "species does not have the shape (N,).");
  }

  std::size_t n() const { return particles.size(); }
  int dimension() const { return space; }
  const std::vector<Shape> &shapes() const { return particles; }
  const Laws<Law> &laws() const { return contact_laws; }

  /// `visit(D)` for the dimension of the particles.
  template <class Visit> auto in_space(const Visit &visit) const
  {
    return in_dimension(space, visit);
  }

  template <int D, class S> PosedPairs<Model, D, S> posed(const PairArrays &arrays) const
  {
    arrays.check(n(), D);
    return {particles, arrays.poses(), arrays.list(), contact_laws};
  }

 private:
  int space;
  Laws<Law> contact_laws;
  std::vector<Shape> particles;

  /// Numbers of the forms, in rows.
  struct Rows {
    const double *data;
    std::size_t n, width;
    const char *expected;
  };
  static Rows rows_of(const Array2<double> &form)
  {
    return {form.data(), form.shape(0), form.shape(1),
            "diameters and form do not have shapes (N, 3) and (N, K)."};
  }
  static Rows rows_of(const Array1<double> &exponent)
  {
    return {exponent.data(), exponent.shape(0), *Model::FORM ? std::size_t{1} : std::size_t{0},
            "diameters and exponent do not have shapes (N, 3) and (N,)."};
  }

  ShapeOf(const Array2<double> &diameters, const Rows &form, int dimension, Laws<Law> laws) :
      space(dimension), contact_laws(std::move(laws))
  {
    require(dimension == 2 || dimension == 3,
            "dimension is " + std::to_string(dimension) + ", expected 2 or 3.");
    require(diameters.shape(1) == 3 && form.n == diameters.shape(0), form.expected);
    particles.reserve(diameters.shape(0));
    // Particles of several forms come in any order, and moments of balls take milliseconds.
    std::map<FormNumbers, std::optional<typename Model::Form>> forms;
    for (std::size_t i = 0; i < diameters.shape(0); ++i) {
      const double *const row = form.data + form.width * i;
      const auto [at, is_new] = forms.try_emplace(FormNumbers(row, row + form.width));
      auto &its = at->second;
      if (is_new) its = Model::Form::from(at->first, dimension);
      std::optional<Shape> shape;
      if (its) shape = Model::shape_from(0.5 * read_vec<3>(diameters.data() + 3 * i), *its);
      require(shape.has_value(), "particle " + std::to_string(i) +
                                     " is not a valid shape: " + Model::SHAPE_RULE + ".");
      particles.push_back(*shape);
    }
  }
};

/// Name of a shape's class: that of the shape, in the plural.
template <class Model> std::string class_name()
{
  std::string name = std::string(Model::NAME) + "s";
  name[0] = static_cast<char>(name[0] - 'a' + 'A');
  return name;
}

/// The class of a shape, once shapes.cpp has made it.
template <class Model> nb::class_<ShapeOf<Model>> class_of()
{
  return nb::borrow<nb::class_<ShapeOf<Model>>>(nb::type<ShapeOf<Model>>());
}

/// Binds `function(shape, arrays, more...)` as a method of a shape's class that takes poses and
/// pairs; `extra` holds the names of the additional arguments and the docstring.
template <class... More, class Model, class Function, class... Extra>
void def_over_pairs(nb::class_<ShapeOf<Model>> of, const char *name, const Function &function,
                    const Extra &...extra)
{
  using namespace nb::literals;
  of.def(
      name,
      [function](const ShapeOf<Model> &self, const Array3<double> &position,
                 const Array3<double> &orientation, const Array3<double> &cell,
                 const Array2<std::int64_t> &pairs, const Array2<std::int64_t> &shift,
                 More... more) {
        return function(self, PairArrays{{position, orientation, cell}, pairs, shift}, more...);
      },
      "position"_a, "orientation"_a, "cell"_a, "pairs"_a, "shift"_a, extra...);
}

/// Binds `function(D, S(), shape, arrays)` as such a method, evaluated in double or long double
/// precision S.
template <class Model, class Function>
void def_in_precision(nb::class_<ShapeOf<Model>> of, const char *name, const Function &function,
                      const char *text)
{
  using namespace nb::literals;
  def_over_pairs<bool>(
      of, name,
      [function](const ShapeOf<Model> &self, const PairArrays &arrays, bool extended) {
        return self.in_space([&](auto D) {
          return extended ? function(D, static_cast<long double>(0), self, arrays)
                          : function(D, 0.0, self, arrays);
        });
      },
      "extended"_a = false, text);
}

}  // namespace jamshape
