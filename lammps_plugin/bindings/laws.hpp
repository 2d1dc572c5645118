#pragma once

#include "contact/spherocylinder/spherocylinder.hpp"
#include "contact/superellipsoid/superellipsoid.hpp"

#include "bindings/arrays.hpp"
#include "text.hpp"

namespace jamshape {

inline SpherocylinderLaw spherocylinder_law(double k_e, int sides)
{
  require(sides == 1 || sides == 2, "sides is " + std::to_string(sides) + ", expected 1 or 2.");
  require(k_e > 0.0, "k_e is " + shown(k_e) + ", expected a positive energy.");
  return SpherocylinderModel::law(static_cast<Sides>(sides), k_e);
}

inline SuperellipsoidLaw superellipsoid_law(double epsilon)
{
  require(epsilon > 0.0, "epsilon is " + shown(epsilon) + ", expected a positive energy.");
  return SuperellipsoidModel::law({}, epsilon);
}

}  // namespace jamshape
