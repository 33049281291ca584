// The lifecycle of every driver: nothing reaches the board outside activation, and failures end safe.
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "catch.hpp"
#include "driver/board_options.hpp"
#include "driver/factory.hpp"
#include "driver/hm2/hm2_driver.hpp"

using namespace abs_hil::driver;
using abs_hil::rig::Command;
using abs_hil::rig::Measurement;

namespace {

/// Records what reached the board, and fails on request.
class ScriptedDriver final : public RigDriver {
 public:
  ~ScriptedDriver() override { static_cast<void>(deactivate()); }
  [[nodiscard]] std::string_view name() const noexcept override { return "scripted"; }

  std::vector<std::string> calls;
  IoError write_error{IoError::none};
  IoError read_error{IoError::none};
  IoError safe_error{IoError::none};
  bool absent{false};

 private:
  void do_configure() override {
    calls.emplace_back("configure");
    if (absent) throw Unavailable("not there");
  }
  void do_activate(std::int64_t /*now_ns*/) override {
    calls.emplace_back("activate");
    if (absent) throw Unavailable("not there");
  }
  IoResult do_read(std::int64_t now_ns, Measurement& measurement) noexcept override {
    calls.emplace_back("read");
    measurement.time_ns = now_ns;
    return {read_error};
  }
  IoResult do_write(const Command& command, Command& sent) noexcept override {
    sent = as_sent(command);
    calls.emplace_back("write");
    return {write_error, 0x40U, 5};
  }
  IoResult do_make_safe() noexcept override {
    calls.emplace_back("safe");
    return {safe_error};
  }
};

using Calls = std::vector<std::string>;

}  // namespace

TEST_CASE("Nothing reaches the board outside activate ... deactivate") {
  ScriptedDriver driver;
  Measurement measurement;
  CHECK(driver.state() == DriverState::unconfigured);
  CHECK(driver.write({}).error == IoError::not_active);
  CHECK(driver.read(0, measurement).error == IoError::not_active);
  CHECK_THROWS_AS(driver.activate(0), Unavailable);
  CHECK(driver.deactivate().ok());
  CHECK(driver.calls.empty());

  driver.configure();
  CHECK(driver.state() == DriverState::inactive);
  CHECK(driver.write({}).error == IoError::not_active);
  CHECK(driver.read(0, measurement).error == IoError::not_active);
  CHECK(driver.calls == Calls{"configure"});

  driver.activate(0);
  CHECK(driver.state() == DriverState::active);
  CHECK(driver.read(7, measurement).ok());
  CHECK(measurement.time_ns == 7);
  CHECK(driver.write({}).ok());
  CHECK(driver.deactivate().ok());
  CHECK(driver.state() == DriverState::inactive);
  CHECK(driver.write({}).error == IoError::not_active);
  CHECK(driver.calls == Calls{"configure", "activate", "read", "write", "safe"});

  driver.activate(0);
  CHECK(driver.state() == DriverState::active);
}

TEST_CASE("A failed write makes the outputs safe before it returns, and latches") {
  ScriptedDriver driver;
  driver.configure();
  driver.activate(0);
  driver.calls.clear();
  driver.write_error = IoError::read_back_mismatch;
  driver.safe_error = IoError::disconnected;
  const IoResult result = driver.write({});
  CHECK(result.error == IoError::read_back_mismatch);  // the first error, not that of making safe
  CHECK(result.where == 0x40U);
  CHECK(result.errno_value == 5);
  CHECK(driver.state() == DriverState::failed);
  CHECK(driver.calls == Calls{"write", "safe"});

  driver.write_error = IoError::none;
  CHECK(driver.write({}).error == IoError::not_active);
  Measurement measurement;
  CHECK(driver.read(1, measurement).error == IoError::not_active);
  CHECK_THROWS_AS(driver.activate(2), Unavailable);
  CHECK(driver.calls == Calls{"write", "safe"});

  CHECK(driver.deactivate().error == IoError::disconnected);
  CHECK(driver.state() == DriverState::failed);  // deactivate alone does not lead out
  driver.safe_error = IoError::none;
  driver.configure();
  CHECK(driver.state() == DriverState::inactive);
  driver.activate(3);
  CHECK(driver.write({}).ok());
}

TEST_CASE("The listener is called before the outputs are made safe, after a failed write and at the end") {
  ScriptedDriver driver;
  struct Listener final : MakingSafeListener {
    explicit Listener(std::vector<std::string>& calls) : calls_(calls) {}
    void making_safe() noexcept override { calls_.emplace_back("told"); }
    std::vector<std::string>& calls_;
  } listener(driver.calls);
  driver.tell_before_making_safe(&listener);
  driver.configure();
  driver.activate(0);
  driver.write_error = IoError::no_answer;
  static_cast<void>(driver.write({}));
  static_cast<void>(driver.deactivate());
  CHECK(driver.calls == std::vector<std::string>{"configure", "activate", "write", "told", "safe", "told", "safe"});
  driver.tell_before_making_safe(nullptr);
  static_cast<void>(driver.deactivate());
  CHECK(driver.calls.back() == "safe");
  CHECK(driver.calls.size() == 8);
}

TEST_CASE("A failed read reports its error and leaves the outputs to the caller's next write") {
  ScriptedDriver driver;
  driver.configure();
  driver.activate(0);
  driver.read_error = IoError::no_answer;
  Measurement measurement;
  CHECK(driver.read(1, measurement).error == IoError::no_answer);
  CHECK(driver.state() == DriverState::active);
}

TEST_CASE("A missing board leaves the driver neither configured nor active") {
  ScriptedDriver driver;
  driver.absent = true;
  CHECK_THROWS_AS(driver.configure(), Unavailable);
  CHECK(driver.state() == DriverState::unconfigured);
  driver.absent = false;
  driver.configure();
  driver.absent = true;
  CHECK_THROWS_AS(driver.activate(0), Unavailable);
  CHECK(driver.state() == DriverState::inactive);
  CHECK(driver.write({}).error == IoError::not_active);
}

TEST_CASE("Configuring an active driver makes it safe first") {
  ScriptedDriver driver;
  driver.configure();
  driver.activate(0);
  driver.calls.clear();
  driver.configure();
  CHECK(driver.calls == Calls{"safe", "configure"});
  CHECK(driver.state() == DriverState::inactive);
}

TEST_CASE("Every I/O error has its own text") {
  std::vector<std::string_view> seen;
  for (int i = 0; i <= static_cast<int>(IoError::command_out_of_range); ++i) {
    const std::string_view words = description(static_cast<IoError>(i));
    CHECK(words != "unknown error");
    for (const std::string_view other : seen) CHECK(words != other);
    seen.push_back(words);
  }
}

TEST_CASE("The grid of the options is the grid of the driver that they make") {
  for (const Backend& board : registered_backends()) {
    for (const char* mode : {"8-bit", "12-bit"}) {
      DriverOptions options{.kind = std::string(board.name)};
      auto& pci = options.boards.of<pci::PciOptions>();
      auto& usb = options.boards.of<usb::UsbOptions>();
      pci.pwm_mode = usb.pwm_mode = mode;
      pci.brake_duty_max = usb.brake_duty_max = options.boards.of<can::CanOptions>().brake_duty_max =
          options.boards.of<hm2::Hm2Options>().brake_duty_max = 0.61;
      const auto driver = make_rig_driver(options);
      const OutputGrid grid = output_grid(options);
      CAPTURE(board.name, mode, grid.duty_steps);
      for (double duty = 0.0; duty <= 1.0; duty += 0.01) {
        const Command command{.motor_duty = duty, .brake_duty = duty, .motor_enable = true};
        CHECK(driver->as_sent(command).motor_duty == grid.as_sent(command).motor_duty);
        CHECK(driver->as_sent(command).brake_duty == grid.as_sent(command).brake_duty);
        CHECK(driver->as_sent(command).brake_duty <= 0.61);
      }
      if (board.name == "can" || board.name == "hm2") continue;
      CHECK(grid.duty_steps == (std::string(mode) == "8-bit" ? 255U : 4095U));
    }
  }
  CHECK_THROWS_AS(output_grid({.kind = "other"}), Unavailable);
}
