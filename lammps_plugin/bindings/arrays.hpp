#pragma once

#include "contact/math/vec.hpp"

#include <cstddef>
#include <initializer_list>
#include <memory>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
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

/// A NumPy array under construction: filled with zeros, handed over to Python once.
template <typename T> class NewArray {
 public:
  explicit NewArray(std::initializer_list<std::size_t> shape) :
      shape(shape), values(new T[size()]{})
  {
  }

  T *row(std::size_t n) { return values.get() + n * (size() / *shape.begin()); }
  T &operator[](std::size_t n) { return values[n]; }

  nb::object release()
  {
    T *data = values.release();
    nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<T *>(p); });
    return nb::cast(nb::ndarray<nb::numpy, T>(data, shape.size(), shape.data(), owner));
  }

 private:
  std::vector<std::size_t> shape;
  std::unique_ptr<T[]> values;

  std::size_t size() const
  {
    std::size_t n = 1;
    for (const std::size_t extent : shape) n *= extent;
    return n;
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

}  // namespace jamshape
