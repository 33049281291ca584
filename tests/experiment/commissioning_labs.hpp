#pragma once

// Rigs for the tests of commissioning, each with its person and guard: one on the emulated card, one on a board whose
// answers the test decides.

#include <algorithm>
#include <functional>
#include <string>

#include "catch.hpp"
#include "commissioning_people.hpp"
#include "driver/pci/model_card.hpp"
#include "experiment/commissioning.hpp"

namespace abs_hil::experiment::test {

using abs_hil::test::ModelCard;

struct Lab {
  explicit Lab(const driver::pci::PciOptions& options = {})
      : own(driver::pci::pci_driver(options, card.opener())), driver(*own) {
    person.turn = [this](bool upper) { card.model.turn_by_hand(upper, 1.0); };
    person.take_time = [this] { clock.sleep_until(clock.now_ns() + 2'000'000'000); };
    // Nothing may act while a question stands.
    person.before_answer = [this] {
      CHECK(card.model.outputs().drive_duty == 0.0);
      CHECK(card.model.outputs().brake_duty == 0.0);
    };
  }
  CommissioningResult run() {
    return experiment::Commissioning(driver, clock, person, guard, {}, [this] { return stop; }).run();
  }

  ModelCard card{};
  std::unique_ptr<driver::RigDriver> own;
  driver::RigDriver& driver;
  runtime::VirtualClock clock{};
  Person person{};
  Guard guard{card};
  bool stop{false};
};

/// A board of another kind: counters, and what comes of reading, writing and making safe.
class OtherBoard final : public driver::RigDriver {
 public:
  explicit OtherBoard(std::string_view kind) : kind_(kind) {}
  [[nodiscard]] std::string_view name() const noexcept override { return kind_; }
  rig::Measurement counters{};
  int lost_answers{0};  ///< so many readings repeat the one before
  std::function<driver::IoResult()> on_read{[] { return driver::IoResult{}; }};
  std::function<driver::IoResult(const rig::Command&)> on_write{[](const rig::Command&) { return driver::IoResult{}; }};
  driver::IoResult made_safe{};
  std::function<bool(rig::Command&)> on_outputs{[](rig::Command&) { return false; }};
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override { return on_outputs(applied); }
  std::string_view cable{};
  [[nodiscard]] std::string_view watched_cable() const noexcept override { return cable; }
  int rests{0};

 private:
  void do_configure() override {}
  void do_activate(std::int64_t /*now_ns*/) override {}
  driver::IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override {
    const driver::IoResult result = on_read();
    if (lost_answers > 0 && lost_answers-- > 0) {
      measurement = last_;
      return result;
    }
    measurement = last_ = counters;
    measurement.time_ns = last_.time_ns = now_ns;
    return result;
  }
  driver::IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
    sent = as_sent(command);
    return on_write(command);
  }
  driver::IoResult do_make_safe() noexcept override { return made_safe; }
  driver::IoResult do_rest() noexcept override {
    ++rests;
    return {};
  }

  std::string_view kind_;
  rig::Measurement last_{};
};

/// A rig on such a board that does what it should: each test lets one thing go wrong.
struct OtherLab {
  OtherLab() {
    person.turn = [this](bool upper) { (upper ? board.counters.upper_counts : board.counters.lower_counts) += 4096; };
    board.on_write = [this](const rig::Command& command) {
      if (command.motor_duty > 0.0) ++board.counters.lower_counts;
      return driver::IoResult{};
    };
  }
  CommissioningResult run() {
    return experiment::Commissioning(board, clock, person, guard, options, [this] { return stop; }).run();
  }

  OtherBoard board{"usb"};
  ModelCard unused{};
  Guard guard{unused};
  runtime::VirtualClock clock{};
  Person person{};
  experiment::CommissioningOptions options{};
  bool stop{false};
};

inline double largest_width(const ModelCard& card) {
  double most = 0.0;
  for (const auto& access : card.traffic) {
    if (access.is_write && access.offset == 0x6C) most = std::max(most, static_cast<double>(access.value) / 4095.0);
  }
  return most;
}

}  // namespace abs_hil::experiment::test
