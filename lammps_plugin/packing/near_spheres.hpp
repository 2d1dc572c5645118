#pragma once

#include "contact/math/vec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

namespace jamshape {

/// Pairs of particles: (M, 2) indices, the first not above the second, and (M, D) cell vectors by
/// which the second one is shifted. In ascending order of all these numbers; of two opposite images
/// of a particle itself one.
struct ListedPairs {
  std::vector<std::int64_t> particles, shift;

  std::size_t size() const { return particles.size() / 2; }
};

/// Search for spheres (discs) that overlap in a periodic box, with all periodic images: the box may
/// be tilted, and shorter than they are. They are sorted into cells along the cell vectors.
template <int D> class NearSpheres {
 public:
  /// Centres (N, D), radii (N,), and cell vectors (D, D) as columns, upper triangular.
  NearSpheres(const double *centre, const std::vector<double> &radius, const double *cell_vectors) :
      cell(cell_vectors), spheres(radius.size()), places(radius.size())
  {
    for (const double r : radius) largest = std::max(largest, WIDER * r);
    for (int k = 0; k < D; ++k) invert(k);
    const double most = 1.0 + 2.0 * std::pow(static_cast<double>(radius.size()), 1.0 / D);
    std::size_t n_cells = 1;
    for (int k = 0; k < D; ++k) {
      count[k] = static_cast<long>(std::clamp(1.0 / (2.0 * largest * width[k]), 1.0, most));
      n_cells *= static_cast<std::size_t>(count[k]);
    }
    require_an_end();
    for (std::size_t i = 0; i < spheres.size(); ++i) wrap(centre + D * i, WIDER * radius[i], i);
    sort(n_cells);
  }

  ListedPairs find() const
  {
    ListedPairs found;
    std::vector<Neighbour> near;
    for (const Sphere &sphere : spheres) {
      near.clear();
      Vec<D> image;
      visit_cells(sphere, 0, 0, image, near);
      std::sort(near.begin(), near.end());
      for (const Neighbour &other : near) {
        found.particles.push_back(sphere.number);
        found.particles.push_back(other.first);
        found.shift.insert(found.shift.end(), other.second.begin(), other.second.end());
      }
    }
    return found;
  }

 private:
  /// Spheres are larger by this factor, so that rounding never hides an overlap.
  static constexpr double WIDER = 1.0 + 1e-9;
  /// Rounding of a component in units of the box, within it.
  static constexpr double ROUNDING = 1e-12;
  /// More cells around one sphere would take hours.
  static constexpr double MOST_CELLS = 1e7;
  /// A centre farther from the box, in its vectors, has no digits left within it.
  static constexpr double FARTHEST = 1e15;

  struct Sphere {
    Vec<D> centre;  // in the box
    double radius;
    std::int64_t number;
  };
  struct Place {
    Vec<D> fraction;
    std::array<std::int64_t, D> turns;  // cell vectors subtracted
  };
  using Neighbour = std::pair<std::int64_t, std::array<std::int64_t, D>>;  // and its shift

  const double *cell;
  std::vector<Sphere> spheres;
  std::vector<Place> places;
  std::array<std::array<double, D>, D> inverse{};  // of the cell vectors
  Vec<D> width;                                    // over a length, in units of each vector
  std::array<long, D> count;
  std::vector<std::size_t> first;  // of each cell, in `sorted`
  std::vector<Sphere> sorted;      // by cells, in each by number
  double largest = 0.0;

  /// Finds a row of the inverse, upper triangular like the matrix.
  void invert(int row)
  {
    double sum = 0.0;
    for (int column = row; column < D; ++column) {
      double left = column == row ? 1.0 : 0.0;
      for (int m = row; m < column; ++m) left -= inverse[row][m] * cell[D * m + column];
      inverse[row][column] = left / cell[(D + 1) * column];
      sum += inverse[row][column] * inverse[row][column];
    }
    width[row] = std::sqrt(sum);
  }

  void require_an_end() const
  {
    double around = 1.0;
    for (int k = 0; k < D; ++k) around *= 1.0 + 4.0 * largest * width[k] * double(count[k]);
    if (around < MOST_CELLS) return;
    throw std::invalid_argument("the box is far shorter than its particles, which have more than a "
                                "million neighbours each; expected a larger box.");
  }

  void wrap(const double *centre, double radius, std::size_t i)
  {
    Sphere &sphere = spheres[i];
    Place &place = places[i];
    sphere.radius = radius;
    sphere.number = static_cast<std::int64_t>(i);
    for (int k = 0; k < D; ++k) {
      double at = 0.0;
      for (int m = k; m < D; ++m) at += inverse[k][m] * centre[m];
      const double turns = std::floor(at);
      if (!(std::abs(turns) < FARTHEST)) {
        throw std::invalid_argument("a particle is more than 1e15 cell vectors away from the box, "
                                    "expected positions near it.");
      }
      place.turns[k] = static_cast<std::int64_t>(turns);
      place.fraction[k] = at - turns;
    }
    for (int k = 0; k < D; ++k) {
      sphere.centre[k] = centre[k];
      for (int m = k; m < D; ++m) {
        sphere.centre[k] -= cell[D * k + m] * static_cast<double>(place.turns[m]);
      }
    }
  }

  /// Counting sort, which keeps the order of numbers.
  void sort(std::size_t n_cells)
  {
    first.assign(n_cells + 1, 0);
    std::vector<std::size_t> own;
    own.reserve(spheres.size());
    for (const Place &place : places) {
      std::size_t at = 0;
      for (int k = 0; k < D; ++k) {
        const long along = static_cast<long>(place.fraction[k] * static_cast<double>(count[k]));
        at = at * count[k] + std::min(along, count[k] - 1);
      }
      own.push_back(at);
      ++first[at + 1];
    }
    for (std::size_t c = 0; c < n_cells; ++c) first[c + 1] += first[c];
    sorted.resize(spheres.size());
    std::vector<std::size_t> next(first.begin(), first.end() - 1);
    for (std::size_t i = 0; i < spheres.size(); ++i) sorted[next[own[i]]++] = spheres[i];
  }

  /// Visits the images of cells that a sphere may reach, along one cell vector after another.
  void visit_cells(const Sphere &sphere, int k, std::size_t own, Vec<D> &image,
                   std::vector<Neighbour> &near) const
  {
    if (k == D) return visit(sphere, own, image, near);
    const double reach = (sphere.radius + largest) * width[k] + ROUNDING;
    const double per_cell = static_cast<double>(count[k]), at = places[sphere.number].fraction[k];
    const long from = static_cast<long>(std::floor((at - reach) * per_cell));
    const long to = static_cast<long>(std::floor((at + reach) * per_cell));
    for (long c = from; c <= to; ++c) {
      const long turns = c >= 0 ? c / count[k] : -((count[k] - 1 - c) / count[k]);
      image[k] = static_cast<double>(turns);
      visit_cells(sphere, k + 1, own * count[k] + static_cast<std::size_t>(c - turns * count[k]),
                  image, near);
    }
  }

  /// Tests a sphere against those in the image of a cell.
  void visit(const Sphere &sphere, std::size_t own, const Vec<D> &image,
             std::vector<Neighbour> &near) const
  {
    Vec<D> from = sphere.centre;
    for (int k = 0; k < D; ++k) {
      for (int m = k; m < D; ++m) from[k] -= cell[D * k + m] * image[m];
    }
    for (std::size_t at = first[own + 1]; at-- > first[own];) {
      const Sphere &other = sorted[at];
      if (other.number < sphere.number) return;
      const double reach = sphere.radius + other.radius;
      if (!(norm_sq(from - other.centre) < reach * reach)) continue;
      Neighbour found{other.number, {}};
      for (int k = 0; k < D; ++k) {
        found.second[k] = static_cast<std::int64_t>(image[k]) + places[sphere.number].turns[k] -
                          places[other.number].turns[k];
      }
      if (other.number > sphere.number || is_leading(found.second)) near.push_back(found);
    }
  }

  /// Whether a shift is the chosen one of two opposite ones.
  static bool is_leading(const std::array<std::int64_t, D> &shift)
  {
    for (const std::int64_t turns : shift) {
      if (turns != 0) return turns > 0;
    }
    return false;
  }
};

}  // namespace jamshape
