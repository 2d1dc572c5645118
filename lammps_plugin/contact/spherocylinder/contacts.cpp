#include "contact/spherocylinder/spherocylinder.hpp"

namespace jamshape {

JAMSHAPE_CONTACTS(, SpherocylinderModel)

}  // namespace jamshape
