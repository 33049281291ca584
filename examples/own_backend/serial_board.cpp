// The board on a serial line: its options, its driver, its safe-state writer and its entry in the registry.
#include "serial_board.hpp"

#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>

#include "serial_line.hpp"

namespace serial_board {

namespace {

using namespace abs_hil::driver;
namespace rig = abs_hil::rig;

/// The rows are the keys driver.serial.*, with their checks, lists and files.
struct SerialOptions {
  ABS_HIL_OPTIONS(SerialOptions);
  ABS_HIL_OPTION(std::string, port, "/dev/ttyACM0", .meaning = "the board's serial line");
  ABS_HIL_OPTION(std::int32_t, answer_timeout_ms, 8, .unit = "ms", .meaning = "longest wait for an answer",
                 .range = rig::between(1, 1000));
  ABS_HIL_OPTION(double, motor_duty_max, 1.0, .meaning = "largest drive PWM that is sent", .range = rig::positive(1));
  ABS_HIL_OPTION(double, brake_duty_max, 0.7, .meaning = "largest brake PWM that is sent", .range = rig::positive(1));
};

constexpr std::uint32_t full_width = 255;  // analogWrite takes 8 bits

OutputGrid outputs_of(const SerialOptions& options) {
  return {.duty_steps = full_width, .motor_duty_max = options.motor_duty_max, .brake_duty_max = options.brake_duty_max};
}

IoResult result_of(LineError error) noexcept {
  switch (error) {
    case LineError::none: return {};
    case LineError::silent: return {IoError::no_answer};
    case LineError::garbled: return {IoError::implausible_answer};
    case LineError::gone: return {IoError::disconnected};
  }
  return {IoError::disconnected};
}

SerialLine open_line(const std::string& port) try { return SerialLine(port); } catch (const std::system_error& error) {
  throw Unavailable("backend rig: serial line " + std::string(error.what()) +
                    " (driver.serial.port); plug the board in, join the group dialout");
}

class SerialDriver final : public RigDriver {
 public:
  explicit SerialDriver(const SerialOptions& options) : options_(options), grid_(outputs_of(options)) {}
  ~SerialDriver() override { static_cast<void>(deactivate()); }

  [[nodiscard]] std::string_view name() const noexcept override { return "serial"; }
  [[nodiscard]] rig::Command as_sent(const rig::Command& command) const noexcept override {
    return grid_.as_sent(command);
  }
  [[nodiscard]] std::vector<std::string> notes() const override { return {"serial line " + options_.port}; }
  [[nodiscard]] BoardIdentity identity() const override { return {.place = serial_, .logic = firmware_}; }
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override {
    State state;
    if (line_.ask_state(state, options_.answer_timeout_ms) != LineError::none) return false;
    applied = {.motor_duty = rig::duty_of(state.drive_width, full_width),
               .brake_duty = rig::duty_of(state.brake_width, full_width)};
    return true;
  }

 private:
  /// Opens the line and asks the board who it is: "abs-serial FIRMWARE SERIAL". Changes no output.
  void do_configure() override {
    line_ = open_line(options_.port);
    line_.drain();
    std::string_view answer;
    if (line_.send("?\n", 2) != LineError::none || line_.receive(answer, patient_ms) != LineError::none ||
        !answer.starts_with(greeting)) {
      throw Unavailable("backend rig: " + options_.port + ": no board answers; check its firmware and its bit rate");
    }
    const std::string words(answer.substr(greeting.size()));
    firmware_ = "firmware " + words.substr(0, words.find(' '));
    serial_ = words.substr(words.find(' ') + 1);
  }
  /// Zeros first, then the counters.
  void do_activate(std::int64_t /*now_ns*/) override {
    if (const IoResult zero = do_make_safe(); !zero.ok()) {
      throw Unavailable("backend rig: " + options_.port + ": taking over the outputs failed: " + error_text(zero));
    }
    if (line_.ask_state(start_, patient_ms) != LineError::none) {
      throw Unavailable("backend rig: " + options_.port + ": it does not answer");
    }
  }
  IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override {
    State state;
    const LineError error = line_.ask_state(state, options_.answer_timeout_ms);
    if (error != LineError::none) return result_of(error);
    // `set` has seen these widths in the board's answer. Zeros are its own watchdog; another value is not from here.
    const auto foreign = [](std::uint32_t shown, std::uint32_t sent) { return shown != sent && shown != 0; };
    if (foreign(state.drive_width, drive_sent_) || foreign(state.brake_width, brake_sent_)) {
      return {IoError::foreign_writer, 0, 0, rig::Reason::foreign_writer};
    }
    measurement = {};
    measurement.time_ns = now_ns;
    measurement.upper_counts = state.upper_counts - start_.upper_counts;
    measurement.lower_counts = state.lower_counts - start_.lower_counts;
    return {};
  }
  IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
    const IoResult result = set(grid_.motor_width(command), grid_.brake_width(command), options_.answer_timeout_ms);
    if (result.ok()) sent = grid_.as_sent(command);
    return result;
  }
  IoResult do_make_safe() noexcept override {
    if (!line_.is_open()) return {IoError::disconnected};
    return set(0, 0, patient_ms);
  }
  /// The answer must show what was sent.
  IoResult set(std::uint32_t drive, std::uint32_t brake, int timeout_ms) noexcept {
    State state;
    const LineError error = line_.set_widths(drive, brake, state, timeout_ms);
    if (error != LineError::none) return result_of(error);
    drive_sent_ = drive;
    brake_sent_ = brake;
    return state.drive_width == drive && state.brake_width == brake ? IoResult{}
                                                                    : IoResult{IoError::read_back_mismatch};
  }

  static constexpr std::string_view greeting = "abs-serial ";
  static constexpr int patient_ms = 200;
  SerialOptions options_;
  OutputGrid grid_;
  SerialLine line_{};
  std::string firmware_{};
  std::string serial_{};
  State start_{};
  std::uint32_t drive_sent_{0};
  std::uint32_t brake_sent_{0};
};

/// The guardian's way to the board: its own descriptor, nothing of the driver's. It sends zeros before it looks for an
/// answer.
class SerialSafeState final : public SafeStateWriter {
 public:
  explicit SerialSafeState(std::string port) : port_(std::move(port)) {}
  [[nodiscard]] std::string_view name() const noexcept override { return "serial"; }
  void prepare() override { line_ = open_line(port_); }
  [[nodiscard]] IoResult make_safe() noexcept override {
    if (!line_.is_open()) {
      try {
        line_ = open_line(port_);
      } catch (...) {
        return {IoError::disconnected};
      }
    }
    // The owner may have died within a line, and its answers may still come.
    constexpr std::string_view end_and_zero = "\nw 0 0\n";
    LineError error = line_.send(end_and_zero.data(), end_and_zero.size());
    line_.drain();
    constexpr int patient_ms = 20;
    State state;
    if (error == LineError::none) error = line_.set_widths(0, 0, state, patient_ms);
    if (error == LineError::gone) line_ = {};
    if (error != LineError::none) return result_of(error);
    return state.drive_width == 0 && state.brake_width == 0 ? IoResult{} : IoResult{IoError::read_back_mismatch};
  }

 private:
  std::string port_;
  SerialLine line_{};
};

std::unique_ptr<RigDriver> make_driver(const SerialOptions& options, const RunFacts& run) {
  if (run.lock_step)
    throw std::invalid_argument("driver.kind = serial: this board keeps its own time; leave out --fast");
  return std::make_unique<SerialDriver>(options);
}

std::unique_ptr<SafeStateWriter> make_writer(const SerialOptions& options, const RunFacts& /*run*/) {
  return std::make_unique<SerialSafeState>(options.port);
}

/// For `abs_hil doctor` and `abs_hil safe`.
std::vector<FoundBoard> find(const SerialOptions& options) {
  if (!std::filesystem::exists(options.port)) return {};
  return {{.what = "serial board at " + options.port, .files = {options.port}}};
}

}  // namespace

Backend serial_backend() {
  return backend<SerialOptions>({.name = "serial",
                                 .summary = "a board on a serial line; the example of docs/writing-a-backend.md",
                                 .not_verified = "This is an example. Do your own checks with abs_hil commission",
                                 .make_driver = make_driver,
                                 .make_safe_state_writer = make_writer,
                                 .outputs = outputs_of,
                                 .find = find,
                                 .free_options = {"port", "answer_timeout_ms"}});
}

}  // namespace serial_board
