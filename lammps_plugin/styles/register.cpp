// The plugin's table of contents, one line per style other than pair styles, and its registration
// in LAMMPS.

#include "atom.h"
#include "comm.h"
#include "compat.h"
#include "compute_contact_local.h"
#include "compute_packing.h"
#include "create_random.h"
#include "decimal_point.h"
#include "domain.h"
#include "error.h"
#include "fix_overdamped_affine.h"
#include "force.h"
#include "input.h"
#include "mending.h"
#include "modify.h"
#include "pair_contact.h"
#include "utils.h"
#include "variable.h"

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <dlfcn.h>
#include <filesystem>
#include <mpi.h>
#include <string>

#define JAMSHAPE_QUOTED(x) #x
#define JAMSHAPE_TEXT(x) JAMSHAPE_QUOTED(x)

// Handles of one MPI library are invalid in another, although its functions have the same names.
#if defined(OPEN_MPI)
#define JAMSHAPE_MPI "Open MPI"
#elif defined(MPICH_VERSION)
#define JAMSHAPE_MPI "MPICH"
#else
#define JAMSHAPE_MPI ""
#endif

namespace {

using LAMMPS_NS::LAMMPS;
namespace compat = jamshape::compat;

template <class T> LAMMPS_NS::Fix *fix(LAMMPS *lmp, int narg, char **arg)
{
  return new T(lmp, narg, arg);
}
template <class T> LAMMPS_NS::Compute *compute(LAMMPS *lmp, int narg, char **arg)
{
  return new T(lmp, narg, arg);
}

LAMMPS_NS::Command *command(LAMMPS *lmp) { return new jamshape::CreateRandom(lmp); }

/// Passes each style to `add`, which distinguishes pairs, fixes, computes and commands.
template <class Add> void for_all_styles(const Add &add)
{
  using namespace jamshape;
  for (const auto &[name, creator] : pair_styles()) add(name.c_str(), creator);
  add("overdamped/affine", fix<FixOverdampedAffine>);
  add("contact/local", compute<ComputeContactLocal>);
  add("packing", compute<ComputePacking>);
  add("create_random", command);
}

/// LAMMPS's names of what creators make.
const char *kind_of(LAMMPS_NS::Pair *(*)(LAMMPS *) ) { return "pair"; }
const char *kind_of(LAMMPS_NS::Fix *(*)(LAMMPS *, int, char **) ) { return "fix"; }
const char *kind_of(LAMMPS_NS::Compute *(*)(LAMMPS *, int, char **) ) { return "compute"; }
const char *kind_of(LAMMPS_NS::Command *(*)(LAMMPS *) ) { return "command"; }

/// Adds styles to those of LAMMPS.
struct AddToStyles {
  LAMMPS *lmp;

  void operator()(const char *name, LAMMPS_NS::Pair *(*creator)(LAMMPS *) ) const
  {
    compat::add_style(compat::pair_styles(lmp->force), name, creator);
  }
  void operator()(const char *name, LAMMPS_NS::Fix *(*creator)(LAMMPS *, int, char **) ) const
  {
    compat::add_style(compat::fix_styles(lmp->modify), name, creator);
  }
  void operator()(const char *name, LAMMPS_NS::Compute *(*creator)(LAMMPS *, int, char **) ) const
  {
    compat::add_style(compat::compute_styles(lmp->modify), name, creator);
  }
  void operator()(const char *name, LAMMPS_NS::Command *(*creator)(LAMMPS *) ) const
  {
    compat::add_style(compat::command_styles(lmp->input), name, creator);
  }
};

/// Adds styles by the function of the PLUGIN package, which can then list and unload them.
struct AddAsPlugins {
  LAMMPS *lmp;
  void *handle;
  lammpsplugin_regfunc add;

  template <class Style> void operator()(const char *name, Style *(*creator)(LAMMPS *) ) const
  {
    lammpsplugin_t one = named(kind_of(creator), name);
    one.creator.v1 = reinterpret_cast<void *(*)(void *)>(creator);
    add(&one, lmp);
  }
  template <class Style>
  void operator()(const char *name, Style *(*creator)(LAMMPS *, int, char **) ) const
  {
    lammpsplugin_t one = named(kind_of(creator), name);
    one.creator.v2 = reinterpret_cast<void *(*)(void *, int, char **)>(creator);
    add(&one, lmp);
  }

 private:
  lammpsplugin_t named(const char *kind, const char *name) const
  {
    // The version has already been checked.
    return {lmp->version, kind, name, name, "jamshape", {}, handle};
  }
};

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

/// The LAMMPS version that this binary was compiled for, as an integer such as 20210929, and the
/// MPI library. (Variables, so that a test can simulate another build.)
int jamshape_built_for = JAMSHAPE_LAMMPS_VERSION;
int jamshape_newest_tested = JAMSHAPE_NEWEST_TESTED;
const char *jamshape_built_with = JAMSHAPE_MPI;

/// The same as text in the file, readable without loading it into LAMMPS.
extern const char jamshape_label[];
const char jamshape_label[] = "jamshape plugin for LAMMPS " JAMSHAPE_TEXT(
    JAMSHAPE_LAMMPS_VERSION) ", newest tested " JAMSHAPE_TEXT(JAMSHAPE_NEWEST_TESTED);
}
#pragma GCC visibility pop

namespace {

/// An error message if LAMMPS's own functions report other numbers than its objects, as the headers
/// describe them: versions under development have one date for many layouts. Else empty.
std::string what_is_misread(void *handle)
{
  const auto *const lmp = static_cast<LAMMPS *>(handle);
  const struct {
    const char *name;
    int read;
  } numbers[] = {
      {"tagint", sizeof(LAMMPS_NS::tagint)}, {"imageint", sizeof(LAMMPS_NS::imageint)},
      {"bigint", sizeof(LAMMPS_NS::bigint)}, {"dimension", lmp->domain->dimension},
      {"triclinic", lmp->domain->triclinic}, {"newton_pair", lmp->force->newton_pair},
      {"nlocal", lmp->atom->nlocal},         {"ntypes", lmp->atom->ntypes},
  };
  for (const auto &[name, read] : numbers) {
    const int told = lammps_extract_setting(handle, name);
    if (read == told) continue;
    return "jamshape read " + std::to_string(read) + " as '" + name + "' of LAMMPS " +
           std::to_string(jamshape_built_for) + ", expected " + std::to_string(told) +
           ": its headers are not those with which this plugin was built; build jamshape again "
           "with this LAMMPS.";
  }
  return "";
}

/// An error message if this LAMMPS is not the one compiled for, whose objects have another layout,
/// or uses another MPI library; else empty.
std::string what_differs(void *handle)
{
  const int found = lammps_version(handle);
  if (found != jamshape_built_for)
    return "jamshape found LAMMPS version " + std::to_string(found) + ", expected " +
           std::to_string(jamshape_built_for) +
           " for which this plugin was built: build jamshape again with this LAMMPS.";
  char text[MPI_MAX_LIBRARY_VERSION_STRING];
  int length = 0;
  MPI_Get_library_version(text, &length);
  const std::string library(text, length);
  if (library.find(jamshape_built_with) == std::string::npos)
    return "jamshape found the MPI library " + library.substr(0, library.find_first_of(",\n\t")) +
           ", expected " + jamshape_built_with +
           " with which this plugin was built: build jamshape again with this LAMMPS.";
  return what_is_misread(handle);
}

/// Sets the variable `jamshape_plugin` of decks, which exists only with the styles, to the file of
/// this plugin. Not by a command, in which LAMMPS would interpret quotes and dollars of the path.
void tell_plugin_file(LAMMPS *lmp)
{
  Dl_info found;
  std::error_code none;
  if (!dladdr(&jamshape_built_for, &found)) return;
  std::string path = std::filesystem::absolute(found.dli_fname, none).string();
  std::string name = "jamshape_plugin", style = "index", away = "delete";
  char *removal[] = {name.data(), away.data()};
  char *definition[] = {name.data(), style.data(), path.data()};
  LAMMPS_NS::Variable *const variables = lmp->input->variable;
  if (variables->find(name.data()) >= 0) variables->set(2, removal);
  variables->set(3, definition);
}

/// Adds the styles and checks that LAMMPS finds them. Tells if no tests have run with its version.
template <class Add> void add_styles(LAMMPS *lmp, const Add &add)
{
  jamshape::give_decimal_point(lmp);
  for_all_styles(add);
  const std::string tested = std::to_string(jamshape_newest_tested);
  for_all_styles([&](const char *name, auto *creator) {
    const std::string kind = kind_of(creator);
    if (lammps_has_style(lmp, kind.c_str(), name)) return;
    lmp->error->all(FLERR, "jamshape added the " + kind + " style " + name +
                               " to LAMMPS, which does not list it, expected a LAMMPS that does: "
                               "use version " +
                               tested + " or an older one.");
  });
  tell_plugin_file(lmp);
  if (jamshape_built_for <= jamshape_newest_tested || lmp->comm->me != 0) return;
  LAMMPS_NS::utils::logmesg(lmp, "jamshape was built for LAMMPS " +
                                     std::to_string(jamshape_built_for) + ", newer than " + tested +
                                     ", the newest of its tests: its checks at loading passed.\n");
}

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

/// An error message if the plugin was not built for this LAMMPS, else null: for callers that
/// LAMMPS's own errors would end. Valid until the next call.
const char *jamshape_differs(void *handle)
{
  static std::string sentence;
  sentence = what_differs(handle);
  return sentence.c_str();
}

/// Adds the styles of this plugin to a LAMMPS instance; stops it with an error if it is another one
/// than it was built for.
void jamshape_register(void *handle)
{
  auto *lmp = static_cast<LAMMPS *>(handle);
  const std::string wrong = what_differs(handle);
  if (!wrong.empty()) lmp->error->all(FLERR, wrong);
  add_styles(lmp, AddToStyles{lmp});
}

/// Adds the styles again if `clear` has removed them.
void jamshape_register_again(void *handle)
{
  if (!lammps_has_style(handle, "fix", "overdamped/affine")) jamshape_register(handle);
}

/// Makes a LAMMPS usable after an error in a command.
void jamshape_mend(void *handle) { jamshape::mend(static_cast<LAMMPS *>(handle)); }

/// Entry point of `plugin load` and LAMMPS_PLUGIN_PATH. Another LAMMPS only gets a warning: one
/// that finds plugins by itself must be able to continue without.
void lammpsplugin_init(void *handle, void *library, void *add)
{
  auto *lmp = static_cast<LAMMPS *>(handle);
  const std::string wrong = what_differs(handle);
  if (!wrong.empty()) {
    if (lmp->comm->me == 0) lmp->error->warning(FLERR, wrong);
    return;
  }
  add_styles(lmp, AddAsPlugins{lmp, library, reinterpret_cast<lammpsplugin_regfunc>(add)});
}

/// Report of the work skipped for the present particles, as in the log; empty before the first
/// evaluation. Valid until the next run.
const char *jamshape_left_out(void *handle)
{
  const auto *lmp = static_cast<LAMMPS *>(handle);
  const auto *pair = dynamic_cast<jamshape::PairContact *>(lmp->force->pair);
  return pair ? pair->left_out().c_str() : "";
}

/// The pair style, if it is one of this plugin: a line with its name and settings, and a line with
/// the coefficients of each pair of types. Valid until the next call.
const char *jamshape_pair(void *handle)
{
  auto *const lmp = static_cast<LAMMPS *>(handle);
  static std::string text;
  text.clear();
  auto *const pair = dynamic_cast<jamshape::PairContact *>(lmp->force->pair);
  if (pair == nullptr) return text.c_str();
  char *rows = nullptr;
  std::size_t size = 0;
  FILE *const file = open_memstream(&rows, &size);
  if (file == nullptr) return text.c_str();
  pair->write_pairs(file, std::string::npos);
  std::fclose(file);
  text = std::string(lmp->force->pair_style) + pair->settings_text() + "\n" + rows;
  std::free(rows);
  return text.c_str();
}

/// Sets the orientations of this rank's atoms, w i j k for each in their present order.
void jamshape_orient(void *handle, const double *quaternions)
{
  auto *const lmp = static_cast<LAMMPS *>(handle);
  jamshape::ParticleView particles(lmp);
  particles.find_ellipsoids("packing.to_lammps");
  for (int i = 0; i < lmp->atom->nlocal; ++i) {
    const double *const q = quaternions + 4 * i;
    particles.set_orientation(i, {q[0], q[1], q[2], q[3]});
  }
}
}
#pragma GCC visibility pop
