#pragma once

#include "compat.h"

#include <string>

namespace jamshape {

/// The file that this plugin was loaded from, as it was named then.
const std::string &plugin_file();

/// Names it to decks: the variable `jamshape_plugin`, which there is only where the styles are.
void tell_plugin_file(LAMMPS_NS::LAMMPS *lmp);

/// The command `jamshape WORD ...` of decks, for what input of LAMMPS cannot say:
/// `jamshape.lammps.deck`, in a Python of its own beside rank 0, answers with orders, one a line,
/// which all ranks carry out. An interpreter within LAMMPS, its command `python`, is not in every
/// LAMMPS, and need not know what jamshape needs.
class DeckCommand : public LAMMPS_NS::Command {
 public:
  using Command::Command;
  void command(int narg, char **arg) override;

 private:
  bool carry_out(const std::string &order, std::string &reply);
  void enter(const std::string &folder);
  void print(const std::string &text);
  [[noreturn]] void end(const std::string &sentence);
  std::string broadcast(std::string line);
};

}  // namespace jamshape
