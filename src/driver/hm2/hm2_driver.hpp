#pragma once

// The driver of a HostMot2 board: its lifecycle and texts (hm2_driver.cpp), its cycle (hm2_cycle.cpp).

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/driver/backend.hpp"
#include "driver/board_kit.hpp"
#include "driver/board_options.hpp"
#include "driver/hm2/wire.hpp"

namespace abs_hil::driver::hm2 {

/// 12 bits: value/4096, so the largest duty is 4095/4096.
[[nodiscard]] OutputGrid output_grid(const Hm2Options& options) noexcept;

/// What `abs_hil doctor` says of the network to the board. Reads only.
[[nodiscard]] std::vector<Finding> inspect(const Hm2Options& options, double rate_Hz, bool chosen);
/// One in `times_us` for each answer; `asked` requests. `foreign`: packets that others sent meanwhile.
[[nodiscard]] Finding judge_round_trips(std::vector<double> times_us, int asked, int foreign);
/// What the kernel's ARP table, as text, has for the address.
[[nodiscard]] Finding judge_arp(const std::string& table, const std::string& address, const std::string& interface);

using OpenLink = std::function<std::unique_ptr<Link>()>;

inline constexpr std::uint32_t quadrature_error = 0x8000;  ///< of a counter's control register

/// Longest that making safe waits for the board's word. The watchdog has acted by then.
inline constexpr int safe_tries = 3;
inline constexpr std::int64_t safe_answer_ns = 20'000'000;
inline constexpr std::int64_t hm2_make_safe_bound_ns = safe_tries * safe_answer_ns;

/// `PWM 0, enable 0, watchdog bites now`: the datagram that drops all outputs from any sender.
[[nodiscard]] Packet safe_packet(const Board& board, const RegisterPair& pwm) noexcept;

/// The rig behind a HostMot2 board over Ethernet (docs/hm2.md). Not verified on hardware.
///
/// One cycle: `read` sends one datagram and waits for its answer; `write` sends one and does not wait. The board's
/// watchdog is petted by that one alone. The number of the last write that the board took comes with each answer: a
/// lost write is counted, and the command that acts is known. A cycle without an answer keeps the measurement before,
/// and nothing is written before status and direction have been read again.
///
/// The board ends its outputs `watchdog_ms` after the last write. Before the first write of an activation, and after
/// `rest`, this is no fault; the first write then sets the outputs up again, with duties 0. Afterwards nothing but a
/// new activation does.
class Hm2Driver final : public BoardDriver {
 public:
  /// Throws std::invalid_argument, naming the key, if an option is outside its range.
  /// @param open_link   called by `configure`; throws Unavailable
  /// @param read_clock  the clock of `now_ns`; null in virtual time, where reading takes no time
  /// @param lock_step   this driver advances the time of the board, which must be an emulator in lock-step
  Hm2Driver(const Hm2Options& options, OpenLink open_link, ReadClock read_clock = nullptr, bool lock_step = false,
            bool must_be_marked = false);
  ~Hm2Driver() override { static_cast<void>(deactivate()); }

  [[nodiscard]] std::string_view name() const noexcept override { return "hm2"; }
  [[nodiscard]] std::vector<std::string> notes() const override;
  [[nodiscard]] std::vector<std::string> tally() const override;
  [[nodiscard]] std::optional<AnswerTimes> answer_times() const override;
  [[nodiscard]] std::vector<std::string> inspection() override;
  [[nodiscard]] std::vector<std::string> traffic() const override;
  [[nodiscard]] BoardIdentity identity() const override;
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override;
  [[nodiscard]] std::int64_t make_safe_bound_ns() const noexcept override { return hm2_make_safe_bound_ns; }
  [[nodiscard]] std::string_view watched_cable() const noexcept override { return "Ethernet cable"; }
  [[nodiscard]] bool took_other_command(rig::Command& command) const noexcept override;
  [[nodiscard]] std::string_view what_holds_unsafe() const noexcept override {
    return "its watchdog drops them at most 20 ms after the last command";
  }

  /// Counts since `activate`.
  struct Counters {
    std::uint64_t cycles{0};
    std::uint64_t unanswered{0};    ///< cycles without their answer in time
    std::uint64_t writes_lost{0};   ///< the board did not take them
    std::uint64_t withheld{0};      ///< writes not sent, because status and direction were not known
    std::uint64_t stale{0};         ///< answers to earlier requests, dropped
    std::uint64_t wrong_length{0};  ///< answers that are none, dropped
    std::uint64_t not_udp{0};       ///< packets that the board got beside datagrams, such as ARP's
    std::int64_t longest_answer_ns{0};
    std::int64_t answers_ns{0};  ///< sum of their times
  };
  [[nodiscard]] const Counters& counters() const noexcept { return counters_; }
  [[nodiscard]] const Board& board() const noexcept { return board_; }

 private:
  void do_configure() override;
  void do_activate(std::int64_t now_ns) override;
  IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override;
  IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override;
  IoResult do_make_safe() noexcept override;
  IoResult do_rest() noexcept override;

  [[nodiscard]] Packet set_up_packet() const noexcept;
  void put_outputs_on(Packet& packet) const noexcept;
  /// Takes the answer to the last read, if it comes in time.
  [[nodiscard]] bool await_answer(std::int64_t deadline_ns, CycleAnswer& answer) noexcept;
  /// Asks for a cycle's answer outside the cycle.
  [[nodiscard]] bool ask_board(CycleAnswer& answer, int tries = safe_tries) noexcept;
  [[nodiscard]] IoResult silent(std::uint32_t where) const noexcept {
    return {IoError::no_answer, where, last_errno_, rig::Reason::hm2_silent};
  }
  [[nodiscard]] bool all_off(const PortWords& direction) const noexcept;
  [[nodiscard]] bool set_up_outputs(std::string& why);
  [[nodiscard]] bool outputs_at_usual_place() noexcept;
  /// True for an emulator that waits for its time; `emulated_ns_` becomes that.
  [[nodiscard]] bool waits_for_time();
  enum class Mark : std::uint8_t { none, real_time, lock_step };
  /// What an emulator carries on the wire, and no board on the market.
  [[nodiscard]] Mark mark();
  IoResult judge(const CycleAnswer& answer) noexcept;
  IoResult judge_talkers(const CycleAnswer& answer) noexcept;
  IoResult take_counts(const CycleAnswer& answer, std::int64_t time_ns) noexcept;
  [[nodiscard]] std::int32_t edge_age_ns(const CycleAnswer& answer, std::size_t wheel, bool moved,
                                         std::int64_t since_ns, std::int32_t before_ns) const noexcept;
  [[nodiscard]] std::int64_t time_of(const CycleAnswer& answer, std::int64_t sent_ns,
                                     std::int64_t received_ns) const noexcept;
  IoResult lost_answer() noexcept;
  IoResult latch(const IoResult& fault) noexcept;
  void send_safe() noexcept;
  void tell_time(std::int64_t time_ns) noexcept;

  Hm2Options options_;
  OpenLink open_link_;
  bool lock_step_;
  bool must_be_marked_;
  std::int64_t answer_timeout_ns_;
  double stamp_tick_ns_{0.0};

  std::unique_ptr<RecordedLink> link_{};
  Board board_{};
  CycleWire wire_{};
  UsedPins pins_{};

  std::uint32_t read_number_{0};
  std::uint32_t write_number_{0};
  std::uint32_t first_write_{0};             ///< number before the first write of this activation
  std::array<rig::Command, 64> commands_{};  ///< by the number of their write
  rig::Command command_{};                   ///< what the board has, as far as is known
  bool driving_{false};                      ///< a write has been sent since the activation or the rest
  bool at_rest_{false};                      ///< the outputs are off before the first write
  bool unanswered_{false};                   ///< the last read had no answer
  bool took_other_{false};                   ///< by the last answer the board has not taken what was sent last
  IoResult fault_{};
  int last_errno_{0};

  std::int64_t activated_ns_{0};  ///< in lock-step: time of `activate`, and the emulator's then
  std::int64_t emulated_ns_{0};
  std::int64_t told_ns_{0};  ///< the emulator's time now
  bool any_answer_{false};
  bool counts_udp_{false};        ///< the board counts datagrams apart from other packets
  Received received_{};           ///< at the last answer
  std::uint32_t sent_before_{0};  ///< datagrams sent before the last answer
  std::uint32_t missing_{0};      ///< of those, how many the board has not received; they may still come
  int answers_since_missing_{0};
  std::uint16_t clock_us_{0};
  std::array<std::uint32_t, 2> raw_counts_{};  ///< as CycleAnswer has them
  rig::Measurement last_{};
  LossBucket bucket_{2, 1, 20};  ///< trips at the tenth loss in a row
  Counters counters_{};
};

/// Makes the writer that drops all outputs of a HostMot2 board from a second process, through a socket of its own: one
/// datagram `PWM 0, enable 0, watchdog bites now`, then a look whether the direction of all pins is 0. The board
/// answers to each sender, so it works beside the owner; but an owner takes its datagrams for another program's.
/// @param open_link  throws Unavailable
[[nodiscard]] std::unique_ptr<SafeStateWriter> safe_state_writer(const Hm2Options& options, OpenLink open_link);

}  // namespace abs_hil::driver::hm2
