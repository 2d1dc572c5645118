#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include "packing/image_cells.hpp"
#include "packing/orientation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

namespace jamshape {

/// Outcome of an insertion.
enum class Inserted {
  ALL,
  TOO_SHORT,  // the longest particle meets its own periodic images in every direction tried
  STALLED     // no room found after many attempts
};

/// Random sequential insertion of hard particles in a periodic box, the longest first, since early
/// on there is room for them and short ones fit into gaps. An orientation is drawn before a place
/// is searched for, and redrawn only if none is found: drawing both together would favour particles
/// aligned with those around them.
///
/// `Model` as for pair styles, with `are_overlapping` for its bodies. `Draw` gives random numbers:
/// `positions(n, out)`, n D numbers uniform in [0, 1), and `orientations(n, out)`, n angles in 2D
/// or n quaternions in 3D. The order of the draws is part of the definition of a seed.
template <class Model, int D> class RandomInsertion {
 public:
  using Shape = typename Model::Shape;
  static constexpr int PER_ORIENTATION = D == 2 ? 1 : 4;

  RandomInsertion(const std::vector<Shape> &longest_first, const Vec<D> &box_edges) :
      shapes(longest_first), edges(box_edges), n(shapes.size()),
      reach(2.0 * Model::template outer_radius<D>(shapes.front())), placed(edges, reach, n),
      orientation(PER_ORIENTATION * n), waiting(n)
  {
    for (const Shape &shape : shapes) {
      bodies.push_back(Model::template body<D>(shape));
      radius.push_back(Model::template outer_radius<D>(shape));
    }
    std::iota(waiting.begin(), waiting.end(), std::size_t{0});
  }

  template <class Draw> Inserted run(Draw &draw)
  {
    const std::size_t most_attempts = ATTEMPTS + ATTEMPTS_PER_PARTICLE * n;
    double pairs_per_trial = static_cast<double>(n);
    for (int k = 0; k < D; ++k) pairs_per_trial *= 2.0 * reach / edges[k];
    if (pairs_per_trial > MOST_PAIRS) return Inserted::TOO_SHORT;
    const auto most_trials =
        std::min(static_cast<std::size_t>(MOST_PAIRS / pairs_per_trial), MOST_TRIALS);
    if (!turn(draw, without_place())) return Inserted::TOO_SHORT;
    const std::size_t competing = std::max<std::size_t>(1, n / COMPETING);
    std::size_t n_trials = std::min(competing, most_trials);
    while (n_done < n) {
      if (attempts >= most_attempts) return n_done == 0 ? Inserted::TOO_SHORT : Inserted::STALLED;
      attempts += n_trials;
      const std::size_t n_placed = place(draw, std::min(competing, n - n_done), n_trials);
      // No room at the present orientations.
      if (n_placed == 0 && n_trials == most_trials && !turn(draw, without_place()))
        return Inserted::TOO_SHORT;
      if (2 * n_placed < std::min(competing, n_trials))
        n_trials = std::min(2 * n_trials, most_trials);
    }
    return Inserted::ALL;
  }

  std::size_t n_attempts() const { return attempts; }
  /// Particles without a place, ascending.
  std::vector<std::size_t> without_place() const
  {
    return {waiting.begin() + n_done, waiting.end()};
  }
  const Vec<D> &position(std::size_t i) const { return bodies[i].centre; }
  const double *orientation_of(std::size_t i) const { return &orientation[PER_ORIENTATION * i]; }

 private:
  using Body = typename Model::template Body<D>;

  /// Trial placements before insertion counts as stalled: half a second for 1000 particles.
  static constexpr std::size_t ATTEMPTS = 1'000'000, ATTEMPTS_PER_PARTICLE = 2000;
  /// Most trials tested in one batch, and most products of those and the particles near one.
  static constexpr std::size_t MOST_TRIALS = 4096;
  static constexpr double MOST_PAIRS = 524288.0;
  /// One in this many particles competes for places in one batch: few, so that the longest stay
  /// ahead.
  static constexpr std::size_t COMPETING = 16;
  /// Trials for which memory is prefetched.
  static constexpr std::size_t AHEAD = 8;
  /// Orientations tried for a particle in a box shorter than it.
  static constexpr int DIRECTIONS = 4096;

  const std::vector<Shape> &shapes;
  Vec<D> edges;
  std::size_t n, attempts = 0, n_done = 0;
  double reach;
  ImageCells<D, Body> placed;
  std::vector<double> orientation;
  std::vector<std::size_t> waiting;  // from n_done on, ascending
  std::vector<Body> bodies;          // at their orientations; centres of those placed
  std::vector<double> radius;

  /// Draws orientations of these particles that avoid their own images; false if there are none.
  template <class Draw> bool turn(Draw &draw, std::vector<std::size_t> which)
  {
    std::vector<double> drawn, ignored;
    for (int attempt = 0; attempt < DIRECTIONS && !which.empty(); ++attempt) {
      drawn.resize(PER_ORIENTATION * which.size());
      draw.orientations(which.size(), drawn.data());
      ignored.resize(D * which.size());
      draw.positions(which.size(), ignored.data());  // part of the definition of a seed
      for (std::size_t k = 0; k < which.size(); ++k) {
        const double *const from = &drawn[PER_ORIENTATION * k];
        std::copy_n(from, PER_ORIENTATION, &orientation[PER_ORIENTATION * which[k]]);
        if (Model::template turns<D>(shapes[which[k]]))
          Model::template turn_to<D>(bodies[which[k]], orientation_from<D>(from));
      }
      which.erase(std::remove_if(which.begin(), which.end(),
                                 [&](std::size_t i) { return !meets_own_images(i); }),
                  which.end());
    }
    return which.empty();
  }

  bool meets_own_images(std::size_t i) const
  {
    return placed.any_shift(2.0 * radius[i],
                            [&](const Vec<D> &apart) { return overlap(i, bodies[i], apart); });
  }

  /// Tries random places for the first of the waiting particles, each as often as `n_trials` in all
  /// allow; returns how many have found one.
  template <class Draw> std::size_t place(Draw &draw, std::size_t competing, std::size_t n_trials)
  {
    std::vector<double> at(D * n_trials);
    draw.positions(n_trials, at.data());
    std::vector<char> found(competing, 0);
    const auto trial = [&](std::size_t t) {
      Vec<D> x;
      for (int k = 0; k < D; ++k) x[k] = edges[k] * at[D * t + k];
      return x;
    };
    for (std::size_t begin = 0; begin < n_trials; begin += AHEAD) {
      const std::size_t end = std::min(begin + AHEAD, n_trials);
      for (std::size_t t = end; t < std::min(end + AHEAD, n_trials); ++t)
        placed.fetch_here(trial(t));
      std::array<std::size_t, AHEAD> left;  // those that the cells around must decide
      std::size_t n_left = 0;
      for (std::size_t t = begin; t < end; ++t) {
        const Vec<D> x = trial(t);
        const std::size_t i = waiting[n_done + t % competing];
        if (found[t % competing] || placed.any_here(x, radius[i], 0, with(i))) continue;
        placed.fetch_around(x);
        left[n_left++] = t;
      }
      for (std::size_t k = 0; k < n_left; ++k) {
        const std::size_t rank = left[k] % competing, i = waiting[n_done + rank];
        const Vec<D> x = trial(left[k]);
        if (found[rank] || placed.any_around(x, radius[i], 0, with(i))) continue;
        bodies[i].centre = x;
        found[rank] = 1;
      }
    }
    return keep(found);
  }

  /// Keeps the places found in one batch except those that overlap an earlier one of it.
  std::size_t keep(std::vector<char> &found)
  {
    const std::size_t first_new = placed.size();
    for (std::size_t rank = 0; rank < found.size(); ++rank) {
      const std::size_t i = waiting[n_done + rank];
      found[rank] = found[rank] && !placed.any_here(position(i), radius[i], first_new, with(i)) &&
                    !placed.any_around(position(i), radius[i], first_new, with(i));
      if (found[rank]) placed.add(bodies[i], radius[i]);
    }
    std::size_t to = n_done + found.size();  // the others of the batch move up to the waiting ones
    for (std::size_t rank = found.size(); rank-- > 0;) {
      if (!found[rank]) waiting[--to] = waiting[n_done + rank];
    }
    n_done = to;
    return placed.size() - first_new;
  }

  /// Test of particle i with others.
  auto with(std::size_t i) const
  {
    return [this, i](const Body &other, const Vec<D> &apart) { return overlap(i, other, apart); };
  }

  /// Not inlined into each of the loops that call it.
  [[gnu::noinline]] bool overlap(std::size_t i, const Body &other, const Vec<D> &apart) const
  {
    Body first = bodies[i], second = other;
    first.centre = apart;
    second.centre = Vec<D>{};
    return are_overlapping(first, second);
  }
};

}  // namespace jamshape
