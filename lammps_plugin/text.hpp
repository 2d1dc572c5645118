#pragma once

#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <string>

namespace jamshape {

/// A number for a message, with six significant digits; std::to_string gives 0.000000 for 1e-7.
inline std::string shown(double number)
{
  std::ostringstream text;
  text << number;
  return text.str();
}

/// The shortest text that reads back as the same number.
inline std::string exactly(double number)
{
  char text[32];
  for (int digits = 6; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, number);
    if (std::strtod(text, nullptr) == number) break;
  }
  return text;
}

/// The arguments of a command, as given.
inline std::string joined(int n_words, const char *const *words)
{
  std::string text;
  for (int k = 0; k < n_words; ++k) text += std::string(k == 0 ? "" : " ") + words[k];
  return text;
}

}  // namespace jamshape
