#include "contact/dimer/dimer.hpp"

namespace jamshape {

JAMSHAPE_CONTACTS(, DimerModel)

}  // namespace jamshape
