#include "bindings/arrays.hpp"

#include <algorithm>
#include <array>

namespace jamshape {

namespace {

/// Columns whose sums stay in registers.
constexpr std::size_t AT_ONCE = 4;

struct SparseRows {
  const std::int64_t *first, *column;
  const double *value;
};

/// Multiplies rows by some columns from j on of a dense matrix with k columns.
template <std::size_t COUNT, class T>
void add_columns(const SparseRows &of, std::size_t row, const T *dense, std::size_t k,
                 long double *to)
{
  std::array<long double, COUNT> sum{};
  for (std::int64_t e = of.first[row]; e < of.first[row + 1]; ++e) {
    const T *from = dense + static_cast<std::size_t>(of.column[e]) * k;
    const long double value = of.value[e];
    for (std::size_t c = 0; c < COUNT; ++c) sum[c] += value * from[c];
  }
  std::copy(sum.begin(), sum.end(), to);
}

template <class T>
void multiply(const SparseRows &of, std::size_t rows, const T *dense, std::size_t k,
              long double *to)
{
  for (std::size_t row = 0; row < rows; ++row) {
    std::size_t j = 0;
    for (; j + AT_ONCE <= k; j += AT_ONCE)
      add_columns<AT_ONCE>(of, row, dense + j, k, to + row * k + j);
    for (; j < k; ++j) add_columns<1>(of, row, dense + j, k, to + row * k + j);
  }
}

/// NumPy's long doubles cross as pairs of doubles with the same bytes.
constexpr std::size_t PARTS = sizeof(long double) / sizeof(double);

nb::object sparse_product(const Array1<std::int64_t> &first, const Array1<std::int64_t> &column,
                          const Array1<double> &value, const Array2<double> &dense, bool is_long)
{
  const std::size_t parts = is_long ? PARTS : 1, n = dense.shape(0), k = dense.shape(1) / parts;
  require(first.shape(0) > 0 && dense.shape(1) == k * parts, "a sparse product has other shapes.");
  const std::size_t rows = first.shape(0) - 1;
  require(column.shape(0) == value.shape(0) && first.data()[0] == 0 &&
              std::is_sorted(first.data(), first.data() + rows + 1) &&
              static_cast<std::size_t>(first.data()[rows]) == value.shape(0),
          "rows of a sparse matrix are no partition of its entries.");
  require(std::all_of(column.data(), column.data() + column.shape(0),
                      [&](std::int64_t c) { return c >= 0 && static_cast<std::size_t>(c) < n; }),
          "a sparse matrix has a column that the dense one has no row for.");
  const SparseRows of{first.data(), column.data(), value.data()};
  NewArray<double> result({rows, k * PARTS});
  auto *to = reinterpret_cast<long double *>(result.row(0));
  if (is_long)
    multiply(of, rows, reinterpret_cast<const long double *>(dense.data()), k, to);
  else
    multiply(of, rows, dense.data(), k, to);
  return result.release();
}

}  // namespace

void export_sparse_product(nb::module_ &m)
{
  using namespace nb::literals;
  m.def("sparse_product", &sparse_product, "first"_a, "column"_a, "value"_a, "dense"_a, "is_long"_a,
        "Rows (m, 2 k) of a sparse matrix, CSR: first (m + 1,), column and value (e,), times a "
        "dense\n"
        "one (n, k) in long double; dense numbers that are long doubles, and the result, are seen\n"
        "as pairs of doubles.");
}

}  // namespace jamshape
