#include "guardian/kept_board.hpp"

#include <filesystem>
#include <system_error>

namespace abs_hil::guardian {

std::string kept_board(const driver::DriverOptions& options) {
  const auto canonical = [](const std::string& folder) {
    std::error_code error;
    const std::filesystem::path path = std::filesystem::weakly_canonical(folder, error);
    return error ? folder : path.string();
  };
  const auto or_only = [](const std::string& which) { return which.empty() ? std::string("the only one") : which; };
  if (options.kind == "pci") return "pci card " + or_only(options.pci.bdf) + " in " + canonical(options.pci.root);
  if (options.kind == "can") return "can node at " + options.can.interface;
  if (options.kind == "usb") {
    return "usb board " + or_only(options.usb.serial) + " of " + options.usb.manufacturer + " in " +
           canonical(options.usb.sysfs_root);
  }
  return options.kind;
}

std::unique_ptr<driver::SafeStateWriter> safe_state_writer_of(const driver::DriverOptions& options) {
  return driver::make_safe_state_writer(options);
}

}  // namespace abs_hil::guardian
