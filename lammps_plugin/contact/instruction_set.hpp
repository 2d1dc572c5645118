#pragma once

#include <cstdlib>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace jamshape {

/// Instruction sets that packs are compiled for; `scalar` uses no packs.
enum class InstructionSet { scalar, baseline, avx2, avx512 };

struct NamedSet {
  InstructionSet set;
  const char *name;
};
inline constexpr NamedSet INSTRUCTION_SETS[] = {{InstructionSet::scalar, "scalar"},
                                                {InstructionSet::baseline, "baseline"},
                                                {InstructionSet::avx2, "avx2"},
                                                {InstructionSet::avx512, "avx512"}};

inline bool machine_has(InstructionSet set)
{
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (set == InstructionSet::avx2) {
    return __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  }
  if (set == InstructionSet::avx512) {
    return __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512dq") != 0;
  }
#endif
  return set != InstructionSet::avx2 && set != InstructionSet::avx512;
}

/// The set that the environment variable JAMSHAPE_SIMD names, or the best of this machine if it is
/// unset; nothing if the name is unknown or not supported here.
inline std::optional<InstructionSet> instruction_set()
{
  const char *const wish = std::getenv("JAMSHAPE_SIMD");
  std::optional<InstructionSet> best;
  for (const NamedSet &known : INSTRUCTION_SETS) {
    if (machine_has(known.set) && (wish == nullptr || wish == std::string(known.name))) {
      best = known.set;
    }
  }
  return best;
}

/// Names of the sets of this machine, for messages.
inline std::string known_sets()
{
  std::string names = "no value";
  for (const NamedSet &known : INSTRUCTION_SETS) {
    if (machine_has(known.set)) names += std::string(" or ") + known.name;
  }
  return names;
}

/// The set to use; throws std::invalid_argument if JAMSHAPE_SIMD names none of this machine.
inline InstructionSet required_instruction_set()
{
  const auto chosen = instruction_set();
  if (chosen) return *chosen;
  throw std::invalid_argument(std::string("found JAMSHAPE_SIMD=") + std::getenv("JAMSHAPE_SIMD") +
                              ", expected " + known_sets() + ".");
}

/// Selects from functions compiled once per set, `of_set(set)`, the one that this machine supports;
/// none if pairs are evaluated one by one.
template <class OfSet>
auto compiled_for(InstructionSet set, const OfSet &of_set)
    -> decltype(of_set(std::integral_constant<InstructionSet, InstructionSet::baseline>()))
{
  if (set == InstructionSet::scalar) return nullptr;
#if defined(__x86_64__)
  if (set == InstructionSet::avx2) {
    return of_set(std::integral_constant<InstructionSet, InstructionSet::avx2>());
  }
  if (set == InstructionSet::avx512) {
    return of_set(std::integral_constant<InstructionSet, InstructionSet::avx512>());
  }
#endif
  return of_set(std::integral_constant<InstructionSet, InstructionSet::baseline>());
}

}  // namespace jamshape
