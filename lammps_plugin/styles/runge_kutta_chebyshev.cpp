#include "runge_kutta_chebyshev.h"

#include <cmath>

namespace jamshape {

namespace {

constexpr double DAMPING = 2.0 / 13.0;

/// Chebyshev polynomials of the first kind and their first two derivatives at w0, up to degree s.
struct Chebyshev {
  double w0;
  std::vector<double> t, t1, t2;

  explicit Chebyshev(int s) :
      w0(1.0 + DAMPING / (static_cast<double>(s) * s)), t{1.0, w0}, t1{0.0, 1.0}, t2{0.0, 0.0}
  {
    for (int j = 2; j <= s; ++j) {
      t.push_back(2.0 * w0 * t[j - 1] - t[j - 2]);
      t1.push_back(2.0 * (t[j - 1] + w0 * t1[j - 1]) - t1[j - 2]);
      t2.push_back(2.0 * (2.0 * t1[j - 1] + w0 * t2[j - 1]) - t2[j - 2]);
    }
  }
};

}  // namespace

RungeKuttaChebyshev::RungeKuttaChebyshev(int n_stages) : s(n_stages), stage(n_stages + 1)
{
  const Chebyshev p(s);
  const double w0 = p.w0, w1 = p.t1[s] / p.t2[s];
  std::vector<double> b(s + 1);
  for (int j = 2; j <= s; ++j) b[j] = p.t2[j] / (p.t1[j] * p.t1[j]);
  b[0] = b[1] = b[2];
  stage[1] = {w1 * p.t2[2] / (p.t1[2] * p.t1[2]), b[1] * w1, 0.0, 0.0, 0.0};
  for (int j = 2; j <= s; ++j) {
    const double of_rate = 2.0 * b[j] * w1 / b[j - 1];
    const double a = 1.0 - b[j - 1] * p.t[j - 1];
    stage[j] = {w1 * p.t2[j] / p.t1[j], -a * of_rate, of_rate, 2.0 * b[j] * w0 / b[j - 1],
                j == 2 ? 0.0 : -b[j] / b[j - 2]};
  }
}

double RungeKuttaChebyshev::interval(int s)
{
  const Chebyshev p(s);
  return (p.w0 + 1.0) * p.t2[s] / p.t1[s];
}

int RungeKuttaChebyshev::stages(double z, int most)
{
  int s = 2;
  while (s < most && interval(s) < z) ++s;
  return s;
}

}  // namespace jamshape
