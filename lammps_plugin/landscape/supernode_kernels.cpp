// Compiled once for each instruction set, JAMSHAPE_SET, with fused multiplications and additions.

#include "landscape/supernode_kernels.hpp"

#include "landscape/dense_square.hpp"
#include "landscape/single_precision.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace jamshape {
namespace {

/// Numbers of a register, and the size of a tile of a product that fills the registers: its height
/// in registers and its columns.
#if defined(__AVX512F__)
constexpr int LANES = 8, HIGH = 3, WIDE = 8;
#elif defined(__AVX2__)
constexpr int LANES = 4, HIGH = 2, WIDE = 4;
#else
constexpr int LANES = 2, HIGH = 2, WIDE = 4;
#endif
static_assert(LANES * HIGH <= SUPERNODE_ROOM);
using Lanes = double __attribute__((vector_size(8 * LANES)));

Lanes loaded(const double *from)
{
  Lanes v;
  std::memcpy(&v, from, sizeof(v));
  return v;
}

Lanes loaded(const float *from) { return in_doubles<Lanes>(from); }

void put(const Lanes &v, double *to) { std::memcpy(to, &v, sizeof(v)); }

/// One supernode, in coordinates.
template <class Number> struct SupernodeOf {
  Number *numbers;
  int width, height;
  std::size_t stride;

  Number *column(int c) const { return numbers + stride * c; }
  Number pivot(int c) const { return column(c)[c]; }
};
using Supernode = SupernodeOf<double>;

template <int BLOCK, class Number>
SupernodeOf<Number> supernode(const SupernodeView &at, Number *numbers, int s)
{
  const int width = BLOCK * (at.column[s + 1] - at.column[s]);
  const int height = width + BLOCK * (at.first[s + 1] - at.first[s]);
  return {numbers + at.start[s], width, height, static_cast<std::size_t>(supernode_stride(height))};
}

template <int BLOCK> Supernode supernode(const SupernodeView &at, int s)
{
  return supernode<BLOCK>(at, at.numbers, s);
}

/// A tile of the product of a matrix (rows, k) in columns and one (k, WIDE) in rows.
template <int ROWS> struct Tile {
  static constexpr int HEIGHT = ROWS * LANES;
  Lanes sum[WIDE][ROWS];

  Tile(const double *left, std::size_t stride, const double *by, int k)
  {
    for (auto &column : sum) {
      for (Lanes &one : column) one = Lanes{};
    }
    for (int m = 0; m < k; ++m, left += stride, by += WIDE) {
      Lanes own[ROWS];
      for (int r = 0; r < ROWS; ++r) own[r] = loaded(left + LANES * r);
      for (int c = 0; c < WIDE; ++c) {
        for (int r = 0; r < ROWS; ++r) sum[c][r] += own[r] * by[c];
      }
    }
  }

  /// Subtracts a column of it from one of a supernode, `n` rows to these.
  void take(int c, const int *to, int n, double *column) const
  {
    if (n >= HEIGHT && to[HEIGHT - 1] - to[0] == HEIGHT - 1) {
      column += to[0];
      for (int r = 0; r < ROWS; ++r) {
        put(loaded(column + LANES * r) - sum[c][r], column + LANES * r);
      }
    } else {
      double each[HEIGHT];
      for (int r = 0; r < ROWS; ++r) put(sum[c][r], each + LANES * r);
      for (int r = 0; r < std::min(n, HEIGHT); ++r) column[to[r]] -= each[r];
    }
  }
};

/// The first k columns of a supernode from a row on, as they contribute to `into`: its rows there,
/// `to`, of which the first n are columns.
struct Contribution {
  const Supernode &from;
  int k, row, n;
  const int *to;
  const Supernode &into;

  int rows() const { return from.height - row; }

  /// Sorts the first n rows times the pivots, in groups of WIDE.
  void sort(double *by) const
  {
    for (int j = 0; j < n; j += WIDE) {
      const int some = std::min(WIDE, n - j);
      for (int m = 0; m < k; ++m, by += WIDE) {
        const double *const own = from.column(m) + row + j;
        for (int c = 0; c < some; ++c) by[c] = own[c] * from.pivot(m);
        for (int c = some; c < WIDE; ++c) by[c] = 0.0;
      }
    }
  }

  /// Subtracts tiles of some rows, except for those above the diagonal.
  template <int ROWS> void take_rows(int r, const double *by) const
  {
    for (int j = 0; j < n && j < r + ROWS * LANES; j += WIDE) {
      const double *const factors = by + static_cast<std::size_t>(k) * j;
      const Tile<ROWS> tile(from.column(0) + row + r, from.stride, factors, k);
      for (int c = 0; c < std::min(WIDE, n - j); ++c) {
        tile.take(c, to + r, rows() - r, into.column(to[j + c]));
      }
    }
  }

  void take(double *by) const
  {
    sort(by);
    int r = 0;
    for (; rows() - r > (HIGH - 1) * LANES; r += HIGH * LANES) take_rows<HIGH>(r, by);
    for (; r < rows(); r += LANES) take_rows<1>(r, by);
  }
};

/// Sets the numbers of a supernode to those of the matrix, and notes where its rows are.
template <int BLOCK>
void begin(const BlockView &matrix, const SupernodeView &at, const SupernodeWork &work, int s)
{
  constexpr int SIZE = BLOCK * BLOCK;
  const Supernode own = supernode<BLOCK>(at, s);
  std::fill(at.numbers + at.start[s], at.numbers + at.start[s + 1], 0.0);
  int next = 0;
  for (int j = at.column[s]; j < at.column[s + 1]; ++j, next += BLOCK) work.local[j] = next;
  for (int b = at.first[s]; b < at.first[s + 1]; ++b, next += BLOCK) work.local[at.row[b]] = next;
  for (int j = at.column[s]; j < at.column[s + 1]; ++j) {
    const auto place = [&](const double *block, int row) {
      for (int c = 0; c < BLOCK; ++c) {
        double *const to = own.column(work.local[j] + c) + work.local[row];
        std::memcpy(to, block + BLOCK * c, BLOCK * sizeof(double));
      }
    };
    place(matrix.diagonal + SIZE * j, j);
    for (int b = matrix.first[j]; b < matrix.first[j + 1]; ++b) {
      place(matrix.below + SIZE * b, matrix.row[b]);
    }
  }
}

/// Columns of a supernode that are eliminated together, and their square on the diagonal.
constexpr int GROUP = 8;
using Square = double[GROUP][GROUP];

/// Divides N columns from g on by the factors of their square.
template <int N>
void divide(const Supernode &own, int g, const Square &l, const double *inverse_pivots)
{
  double *columns[N];
  for (int c = 0; c < N; ++c) columns[c] = own.column(g + c);
  for (int row = g; row < own.height; row += LANES) {
    Lanes each[N];
    for (int c = 0; c < N; ++c) each[c] = loaded(columns[c] + row);
    for (int c = 0; c < N; ++c) {
      for (int k = 0; k < c; ++k) each[c] -= each[k] * l[k][c];
    }
    for (int c = 0; c < N; ++c) put(each[c] * inverse_pivots[c], columns[c] + row);
  }
}

template <int N = GROUP>
void divide(const Supernode &own, int g, int n, const Square &l, const double *inverse_pivots)
{
  if (n == N) {
    divide<N>(own, g, l, inverse_pivots);
  } else if constexpr (N > 1) {
    divide<N - 1>(own, g, n, l, inverse_pivots);
  }
}

/// Factorises a supernode from which all others were subtracted.
bool eliminate(const Supernode &own, double *inverse_pivots, const SupernodeWork &work)
{
  for (int g = 0; g < own.width; g += GROUP) {
    const int n = std::min(GROUP, own.width - g);
    if (g > 0) {
      for (int r = g; r < own.height; ++r) work.to[r - g] = r;
      Contribution{own, g, g, n, work.to, own}.take(work.by);
    }
    Square l{};
    for (int c = 0; c < n; ++c) std::memcpy(l[c], own.column(g + c) + g, n * sizeof(double));
    if (!factorise_square(l[0], GROUP, n, inverse_pivots + g)) return false;
    divide(own, g, n, l, inverse_pivots + g);
    for (int c = 0; c < n; ++c) std::memcpy(own.column(g + c) + g, l[c], n * sizeof(double));
  }
  return true;
}

/// Lists a supernode with the one that it contributes to next, from this block row on.
void list(const SupernodeView &at, const SupernodeWork &work, int k, int row)
{
  if (row == at.first[k + 1]) return;
  const int to = at.of_column[at.row[row]];
  work.position[k] = row;
  work.next[k] = work.head[to];
  work.head[to] = k;
}

/// Subtracts from a supernode the contributions of the eliminated ones on its left, which are
/// listed with it; each is then listed with the next one that it contributes to.
template <int BLOCK> void gather(const SupernodeView &at, const SupernodeWork &work, int s)
{
  const Supernode own = supernode<BLOCK>(at, s);
  for (int k = work.head[s], next; k >= 0; k = next) {
    next = work.next[k];
    const Supernode from = supernode<BLOCK>(at, k);
    const int first = work.position[k], last = at.first[k + 1];
    int *to = work.to, end = first;
    while (end < last && at.row[end] < at.column[s + 1]) ++end;
    for (int b = first; b < last; ++b) {
      for (int c = 0; c < BLOCK; ++c) *to++ = work.local[at.row[b]] + c;
    }
    const int row = from.width + BLOCK * (first - at.first[k]);
    Contribution{from, from.width, row, BLOCK * (end - first), work.to, own}.take(work.by);
    list(at, work, k, end);
  }
}

template <int BLOCK>
bool factorise(const BlockView &matrix, const SupernodeView &at, const SupernodeWork &work)
{
  std::fill(work.head, work.head + at.n, -1);
  for (int s = 0; s < at.n; ++s) {
    begin<BLOCK>(matrix, at, work, s);
    gather<BLOCK>(at, work, s);
    double *const inverse_pivots = at.inverse_pivots + BLOCK * at.column[s];
    if (!eliminate(supernode<BLOCK>(at, s), inverse_pivots, work)) return false;
    list(at, work, s, at.first[s]);
  }
  return true;
}

/// Numbers of a dot product that are added at once, with any instruction set.
constexpr int SUMS = 8, PARTS = SUMS / LANES;

/// Columns by which a solution proceeds.
constexpr int COLUMNS = 4;

/// Copies the rows of a supernode, from x or back.
template <int BLOCK, class Copy>
void each_row(const SupernodeView &at, int s, double *part, const Copy &copy)
{
  for (int j = at.column[s]; j < at.column[s + 1]; ++j, part += BLOCK) copy(BLOCK * j, part);
  for (int b = at.first[s]; b < at.first[s + 1]; ++b, part += BLOCK) copy(BLOCK * at.row[b], part);
}

/// Subtracts from all rows below N columns their parts.
template <int N, class Number>
void substitute_forward(const SupernodeOf<Number> &own, int g, double *x)
{
  const Number *l[N];
  double by[N];
  for (int c = 0; c < N; ++c) {
    l[c] = own.column(g + c);
    by[c] = x[g + c];
    for (int r = g + c + 1; r < g + N; ++r) x[r] -= l[c][r] * by[c];
  }
  int r = g + N;
  for (; r + LANES <= own.height; r += LANES) {
    Lanes rest = loaded(x + r);
    for (int c = 0; c < N; ++c) rest -= loaded(l[c] + r) * by[c];
    put(rest, x + r);
  }
  for (; r < own.height; ++r) {
    for (int c = 0; c < N; ++c) x[r] -= l[c][r] * by[c];
  }
}

/// Subtracts from N rows of x their dot products with the columns below them.
template <int N, class Number>
void substitute_back(const SupernodeOf<Number> &own, int g, double *x)
{
  const Number *l[N];
  for (int c = 0; c < N; ++c) l[c] = own.column(g + c);
  Lanes sum[N][PARTS]{};
  int r = g + N;
  for (; r + SUMS <= own.height; r += SUMS) {
    for (int m = 0; m < PARTS; ++m) {
      const Lanes other = loaded(x + r + LANES * m);
      for (int c = 0; c < N; ++c) sum[c][m] += loaded(l[c] + r + LANES * m) * other;
    }
  }
  for (int c = N - 1; c >= 0; --c) {
    double each[SUMS], all = 0.0;
    std::memcpy(each, sum[c], sizeof(each));
    for (int k = 0; k < SUMS; ++k) all += each[k];
    for (int k = r; k < own.height; ++k) all += l[c][k] * x[k];
    for (int k = g + c + 1; k < g + N; ++k) all += l[c][k] * x[k];
    x[g + c] -= all;
  }
}

template <int BLOCK, class Number>
void solve_with(const SupernodeView &at, const Number *numbers, double *x, double *part)
{
  constexpr std::size_t BYTES = BLOCK * sizeof(double);
  const auto from_x = [&](int at_x, double *own) { std::memcpy(own, x + at_x, BYTES); };
  const auto to_x = [&](int at_x, const double *own) { std::memcpy(x + at_x, own, BYTES); };
  for (int s = 0; s < at.n; ++s) {
    const auto own = supernode<BLOCK>(at, numbers, s);
    each_row<BLOCK>(at, s, part, from_x);
    int g = 0;
    for (; g + COLUMNS <= own.width; g += COLUMNS) substitute_forward<COLUMNS>(own, g, part);
    for (; g < own.width; ++g) substitute_forward<1>(own, g, part);
    each_row<BLOCK>(at, s, part, to_x);
  }
  for (int s = at.n - 1; s >= 0; --s) {
    const auto own = supernode<BLOCK>(at, numbers, s);
    each_row<BLOCK>(at, s, part, from_x);
    const double *const inverse_pivots = at.inverse_pivots + BLOCK * at.column[s];
    for (int c = 0; c < own.width; ++c) part[c] *= inverse_pivots[c];
    int g = own.width;
    for (; g % COLUMNS != 0; --g) substitute_back<1>(own, g - 1, part);
    for (; g > 0; g -= COLUMNS) substitute_back<COLUMNS>(own, g - COLUMNS, part);
    std::memcpy(x + BLOCK * at.column[s], part, own.width * sizeof(double));
  }
}

template <int BLOCK> void solve(const SupernodeView &at, double *x, double *part)
{
  if (at.singles) {
    solve_with<BLOCK>(at, at.singles, x, part);
  } else {
    solve_with<BLOCK>(at, at.numbers, x, part);
  }
}

}  // namespace

template <InstructionSet SET, int BLOCK> SupernodeKernels supernode_kernels_of()
{
  return {&factorise<BLOCK>, &solve<BLOCK>};
}

template SupernodeKernels supernode_kernels_of<InstructionSet::JAMSHAPE_SET, 3>();
template SupernodeKernels supernode_kernels_of<InstructionSet::JAMSHAPE_SET, 6>();

}  // namespace jamshape
