#pragma once

#include "contact/math/vec.hpp"

#include "text.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <initializer_list>
#include <memory>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

namespace jamshape {

namespace nb = nanobind;

template <typename T>
using Array1 = nb::ndarray<const T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
template <typename T>
using Array2 = nb::ndarray<const T, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
template <typename T>
using Array3 = nb::ndarray<const T, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

/// A NumPy array under construction: filled with zeros, handed over to Python once. Files make many
/// of them: what is done once for each array is not inlined.
template <typename T> class NewArray {
 public:
  [[gnu::noinline]] explicit NewArray(std::initializer_list<std::size_t> shape) :
      shape(shape), values(new T[size()]{})
  {
  }

  T *row(std::size_t n) { return values.get() + n * product(shape.begin() + 1); }
  T &operator[](std::size_t n) { return values[n]; }

  [[gnu::noinline]] nb::object release()
  {
    T *data = values.release();
    nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<T *>(p); });
    return nb::cast(nb::ndarray<nb::numpy, T>(data, shape.size(), shape.data(), owner));
  }

 private:
  std::vector<std::size_t> shape;
  std::unique_ptr<T[]> values;

  std::size_t size() const { return product(shape.begin()); }

  /// Product of the extents from this one on.
  std::size_t product(std::vector<std::size_t>::const_iterator from) const
  {
    return std::accumulate(from, shape.end(), std::size_t{1}, std::multiplies<>());
  }
};

template <int D> Vec<D> read_vec(const double *from)
{
  Vec<D> v;
  for (int k = 0; k < D; ++k) v[k] = from[k];
  return v;
}

template <int D, class S> void write_vec(const Vec<D, S> &v, double *to)
{
  for (int k = 0; k < D; ++k) to[k] = static_cast<double>(v[k]);
}

inline void require(bool condition, const std::string &sentence)
{
  if (!condition) throw std::invalid_argument(sentence);
}

inline bool are_finite(const double *from, std::size_t n)
{
  return std::all_of(from, from + n, [](double x) { return std::isfinite(x); });
}

/// Whether an angle or a quaternion of any length specifies a rotation.
template <int D> bool is_turn(const double *from)
{
  if (D == 2) return std::isfinite(from[0]);
  const double size = norm_sq(read_vec<4>(from));
  return size > 0.0 && std::isfinite(size);
}

/// Throws if any of n numbers is not finite: contacts of such particles would be dropped silently.
inline void require_finite(const double *from, std::size_t n, const char *name)
{
  const double *const end = from + n;
  const double *const bad = std::find_if(from, end, [](double x) { return !std::isfinite(x); });
  if (bad == end) return;
  throw std::invalid_argument("number " + std::to_string(bad - from) + " of " + name + " is " +
                              shown(*bad) + ", expected a finite one: find where it comes from.");
}

template <class Array> void require_finite(const Array &array, const char *name)
{
  require_finite(array.data(), array.size(), name);
}

inline void require_finite(double number, const char *name)
{
  require(std::isfinite(number), name + (" is " + shown(number)) + ", expected a finite number.");
}

/// Throws unless the number of threads is allowed.
inline void require_threads(std::int64_t threads)
{
  require(threads >= 1 && threads <= 1024,
          "threads is " + std::to_string(threads) + ", expected from 1 to 1024.");
}

/// Throws unless all D edges of a box are positive lengths.
inline void require_edges(const double *edges, std::size_t D)
{
  const double *const end = edges + D;
  require(std::all_of(edges, end, [](double x) { return x > 0.0 && std::isfinite(x); }),
          "edges hold a number that is not a positive length.");
}

/// Throws unless (D, D) are an upper triangular matrix, with a positive diagonal or, as of low
/// parts, any.
inline void require_upper(const double *of, std::size_t D, const std::string &name,
                          bool positive = true)
{
  require_finite(of, D * D, name.c_str());
  for (std::size_t k = 0; k < D; ++k) {
    const double *const row = of + k * D;
    require(std::all_of(row, row + k, [](double x) { return x == 0.0; }),
            name + " is not upper triangular, expected vectors as columns, the first along x.");
    require(!positive || row[k] > 0.0, name + " has an edge that is not a positive length.");
  }
}

/// Throws unless (2, D, D), double-doubles, are such a matrix.
inline void require_upper(const Array3<double> &of, std::size_t D, const std::string &name)
{
  require(of.shape(0) == 2 && of.shape(1) == D && of.shape(2) == D,
          name + " does not have the shape (2, D, D).");
  require_finite(of, name.c_str());
  require_upper(of.data(), D, name);
  require_upper(of.data() + D * D, D, name, false);
}

/// Throws unless (2, D, D) are the cell vectors of a box, as columns.
inline void require_cell(const Array3<double> &cell, std::size_t D)
{
  require_upper(cell, D, "cell");
}

/// Throws unless n orientations, angles or quaternions, specify rotations.
inline void require_orientations(const double *from, std::size_t n, std::size_t D)
{
  require_finite(from, D == 2 ? n : 4 * n, "orientation");
  for (std::size_t i = 0; D == 3 && i < n; ++i) {
    require(is_turn<3>(from + 4 * i), "the quaternion of particle " + std::to_string(i) +
                                          " has no direction, expected one of length 1.");
  }
}

}  // namespace jamshape
