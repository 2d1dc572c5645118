// Functions of packs beside those of long doubles: the largest errors in units of the last place of
// a double, as JSON.

#include "contact/math/pack_functions.hpp"

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <random>

using namespace jamshape;

namespace {

constexpr double EPSILON = std::numeric_limits<double>::epsilon();
std::mt19937_64 chance(18);

double between(double low, double high)
{
  return std::uniform_real_distribution<double>(low, high)(chance);
}

template <class OfPack, class OfNumber, class Draw>
double largest_error(const OfPack &of_pack, const OfNumber &of_number, const Draw &draw)
{
  double largest = 0.0;
  for (int n = 0; n < 50000; ++n) {
    double x[LANES], y[LANES];
    for (double &each : x) each = draw();
    of_pack(Pack::load(x)).store(y);
    for (int k = 0; k < LANES; ++k) {
      const long double exact = of_number(static_cast<long double>(x[k]));
      const double error = static_cast<double>(std::abs((y[k] - exact) / exact)) / EPSILON;
      if (!(error <= largest)) largest = error;
    }
  }
  return largest;
}

double number_of(const Pack &x) { return x.lanes[0]; }

}  // namespace

int main()
{
  const auto exp_ = [](const Pack &x) { return exp(x); };
  const auto log_ = [](const Pack &x) { return log(x); };
  const auto log1p_ = [](const Pack &x) { return log1p(x); };
  std::printf("{\"exp\": %.3g, ", largest_error(exp_, expl, [] { return between(-708, 709); }));
  std::printf("\"exp of little\": %.3g, ",
              largest_error(exp_, expl, [] { return between(-1, 1); }));
  const auto any_size = [] { return std::exp2(between(-1022, 1023)); };
  std::printf("\"log\": %.3g, ", largest_error(log_, logl, any_size));
  std::printf("\"log near 1\": %.3g, ", largest_error(log_, logl, [] { return between(0.5, 2); }));
  std::printf("\"log1p\": %.3g, ", largest_error(log1p_, log1pl, [] { return between(-0.9, 9); }));
  const auto little = [] { return std::copysign(std::exp2(between(-300, -1)), between(-1, 1)); };
  std::printf("\"log1p of little\": %.3g, ", largest_error(log1p_, log1pl, little));
  for (const double power : {1.0 / 3, 0.7, 2.2}) {
    std::printf("\"pow %.1f\": %.3g, ", power,
                largest_error([=](const Pack &x) { return pow(x, power); },
                              [=](long double x) { return powl(x, power); },
                              [] { return between(0.01, 3); }));
  }
  const double most = std::numeric_limits<double>::infinity(), none = std::nan("");
  std::printf("\"ends\": [%d, %d, %d, %d, %d, %d, %d]}\n", number_of(exp(Pack(-1e9))) == 0.0,
              number_of(exp(Pack(1e9))) == most, std::isnan(number_of(exp(Pack(none)))),
              std::isnan(number_of(log(Pack(-1.0)))), std::isnan(number_of(log(Pack(none)))),
              number_of(pow(Pack(0.0), 0.5)) == 0.0, std::isnan(number_of(pow(Pack(none), 0.5))));
}
