#include "contact/shapes.hpp"

#include "bindings/shape.hpp"
#include "packing/random_insertion.hpp"

#include <algorithm>
#include <cstdint>

namespace jamshape {

namespace {

/// Random numbers drawn by Python functions, so that one NumPy seed determines the whole start.
class DrawnInPython {
 public:
  DrawnInPython(const nb::callable &positions_in_box, const nb::callable &directions) :
      of_positions(positions_in_box), of_orientations(directions)
  {
  }
  void positions(std::size_t n, double *out) const { draw(of_positions, n, out); }
  void orientations(std::size_t n, double *out) const { draw(of_orientations, n, out); }

 private:
  const nb::callable &of_positions, &of_orientations;

  static void draw(const nb::callable &numbers, std::size_t n, double *out)
  {
    const auto drawn = nb::cast<Array2<double>>(numbers(n));
    require(drawn.shape(0) == n, "random numbers do not have the shape (n, D) or (n, 1 or 4).");
    std::copy_n(drawn.data(), drawn.size(), out);
  }
};

const char *name_of(Inserted outcome)
{
  switch (outcome) {
    case Inserted::ALL:
      return "all";
    case Inserted::TOO_SHORT:
      return "too short";
    default:
      return "stalled";
  }
}

template <class Model, int D>
nb::dict inserted(const ShapeOf<Model> &of, const Vec<D> &edges, const DrawnInPython &draw)
{
  using Insertion = RandomInsertion<Model, D>;
  Insertion insertion(of.shapes(), edges);
  const Inserted outcome = insertion.run(draw);
  NewArray<double> position({of.n(), D}),
      orientation({of.n(), static_cast<std::size_t>(Insertion::PER_ORIENTATION)});
  for (std::size_t i = 0; i < of.n(); ++i) {
    write_vec(insertion.position(i), position.row(i));
    std::copy_n(insertion.orientation_of(i), Insertion::PER_ORIENTATION, orientation.row(i));
  }
  const std::vector<std::size_t> without_place = insertion.without_place();
  NewArray<std::int64_t> waiting({without_place.size()});
  for (std::size_t k = 0; k < without_place.size(); ++k)
    waiting[k] = static_cast<std::int64_t>(without_place[k]);
  nb::dict result;
  result["outcome"] = name_of(outcome);
  result["position"] = position.release();
  result["orientation"] = orientation.release();
  result["waiting"] = waiting.release();
  result["attempts"] = insertion.n_attempts();
  return result;
}

}  // namespace

void export_starts()
{
  using namespace nb::literals;
  Shapes::each([](auto model) {
    using Model = decltype(model);
    class_of<Model>().def(
        "insert",
        [](const ShapeOf<Model> &of, const Array1<double> &edges, const nb::callable &positions,
           const nb::callable &orientations) {
          return of.in_space([&](auto D) {
            require(of.n() > 0 && edges.shape(0) == D,
                    "edges do not have the shape (D,), or there are no particles.");
            require_edges(edges.data(), D);
            return inserted<Model, D>(of, read_vec<D>(edges.data()), {positions, orientations});
          });
        },
        "edges"_a, "positions"_a, "orientations"_a,
        "Random insertion of the particles, the longest first, into a periodic box: "
        "`positions(n)`\n"
        "draws (n, D) numbers in [0, 1), `orientations(n)` (n, 1) angles or (n, 4) quaternions.\n"
        "Returns a dict: outcome (all, stalled, too short), position, orientation, waiting (those\n"
        "without a place) and attempts.");
  });
}

}  // namespace jamshape
