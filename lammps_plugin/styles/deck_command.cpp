#include "deck_command.h"

#include "atom.h"
#include "comm.h"
#include "compat.h"
#include "error.h"
#include "input.h"
#include "update.h"
#include "variable.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <filesystem>
#include <memory>
#include <mpi.h>
#include <spawn.h>
#include <sstream>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>
#include <vector>

extern "C" void jamshape_register(void *handle);
extern char **environ;

namespace jamshape {

namespace {

namespace fs = std::filesystem;

// Texts go as x and their bytes in hex, so that no sign in them means anything on the way.
std::string in_hex(const std::string &text)
{
  const char *digits = "0123456789abcdef";
  std::string hex = "x";
  for (const unsigned char byte : text) {
    hex += digits[byte >> 4];
    hex += digits[byte & 15];
  }
  return hex;
}

std::string from_hex(const std::string &hex)
{
  std::string text;
  for (std::size_t at = 1; at + 1 < hex.size(); at += 2)
    text += static_cast<char>(std::stoi(hex.substr(at, 2), nullptr, 16));
  return text;
}

/// A Python that can import jamshape: the one that the environment names, or that of the
/// environment in which the plugin is installed, or the active one.
std::string interpreter()
{
  if (const char *named = std::getenv("JAMSHAPE_PYTHON"); named && *named) return named;
  std::vector<fs::path> homes;
  const fs::path packages = fs::path(plugin_file()).parent_path().parent_path();
  if (packages.filename() == "site-packages")
    homes.push_back(packages.parent_path().parent_path().parent_path());
  for (const char *name : {"VIRTUAL_ENV", "CONDA_PREFIX"})
    if (const char *home = std::getenv(name); home && *home) homes.emplace_back(home);
  for (const fs::path &home : homes) {
    std::error_code none;
    if (fs::exists(home / "bin" / "python", none)) return (home / "bin" / "python").string();
  }
  return "python3";
}

/// A process of Python at the other end of a socket, which is its input, its output and where it
/// complains.
class Helper {
 public:
  explicit Helper(const std::vector<std::string> &words)
  {
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends)) {
      said_ = std::strerror(errno);
      return;
    }
    socket_ = ends[0];
    std::vector<char *> arguments;
    arguments.reserve(words.size() + 1);
    for (const std::string &word : words) arguments.push_back(const_cast<char *>(word.c_str()));
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    for (const int stream : {0, 1, 2}) posix_spawn_file_actions_adddup2(&actions, ends[1], stream);
    const int failed =
        posix_spawnp(&process_, arguments[0], &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    if (failed) {
      process_ = -1;
      said_ = std::strerror(failed);
    }
  }
  Helper(const Helper &) = delete;
  Helper &operator=(const Helper &) = delete;
  ~Helper()
  {
    if (socket_ >= 0) close(socket_);
    while (process_ > 0 && waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }

  /// The next order, without the sign that tells it from complaints; empty when there are no more.
  std::string next()
  {
    for (std::string line; read_line(line);) {
      if (line[0] == '@') return line.substr(1);
      if (line.find_first_not_of(" \t") != std::string::npos) said_ = line;
    }
    return "";
  }

  void send(const std::string &line) const
  {
    const std::string whole = line + "\n";
    for (std::size_t sent = 0; sent < whole.size();) {
      const ssize_t more = ::send(socket_, whole.data() + sent, whole.size() - sent, MSG_NOSIGNAL);
      if (more < 0 && errno != EINTR) return;  // it has died, which the next line tells
      if (more > 0) sent += static_cast<std::size_t>(more);
    }
  }

  /// What it complained of last.
  const std::string &said() const { return said_; }

 private:
  bool read_line(std::string &line)
  {
    std::size_t end;
    while ((end = waiting_.find('\n')) == std::string::npos) {
      char piece[4096];
      const ssize_t got = process_ > 0 ? read(socket_, piece, sizeof piece) : 0;
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) {
        if (!waiting_.empty()) said_ = std::exchange(waiting_, "");
        return false;
      }
      waiting_.append(piece, static_cast<std::size_t>(got));
    }
    line = waiting_.substr(0, end);
    waiting_.erase(0, end + 1);
    return true;
  }

  int socket_ = -1;
  pid_t process_ = -1;
  std::string waiting_, said_;
};

/// Makes a variable of any text: in input LAMMPS would change letters that are not ASCII,
/// end the text at quotes and put values in for dollars, the last in the style `string` even here.
void set_variable(LAMMPS_NS::Variable *variables, const std::string &name, const std::string &value)
{
  std::string own = name, text = value, style = "index", away = "delete";
  char *removal[] = {own.data(), away.data()};
  char *definition[] = {own.data(), style.data(), text.data()};
  if (variables->find(own.data()) >= 0) variables->set(2, removal);
  variables->set(3, definition);
}

}  // namespace

const std::string &plugin_file()
{
  static const std::string path = [] {
    Dl_info found;
    std::error_code none;
    return dladdr(reinterpret_cast<const void *>(&plugin_file), &found)
               ? fs::absolute(found.dli_fname, none).string()
               : std::string();
  }();
  return path;
}

void tell_plugin_file(LAMMPS_NS::LAMMPS *lmp)
{
  set_variable(lmp->input->variable, "jamshape_plugin", plugin_file());
}

void DeckCommand::command(int narg, char **arg)
{
  if (narg == 0)
    error->all(FLERR, std::string("jamshape found no word, expected one such as enter: "
                                  "docs/how-to/decks.md lists them."));
  // What `clear` took away.
  if (std::string(arg[0]) == "styles") return jamshape_register(lmp);

  std::unique_ptr<Helper> helper;
  std::vector<std::string> words;
  if (comm->me == 0) {
    words = {interpreter(),
             "-P",
             "-m",
             "jamshape.lammps.deck",
             std::to_string(getpid()),
             std::to_string(atom->natoms),
             std::to_string(update->ntimestep)};
    words.insert(words.end(), arg, arg + narg);
    helper = std::make_unique<Helper>(words);
  }
  for (bool goes_on = true; goes_on;) {
    std::string order = helper ? helper->next() : "", reply;
    if (helper && order.empty())
      order = "end " + in_hex("Found no answer of " + words[0] + " to 'jamshape " + arg[0] + "' (" +
                              helper->said() +
                              "), expected a Python in which jamshape is installed: set "
                              "JAMSHAPE_PYTHON to its path.");
    goes_on = carry_out(broadcast(order), reply);
    if (helper && !reply.empty()) helper->send(reply);
  }
}

/// Carries out an order on every rank, and says whether more may follow.
bool DeckCommand::carry_out(const std::string &order, std::string &reply)
{
  std::istringstream words(order);
  std::string verb, first, second;
  words >> verb >> first >> second;
  first = from_hex(first);
  second = from_hex(second);
  if (verb == "ask") {
    // On all ranks, as the value of a formula may need them all.
    const char *value = input->variable->retrieve(first.data());
    reply = value ? in_hex(value) : "none";
  } else if (verb == "set") {
    set_variable(input->variable, first, second);
  } else if (verb == "enter") {
    enter(first);
  } else if (verb == "print") {
    print(first);
  } else if (verb == "end") {
    end(first);
  }
  return verb != "done";
}

void DeckCommand::enter(const std::string &folder)
{
  const int own = chdir(folder.c_str()) ? errno : 0;
  int worst = 0;
  MPI_Allreduce(&own, &worst, 1, MPI_INT, MPI_MAX, world);
  if (worst)
    end("Cannot enter the folder " + folder + " (" + std::strerror(worst) +
        "), expected one that all ranks reach: name another with -var out.");
}

void DeckCommand::print(const std::string &text)
{
  if (comm->me != 0) return;
  for (FILE *file : {screen, logfile})
    if (file) fprintf(file, "%s\n", text.c_str());
}

void DeckCommand::end(const std::string &sentence)
{
  print("ERROR: " + sentence);
  error->done(1);
}

/// The line of rank 0, on every rank.
std::string DeckCommand::broadcast(std::string line)
{
  int length = static_cast<int>(line.size());
  MPI_Bcast(&length, 1, MPI_INT, 0, world);
  line.resize(static_cast<std::size_t>(length));
  MPI_Bcast(line.data(), length, MPI_CHAR, 0, world);
  return line;
}

}  // namespace jamshape
