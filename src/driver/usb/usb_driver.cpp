// The driver's lifecycle and cycle, its entry in the registry, and what it tells people.

#include "driver/usb/usb_driver.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "abs_hil/rig/time_units.hpp"
#include "driver/file_descriptor.hpp"
#include "driver/monotonic_time.hpp"
#include "driver/own_handle_writer.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::usb {

using rig::formatted;

namespace {

rig::Reason reason_for(IoError error) noexcept {
  switch (error) {
    case IoError::disconnected: return rig::Reason::usb_unplugged;
    case IoError::stalled: return rig::Reason::usb_stalled;
    case IoError::incomplete_answer: return rig::Reason::usb_short_frame;
    case IoError::no_answer: return rig::Reason::usb_no_answer;
    case IoError::implausible_answer: return rig::Reason::usb_not_a_frame;
    case IoError::read_back_mismatch: return rig::Reason::usb_outputs_not_taken;
    case IoError::transfer_failed: return rig::Reason::usb_transfer_failed;
    default: return rig::Reason::none;
  }
}

IoResult with_reason(IoResult result) noexcept {
  if (!result.ok()) result.reason = reason_for(result.error);
  return result;
}

class UsbDriver final : public BoardDriver {
 public:
  UsbDriver(const UsbOptions& options, OpenBoard open_board, ReadClock read_clock)
      : BoardDriver(pwm_grid(options), read_clock),
        options_(options),
        mode_(pwm_mode_named(options.pwm_mode)),
        open_board_(std::move(open_board)) {
    check_options("driver.usb.", options);
  }
  ~UsbDriver() override { static_cast<void>(deactivate()); }

  [[nodiscard]] std::string_view name() const noexcept override { return "usb"; }
  [[nodiscard]] std::vector<std::string> notes() const override {
    if (!board_.link) return {};
    std::vector<std::string> notes;
    notes.push_back("USB board " + board_.place + ": opened and claimed");
    notes.push_back(formatted("version word 0x%04x (%s), channel counts %04x %04x %04x", identity_[word::version],
                              options_.version >= 0 ? "as configured" : "not compared: driver.usb.version is not set",
                              identity_[word::channel_counts], identity_[word::channel_counts + 1],
                              identity_[word::channel_counts + 2]));
    const auto prescaler = static_cast<std::uint32_t>(options_.pwm_prescaler);
    notes.push_back(formatted(
        "PWM %d drive, %d brake, %s, prescaler %u: %.4g Hz if its clock is that of the PCI board; drive duty at "
        "most %.3g, brake duty at most %.3g",
        options_.drive_pwm, options_.brake_pwm, options_.pwm_mode.c_str(), prescaler,
        pwm_frequency_Hz(mode_, prescaler), options_.motor_duty_max, options_.brake_duty_max));
    notes.push_back(
        options_.verify_outputs
            ? "every frame must show the PWM words that were sent"
            : "the driver does not check the PWM words in the frames (driver.usb.verify_outputs=false): the "
              "safe state is sent and accepted, but not verified");
    notes.push_back(
        formatted("a cycle waits at most %d us for its frame; supply, temperature and interlocks are not known",
                  options_.answer_timeout_us));
    notes.emplace_back(
        "the board has no known watchdog: if this program dies or the cable is unplugged, the PWMs are assumed to hold "
        "their duties: press the E-stop");
    return notes;
  }
  [[nodiscard]] std::vector<std::string> inspection() override {
    if (!board_.link) return {};
    std::span<const std::uint8_t> bytes;
    const IoResult result = fresh_answer(*board_.link, patient_ns, bytes);
    if (!result.ok()) return {"no frame: " + error_text(result)};
    std::vector<std::string> lines;
    for (const WordGroup& group : words()) {
      if (group.name == "-") continue;
      std::string line = formatted("%3zu  %-21s", group.first, std::string(group.name).c_str());
      constexpr std::size_t most_shown = 16;
      for (std::size_t i = 0; i < group.count && i < most_shown; ++i) {
        line += formatted("%04x ", word_at(bytes, group.first + i));
      }
      if (group.count > most_shown) line += "... ";
      line +=
          formatted(" %s, %s", std::string(name_of(group.standing)).c_str(), std::string(name_of(group.use)).c_str());
      if (!group.open.empty()) line += "; not known: " + std::string(group.open);
      lines.push_back(std::move(line));
    }
    return lines;
  }
  [[nodiscard]] std::vector<std::string> tally() const override {
    return {formatted("USB board: %llu cycles without their frame", static_cast<unsigned long long>(frames_lost_))};
  }
  [[nodiscard]] BoardIdentity identity() const override {
    if (!board_.link) return {};
    return {.place = board_.serial, .logic = "version " + std::to_string(identity_[word::version])};
  }
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override {
    if (!board_.link) return false;
    Contents contents;
    const IoResult read = fresh_frame(patient_ns, contents);
    if (!read.ok() && read.error != IoError::read_back_mismatch) return false;
    applied = command_shown(contents.drive[2], contents.brake[2], grid_.duty_steps);
    return options_.verify_outputs;
  }
  [[nodiscard]] std::int64_t make_safe_bound_ns() const noexcept override { return usb_make_safe_bound_ns; }
  [[nodiscard]] std::string_view what_holds_unsafe() const noexcept override {
    return "its PWMs may hold their last duties, because the board has no known watchdog";
  }

 private:
  void do_configure() override {
    board_ = {};  // releases the board if this driver has claimed it
    board_ = open_board_();
    const auto refuse = [this](const std::string& what) {
      const std::string text = "backend rig: USB board " + board_.place + ": " + what + "; no output was written";
      board_ = {};
      throw Unavailable(text);
    };
    std::span<const std::uint8_t> bytes;
    const IoResult result = fresh_answer(*board_.link, patient_ns, bytes);
    if (!result.ok()) refuse("its first frame did not come: " + error_text(result));
    Contents contents;
    if (decode(bytes, options_, contents) != IoError::none) {
      refuse("its first frame has " + std::to_string(bytes.size()) + " bytes, not " + std::to_string(frame_bytes) +
             ": it is another device, or it has another logic");
    }
    std::copy(bytes.begin(), bytes.end(), shown_.begin());
    identity_ = contents.identity;
    if (options_.version >= 0 && identity_[word::version] != options_.version) {
      refuse("version word " + std::to_string(identity_[word::version]) + " is not the configured " +
             std::to_string(options_.version) +
             " (driver.usb.version): another logic has other frames. Load the right logic or correct the key");
    }
  }
  void do_activate(std::int64_t now_ns) override {
    frame_ = frame_from(shown_);
    bucket_.reset();
    frames_lost_ = 0;
    lost_this_cycle_ = false;
    command_sent_ = {};
    IoResult result{};
    if (board_.time) result = board_.time->start(now_ns);
    if (result.ok()) result = take_over(zero_);
    if (!result.ok()) {
      static_cast<void>(do_make_safe());
      std::string text =
          "backend rig: USB board " + board_.place + ": taking over the outputs failed: " + error_text(result);
      if (result.error == IoError::read_back_mismatch) {
        text +=
            ". Its frames do not show the PWM words that were sent. It is not known whether the real board shows them. "
            "If yours does not, set driver.usb.verify_outputs=false; the safe state is then sent but never verified";
      }
      throw Unavailable(text);
    }
    last_ = {};
    last_.time_ns = now_ns;
  }
  IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override {
    lost_this_cycle_ = false;
    if (board_.time) {
      const IoResult result = board_.time->follow(now_ns);
      if (!result.ok()) return with_reason(result);
    }
    Contents contents{.read_ns = now_ns};
    IoResult result = fresh_frame(options_.answer_timeout_us * rig::ns_per_us, contents);
    if (result.error == IoError::no_answer) {
      measurement = last_;
      lost_this_cycle_ = true;
      return lost_frame();
    }
    if (!result.ok()) return failed(result);
    const std::int32_t upper = with_sign(contents.upper_raw - zero_.upper_raw, options_.upper_sign);
    const std::int32_t lower = with_sign(contents.lower_raw - zero_.lower_raw, options_.lower_sign);
    const std::int64_t elapsed_ns = contents.read_ns - last_.time_ns;
    if (!plausible_travel(last_.upper_counts, upper, elapsed_ns, options_) ||
        !plausible_travel(last_.lower_counts, lower, elapsed_ns, options_)) {
      return failed({IoError::implausible_answer, endpoint_in});
    }
    bucket_.good();
    last_.time_ns = contents.read_ns;
    last_.upper_counts = upper;
    last_.lower_counts = lower;
    measurement = last_;  // the generic logic has no values of supply, temperature and interlocks
    return {};
  }
  IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
    if (!in_range(command)) return {IoError::command_out_of_range};
    const OutputWords sent_before = sent_;
    put_command(grid_.motor_width(command), grid_.brake_width(command), command.motor_enable);
    const IoResult result = board_.link->send(frame_);
    if (result.error != IoError::no_answer) {
      sent = command_sent_ = grid_.as_sent(command);
      return with_reason(result);
    }
    sent = command_sent_;
    sent_ = sent_before;
    // Count a cycle only once. Without a read, only this would find a board that takes no frames.
    return std::exchange(lost_this_cycle_, false) ? IoResult{} : lost_frame();
  }
  IoResult do_make_safe() noexcept override {
    if (!board_.link) return {IoError::disconnected};
    IoResult result = send_safe();
    if (result.ok() || result.error == IoError::disconnected) return with_reason(result);
    board_.link->recover();
    return with_reason(send_safe());
  }

  /// Requests a current frame and waits for it, at most `timeout_ns`. Drops a late frame first.
  IoResult fresh_frame(std::int64_t timeout_ns, Contents& contents) noexcept {
    FrameLink& link = *board_.link;
    std::span<const std::uint8_t> bytes;
    const std::int64_t deadline_ns = clock_ns(0) + timeout_ns;
    if (link.answer_outstanding()) {
      if (const IoResult late = link.receive(timeout_ns, bytes); !late.ok()) return late;
    }
    const std::int64_t asked_ns = clock_ns(contents.read_ns);
    if (const IoResult result = link.request(); !result.ok()) return result;
    const std::int64_t left_ns = deadline_ns - clock_ns(0);
    if (const IoResult result = link.receive(left_ns > 0 ? left_ns : 0, bytes); !result.ok()) return result;
    contents.read_ns = asked_ns + (clock_ns(asked_ns) - asked_ns) / 2;
    if (const IoError error = decode(bytes, options_, contents); error != IoError::none) return {error, endpoint_in};
    return checked(contents);
  }
  IoResult lost_frame() noexcept {
    ++frames_lost_;
    bucket_.lost();
    if (!bucket_.tripped()) return {};
    return failed({IoError::no_answer, endpoint_in});
  }
  /// Adds the reason to a failure, and sends the safe frame without waiting. Only for frames that show other outputs
  /// than those sent it waits for one more frame, at most `answer_timeout_us`, to tell why.
  IoResult failed(const IoResult& result) noexcept {
    put_command(0, 0, false);
    if (board_.link->send(frame_).ok()) command_sent_ = rig::safe_command;
    if (result.error != IoError::read_back_mismatch) return with_reason(result);
    // A board that shows the zeros takes what is sent: what it showed before, something else had sent.
    Contents contents;
    const bool takes_zeros = fresh_frame(options_.answer_timeout_us * rig::ns_per_us, contents).ok();
    return takes_zeros ? IoResult{IoError::foreign_writer, endpoint_in, 0, rig::Reason::foreign_writer}
                       : with_reason(result);
  }
  [[nodiscard]] IoResult checked(const Contents& contents) const noexcept {
    if (contents.identity != identity_) return {IoError::implausible_answer, endpoint_in};
    if (!options_.verify_outputs) return {};
    return shows(contents, sent_, options_) ? IoResult{} : IoResult{IoError::read_back_mismatch, endpoint_in};
  }
  void put_command(std::uint32_t drive_width, std::uint32_t brake_width, bool enable) noexcept {
    sent_ = put_outputs(frame_, options_, drive_width, brake_width, enable);
  }
  IoResult send_safe() noexcept {
    put_command(0, 0, false);
    IoResult result = board_.link->send(frame_);
    if (result.ok()) result = board_.link->flush(patient_ns);
    if (!result.ok() || !options_.verify_outputs) return result;
    Contents contents;
    return fresh_frame(patient_ns, contents);
  }
  IoResult take_over(Contents& contents) noexcept {
    // First set the widths to 0 with the old mode and prescaler: changing these could turn an old width into a pulse.
    for (const std::int32_t channel : {options_.drive_pwm, options_.brake_pwm}) {
      put_payload(frame_, word::pwm + pwm_words * static_cast<std::size_t>(channel) + 2, 0);
    }
    IoResult result = board_.link->send(frame_);
    if (result.ok()) result = board_.link->flush(patient_ns);
    if (result.ok()) result = send_safe();
    if (result.ok()) result = fresh_frame(patient_ns, contents);
    return result;
  }

  UsbOptions options_;
  PwmMode mode_;
  OpenBoard open_board_;
  Board board_{};

  std::array<std::uint16_t, identity_words> identity_{};
  Frame shown_{};                ///< the board's frame at `configure`
  Frame frame_{};                ///< the frame sent last
  OutputWords sent_{};           ///< what the board's frames must show
  rig::Command command_sent_{};  ///< the command of the frame sent last

  Contents zero_{};  ///< the counters at `activate`
  rig::Measurement last_{};
  LossBucket bucket_{2, 1, 10};  ///< trips at the fifth loss in a row
  bool lost_this_cycle_{false};
  std::uint64_t frames_lost_{0};  ///< since `activate`
};

std::unique_ptr<RigDriver> make_usb_driver(const UsbOptions& options, const RunFacts& run) {
  UsbOptions usb = options;
  usb.encoder_counts_per_rev = run.encoder_counts_per_rev;
  return usb_driver(
      usb, [usb, run] { return open_board(usb, run.lock_step, run.emulated); }, run.lock_step ? nullptr : monotonic_ns);
}

std::unique_ptr<SafeStateWriter> make_usb_writer(const UsbOptions& options, const RunFacts& /*run*/) {
  return safe_state_writer(options, [options, again = Reopening{}]() mutable {
    if (!again.due()) return Board{};
    Board board = open_board(options, false, false);  // zeros are for any board
    again.found(options.sysfs_root + '/' + board.address);
    return board;
  });
}

/// A cycle must not wait for an answer longer than its period.
void refuse_slow_answers(const UsbOptions& options, const RunFacts& run) {
  if (run.lock_step || options.answer_timeout_us * run.rate_Hz < 1e6) return;
  throw std::invalid_argument("driver.usb.answer_timeout_us = " + std::to_string(options.answer_timeout_us) +
                              ": a cycle must not wait longer than its period; give a value below " +
                              std::to_string(std::llround(1e6 / run.rate_Hz)) + " or a lower control.rate_Hz");
}

std::vector<FoundBoard> survey_boards(const UsbOptions& options) {
  std::vector<FoundBoard> found;
  for (const UsbDevice& device : find_boards(options)) {
    FoundBoard board{
        .what = "RT-DAC/USB2 " + device.text(),
        .detail = "\"" + device.manufacturer + "\", \"" + device.product + "\"; this driver is unverified on hardware"};
    if (!device.serial.empty()) board.selection.push_back("driver.usb.serial=" + device.serial);
    board.files.push_back(device.node.string());
    if (!can_be_opened(device.node)) {
      board.obstacles.push_back(
          {device.node.string() + " not accessible to this user",
           "put this line into /etc/udev/rules.d/70-abs-hil.rules and plug the board in again (docs/usb.md):\n" +
               udev_rule(device)});
    }
    found.push_back(std::move(board));
  }
  return found;
}

}  // namespace

std::unique_ptr<RigDriver> usb_driver(const UsbOptions& options, OpenBoard open_board,
                                      BoardDriver::ReadClock read_clock) {
  return std::make_unique<UsbDriver>(options, std::move(open_board), read_clock);
}

Backend usb_backend() {
  return backend<UsbOptions>({
      .name = "usb",
      .summary = "RT-DAC/USB2 with generic logic; unverified on hardware",
      .not_verified =
          "The frame format comes from the maker's documents and has been tested only with an emulator. The board has "
          "no known watchdog. Do the checks of docs/usb.md and docs/rig-setup.md with abs_hil commission",
      .make_driver = make_usb_driver,
      .make_safe_state_writer = make_usb_writer,
      .outputs = pwm_grid<UsbOptions>,
      .reality = usb_reality,
      .find = survey_boards,
      .check = refuse_slow_answers,
      .free_options = {"sysfs_root", "device_root", "vendor_id", "product_id", "manufacturer", "serial", "version",
                       "answer_timeout_us", "plausible_speed_rad_s"},
  });
}

}  // namespace abs_hil::driver::usb
