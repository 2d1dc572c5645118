#pragma once

#include "contact/math/scalar.hpp"

namespace jamshape {

/// Quintic step: 0 for x <= 0, 1 for x >= 1, twice continuously differentiable between.
template <class S> S smooth_step(const S &x)
{
  const S y = least(S(1.0), most(S(0.0), x));
  return y * y * y * (10.0 + y * (6.0 * y - 15.0));
}

template <class S> S smooth_step_gradient(const S &x)
{
  const S y = least(S(1.0), most(S(0.0), x));
  return 30.0 * y * y * (1.0 - y) * (1.0 - y);
}

}  // namespace jamshape
