#include "pair_dimer_harmonic.h"

namespace jamshape {

template class PairContactOf<DimerModel>;

}  // namespace jamshape
