#pragma once

#include <algorithm>

namespace jamshape {

/// Quintic step: 0 for x <= 0, 1 for x >= 1, twice continuously differentiable between.
inline double smooth_step(double x)
{
  const double y = std::clamp(x, 0.0, 1.0);
  return y * y * y * (10.0 + y * (6.0 * y - 15.0));
}

inline double smooth_step_gradient(double x)
{
  const double y = std::clamp(x, 0.0, 1.0);
  return 30.0 * y * y * (1.0 - y) * (1.0 - y);
}

}  // namespace jamshape
