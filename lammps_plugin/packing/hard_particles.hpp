#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

namespace jamshape {

/// Largest moves of a Monte Carlo simulation: each coordinate, and the angle.
struct Moves {
  double shift, turn;
};

/// Counts of the moves of a sweep.
struct Tally {
  std::size_t tried = 0, accepted = 0;

  Tally &operator+=(const Tally &other)
  {
    tried += other.tried;
    accepted += other.accepted;
    return *this;
  }
};

/// Monte Carlo of hard particles in a periodic box that is at least twice as wide as they are:
/// every move without overlaps is accepted. `Model` as for pair styles, with `are_overlapping` for
/// its bodies.
template <class Model, int D> class HardParticles {
 public:
  using Body = typename Model::template Body<D>;
  using Shape = typename Model::Shape;

  HardParticles(const std::vector<Shape> &shapes, const std::vector<Vec<D>> &centres,
                std::vector<Quaternion> at, const Vec<D> &box_edges, std::uint64_t seed) :
      orientation(std::move(at)), edges(box_edges), random(seed)
  {
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      bodies.push_back(Model::template body<D>(shapes[i]));
      bodies[i].centre = centres[i];
      Model::template turn_to<D>(bodies[i], orientation[i]);
      radius.push_back(Model::template outer_radius<D>(shapes[i]));
      reach = std::max(reach, 2.0 * radius[i]);
    }
    std::size_t n_cells = 1;
    const double most = 1.0 + 2.0 * std::pow(bodies.size(), 1.0 / D);  // few cells are empty
    for (int k = 0; k < D; ++k) {
      count[k] = static_cast<std::size_t>(std::clamp(edges[k] / reach, 1.0, most));
      n_cells *= count[k];
    }
    members.resize(n_cells);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      wrap(bodies[i].centre);
      members[cell_at(bodies[i].centre)].push_back(i);
    }
  }

  bool has_room() const
  {
    for (int k = 0; k < D; ++k) {
      if (edges[k] < 2.0 * reach) return false;
    }
    return true;
  }

  /// Whether any two particles overlap.
  bool any_overlap() const
  {
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (overlaps(i, bodies[i])) return true;
    }
    return false;
  }

  /// Makes as many moves as there are particles, each of a particle chosen at random.
  Tally sweep(const Moves &moves)
  {
    Tally tally;
    std::uniform_int_distribution<std::size_t> any(0, bodies.size() - 1);
    for (std::size_t n = 0; n < bodies.size(); ++n) {
      ++tally.tried;
      tally.accepted += move(any(random), moves);
    }
    return tally;
  }

  const Body &body(std::size_t i) const { return bodies[i]; }
  const Quaternion &pose(std::size_t i) const { return orientation[i]; }

 private:
  std::vector<Body> bodies;
  std::vector<double> radius;  // of the bounding spheres
  std::vector<Quaternion> orientation;
  Vec<D> edges;
  std::mt19937_64 random;
  double reach = 0.0;
  std::array<std::size_t, D> count;
  std::vector<std::vector<std::size_t>> members;

  /// Uniform in [-1, 1).
  double around_zero() { return 2.0 * std::generate_canonical<double, 53>(random) - 1.0; }

  bool move(std::size_t i, const Moves &moves)
  {
    Body trial = bodies[i];
    for (int k = 0; k < D; ++k) trial.centre[k] += moves.shift * around_zero();
    wrap(trial.centre);
    // A rotation vector uniform in a ball, so that a move and its reverse are equally likely.
    Torque<D> turn;
    do {
      for (int k = 0; k < ROTATIONS<D>; ++k) turn[k] = around_zero();
    } while (norm_sq(turn) > 1.0);
    const Quaternion q = turned(orientation[i], moves.turn * turn);
    Model::template turn_to<D>(trial, q);
    if (overlaps(i, trial)) return false;
    change_cell(i, cell_at(bodies[i].centre), cell_at(trial.centre));
    bodies[i] = trial;
    orientation[i] = q;
    return true;
  }

  void change_cell(std::size_t i, std::size_t from, std::size_t to)
  {
    if (from == to) return;
    std::vector<std::size_t> &old = members[from];
    *std::find(old.begin(), old.end(), i) = old.back();
    old.pop_back();
    members[to].push_back(i);
  }

  /// Whether `trial`, a new pose of particle i, overlaps any other particle.
  bool overlaps(std::size_t i, const Body &trial) const
  {
    const std::array<std::size_t, D> centre = cell_of(trial.centre);
    std::array<std::size_t, D> cell;
    return overlaps_in(0, cell, centre, i, trial);
  }

  /// The cells around `centre`, each once, one dimension after another.
  bool overlaps_in(int k, std::array<std::size_t, D> &cell,
                   const std::array<std::size_t, D> &centre, std::size_t i, const Body &trial) const
  {
    if (k == D) return overlaps_members(members[flat(cell)], i, trial);
    const std::size_t n = std::min<std::size_t>(3, count[k]);
    for (std::size_t step = 0; step < n; ++step) {
      cell[k] = (centre[k] + count[k] + step - (n == 3 ? 1 : 0)) % count[k];
      if (overlaps_in(k + 1, cell, centre, i, trial)) return true;
    }
    return false;
  }

  bool overlaps_members(const std::vector<std::size_t> &others, std::size_t i,
                        const Body &trial) const
  {
    for (const std::size_t j : others) {
      if (j == i) continue;
      Vec<D> r = trial.centre - bodies[j].centre;
      for (int k = 0; k < D; ++k) r[k] -= edges[k] * std::nearbyint(r[k] / edges[k]);
      const double bounding = radius[i] + radius[j];
      if (norm_sq(r) >= bounding * bounding) continue;
      Body near = bodies[j];
      near.centre = trial.centre - r;
      if (are_overlapping(trial, near)) return true;
    }
    return false;
  }

  void wrap(Vec<D> &x) const
  {
    for (int k = 0; k < D; ++k) x[k] -= edges[k] * std::floor(x[k] / edges[k]);
  }

  std::array<std::size_t, D> cell_of(const Vec<D> &x) const
  {
    std::array<std::size_t, D> cell;
    for (int k = 0; k < D; ++k) {
      const double along = static_cast<double>(count[k]) * (x[k] / edges[k]);
      cell[k] = static_cast<std::size_t>(std::clamp(along, 0.0, count[k] - 1.0));
    }
    return cell;
  }

  std::size_t flat(const std::array<std::size_t, D> &cell) const
  {
    std::size_t index = 0;
    for (int k = 0; k < D; ++k) index = index * count[k] + cell[k];
    return index;
  }

  std::size_t cell_at(const Vec<D> &x) const { return flat(cell_of(x)); }
};

}  // namespace jamshape
