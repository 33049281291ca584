#pragma once

#include <cerrno>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "driver/pci/pci_driver.hpp"
#include "emulator/card_model.hpp"

namespace abs_hil::test {

struct RegisterAccess {
  bool is_write{false};
  std::uint32_t offset{0};
  std::uint32_t value{0};
  friend bool operator==(const RegisterAccess&, const RegisterAccess&) = default;
};

/// The emulated card in this process: no files, no clock but the driver's.
struct ModelCard {
  explicit ModelCard(const emulator::BoardOptions& options = {}) : model(options), faulty(model, 1) {}

  /// Opens the card for the driver; the model must outlive it.
  [[nodiscard]] driver::pci::OpenCard opener();
  /// The accesses since the last call.
  std::vector<RegisterAccess> take_traffic() { return std::exchange(traffic, {}); }

  emulator::CardModel model;
  emulator::FaultyCard faulty;
  std::vector<RegisterAccess> traffic{};
  bool unplugged{false};
  std::optional<std::uint32_t> misread_next{};  ///< the next reading of this offset has a wrong bit
  std::function<void()> after_access{};         ///< what something else does meanwhile
};

class ModelWindow final : public driver::pci::RegisterWindow {
 public:
  explicit ModelWindow(ModelCard& card) : card_(card) {}
  driver::IoResult read32(std::uint32_t offset, std::uint32_t& value) noexcept override {
    if (card_.unplugged) return {driver::IoError::disconnected, offset, ENODEV};
    const emulator::AccessResult result = card_.faulty.read32(offset);
    if (result.failed) return {driver::IoError::disconnected, offset, EIO};
    value = result.value;
    if (card_.misread_next == offset) {
      value ^= 1U;
      card_.misread_next.reset();
    }
    card_.traffic.push_back({false, offset, value});
    if (card_.after_access) card_.after_access();
    return {};
  }
  driver::IoResult write32(std::uint32_t offset, std::uint32_t value) noexcept override {
    if (card_.unplugged) return {driver::IoError::disconnected, offset, ENODEV};
    card_.traffic.push_back({true, offset, value});
    if (card_.faulty.write32(offset, value).failed) return {driver::IoError::disconnected, offset, EIO};
    if (card_.after_access) card_.after_access();
    return {};
  }

 private:
  ModelCard& card_;
};

class ModelTime final : public driver::EmulatedTime {
 public:
  explicit ModelTime(ModelCard& card) : card_(card) {}
  driver::IoResult now(std::int64_t& time_ns) noexcept override {
    time_ns = card_.model.time_ns();
    return {};
  }
  driver::IoResult advance_to(std::int64_t time_ns) noexcept override {
    card_.model.advance_to(time_ns);
    return {};
  }

 private:
  ModelCard& card_;
};

inline driver::pci::OpenCard ModelCard::opener() {
  return [this] {
    driver::pci::Card card{.place = "0000:03:00.0 in this process"};
    card.window = std::make_unique<ModelWindow>(*this);
    card.time = std::make_unique<ModelTime>(*this);
    return card;
  };
}

}  // namespace abs_hil::test
