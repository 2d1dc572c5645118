#pragma once

#include <type_traits>

namespace jamshape {

/// Passes a dimension known at run time as a compile-time constant: `in_dimension(d, [&](auto D) {
/// return f<D>(x); })`.
template <class Visit> auto in_dimension(int dimension, const Visit &visit)
{
  return dimension == 2 ? visit(std::integral_constant<int, 2>())
                        : visit(std::integral_constant<int, 3>());
}

}  // namespace jamshape
