#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "driver/pwm.hpp"
#include "driver/usb/wire.hpp"

namespace abs_hil::driver::usb {

/// Longer timeout for transfers outside the cycle.
inline constexpr std::int64_t patient_ns = 500'000'000;
/// Bound of FrameLink::recover on a failing board: two seconds for what is cancelled, the kernel's 5 s for the clearing
/// of each endpoint, and four short waits for old answers.
inline constexpr std::int64_t recovery_bound_ns = 12'100'000'000;
/// Two tries with a recovery in between. Each try waits for the board to take the frame and to show it.
inline constexpr std::int64_t usb_make_safe_bound_ns = std::int64_t{2} * 2 * patient_ns + recovery_bound_ns;

using OpenBoard = std::function<Board()>;

/// The RT-DAC/USB2 with generic logic. Not verified on hardware.
///
/// `read` requests a frame and waits for it, at most `answer_timeout_us`; `write` queues a frame and does not wait. A
/// cycle without its frame counts as lost and keeps the previous measurement with its time stamp. A frame that arrives
/// after its cycle is dropped, because its time is unknown. Making safe takes up to three seconds on a failing board,
/// and longer if a stall must be cleared. The driver itself gates the motor enable, and also sets a digital line if one
/// is configured. The board has no known watchdog: it is assumed to keep its last duties when the program dies or the
/// cable is unplugged.
class UsbDriver final : public BoardDriver {
 public:
  /// Throws std::invalid_argument, naming the key, if an option is outside its range.
  /// @param open_board called by `configure`; throws Unavailable
  /// @param read_clock the clock of `now_ns`. The time stamp of the counters is the middle between request and answer.
  ///                   Null in virtual time, where reading takes no time.
  UsbDriver(const UsbOptions& options, OpenBoard open_board, ReadClock read_clock = nullptr);
  ~UsbDriver() override { static_cast<void>(deactivate()); }

  [[nodiscard]] std::string_view name() const noexcept override { return "usb"; }
  [[nodiscard]] std::vector<std::string> notes() const override;
  [[nodiscard]] std::vector<std::string> inspection() override;
  [[nodiscard]] std::vector<std::string> tally() const override;
  [[nodiscard]] BoardIdentity identity() const override;
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override;
  [[nodiscard]] std::int64_t make_safe_bound_ns() const noexcept override { return usb_make_safe_bound_ns; }
  [[nodiscard]] std::string_view what_holds_unsafe() const noexcept override {
    return "its PWMs may hold their last duties, because the board has no known watchdog";
  }
  /// Number of cycles without their frame since `activate`.
  [[nodiscard]] std::uint64_t frames_lost() const noexcept { return frames_lost_; }

 private:
  void do_configure() override;
  void do_activate(std::int64_t now_ns) override;
  IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override;
  IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override;
  IoResult do_make_safe() noexcept override;

  /// Requests a current frame and waits for it, at most `timeout_ns`. Drops a late frame first.
  IoResult fresh_frame(std::int64_t timeout_ns, Contents& contents) noexcept;
  IoResult lost_frame() noexcept;
  /// Adds the reason to a failure, and sends the safe frame without waiting. Only for frames that show other outputs
  /// than those sent it waits for one more frame, at most `answer_timeout_us`, to tell why.
  IoResult failed(const IoResult& result) noexcept;
  [[nodiscard]] IoResult checked(const Contents& contents) const noexcept;
  void put_command(std::uint32_t drive_width, std::uint32_t brake_width, bool enable) noexcept;
  IoResult send_safe() noexcept;
  IoResult take_over(Contents& contents) noexcept;

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
  std::uint64_t frames_lost_{0};
};

/// Makes the writer of an RT-DAC/USB2's safe state after its owner's end; only one process can claim the board. It
/// sends zeros whether or not the board answers, and verifies them afterwards. A frame sets all words of the board:
/// those that are not of the rig come from a frame that the board has shown. If it shows none, its digital lines become
/// inputs.
[[nodiscard]] std::unique_ptr<SafeStateWriter> safe_state_writer(const UsbOptions& options, OpenBoard open_board);

}  // namespace abs_hil::driver::usb
