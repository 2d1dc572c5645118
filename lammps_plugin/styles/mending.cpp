#include "mending.h"

#include "atom.h"
#include "modify.h"
#include "output.h"
#include "pointers.h"
#include "update.h"

namespace jamshape {

namespace {

/// A substitute for a deleted Thermo, of which LAMMPS reads a flag and calls the virtual destructor
/// before it makes a new one.
class NoThermo : LAMMPS_NS::Pointers {
 public:
  explicit NoThermo(LAMMPS_NS::LAMMPS *lmp) : Pointers(lmp) {}

 private:
  [[maybe_unused]] char room[1 << 14] = {};  // longer than Thermo, whose header Debian lacks
};

void mend_thermo(LAMMPS_NS::LAMMPS *lmp)
{
  if (lmp->output->thermo != nullptr) return;
  lmp->output->thermo = reinterpret_cast<LAMMPS_NS::Thermo *>(new NoThermo(lmp));
  char one[] = "one";
  char *words[] = {one};
  lmp->output->create_thermo(1, words);
}

void mend_update(LAMMPS_NS::Update *update)
{
  update->whichflag = 0;  // the run or minimisation is over
  char verlet[] = "verlet", cg[] = "cg";
  char *integrate[] = {verlet}, *minimize[] = {cg};
  if (update->integrate == nullptr) update->create_integrate(1, integrate, 1);
  if (update->minimize == nullptr) update->create_minimize(1, minimize, 1);
}

}  // namespace

void mend(LAMMPS_NS::LAMMPS *lmp)
{
  mend_update(lmp->update);
  mend_thermo(lmp);
  if (lmp->atom->avec == nullptr) lmp->atom->create_avec("atomic", 0, nullptr, 1);
  for (int i = lmp->modify->nfix - 1; i >= 0; --i)
    if (lmp->modify->fix[i] == nullptr) lmp->modify->delete_fix(i);
}

}  // namespace jamshape
