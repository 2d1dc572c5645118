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
  } catch (...) {  // newer LAMMPS has not ended the ranks yet
    // The mpirun of MPICH loses unread output when they end: about one message of ten.
    if (lmp->comm->nprocs > 1) {
      if (lmp->screen) std::fflush(lmp->screen);
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
    }
    throw;
  }
}

}  // namespace jamshape
