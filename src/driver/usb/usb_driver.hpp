#pragma once

#include <cstdint>
#include <functional>

#include "driver/board_options.hpp"
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
///
/// Throws std::invalid_argument, naming the key, if an option is outside its range.
/// @param open_board called by `configure`; throws Unavailable
/// @param read_clock the clock of `now_ns`. The time stamp of the counters is the middle between request and answer.
///                   Null in virtual time, where reading takes no time.
[[nodiscard]] std::unique_ptr<RigDriver> usb_driver(const UsbOptions& options, OpenBoard open_board,
                                                    BoardDriver::ReadClock read_clock = nullptr);

/// Makes the writer of an RT-DAC/USB2's safe state after its owner's end; only one process can claim the board. It
/// sends zeros whether or not the board answers, and verifies them afterwards. A frame sets all words of the board:
/// those that are not of the rig come from a frame that the board has shown. If it shows none, its digital lines become
/// inputs.
[[nodiscard]] std::unique_ptr<SafeStateWriter> safe_state_writer(const UsbOptions& options, OpenBoard open_board);

}  // namespace abs_hil::driver::usb
