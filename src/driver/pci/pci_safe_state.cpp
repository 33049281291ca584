#include "driver/pci/pci_safe_state.hpp"

#include "driver/pci/discovery.hpp"
#include "driver/pci/register_map.hpp"

namespace abs_hil::driver::pci {

namespace {

constexpr Pwm both[] = {Pwm::drive, Pwm::brake};

IoResult set_to_zero(RegisterWindow& window, Pwm pwm) noexcept {
  if (const IoResult result = window.write32(reg::pwm_index, static_cast<std::uint32_t>(pwm)); !result.ok()) {
    return result;
  }
  return window.write32(reg::pwm_width, 0);
}

IoResult check_for_zero(RegisterWindow& window, Pwm pwm) noexcept {
  const auto index = static_cast<std::uint32_t>(pwm);
  if (const IoResult result = window.write32(reg::pwm_index, index); !result.ok()) return result;
  std::uint32_t index_read = 0;
  std::uint32_t width = 0;
  if (const IoResult result = window.read32(reg::pwm_width, width); !result.ok()) return result;
  // Read the index as well: if another process changed it, the width belonged to another PWM.
  if (const IoResult result = window.read32(reg::pwm_index, index_read); !result.ok()) return result;
  if (width == all_ones || index_read == all_ones) return {IoError::disconnected, reg::pwm_width};
  if (pwm_bits(reg::pwm_index, index_read) != index) return {IoError::read_back_mismatch, reg::pwm_index};
  return pwm_bits(reg::pwm_width, width) == 0 ? IoResult{} : IoResult{IoError::read_back_mismatch, reg::pwm_width};
}

}  // namespace

PciSafeState::PciSafeState(const PciOptions& options, bool beside_guardian)
    : PciSafeState([options, beside_guardian] { return open_beside_owner(options, beside_guardian); }) {}

void PciSafeState::prepare() { window_ = open_window_(); }

IoResult PciSafeState::open_again() noexcept {
  window_.reset();
  try {
    window_ = open_window_();
    return {};
  } catch (...) {
    return {IoError::disconnected};
  }
}

IoResult PciSafeState::make_safe() noexcept {
  if (!window_) {
    if (const IoResult opened = open_again(); !opened.ok()) return opened;
  }
  IoResult first{};
  const auto note = [&first](const IoResult& result) {
    if (first.ok()) first = result;
  };
  for (const Pwm pwm : both) note(set_to_zero(*window_, pwm));
  for (const Pwm pwm : both) note(check_for_zero(*window_, pwm));
  if (first.error == IoError::disconnected) window_.reset();
  return first;
}

}  // namespace abs_hil::driver::pci
