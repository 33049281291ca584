// The table of backends; it refuses an entry that lacks a driver, a safe-state writer or limits.
#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "abs_hil/driver/backend.hpp"
#include "driver/board_options.hpp"

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

}  // namespace abs_hil::driver
