// The order of a driver's life: configure, activate, read and write, safe, deactivate.
#include "abs_hil/driver/rig_driver.hpp"

#include <array>
#include <cstdio>
#include <cstring>

namespace abs_hil::driver {

std::string error_text(const IoResult& result) {
  std::array<char, 16> place{};
  std::snprintf(place.data(), place.size(), " at 0x%x", result.where);
  std::string text = std::string(description(result.error)) + place.data();
  if (result.errno_value != 0) text += std::string(": ") + std::strerror(result.errno_value);
  return text;
}

void RigDriver::configure() {
  static_cast<void>(deactivate());
  state_ = DriverState::unconfigured;
  do_configure();
  state_ = DriverState::inactive;
}

void RigDriver::activate(std::int64_t now_ns) {
  if (state_ == DriverState::active) return;
  if (state_ != DriverState::inactive) {
    throw Unavailable(std::string(name()) + ": activate() needs a configured driver; call configure() first");
  }
  do_activate(now_ns);
  state_ = DriverState::active;
}

IoResult RigDriver::read(std::int64_t now_ns, rig::Measurement& measurement) noexcept {
  if (state_ != DriverState::active) return {IoError::not_active};
  return do_read(now_ns, measurement);
}

rig::Command RigDriver::as_sent(const rig::Command& command) const noexcept {
  rig::Command sent = command;
  if (!command.motor_enable) sent.motor_duty = 0.0;
  return sent;
}

IoResult RigDriver::write(const rig::Command& command, rig::Command& sent) noexcept {
  sent = rig::safe_command;
  if (state_ != DriverState::active) return {IoError::not_active};
  const IoResult result = do_write(command, sent);
  if (!result.ok()) {
    sent = rig::safe_command;
    state_ = DriverState::failed;
    // The first error is the one to report, even when making safe fails as well.
    static_cast<void>(make_safe());
  }
  return result;
}

IoResult RigDriver::make_safe() noexcept {
  if (listener_ != nullptr) listener_->making_safe();
  return do_make_safe();
}

IoResult RigDriver::deactivate() noexcept {
  if (state_ != DriverState::active && state_ != DriverState::failed) return {};
  const IoResult result = make_safe();
  if (state_ == DriverState::active) state_ = DriverState::inactive;
  return result;
}

}  // namespace abs_hil::driver
