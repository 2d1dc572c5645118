#pragma once

#include "contact/clump/clump.hpp"
#include "contact/dimer/dimer.hpp"
#include "contact/spherocylinder/spherocylinder.hpp"
#include "contact/spheropolygon/spheropolygon.hpp"
#include "contact/superellipsoid/superellipsoid.hpp"

namespace jamshape {

template <class... Models> struct ShapeList {
  /// Calls `visit` with an empty object of each model's type.
  template <class Visit> static void each(const Visit &visit) { (visit(Models{}), ...); }
};

/// All shapes available in Python and the command `create_random`.
using Shapes =
    ShapeList<SpherocylinderModel, SuperellipsoidModel, DimerModel, ClumpModel, SpheropolygonModel>;

}  // namespace jamshape
