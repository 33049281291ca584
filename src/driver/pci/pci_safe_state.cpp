// Makes an RT-DAC4/PCI safe from a second process.
#include "driver/pci/pci_safe_state.hpp"

#include <algorithm>
#include <string>

#include "driver/pci/discovery.hpp"
#include "driver/pwm.hpp"

namespace abs_hil::driver::pci {

namespace {

constexpr Pwm both[] = {Pwm::drive, Pwm::brake};

}  // namespace

PciSafeState::PciSafeState(const PciOptions& options, bool beside_guardian)
    : PciSafeState(
          [options, beside_guardian, again = Reopening{}]() mutable -> std::unique_ptr<RegisterWindow> {
            if (!again.due()) return nullptr;
            std::string file;
            auto window = open_beside_owner(options, beside_guardian, &file);
            again.found(std::move(file));
            return window;
          },
          beside_guardian ? full_width(pwm_mode_named(options.pwm_mode)) : 0) {}

void PciSafeState::prepare() {
  open_now();
  if (!handle_) refuse("the card has just been looked for, and was not there");
}

IoResult PciSafeState::select(Pwm pwm, std::uint32_t& width) noexcept {
  const IoResult selected = handle_->write32(reg::pwm_index, static_cast<std::uint32_t>(pwm));
  return selected.ok() ? handle_->read32(reg::pwm_width, width) : selected;
}

IoResult PciSafeState::look() noexcept {
  for (const Pwm pwm : both) {
    std::uint32_t width = 0;
    if (const IoResult shown = select(pwm, width); !shown.ok()) return shown;
    if (width == all_ones) return {IoError::disconnected, reg::pwm_width};
    if (pwm_bits(reg::pwm_width, width) != 0) return foreign_output(reg::pwm_width);
  }
  return {};
}

IoResult PciSafeState::set_to_zero(Pwm pwm) noexcept {
  const IoResult selected = handle_->write32(reg::pwm_index, static_cast<std::uint32_t>(pwm));
  if (!selected.ok()) return selected;
  std::uint32_t width = 0;
  if (full_width_ != 0 && handle_->read32(reg::pwm_width, width).ok() && width != all_ones) {
    (pwm == Pwm::drive ? found_->motor_duty : found_->brake_duty) =
        std::min(1.0, rig::duty_of(pwm_bits(reg::pwm_width, width), full_width_));
  }
  return handle_->write32(reg::pwm_width, 0);
}

IoResult PciSafeState::check_for_zero(Pwm pwm) noexcept {
  std::uint32_t width = 0;
  std::uint32_t index = 0;
  if (const IoResult result = select(pwm, width); !result.ok()) return result;
  // Read the index as well: if another process changed it, the width belonged to another PWM.
  if (const IoResult result = handle_->read32(reg::pwm_index, index); !result.ok()) return result;
  if (width == all_ones || index == all_ones) return {IoError::disconnected, reg::pwm_width};
  if (pwm_bits(reg::pwm_index, index) != static_cast<std::uint32_t>(pwm)) {
    return {IoError::read_back_mismatch, reg::pwm_index};
  }
  return pwm_bits(reg::pwm_width, width) == 0 ? IoResult{} : IoResult{IoError::read_back_mismatch, reg::pwm_width};
}

IoResult PciSafeState::write_zeros() noexcept {
  IoResult first{};
  const auto note = [&first](const IoResult& result) {
    if (first.ok()) first = result;
  };
  if (full_width_ != 0) found_.emplace();
  for (const Pwm pwm : both) note(set_to_zero(pwm));
  for (const Pwm pwm : both) note(check_for_zero(pwm));
  return first;
}

}  // namespace abs_hil::driver::pci
