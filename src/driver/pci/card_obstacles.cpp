#include "driver/pci/card_obstacles.hpp"

#include <fstream>
#include <string>
#include <system_error>

#include "driver/pci/discovery.hpp"

namespace abs_hil::driver::pci {

namespace {

namespace fs = std::filesystem;

std::string first_word(const fs::path& file) {
  std::ifstream in(file);
  std::string word;
  in >> word;
  return word;
}

}  // namespace

std::vector<FoundBoard::Obstacle> port_obstacles(const fs::path& device) {
  std::vector<FoundBoard::Obstacle> found;
  const BarInfo bar = read_bar2(device);
  if (bar.bytes != 0 && (bar.unset || bar.disabled)) {
    found.push_back({std::string("its I/O ports (BAR 2) are ") + (bar.unset ? "not assigned" : "disabled") +
                         ": an access would reach other devices of this computer",
                     "shut down and put the card into another slot, or let the BIOS assign resources (\"PnP OS\" off); "
                     "lspci -vv shows region 2"});
  }
  return found;
}

bool is_locked_down(const fs::path& devices) {
  // ROOT/sys/bus/pci/devices -> ROOT/sys/kernel/security/lockdown, "none [integrity] confidentiality"
  std::ifstream in((devices / "../../../kernel/security/lockdown").lexically_normal());
  std::string line;
  std::getline(in, line);
  return line.find('[') != std::string::npos && line.find("[none]") == std::string::npos;
}

std::vector<FoundBoard::Obstacle> card_obstacles(const fs::path& device) {
  std::vector<FoundBoard::Obstacle> found = port_obstacles(device);
  if (const std::string enabled = first_word(device / "enable"); enabled.empty() || enabled == "0") {
    found.push_back({"not enabled", "echo 1 | sudo tee " + device.string() + "/enable"});
  }
  std::error_code none_bound;
  const fs::path bound = fs::read_symlink(device / "driver", none_bound);
  if (!none_bound) {
    found.push_back({"owned by the kernel driver " + bound.filename().string(),
                     "echo " + device.filename().string() + " | sudo tee " + device.string() + "/driver/unbind"});
  }
  if (is_locked_down(device.parent_path())) {
    found.push_back({"the kernel is locked down (Secure Boot) and refuses every write to I/O ports",
                     "switch Secure Boot off in the computer's firmware, or boot without lockdown=; cat "
                     "/sys/kernel/security/lockdown shows it"});
  }
  return found;
}

}  // namespace abs_hil::driver::pci
