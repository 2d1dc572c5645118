// Errors of a LAMMPS compiled without exceptions, as on Debian 12, which ends its process at an
// error. Python loads this library before LAMMPS's, so that calls of `Error::all` and `Error::one`,
// in LAMMPS and in the plugin, arrive here: within a command given by Python they throw, and
// `jamshape_command` returns their message. In all other cases, as in decks and on several ranks,
// LAMMPS's own functions are called.

#include "comm.h"
#include "error.h"
#include "force.h"
#include "lammps.h"
#include "update.h"

#include <cstdio>
#include <cstdlib>
#include <dlfcn.h>
#include <exception>
#include <string>
#include <utility>

namespace {

using LAMMPS_NS::Pointers;

struct Refusal {
  std::string sentence;
};

/// Whether this thread is within a command given by Python.
thread_local bool is_within = false;

constexpr char ALL[] =
    "_ZN9LAMMPS_NS5Error3allERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEEiS8_";
constexpr char ONE[] =
    "_ZN9LAMMPS_NS5Error3oneERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEEiS8_";

constexpr char CREATE_INTEGRATE[] = "_ZN9LAMMPS_NS6Update16create_integrateEiPPci";
constexpr char CREATE_MINIMIZE[] = "_ZN9LAMMPS_NS6Update15create_minimizeEiPPci";
constexpr char CREATE_KSPACE[] =
    "_ZN9LAMMPS_NS5Force13create_kspaceERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEEi";

/// A function of LAMMPS's library, located through the virtual table of one of its objects.
void *of_lammps(const void *object, const char *name)
{
  Dl_info found;
  if (!dladdr(*static_cast<void *const *>(object), &found)) return nullptr;
  void *const library = dlopen(found.dli_fname, RTLD_NOLOAD | RTLD_LAZY);
  return library ? dlsym(library, name) : nullptr;
}

[[noreturn]] void leave_to_lammps(const char *name, LAMMPS_NS::Error *error,
                                  const std::string &file, int line, const std::string &sentence)
{
  using Stop = void (*)(LAMMPS_NS::Error *, const std::string &, int, const std::string &);
  if (const auto stop = reinterpret_cast<Stop>(of_lammps(error, name)))
    stop(error, file, line, sentence);
  std::fprintf(stderr, "ERROR: %s\n", sentence.c_str());
  std::abort();
}

/// Calls the function of LAMMPS that replaces a style, without the old one, which it would delete
/// first and still point to after an error.
template <class Function, class Owner, class Style, class... Arguments>
void replace(const char *function, Owner *owner, Style *&style, char *&name,
             Arguments &&...arguments)
{
  const auto make = reinterpret_cast<Function>(of_lammps(owner, function));
  Style *const old_style = std::exchange(style, nullptr);
  char *const old_name = std::exchange(name, nullptr);
  try {
    make(owner, std::forward<Arguments>(arguments)...);
  } catch (...) {
    style = old_style;
    name = old_name;
    throw;
  }
  delete reinterpret_cast<Pointers *>(old_style);  // the base of all styles
  delete[] old_name;
}

using CreateByWords = void (*)(LAMMPS_NS::Update *, int, char **, int);
using CreateByName = void (*)(LAMMPS_NS::Force *, const std::string &, int);

}  // namespace

namespace LAMMPS_NS {

void Error::all(const std::string &file, int line, const std::string &sentence)
{
  if (!is_within || comm->nprocs > 1) leave_to_lammps(ALL, this, file, line, sentence);
  if (logfile) std::fprintf(logfile, "ERROR: %s\n", sentence.c_str());
  update->whichflag = 0;  // the run or minimisation is over: the next command may begin one
  throw Refusal{sentence};
}

void Error::one(const std::string &file, int line, const std::string &sentence)
{
  if (!is_within || comm->nprocs > 1) leave_to_lammps(ONE, this, file, line, sentence);
  all(file, line, sentence);
}

void Update::create_integrate(int narg, char **arg, int try_suffix)
{
  replace<CreateByWords>(CREATE_INTEGRATE, this, integrate, integrate_style, narg, arg, try_suffix);
}

void Update::create_minimize(int narg, char **arg, int try_suffix)
{
  replace<CreateByWords>(CREATE_MINIMIZE, this, minimize, minimize_style, narg, arg, try_suffix);
}

void Force::create_kspace(const std::string &style, int try_suffix)
{
  replace<CreateByName>(CREATE_KSPACE, this, kspace, kspace_style, style, try_suffix);
}

}  // namespace LAMMPS_NS

extern "C" {

/// Whether LAMMPS's calls arrive here: not if its library was loaded before this one.
int jamshape_is_asked()
{
  Dl_info found;
  Dl_info own;
  return dladdr(dlsym(RTLD_DEFAULT, ALL), &found) &&
         dladdr(reinterpret_cast<void *>(&jamshape_is_asked), &own) &&
         found.dli_fbase == own.dli_fbase;
}

/// Passes a command to LAMMPS by its function `lammps_command`; writes the message of an error,
/// truncated to `room` bytes including the final 0, or nothing, and returns whether there was one.
int jamshape_command(char *(*lammps_command)(void *, const char *), void *lammps, const char *line,
                     char *sentence, std::size_t room)
{
  const auto refused = [&](const char *text) {
    is_within = false;
    std::snprintf(sentence, room, "%s", text);
    return 1;
  };
  is_within = true;
  try {
    lammps_command(lammps, line);
  } catch (const Refusal &refusal) {
    return refused(refusal.sentence.c_str());
  } catch (const std::exception &error) {  // such as std::bad_alloc
    static_cast<LAMMPS_NS::LAMMPS *>(lammps)->update->whichflag = 0;
    return refused(error.what());
  }
  is_within = false;
  return 0;
}
}
