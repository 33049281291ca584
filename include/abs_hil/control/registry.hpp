#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::control {

/// One line of the table of controllers.
struct ControllerEntry {
  std::string_view name;
  std::string_view summary;  ///< for `abs_hil list`
  std::unique_ptr<SlipController> (*make)(const ControllerContext&);
};

/// The entry of a class with the constructor `Controller(const ControllerContext&)`: a line of the table, or, for a
/// controller that lives outside this library, what its own program goes on with.
template <class Controller>
[[nodiscard]] constexpr ControllerEntry controller_entry(std::string_view name, std::string_view summary) noexcept {
  return {name, summary, [](const ControllerContext& context) -> std::unique_ptr<SlipController> {
            return std::make_unique<Controller>(context);
          }};
}

/// All controllers, in the order in which `abs_hil list` shows them: ours, then those registered. The span is good
/// until the next one is registered.
[[nodiscard]] std::span<const ControllerEntry> controllers() noexcept;

/// Adds a controller that lives outside this library. Throws std::invalid_argument for an empty name or one that is
/// taken. To be called before anything else of this library is used: not thread-safe.
void register_controller(const ControllerEntry& entry);

/// Makes the controller named `name`. Throws std::invalid_argument, naming the nearest and all known ones, for an
/// unknown name, and for options that are not usable (Q not positive definite, say). Not real-time safe: called once
/// before a run.
[[nodiscard]] std::unique_ptr<SlipController> make_controller(std::string_view name, const ControllerContext& context);

}  // namespace abs_hil::control
