#pragma once

#include "contact/math/rotation.hpp"

#include <cmath>

namespace jamshape {

/// The orientation given by an angle (2D) or the four numbers of a quaternion of any length (3D).
template <int D> Quaternion orientation_from(const double *numbers)
{
  if constexpr (D == 2) {
    return {std::cos(0.5 * *numbers), 0.0, 0.0, std::sin(0.5 * *numbers)};
  } else {
    return normalized(Quaternion{numbers[0], numbers[1], numbers[2], numbers[3]});
  }
}

}  // namespace jamshape
