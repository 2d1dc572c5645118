#pragma once

#include "contact/contact.hpp"
#include "contact/math/vec.hpp"

#include "compat.h"
#include "particle_view.h"

#include <cstdint>
#include <string>
#include <vector>

namespace jamshape {

/// The command `create_random SHAPE N PHI SEED type SHARE DX DY DZ [form NUMBER ...] ...`: a
/// periodic box with non-overlapping particles at random positions and orientations. Every rank
/// finds all positions and keeps its own, so that a seed gives the same state on any number of
/// ranks.
class CreateRandom : public LAMMPS_NS::Command {
 public:
  explicit CreateRandom(LAMMPS_NS::LAMMPS *lmp) : Command(lmp), view(lmp) {}
  void command(int narg, char **arg) override;

  /// A type of particles: diameters, further numbers, and its share of all particles.
  struct Kind {
    double share;
    Vec<3> diameters;
    FormNumbers form;
  };
  /// Poses of all particles by ascending ID, as consecutive doubles.
  struct Start {
    double edge = 0.0;
    std::vector<int> type;
    std::vector<double> position;     // (N, 3)
    std::vector<double> orientation;  // (N, 4) quaternions w i j k
  };

 private:
  ParticleView view;
  std::string words;
  int n = 0;
  double phi = 0.0;
  std::uint64_t seed = 0;
  std::vector<Kind> kinds;

  void read(int narg, char **arg);
  void require(bool holds, const std::string &expected);
  double number(const char *word, const char *name);
  template <class Model, int D> Start start();
  template <class Model, int D> std::vector<typename Model::Shape> shapes_of_kinds();
  void create(const Start &start);
};

}  // namespace jamshape
