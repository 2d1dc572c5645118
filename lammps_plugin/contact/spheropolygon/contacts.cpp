#include "contact/spheropolygon/spheropolygon.hpp"

namespace jamshape {

JAMSHAPE_CONTACTS(, SpheropolygonModel)

}  // namespace jamshape
