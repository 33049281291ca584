#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/option_box.hpp"

namespace abs_hil::control {

/// One line of the table of controllers.
struct ControllerEntry {
  std::string_view name;
  std::string_view summary;  ///< for `abs_hil list`
  std::unique_ptr<SlipController> (*make)(const ControllerContext&);
  rig::OptionBox (*own_options)(){nullptr};  ///< defaults of the options that it brings; null: it brings none
};

/// A controller that brings its options: `Controller::Options`, a struct of option rows (abs_hil/rig/option.hpp).
template <class Controller>
concept BringsOptions = requires {
  typename Controller::Options;
} && std::is_constructible_v<Controller, const ControllerContext&, const typename Controller::Options&>;

/// Makes the table's entry for a class with the constructor `Controller(const ControllerContext&)`, or for one that
/// brings options with `Controller(const ControllerContext&, const Options&)`. Their keys are `control.NAME.OPTION`,
/// with `_` for each `-` of the name; no two controllers share a type of options. Programs outside this library use it
/// for their own controllers.
template <class Controller>
[[nodiscard]] constexpr ControllerEntry controller_entry(std::string_view name, std::string_view summary) noexcept {
  if constexpr (BringsOptions<Controller>) {
    using Options = typename Controller::Options;
    return {name, summary,
            [](const ControllerContext& context) -> std::unique_ptr<SlipController> {
              return std::make_unique<Controller>(context, context.options.own.template get<Options>());
            },
            [] { return rig::OptionBox::of(Options{}); }};
  } else {
    return {name, summary, [](const ControllerContext& context) -> std::unique_ptr<SlipController> {
              return std::make_unique<Controller>(context);
            }};
  }
}

/// All controllers, in the order of `abs_hil list`: those of this library, then the registered ones. The span is valid
/// until the next registration.
[[nodiscard]] std::span<const ControllerEntry> controllers() noexcept;

/// Adds a controller from outside this library. Throws std::invalid_argument if the name is empty or already exists.
/// Call it before any other use of this library: it is not thread-safe.
void register_controller(const ControllerEntry& entry);

/// Controllers that come from files: the registry makes them for a name that ends in `ending`.
struct ControllerFiles {
  std::string_view ending;  ///< with its dot
  /// Throws std::invalid_argument, which names the file, if it holds no usable controller.
  std::unique_ptr<SlipController> (*make)(const std::string& file, const ControllerContext& context);
};

/// Lets controllers come from files. The ending must be one of those in the row of `control.controller`. Throws and is
/// called as `register_controller`.
void register_controller_files(const ControllerFiles& files);

/// True for the name of a file that may hold a controller.
[[nodiscard]] bool is_controller_file(std::string_view name) noexcept;

/// Makes the controller named `name`. Throws std::invalid_argument for an unknown name, with the nearest and all known
/// names, and for invalid options (such as a Q that is not positive definite). Not real-time safe: call it before a
/// run.
[[nodiscard]] std::unique_ptr<SlipController> make_controller(std::string_view name, const ControllerContext& context);

/// Part of the keys' names that holds the options of a controller, such as "control.sliding_mode.".
[[nodiscard]] std::string section_of(std::string_view controller);

/// The key of the slip reference, which may change in every run.
inline constexpr std::string_view slip_ref_key = "control.slip_ref";

/// True if the option `key` may change while the controller runs: the slip reference, and the controller's gains but
/// for the start values of its estimates.
[[nodiscard]] bool changes_in_a_run(std::string_view key, const rig::OptionFacts& facts, std::string_view controller);

}  // namespace abs_hil::control
