#include "driver/pci/pci_safe_state.hpp"

#include <algorithm>

#include "driver/pci/discovery.hpp"
#include "driver/pci/register_map.hpp"
#include "driver/pwm.hpp"
#include "driver/reopening.hpp"

namespace abs_hil::driver::pci {

namespace {

constexpr Pwm both[] = {Pwm::drive, Pwm::brake};

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
  window_ = open_window_();
  if (!window_) throw Unavailable("backend rig: the card has just been looked for, and was not there");
}

IoResult PciSafeState::open_again() noexcept {
  window_.reset();
  try {
    window_ = open_window_();
    return window_ ? IoResult{} : IoResult{IoError::disconnected};
  } catch (...) {
    return {IoError::disconnected};
  }
}

IoResult PciSafeState::verify_safe() noexcept {
  bool zero = window_ != nullptr;
  bool foreign = false;
  for (const Pwm pwm : both) {
    std::uint32_t width = 0;
    zero = zero && window_->write32(reg::pwm_index, static_cast<std::uint32_t>(pwm)).ok() &&
           window_->read32(reg::pwm_width, width).ok() && pwm_bits(reg::pwm_width, width) == 0;
    foreign = foreign || (width != all_ones && pwm_bits(reg::pwm_width, width) != 0);
  }
  if (zero) return {};
  const IoResult made_safe = make_safe();
  return foreign ? IoResult{IoError::foreign_writer, reg::pwm_width, 0, rig::Reason::foreign_writer} : made_safe;
}

double PciSafeState::look() noexcept {
  std::uint32_t width = 0;
  if (!window_->read32(reg::pwm_width, width).ok() || width == all_ones) return 0.0;
  return std::min(1.0, rig::duty_of(pwm_bits(reg::pwm_width, width), full_width_));
}

IoResult PciSafeState::set_to_zero(Pwm pwm) noexcept {
  if (const IoResult result = window_->write32(reg::pwm_index, static_cast<std::uint32_t>(pwm)); !result.ok()) {
    return result;
  }
  if (full_width_ != 0) (pwm == Pwm::drive ? found_->motor_duty : found_->brake_duty) = look();
  return window_->write32(reg::pwm_width, 0);
}

IoResult PciSafeState::make_safe() noexcept {
  found_.reset();
  if (!window_) {
    if (const IoResult opened = open_again(); !opened.ok()) return opened;
  }
  IoResult first{};
  const auto note = [&first](const IoResult& result) {
    if (first.ok()) first = result;
  };
  if (full_width_ != 0) found_.emplace();
  for (const Pwm pwm : both) note(set_to_zero(pwm));
  for (const Pwm pwm : both) note(check_for_zero(*window_, pwm));
  if (first.error == IoError::disconnected) window_.reset();
  return first;
}

}  // namespace abs_hil::driver::pci
