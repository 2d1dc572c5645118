#include "mending.h"

#include "atom.h"
#include "compat.h"
#include "error.h"
#include "force.h"
#include "modify.h"
#include "output.h"
#include "pair.h"
#include "pointers.h"
#include "update.h"

#include <cstring>
#include <string>
#include <vector>

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

/// A substitute for a deleted pair style, which stops a run or minimisation with an error until
/// there is another one. Without it LAMMPS would read a null pointer.
class NoPair : public LAMMPS_NS::Pair {
 public:
  explicit NoPair(LAMMPS_NS::LAMMPS *lmp) :
      Pair(lmp), all_set(atom->ntypes + 1, 1), rows(atom->ntypes + 1, all_set.data())
  {
    restartinfo = 0;
    allocated = atom->ntypes > 0;  // else LAMMPS itself refuses to run
    setflag = rows.data();
  }
  void compute(int, int) override { refuse(); }
  void settings(int, char **) override { refuse(); }
  void coeff(int, char **) override { refuse(); }
  void init_style() override { refuse(); }

 private:
  std::vector<int> all_set;
  std::vector<int *> rows;

  void refuse()
  {
    const std::string sentence = "LAMMPS found no pair style, since it refused the last one, "
                                 "expected one; give pair_style and pair_coeff";
    error->all(FLERR, sentence);
  }
};

void mend_pair(LAMMPS_NS::LAMMPS *lmp)
{
  if (lmp->force->pair_style != nullptr) return;
  constexpr char NAME[] = "refused";
  lmp->force->pair_style = new char[sizeof(NAME)];
  std::strcpy(lmp->force->pair_style, NAME);
  lmp->force->pair = new NoPair(lmp);
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
  mend_pair(lmp);
  if (lmp->atom->avec == nullptr) lmp->atom->create_avec("atomic", 0, nullptr, 1);
  const std::vector<LAMMPS_NS::Fix *> fixes = compat::fixes(lmp->modify);
  for (int i = static_cast<int>(fixes.size()) - 1; i >= 0; --i)
    if (fixes[i] == nullptr) lmp->modify->delete_fix(i);
}

}  // namespace jamshape
