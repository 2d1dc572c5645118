#include "create_random.h"

#include "contact/math/dimension.hpp"
#include "contact/shapes.hpp"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "input.h"
#include "packing/numpy_random.hpp"
#include "packing/random_insertion.hpp"
#include "text.hpp"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

extern "C" int lammps_create_atoms(void *handle, int n, const int *id, const int *type,
                                   const double *x, const double *v, const int *image, int bexpand);

namespace jamshape {

namespace {

constexpr int MOST_PARTICLES = 10'000'000;
constexpr double TWO_PI = 6.283185307179586;

/// Random numbers of an insertion, drawn in the same order as by Python's `random_packing`.
template <int D> class Draw {
 public:
  explicit Draw(NumpyRandom &from) : random(from) {}

  void positions(std::size_t n, double *out)
  {
    std::generate_n(out, D * n, [&] { return random.uniform(); });
  }

  void orientations(std::size_t n, double *out)
  {
    if (D == 2) {
      std::generate_n(out, n, [&] { return TWO_PI * random.uniform(); });
      return;
    }
    for (std::size_t k = 0; k < n; ++k) in_unit_ball(out + 4 * k);
  }

 private:
  NumpyRandom &random;

  void in_unit_ball(double *q)
  {
    double size;
    do {
      std::generate_n(q, 4, [&] { return 2.0 * random.uniform() - 1.0; });
      size = std::inner_product(q, q + 4, q, 0.0);
    } while (size > 1.0 || size == 0.0);
  }
};

/// Number of particles of each kind: largest remainders are rounded up.
std::vector<int> numbers(int n, const std::vector<CreateRandom::Kind> &kinds)
{
  double all = 0.0;
  for (const auto &kind : kinds) all += kind.share;
  std::vector<int> whole(kinds.size()), order(kinds.size());
  std::vector<double> remainder(kinds.size());
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    const double exact = n * kinds[k].share / all;
    whole[k] = static_cast<int>(exact);
    remainder[k] = exact - whole[k];
  }
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return remainder[a] > remainder[b]; });
  const int left = n - std::accumulate(whole.begin(), whole.end(), 0);
  for (int k = 0; k < left; ++k) ++whole[order[k]];
  return whole;
}

std::string exact(double number)
{
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", number);
  return text;
}

}  // namespace

void CreateRandom::command(int narg, char **arg)
{
  words = "create_random " + joined(narg, arg);
  require(!domain->box_exist, "no box before: leave out read_data and create_box");
  view.find_ellipsoids("create_random");
  require(domain->xperiodic && domain->yperiodic && domain->zperiodic, "'boundary p p p'");
  read(narg, arg);
  bool is_known = false;
  std::string names;
  Shapes::each([&](auto model) {
    using Model = decltype(model);
    names += std::string(names.empty() ? "" : ", ") + Model::NAME;
    if (is_known || std::string(arg[0]) != Model::NAME) return;
    is_known = true;
    in_dimension(domain->dimension, [&](auto D) { create(start<Model, D>()); });
  });
  require(is_known, "one of the shapes " + names);
}

void CreateRandom::require(bool holds, const std::string &expected)
{
  if (!holds) error->all(FLERR, "Found '" + words + "', expected " + expected + ".");
}

double CreateRandom::number(const char *word, const char *name)
{
  require(LAMMPS_NS::utils::is_double(word), std::string("a number for ") + name);
  return LAMMPS_NS::utils::numeric(FLERR, word, true, lmp);
}

void CreateRandom::read(int narg, char **arg)
{
  require(narg >= 4, "'create_random SHAPE N PHI SEED type SHARE DX DY DZ ...'");
  const double count = number(arg[1], "N"), drawn = number(arg[3], "SEED");
  require(count >= 1 && count <= MOST_PARTICLES && count == std::floor(count),
          "N from 1 to " + std::to_string(MOST_PARTICLES));
  require(drawn >= 0 && drawn < 0x1p53 && drawn == std::floor(drawn), "a whole SEED from 0 on");
  n = static_cast<int>(count);
  seed = static_cast<std::uint64_t>(drawn);
  phi = number(arg[2], "PHI");
  require(phi > 0.0 && phi < 1.0, "a packing fraction PHI between 0 and 1");
  kinds.clear();
  for (int k = 4; k < narg;) {
    const std::string word = arg[k];
    if (word == "type" && k + 4 < narg) {
      const auto of = [&](int m, const char *name) { return number(arg[k + m], name); };
      kinds.push_back({of(1, "SHARE"), {{of(2, "DX"), of(3, "DY"), of(4, "DZ")}}});
      require(kinds.back().share > 0.0 && std::isfinite(kinds.back().share), "a positive SHARE");
      k += 5;
    } else if ((word == "form" || word == "exponent") && k + 1 < narg && !kinds.empty()) {
      for (++k; k < narg && std::string(arg[k]) != "type"; ++k) {
        kinds.back().form.push_back(number(arg[k], word.c_str()));
      }
    } else {
      require(false, "'type SHARE DX DY DZ' or 'form NUMBER ...' after it, not '" + word + "'");
    }
  }
  require(!kinds.empty(), "at least one 'type SHARE DX DY DZ' at the end");
}

template <class Model, int D> std::vector<typename Model::Shape> CreateRandom::shapes_of_kinds()
{
  std::vector<typename Model::Shape> shapes;
  for (const Kind &kind : kinds) {
    const auto form = Model::Form::from(kind.form, D);
    require(form.has_value(), std::string("'form' with ") + Model::FORM_RULE);
    const auto shape = Model::shape_from(0.5 * kind.diameters, *form);
    require(shape.has_value(), std::string("diameters of its shape (") + Model::SHAPE_RULE + ")");
    shapes.push_back(*shape);
  }
  return shapes;
}

/// In the same order as Python's `random_packing`, so that both give the same state in 2D.
template <class Model, int D> CreateRandom::Start CreateRandom::start()
{
  const std::vector<typename Model::Shape> of_kind = shapes_of_kinds<Model, D>();
  const std::vector<int> count = numbers(n, kinds);
  std::vector<std::size_t> longest(kinds.size());
  std::iota(longest.begin(), longest.end(), std::size_t{0});
  std::stable_sort(longest.begin(), longest.end(), [&](std::size_t a, std::size_t b) {
    return Model::template outer_radius<D>(of_kind[a]) >
           Model::template outer_radius<D>(of_kind[b]);
  });
  std::vector<typename Model::Shape> shapes;
  std::vector<double> measures;
  std::vector<int> types;
  for (const std::size_t kind : longest) {
    shapes.insert(shapes.end(), count[kind], of_kind[kind]);
    measures.insert(measures.end(), count[kind], Model::template drag<D>(of_kind[kind]).measure);
    types.insert(types.end(), count[kind], static_cast<int>(kind) + 1);
  }
  Start start;
  start.edge = std::pow(numpy_sum(measures.data(), measures.size()) / phi, 1.0 / D);
  Vec<D> edges;
  for (int k = 0; k < D; ++k) edges[k] = start.edge;
  NumpyRandom random(seed);
  Draw<D> draw(random);
  RandomInsertion<Model, D> insertion(shapes, edges);
  const Inserted outcome = insertion.run(draw);
  require(outcome != Inserted::TOO_SHORT,
          "a box longer than the longest particle: a smaller PHI, or more particles");
  double placed = 0.0;
  if (outcome == Inserted::STALLED) {
    std::vector<char> waits(shapes.size(), 0);
    for (const std::size_t i : insertion.without_place()) waits[i] = 1;
    for (std::size_t i = 0; i < shapes.size(); ++i) placed += waits[i] ? 0.0 : measures[i];
  }
  require(outcome == Inserted::ALL, "a PHI with room for random insertion, which stalled at " +
                                        shown(placed / std::pow(start.edge, D)));
  for (const std::size_t i : random.permutation(shapes.size())) {
    start.type.push_back(types[i]);
    for (int k = 0; k < 3; ++k) {
      const double x = k < D ? insertion.position(i)[k] : 0.0;
      start.position.push_back(x < start.edge ? x : 0.0);
    }
    const Quaternion q = normalized(orientation_from<D>(insertion.orientation_of(i)));
    start.orientation.insert(start.orientation.end(), {q.w, q.i, q.j, q.k});
  }
  return start;
}

void CreateRandom::create(const Start &start)
{
  const std::string side = " 0 " + exact(start.edge);
  input->one("region create_random block" + side + side +
             (domain->dimension == 2 ? " -0.5 0.5" : side) + " units box");
  input->one("create_box " + std::to_string(kinds.size()) + " create_random");
  std::vector<int> id(n);
  std::iota(id.begin(), id.end(), 1);
  lammps_create_atoms(lmp, n, id.data(), start.type.data(), start.position.data(), nullptr, nullptr,
                      0);
  for (int i = 0; i < atom->nlocal; ++i) {
    view.set_diameters(i, kinds[atom->type[i] - 1].diameters);
  }
  view.find_ellipsoids("create_random");  // now with atoms, whose layout it checks
  atom->nellipsoids = n;
  view.set_orientations(0, atom->nlocal, [&](int i) {
    const double *const q = &start.orientation[4 * (atom->tag[i] - 1)];
    return Quaternion{q[0], q[1], q[2], q[3]};
  });
  if (comm->me == 0)
    LAMMPS_NS::utils::logmesg(lmp, "Created " + std::to_string(n) +
                                       " particles at random, phi = " + shown(phi) + "\n");
}

}  // namespace jamshape
