// Makes an FMU's model by its kind; its variables as text, with their checks.
#include "interchange/fmu/model.hpp"

#include <array>
#include <charconv>
#include <stdexcept>
#include <type_traits>

#include "abs_hil/rig/option_check.hpp"
#include "interchange/fmu/models.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::interchange::fmu {

std::unique_ptr<Model> make_model(std::string_view kind) {
  if (kind == plant_kind) return std::make_unique<PlantModel>();
  if (kind == controller_kind) return std::make_unique<ControllerModel>();
  return nullptr;
}

std::string token_of(std::string_view kind, const Model& model) {
  std::string names;
  for (const Variable& variable : model.variables()) {
    names += variable.name + std::to_string(variable.value.index()) + ',' +
             std::to_string(static_cast<int>(variable.causality)) + ';';
  }
  std::array<char, 17> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), rig::hash_of(names), 16).ptr;
  return "abs_hil-" + std::string(kind) + '-' + std::string(digits.data(), end);
}

std::string text_of(const Variable& variable) {
  return std::visit(
      [](const auto* value) -> std::string {
        using Value = std::remove_cvref_t<decltype(*value)>;
        if constexpr (std::is_same_v<Value, std::string>) {
          return *value;
        } else if constexpr (std::is_same_v<Value, bool>) {
          return *value ? "true" : "false";
        } else {
          std::array<char, 40> digits{};
          return {digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), *value).ptr};
        }
      },
      variable.value);
}

void set_text(const Variable& variable, const std::string& text) {
  std::visit(
      [&](auto* value) {
        using Value = std::remove_cvref_t<decltype(*value)>;
        if constexpr (std::is_same_v<Value, std::string>) {
          *value = text;
        } else if constexpr (std::is_same_v<Value, bool>) {
          *value = text == "true";
        } else {
          const auto number = rig::parse_number<Value>(text);
          if (!number) throw std::invalid_argument(variable.name + ": '" + text + "' is not a number");
          *value = *number;
        }
      },
      variable.value);
}

void check(const Variable& variable) {
  if (variable.causality == Causality::output) return;
  std::visit(
      [&](const auto* value) {
        using Value = std::remove_cvref_t<decltype(*value)>;
        if constexpr (std::is_same_v<Value, std::string>) {
          rig::require_valid(variable.name, variable.facts, std::string_view(*value));
        } else if constexpr (!std::is_same_v<Value, bool>) {
          rig::require_valid(variable.name, variable.facts, static_cast<double>(*value));
        }
      },
      variable.value);
}

}  // namespace abs_hil::interchange::fmu
