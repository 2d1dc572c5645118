#pragma once

#include "contact/dimer/dimer.hpp"
#include "contact/spherocylinder/spherocylinder.hpp"
#include "contact/superellipsoid/superellipsoid.hpp"

namespace jamshape {

template <class... Models> struct ShapeList {
  /// Shows each model, as an empty object of its type.
  template <class Visit> static void each(const Visit &visit) { (visit(Models{}), ...); }
};

/// Every shape that Python and the command `create_random` know.
using Shapes = ShapeList<SpherocylinderModel, SuperellipsoidModel, DimerModel>;

}  // namespace jamshape
