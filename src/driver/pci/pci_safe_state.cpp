// Makes an RT-DAC4/PCI safe from a second process.
#include <algorithm>
#include <string>

#include "driver/own_handle_writer.hpp"
#include "driver/pci/pci_driver.hpp"

namespace abs_hil::driver::pci {

namespace {

constexpr Pwm both[] = {Pwm::drive, Pwm::brake};

class PciSafeState final : public OwnHandleWriter<std::unique_ptr<RegisterWindow>> {
 public:
  PciSafeState(Open open_window, std::uint32_t full_width)
      : OwnHandleWriter(std::move(open_window)), full_width_(full_width) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "pci"; }
  void prepare() override {
    open_now();
    if (!handle_) refuse("the card has just been looked for, and was not there");
  }
  [[nodiscard]] bool works_beside_owner() const noexcept override { return true; }
  [[nodiscard]] bool tells_duties() const noexcept override { return true; }
  /// Stays at the card, and lets an owner in.
  void let_go() noexcept override {
    if (handle_) handle_->refuse_owners(false);
  }
  void take_hold() noexcept override {
    if (handle_) handle_->refuse_owners(true);
  }

 private:
  [[nodiscard]] IoResult write_zeros() noexcept override {
    IoResult first{};
    const auto note = [&first](const IoResult& result) {
      if (first.ok()) first = result;
    };
    if (full_width_ != 0) found_.emplace();
    for (const Pwm pwm : both) note(set_to_zero(pwm));
    for (const Pwm pwm : both) note(check_for_zero(pwm));
    return first;
  }
  /// Four accesses: index and width of each PWM. The card has no way to show a width without its index.
  [[nodiscard]] IoResult look() noexcept override {
    for (const Pwm pwm : both) {
      std::uint32_t width = 0;
      if (const IoResult shown = select(pwm, width); !shown.ok()) return shown;
      if (width == all_ones) return {IoError::disconnected, reg::pwm_width};
      if (pwm_bits(reg::pwm_width, width) != 0) return foreign_output(reg::pwm_width);
    }
    return {};
  }
  /// The width of the PWM that it selects.
  [[nodiscard]] IoResult select(Pwm pwm, std::uint32_t& width) noexcept {
    const IoResult selected = handle_->write32(reg::pwm_index, static_cast<std::uint32_t>(pwm));
    return selected.ok() ? handle_->read32(reg::pwm_width, width) : selected;
  }
  [[nodiscard]] IoResult set_to_zero(Pwm pwm) noexcept {
    const IoResult selected = handle_->write32(reg::pwm_index, static_cast<std::uint32_t>(pwm));
    if (!selected.ok()) return selected;
    std::uint32_t width = 0;
    if (full_width_ != 0 && handle_->read32(reg::pwm_width, width).ok() && width != all_ones) {
      (pwm == Pwm::drive ? found_->motor_duty : found_->brake_duty) =
          std::min(1.0, rig::duty_of(pwm_bits(reg::pwm_width, width), full_width_));
    }
    return handle_->write32(reg::pwm_width, 0);
  }
  [[nodiscard]] IoResult check_for_zero(Pwm pwm) noexcept {
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

  std::uint32_t full_width_;
};

}  // namespace

std::unique_ptr<SafeStateWriter> safe_state_writer(OpenWindow open_window, std::uint32_t full_width) {
  return std::make_unique<PciSafeState>(std::move(open_window), full_width);
}

std::unique_ptr<SafeStateWriter> safe_state_writer_of(const PciOptions& options, const RunFacts& run) {
  const auto open_card = [options, run, again = Reopening{}]() mutable -> std::unique_ptr<RegisterWindow> {
    if (!again.due()) return nullptr;
    std::string file;
    auto window = open_beside_owner(options, run.beside_guardian, &file);
    again.found(std::move(file));
    return window;
  };
  return safe_state_writer(open_card, run.beside_guardian ? full_width(pwm_mode_named(options.pwm_mode)) : 0);
}

}  // namespace abs_hil::driver::pci
