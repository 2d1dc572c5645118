// Compiled once for each instruction set, JAMSHAPE_SET.

#include "landscape/block_kernels.hpp"

#include "landscape/dense_square.hpp"

#include <cstring>

namespace jamshape {
namespace {

using Two = double __attribute__((vector_size(16)));
using Four = double __attribute__((vector_size(32)));

/// N numbers in a register, which may hold more; the content of the others is arbitrary.
template <class V, int N> struct Register {
  V v;

  void load(const double *from) { std::memcpy(&v, from, sizeof(v)); }
  void put(double *to) const { std::memcpy(to, &v, sizeof(v)); }
  void scale(double by) { v *= by; }
  void add(const Register &a, double by) { v += a.v * by; }
  void add(const Register &a, const Register &by) { v += a.v * by.v; }
  void take(const Register &a, double by) { v -= a.v * by; }
  double sum() const
  {
    double all = v[0];
    for (int k = 1; k < N; ++k) all += v[k];
    return all;
  }
};

struct SixNumbers {
  Register<Four, 4> a;
  Register<Two, 2> b;

  void load(const double *from)
  {
    a.load(from);
    b.load(from + 4);
  }
  void put(double *to) const
  {
    a.put(to);
    b.put(to + 4);
  }
  void scale(double by)
  {
    a.scale(by);
    b.scale(by);
  }
  void add(const SixNumbers &c, double by)
  {
    a.add(c.a, by);
    b.add(c.b, by);
  }
  void add(const SixNumbers &c, const SixNumbers &by)
  {
    a.add(c.a, by.a);
    b.add(c.b, by.b);
  }
  void take(const SixNumbers &c, double by)
  {
    a.take(c.a, by);
    b.take(c.b, by);
  }
  double sum() const { return a.sum() + b.sum(); }
};

/// A column of a block, or a row of a vector.
template <int BLOCK> struct ColumnOf;
template <> struct ColumnOf<2> {
  using Type = Register<Two, 2>;
};
template <> struct ColumnOf<3> {
  using Type = Register<Four, 3>;
};
template <> struct ColumnOf<6> {
  using Type = SixNumbers;
};
template <int BLOCK> using Column = typename ColumnOf<BLOCK>::Type;

/// A block.
template <int BLOCK> struct Square {
  Column<BLOCK> column[BLOCK];

  void load(const double *block)
  {
    for (int c = 0; c < BLOCK; ++c) column[c].load(block + BLOCK * c);
  }
  void put(double *block) const
  {
    for (int c = 0; c < BLOCK; ++c) column[c].put(block + BLOCK * c);
  }
};

// Nothing is read or written beyond the block.
template <> void Square<3>::load(const double *block)
{
  for (int c = 0; c < 2; ++c) column[c].load(block + 3 * c);
  column[2].load(block + 5);
  column[2].v = __builtin_shufflevector(column[2].v, column[2].v, 1, 2, 3, 3);
}
template <> void Square<3>::put(double *block) const
{
  for (int c = 0; c < 2; ++c) column[c].put(block + 3 * c);
  std::memcpy(block + 6, &column[2], 3 * sizeof(double));
}

/// A block of a row of the factor times the pivots of its column, transposed: its element (k, c) is
/// by[BLOCK * k + c].
template <int BLOCK> struct Part {
  double by[BLOCK * BLOCK];
};

/// A block from which products of others are subtracted.
template <int BLOCK> struct Rest {
  Square<BLOCK> block;

  void load(const double *from) { block.load(from); }
  void put(double *to) const { block.put(to); }
  void take(const double *a, const Part<BLOCK> &part)
  {
    Square<BLOCK> left;
    left.load(a);
    for (int c = 0; c < BLOCK; ++c) {
      for (int k = 0; k < BLOCK; ++k) block.column[c].take(left.column[k], part.by[BLOCK * k + c]);
    }
  }
};

// Both columns share a register.
template <> struct Rest<2> {
  Four block;

  void load(const double *from) { std::memcpy(&block, from, sizeof(block)); }
  void put(double *to) const { std::memcpy(to, &block, sizeof(block)); }
  void take(const double *a, const Part<2> &part)
  {
    for (int k = 0; k < 2; ++k) {
      Two left;
      std::memcpy(&left, a + 2 * k, sizeof(left));
      const Four by{part.by[2 * k], part.by[2 * k], part.by[2 * k + 1], part.by[2 * k + 1]};
      block -= __builtin_shufflevector(left, left, 0, 1, 0, 1) * by;
    }
  }
};

template <int BLOCK> bool is_zero(const double *block)
{
  bool found = true;
  for (int k = 0; k < BLOCK * BLOCK; ++k) found &= block[k] == 0.0;
  return found;
}

/// Most columns whose products are subtracted in one pass.
constexpr int MOST_COLUMNS = 4;

/// The number of blocks below another one in its column.
inline int below(const FactorView &at, const LeftBlock &left)
{
  return at.first[left.column + 1] - left.block - 1;
}

/// Number of blocks of a row, from k on, whose columns have all further rows in common: with
/// all fill-in, each is then the parent of the one before in the elimination tree.
template <int BLOCK> int columns_alike(const FactorView &at, int k, int last)
{
  constexpr int SIZE = BLOCK * BLOCK;
  int n = 1;
  for (; at.is_complete && n < MOST_COLUMNS && k + n < last; ++n) {
    const LeftBlock &before = at.left[k + n - 1], &next = at.left[k + n];
    const bool is_parent = at.row[at.first[before.column]] == next.column;
    if (!is_parent || below(at, before) != below(at, next)) break;
    if (is_zero<BLOCK>(at.below + SIZE * next.block)) break;
  }
  return n;
}

template <int BLOCK> Part<BLOCK> part_of(const FactorView &at, const LeftBlock &left)
{
  constexpr int SIZE = BLOCK * BLOCK;
  Part<BLOCK> part;
  for (int c = 0; c < BLOCK; ++c) {
    const double pivot = at.diagonal[SIZE * left.column + (BLOCK + 1) * c];
    for (int r = 0; r < BLOCK; ++r) {
      part.by[BLOCK * c + r] = at.below[SIZE * left.block + BLOCK * c + r] * pivot;
    }
  }
  return part;
}

/// Subtracts from column j the contributions of some columns with the same further rows.
template <int BLOCK, int COLUMNS> void take_columns(const FactorView &at, int j, int k)
{
  constexpr int SIZE = BLOCK * BLOCK;
  const double *own[COLUMNS];
  Part<BLOCK> part[COLUMNS];
  for (int m = 0; m < COLUMNS; ++m) {
    own[m] = at.below + SIZE * at.left[k + m].block;
    part[m] = part_of<BLOCK>(at, at.left[k + m]);
  }
  const auto take = [&](int b, double *from) {
    Rest<BLOCK> rest;
    rest.load(from);
    for (int m = 0; m < COLUMNS; ++m) rest.take(own[m] + SIZE * b, part[m]);
    rest.put(from);
  };
  take(0, at.diagonal + SIZE * j);
  const int *const row = at.row + at.left[k].block;
  const int n = below(at, at.left[k]);
  for (int b = 1; b <= n; ++b) {
    if (at.column_of_row[row[b]] == j) take(b, at.below + SIZE * at.block_of_row[row[b]]);
  }
}

/// The same for n of them, up to COLUMNS.
template <int BLOCK, int COLUMNS> void take_up_to(const FactorView &at, int j, int k, int n)
{
  if (n == COLUMNS) {
    take_columns<BLOCK, COLUMNS>(at, j, k);
  } else if constexpr (COLUMNS > 1) {
    take_up_to<BLOCK, COLUMNS - 1>(at, j, k, n);
  }
}

/// Sets the blocks below the diagonal to those of the matrix, and notes where they are.
template <int BLOCK> void begin_column(const BlockView &matrix, const FactorView &at, int j)
{
  constexpr std::size_t SIZE = BLOCK * BLOCK, BYTES = SIZE * sizeof(double);
  for (int b = at.first[j]; b < at.first[j + 1]; ++b) {
    at.block_of_row[at.row[b]] = b;
    at.column_of_row[at.row[b]] = j;
  }
  const std::size_t n = at.first[j + 1] - at.first[j];
  if (n > 0) std::memset(at.below + SIZE * at.first[j], 0, BYTES * n);
  for (int b = matrix.first[j]; b < matrix.first[j + 1]; ++b) {
    double *const to = at.below + SIZE * at.block_of_row[matrix.row[b]];
    std::memcpy(to, matrix.below + SIZE * b, BYTES);
  }
}

/// Subtracts from a column the contributions of the eliminated ones on its left (left-looking),
/// except for blocks outside the pattern, and for blocks of zeros, which pairs that do not touch
/// leave behind.
template <int BLOCK> void gather(const FactorView &at, int j)
{
  constexpr int SIZE = BLOCK * BLOCK;
  const int last = at.first_left[j + 1];
  for (int k = at.first_left[j]; k < last;) {
    if (is_zero<BLOCK>(at.below + SIZE * at.left[k].block)) {
      ++k;
      continue;
    }
    const int n = columns_alike<BLOCK>(at, k, last);
    take_up_to<BLOCK, MOST_COLUMNS>(at, j, k, n);
    k += n;
  }
}

/// Factorises the diagonal block into l d l^T, and divides those below it by d l^T.
template <int BLOCK> bool eliminate(const FactorView &at, int j)
{
  constexpr int SIZE = BLOCK * BLOCK;
  double *const block = at.diagonal + SIZE * j, *const inverse = at.inverse_pivots + BLOCK * j;
  if (!factorise_square(block, BLOCK, BLOCK, inverse)) return false;
  for (int b = at.first[j]; b < at.first[j + 1]; ++b) {
    Square<BLOCK> below;
    below.load(at.below + SIZE * b);
    for (int c = 1; c < BLOCK; ++c) {
      for (int k = 0; k < c; ++k) below.column[c].take(below.column[k], block[BLOCK * k + c]);
    }
    for (int c = 0; c < BLOCK; ++c) below.column[c].scale(inverse[c]);
    below.put(at.below + SIZE * b);
  }
  return true;
}

template <int BLOCK> bool factorise(const BlockView &matrix, const FactorView &at)
{
  for (int j = 0; j < at.n; ++j) at.column_of_row[j] = -1;
  for (int j = 0; j < at.n; ++j) {
    begin_column<BLOCK>(matrix, at, j);
    gather<BLOCK>(at, j);
    if (!eliminate<BLOCK>(at, j)) return false;
  }
  return true;
}

template <int BLOCK> void substitute_forward(const FactorView &at, double *x)
{
  constexpr int SIZE = BLOCK * BLOCK, STRIDE = stride_of(BLOCK);
  for (int j = 0; j < at.n; ++j) {
    double *const own = x + STRIDE * j;
    const double *const l = at.diagonal + SIZE * j;
    for (int c = 0; c < BLOCK; ++c) {
      for (int r = c + 1; r < BLOCK; ++r) own[r] -= l[BLOCK * c + r] * own[c];
    }
    for (int b = at.first[j]; b < at.first[j + 1]; ++b) {
      Square<BLOCK> below;
      Column<BLOCK> rest;
      below.load(at.below + SIZE * b);
      rest.load(x + STRIDE * at.row[b]);
      for (int k = 0; k < BLOCK; ++k) rest.take(below.column[k], own[k]);
      rest.put(x + STRIDE * at.row[b]);
    }
  }
}

template <int BLOCK> void substitute_back(const FactorView &at, double *x)
{
  constexpr int SIZE = BLOCK * BLOCK, STRIDE = stride_of(BLOCK);
  for (int j = at.n - 1; j >= 0; --j) {
    double *const own = x + STRIDE * j;
    const double *const l = at.diagonal + SIZE * j;
    Square<BLOCK> sums{};
    for (int b = at.first[j]; b < at.first[j + 1]; ++b) {
      Square<BLOCK> below;
      Column<BLOCK> other;
      below.load(at.below + SIZE * b);
      other.load(x + STRIDE * at.row[b]);
      for (int c = 0; c < BLOCK; ++c) sums.column[c].add(below.column[c], other);
    }
    for (int c = BLOCK - 1; c >= 0; --c) {
      own[c] = own[c] * at.inverse_pivots[BLOCK * j + c] - sums.column[c].sum();
      for (int r = c + 1; r < BLOCK; ++r) own[c] -= l[BLOCK * c + r] * own[r];
    }
  }
}

template <int BLOCK> void solve(const FactorView &factors, double *x)
{
  substitute_forward<BLOCK>(factors, x);
  substitute_back<BLOCK>(factors, x);
}

template <int BLOCK> void multiply(const BlockView &at, const double *x, double *y)
{
  constexpr int SIZE = BLOCK * BLOCK, STRIDE = stride_of(BLOCK);
  for (int j = 0; j < at.n; ++j) {
    const double *const own = x + STRIDE * j;
    Column<BLOCK> other, to;
    Square<BLOCK> block, sums{};
    block.load(at.diagonal + SIZE * j);
    to.load(y + STRIDE * j);
    for (int k = 0; k < BLOCK; ++k) to.add(block.column[k], own[k]);
    to.put(y + STRIDE * j);
    for (int b = at.first[j]; b < at.first[j + 1]; ++b) {
      block.load(at.below + SIZE * b);
      other.load(x + STRIDE * at.row[b]);
      to.load(y + STRIDE * at.row[b]);
      for (int k = 0; k < BLOCK; ++k) {
        to.add(block.column[k], own[k]);
        sums.column[k].add(block.column[k], other);
      }
      to.put(y + STRIDE * at.row[b]);
    }
    for (int c = 0; c < BLOCK; ++c) y[STRIDE * j + c] += sums.column[c].sum();
  }
}

}  // namespace

template <InstructionSet SET, int BLOCK> BlockKernels block_kernels_of()
{
  return {&factorise<BLOCK>, &solve<BLOCK>, &multiply<BLOCK>};
}

template BlockKernels block_kernels_of<InstructionSet::JAMSHAPE_SET, 2>();
template BlockKernels block_kernels_of<InstructionSet::JAMSHAPE_SET, 3>();
template BlockKernels block_kernels_of<InstructionSet::JAMSHAPE_SET, 6>();

}  // namespace jamshape
