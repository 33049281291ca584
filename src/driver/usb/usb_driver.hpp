#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/driver/pwm.hpp"
#include "abs_hil/driver/rig_driver.hpp"
#include "driver/loss_bucket.hpp"
#include "driver/usb/frame.hpp"
#include "driver/usb/frame_link.hpp"
#include "driver/usb/options.hpp"

namespace abs_hil::driver::usb {

/// The RT-DAC/USB2 with generic logic. Not verified on hardware.
///
/// `read` asks for a frame and waits for it, `answer_timeout_us` at most; `write` queues one and waits for nothing. A
/// cycle without its frame keeps the measurement of the one before, old stamp and all, and counts as lost. An answer
/// that comes after its cycle is dropped: of when it is nobody knows. Making safe takes up to three seconds on a board
/// that fails, and longer where a stall must be cleared. The motor enable is this driver's own gate, and a digital line
/// where one is configured. There is no known watchdog: the board is assumed to go on with its last duties when the
/// program dies or the cable goes.
class UsbDriver final : public RigDriver {
 public:
  using OpenBoard = std::function<Board()>;
  using ReadClock = std::int64_t (*)() noexcept;
  /// Throws std::invalid_argument, naming the key, if an option is outside its range.
  /// @param open_board called by `configure`; throws Unavailable
  /// @param read_clock the clock that `now_ns` comes from: counters are stamped with the middle between request and
  ///                   answer. None in virtual time, where reading takes none.
  UsbDriver(const UsbOptions& options, OpenBoard open_board, ReadClock read_clock = nullptr);
  ~UsbDriver() override;

  [[nodiscard]] std::string_view name() const noexcept override { return "usb"; }
  [[nodiscard]] std::vector<std::string> notes() const override;
  [[nodiscard]] std::vector<std::string> inspection() override;
  [[nodiscard]] std::vector<std::string> tally() const override;
  [[nodiscard]] std::int64_t make_safe_bound_ns() const noexcept override;
  [[nodiscard]] std::string_view what_holds_unsafe() const noexcept override {
    return "its PWMs may hold their last duties, as no watchdog of the board is known";
  }
  /// Cycles without their frame since `activate`.
  [[nodiscard]] std::uint64_t frames_lost() const noexcept { return frames_lost_; }

 private:
  void do_configure() override;
  void do_activate(std::int64_t now_ns) override;
  IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override;
  IoResult do_write(const rig::Command& command) noexcept override;
  IoResult do_make_safe() noexcept override;

  [[nodiscard]] std::int64_t clock_ns(std::int64_t otherwise) const noexcept;
  /// A frame of this moment, waited for until `timeout_ns` from now; one that is late is dropped first.
  IoResult fresh_frame(std::int64_t timeout_ns, Contents& contents, std::int64_t& read_ns) noexcept;
  IoResult lost_frame() noexcept;
  /// The failure with its reason, the safe frame on its way without waiting for it.
  IoResult failed(const IoResult& result) noexcept;
  [[nodiscard]] IoResult checked(const Contents& contents) const noexcept;
  void take_counts(const Contents& contents, std::array<std::int32_t, 2>& counts) const noexcept;
  void put_command(std::uint32_t drive_width, std::uint32_t brake_width, bool enable) noexcept;
  IoResult send_safe() noexcept;
  IoResult take_over(Contents& contents) noexcept;

  UsbOptions options_;
  PwmMode mode_;
  OpenBoard open_board_;
  ReadClock read_clock_;
  Board board_{};

  std::array<std::uint16_t, identity_words> identity_{};
  Frame shown_{};          ///< the frame that the board gave when it was configured
  Frame frame_{};          ///< to the board, as it was sent last
  PwmWords drive_sent_{};  ///< what a frame must show
  PwmWords brake_sent_{};
  std::uint16_t digital_sent_{0};

  std::int64_t activated_ns_{0};  ///< time of `activate`
  std::int64_t emulated_ns_{0};   ///< the emulator's time then
  Contents zero_{};               ///< counters then
  rig::Measurement last_{};
  LossBucket bucket_{2, 1, 10};  ///< the fifth loss in a row trips it
  bool lost_this_cycle_{false};
  std::uint64_t frames_lost_{0};
};

}  // namespace abs_hil::driver::usb
