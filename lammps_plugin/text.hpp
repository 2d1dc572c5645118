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

}  // namespace jamshape
