#pragma once

#include <sstream>
#include <string>

namespace jamshape {

/// A number for a sentence, with six digits wherever they are: std::to_string says 0.000000 of
/// 1e-7.
inline std::string shown(double number)
{
  std::ostringstream text;
  text << number;
  return text.str();
}

/// The words of a command, as they were given.
inline std::string joined(int n_words, const char *const *words)
{
  std::string text;
  for (int k = 0; k < n_words; ++k) text += std::string(k == 0 ? "" : " ") + words[k];
  return text;
}

}  // namespace jamshape
