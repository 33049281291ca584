#pragma once

#include <cstdint>

#include "abs_hil/driver/io_result.hpp"
#include "driver/board_kit.hpp"

namespace abs_hil::driver::pci {

/// The 32-bit registers of one card, by byte offset from the start of its BAR. Real-time safe: no exception, allocation
/// or lock; each access takes as long as the bus.
class RegisterWindow {
 public:
  RegisterWindow() = default;
  RegisterWindow(const RegisterWindow&) = delete;
  RegisterWindow& operator=(const RegisterWindow&) = delete;
  virtual ~RegisterWindow() = default;

  /// `value` does not change on error. `IoResult::where` is the offset.
  virtual IoResult read32(std::uint32_t offset, std::uint32_t& value) noexcept = 0;
  virtual IoResult write32(std::uint32_t offset, std::uint32_t value) noexcept = 0;
  /// Of a guardian's window: whether new owners are refused.
  virtual void refuse_owners(bool /*refuse*/) noexcept {}
};

using driver::EmulatedTime;

}  // namespace abs_hil::driver::pci
