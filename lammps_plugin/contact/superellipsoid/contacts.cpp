#include "contact/superellipsoid/superellipsoid.hpp"

namespace jamshape {

JAMSHAPE_CONTACTS(, SuperellipsoidModel)
JAMSHAPE_SEARCHES(, 2)
JAMSHAPE_SEARCHES(, 3)

}  // namespace jamshape
