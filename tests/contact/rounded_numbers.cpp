// Double-doubles rounded to long doubles in doubles alone, beside the conversion itself: the number
// of those that differ, as JSON.

#include "packing/split.hpp"

#include <cmath>
#include <cstdio>
#include <random>

using namespace jamshape;

namespace {

std::mt19937_64 chance(7);

double between(double low, double high)
{
  return std::uniform_real_distribution<double>(low, high)(chance);
}

bool differ(const Split &x)
{
  const Split expected = split(joined(x)), found = rounded_to_long(x);
  return found.value != expected.value || found.rest != expected.rest;
}

/// The number that differ, of rests up to this many units in the last place of their numbers.
int different(double units)
{
  int found = 0;
  for (int n = 0; n < 300000; ++n) {
    const double value = std::copysign(std::exp2(between(-40.0, 20.0)), between(-1.0, 1.0));
    found += differ({value, units * between(-1.0, 1.0) * 0x1p-53 * value});
  }
  return found;
}

/// The same of ties: half a unit in the last place of a long double, beside whole ones.
int different_ties()
{
  int found = 0;
  for (int n = 0; n < 100000; ++n) {
    const double value = between(1.0, 2.0), unit = 0x1p-63;
    found += differ({value, unit * (0.5 + std::floor(between(-1023.0, 1023.0)))});
  }
  return found;
}

}  // namespace

int main()
{
  std::printf("{\"normal\": %d, \"larger rests\": %d, \"ties\": %d, ", different(1.0),
              different(1000.0), different_ties());
  std::printf("\"zeros\": %d}\n", differ({0.0, 0.0}) + differ({-0.0, 0.0}) + differ({1.0, 0.0}));
}
