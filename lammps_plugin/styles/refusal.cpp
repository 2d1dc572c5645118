#include "refusal.h"

#include "comm.h"
#include "error.h"

#include <chrono>
#include <cstdio>
#include <thread>

namespace jamshape {

void refuse(LAMMPS_NS::LAMMPS *lmp, const std::string &file, int line, const std::string &sentence)
{
  try {
    lmp->error->one(file, line, sentence);
  } catch (...) {  // newer LAMMPS has yet to end the ranks
    // The mpirun of MPICH forgets what it has not read when they end: one sentence of ten.
    if (lmp->comm->nprocs > 1) {
      if (lmp->screen) std::fflush(lmp->screen);
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
    }
    throw;
  }
}

}  // namespace jamshape
