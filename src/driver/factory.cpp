// The table of backends, which refuses an entry without a needed part, and the parts of the one that driver.kind names.
#include "driver/factory.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>

#include "driver/board_options.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver {

namespace {

/// Never destroyed: a controller may call exit() while another thread of a comparison makes settings from the table.
std::vector<Backend>& backend_table() {
  static auto& entries =
      *new std::vector<Backend>{pci::pci_backend(), can::can_backend(), usb::usb_backend(), hm2::hm2_backend()};
  return entries;
}

}  // namespace

void require_complete(std::string_view name, bool makes_driver, bool makes_writer, bool has_outputs) {
  const std::string lacks = name.empty()    ? "a name"
                            : !makes_driver ? "a function that makes its driver"
                            : !makes_writer ? "a function that makes its safe-state writer"
                            : !has_outputs  ? "a function that gives its outputs"
                                            : "";
  if (lacks.empty()) return;
  throw std::invalid_argument("backend '" + std::string(name) + "': the entry needs " + lacks +
                              " (docs/writing-a-backend.md)");
}

void register_backend(const Backend& entry) {
  if (std::ranges::find(backend_table(), entry.name, &Backend::name) != backend_table().end() || entry.name == "sim") {
    throw std::invalid_argument("a backend named '" + std::string(entry.name) +
                                "' already exists; choose another name");
  }
  backend_table().push_back(entry);
}

std::span<const Backend> registered_backends() { return backend_table(); }

std::span<const BackendKind> backend_kinds() noexcept {
  static constexpr std::array<BackendKind, 2> entries{{
      {"sim", "the simulated rig, at the level of encoder counts and duty cycles"},
      {"rig", "the real rig, behind the board that driver.kind names"},
  }};
  return entries;
}

std::string_view board_name(std::size_t index) noexcept {
  const std::span<const Backend> all = registered_backends();
  return index < all.size() ? all[index].name : std::string_view{};
}

AllBoardOptions::AllBoardOptions() {
  for (const Backend& entry : registered_backends()) boards_.emplace_back(entry.name, entry.defaults);
}

const BoardOptions* AllBoardOptions::find(std::string_view kind) const noexcept {
  for (const auto& [name, options] : boards_) {
    if (name == kind) return &options;
  }
  return nullptr;
}

void AllBoardOptions::visit_options(const std::string& prefix, const rig::OptionVisitor& visit) {
  for (auto& [name, options] : boards_) options.visit_options(prefix + std::string(name) + '.', visit);
}

bool is_known(std::string_view kind) {
  return std::ranges::find(registered_backends(), kind, &Backend::name) != registered_backends().end();
}

ChosenBackend chosen_backend(const DriverOptions& options) {
  const std::span<const Backend> all = registered_backends();
  const auto entry = std::ranges::find(all, options.kind, &Backend::name);
  const BoardOptions* board = options.boards.find(options.kind);
  if (entry != all.end() && board != nullptr) return {*entry, *board};
  std::vector<std::string> known;
  for (const Backend& other : all) known.emplace_back(other.name);
  throw Unavailable("backend rig: driver.kind = \"" + options.kind +
                    "\": this build has no driver for that board; use one of " + rig::joined(known) +
                    ", or --backend sim");
}

OutputGrid output_grid(const DriverOptions& options) {
  const ChosenBackend chosen = chosen_backend(options);
  return chosen.entry.outputs(chosen.options);
}

OutputGrid simulated_output_grid(const DriverOptions& options, bool any_brake_duty) {
  return {.duty_steps = full_width(pwm_mode_named(options.sim.pwm_mode)), .any_brake_duty = any_brake_duty};
}

std::unique_ptr<RigDriver> make_rig_driver(const DriverOptions& options, bool lock_step) {
  const ChosenBackend chosen = chosen_backend(options);
  return chosen.entry.make_driver(chosen.options, options.facts(lock_step));
}

std::unique_ptr<SafeStateWriter> make_safe_state_writer(const DriverOptions& options, bool beside_guardian) {
  const ChosenBackend chosen = chosen_backend(options);
  RunFacts facts = options.facts();
  facts.beside_guardian = beside_guardian;
  return chosen.entry.make_safe_state_writer(chosen.options, facts);
}

BoardReality reality_of(const DriverOptions& options) {
  const ChosenBackend chosen = chosen_backend(options);
  return chosen.entry.reality ? chosen.entry.reality(chosen.options) : BoardReality{};
}

std::string verification_note(const DriverOptions& options) {
  if (options.verified_on_hardware) return {};
  return "backend rig, driver.kind=" + options.kind + ": not verified on hardware. " +
         std::string(chosen_backend(options).entry.not_verified) + ", then set driver.verified_on_hardware=true";
}

}  // namespace abs_hil::driver
