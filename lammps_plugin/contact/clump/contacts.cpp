#include "contact/clump/clump.hpp"

namespace jamshape {

JAMSHAPE_CONTACTS(, ClumpModel)

}  // namespace jamshape
