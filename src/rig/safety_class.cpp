// Judges whether a value weakens a limit, by the class of its option's row.
#include "abs_hil/rig/option.hpp"

namespace abs_hil::rig {

bool SafetyClass::weakened_by(double value) const noexcept {
  switch (kind) {
    case Kind::above: return value > bound;
    case Kind::below: return value < bound;
    case Kind::unless: return value != bound;
    default: return false;
  }
}

bool SafetyClass::weakened_by(std::string_view value) const noexcept {
  return (kind == Kind::unless && value != text) || (kind == Kind::text && value == text);
}

}  // namespace abs_hil::rig
