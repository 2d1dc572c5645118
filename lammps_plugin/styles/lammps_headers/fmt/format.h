#pragma once

// Debian's liblammps-dev includes this header and ships none. Only names that LAMMPS's own
// declarations mention are here; nothing of it may be called (build a std::string instead).

namespace fmt {
inline namespace v7_lmp {
template <typename Char> class basic_string_view;
using string_view = basic_string_view<char>;
class format_args;
template <typename... Args, typename S> format_args make_args_checked(const S &, const Args &...);
}  // namespace v7_lmp
}  // namespace fmt
