#pragma once

#include "contact/math/vec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace jamshape {

/// Bodies in a periodic box, sorted into cells, with all their images: the box may be shorter than
/// the search distance.
template <int D, class Body> class ImageCells {
 public:
  /// Cells for neighbours closer than `distance` among about n bodies.
  ImageCells(const Vec<D> &box_edges, double distance, std::size_t n) :
      edges(box_edges), per_distance(1.0 / distance)
  {
    const double most = 1.0 + 2.0 * std::pow(static_cast<double>(n), 1.0 / D);  // few are empty
    std::size_t n_cells = 1;
    for (int k = 0; k < D; ++k) {
      count[k] = static_cast<long>(std::clamp(edges[k] / distance, 1.0, most));
      around[k] = static_cast<long>(std::ceil(distance * count[k] / edges[k]));
      n_cells *= static_cast<std::size_t>(count[k]);
      rounding = std::max(rounding, static_cast<float>(1e-6 * (1.0 + edges[k] / distance)));
    }
    parts.resize(n_cells);
  }

  std::size_t size() const { return n_bodies; }

  void add(const Body &body, double radius)
  {
    std::size_t at = cell_of(body.centre);
    while (parts[at].n == PER_PART) {
      if (parts[at].more == NONE) {
        parts[at].more = static_cast<std::uint32_t>(parts.size());
        parts.push_back({});
      }
      at = parts[at].more;
    }
    Part &part = parts[at];
    for (int k = 0; k < D; ++k) part.x[k][part.n] = scaled(body.centre[k]);
    part.radius[part.n] = scaled(radius);
    part.members[part.n++] = {body, radius, n_bodies++};
  }

  /// Whether `test(body, x - y)` holds for any image, with centre y, of a body whose bounding
  /// sphere meets one of this radius about x, of the bodies added after the first `but`: of those
  /// in the cell of x, where most hits are, and of those in the cells around it.
  template <class Test>
  bool any_here(const Vec<D> &x, double radius, std::size_t but, const Test &test) const
  {
    return any_of_cell(cell_of(x), Vec<D>{}, {x, radius, but}, test);
  }
  template <class Test>
  bool any_around(const Vec<D> &x, double radius, std::size_t but, const Test &test) const
  {
    const Sphere about{x, radius, but};
    return any_in(0, 0, Vec<D>{}, false, x, [&](std::size_t cell, const Vec<D> &image) {
      return any_of_cell(cell, image, about, test);
    });
  }

  /// Prefetches the memory that `any_here` and `any_around` read first.
  void fetch_here(const Vec<D> &x) const { __builtin_prefetch(&parts[cell_of(x)]); }
  void fetch_around(const Vec<D> &x) const
  {
    any_in(0, 0, Vec<D>{}, false, x, [&](std::size_t cell, const Vec<D> &) {
      __builtin_prefetch(&parts[cell]);
      return false;
    });
  }

  /// Whether `test(shift)` holds for any sum of edges shorter than a length, each pair of opposite
  /// sums once.
  template <class Test> bool any_shift(double length, const Test &test) const
  {
    return any_shift_from(0, false, length, Vec<D>{}, test);
  }

 private:
  static constexpr std::size_t PER_PART = D == 2 ? 4 : 3, LINE = 64;  // bytes of a cache line
  static constexpr auto NONE = static_cast<std::uint32_t>(-1);
  struct Member {
    Body body;
    double radius;
    std::size_t number;  // in the order in which they were added
  };
  struct Sphere {
    const Vec<D> &x;
    double radius;
    std::size_t but;
  };
  /// Bodies of a cell, contiguous in memory: fetching them dominates the time in a large box. The
  /// rounded bounding spheres in the first cache line exclude most bodies.
  struct alignas(LINE) Part {
    std::uint32_t n = 0, more = NONE;
    std::array<std::array<float, PER_PART>, D> x;  // in search distances, as `radius`
    std::array<float, PER_PART> radius;
    std::array<Member, PER_PART> members;
  };

  Vec<D> edges;
  double per_distance;
  float rounding = 0.0F;  // bound on the rounding error of a scaled distance
  std::array<long, D> count, around;
  std::vector<Part> parts;  // the first of each cell, then those of full cells
  std::size_t n_bodies = 0;

  float scaled(double length) const { return static_cast<float>(length * per_distance); }

  std::size_t cell_along(int k, double x) const
  {
    const double at = static_cast<double>(count[k]) * (x / edges[k]);
    return static_cast<std::size_t>(std::clamp(at, 0.0, static_cast<double>(count[k] - 1)));
  }

  std::size_t cell_of(const Vec<D> &x) const
  {
    std::size_t cell = 0;
    for (int k = 0; k < D; ++k) cell = cell * count[k] + cell_along(k, x[k]);
    return cell;
  }

  /// Whether `visit(cell, image)` holds for any of the cells around that of x.
  template <class Visit>
  bool any_in(int k, std::size_t cell, Vec<D> image, bool is_other, const Vec<D> &x,
              const Visit &visit) const
  {
    if (k == D) return is_other && visit(cell, image);
    const long centre = static_cast<long>(cell_along(k, x[k]));
    for (long c = centre - around[k]; c <= centre + around[k]; ++c) {
      const long turns = c >= 0 ? c / count[k] : -((count[k] - 1 - c) / count[k]);
      image[k] = static_cast<double>(turns);
      const auto own = static_cast<std::size_t>(c - turns * count[k]);
      if (any_in(k + 1, cell * count[k] + own, image, is_other || c != centre, x, visit))
        return true;
    }
    return false;
  }

  template <class Test>
  bool any_of_cell(std::size_t cell, const Vec<D> &image, const Sphere &about,
                   const Test &test) const
  {
    std::array<float, D> x;
    for (int k = 0; k < D; ++k) x[k] = scaled(about.x[k] - image[k] * edges[k]);
    const float reach = scaled(about.radius) + rounding;
    for (std::size_t at = cell; at != NONE; at = parts[at].more) {
      const Part &part = parts[at];
      for (std::size_t m = 0; m < part.n; ++m) {
        float distance_sq = 0.0F;
        for (int k = 0; k < D; ++k) distance_sq += (x[k] - part.x[k][m]) * (x[k] - part.x[k][m]);
        const float most = reach + part.radius[m];
        if (distance_sq < most * most && is_hit(part.members[m], image, about, test)) return true;
      }
    }
    return false;
  }

  template <class Test>
  bool is_hit(const Member &member, const Vec<D> &image, const Sphere &about,
              const Test &test) const
  {
    if (member.number < about.but) return false;
    Vec<D> apart;
    for (int k = 0; k < D; ++k) {
      // Across the box the difference is large before an edge is subtracted: not in doubles.
      apart[k] = image[k] == 0.0 ? about.x[k] - member.body.centre[k]
                                 : static_cast<double>(static_cast<long double>(about.x[k]) -
                                                       member.body.centre[k] - image[k] * edges[k]);
    }
    const double reach = about.radius + member.radius;
    return norm_sq(apart) < reach * reach && test(member.body, apart);
  }

  template <class Test>
  bool any_shift_from(int k, bool is_positive, double length, Vec<D> shift, const Test &test) const
  {
    if (k == D) return is_positive && norm_sq(shift) < length * length && test(shift);
    const long most = static_cast<long>(length / edges[k]);
    for (long turns = is_positive ? -most : 0; turns <= most; ++turns) {
      shift[k] = static_cast<double>(turns) * edges[k];
      if (any_shift_from(k + 1, is_positive || turns > 0, length, shift, test)) return true;
    }
    return false;
  }
};

}  // namespace jamshape
