#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/rig/reason.hpp"
#include "driver/file_descriptor.hpp"
#include "guardian/shared_region.hpp"

namespace abs_hil::guardian {

/// What a guard did for one run. A plain value: it travels between processes.
struct GuardianReport {
  rig::Reason reason{rig::Reason::none};  ///< `none`: the run ended in order and the guard was dismissed
  bool acted{false};                      ///< the guard wrote the safe state
  bool verified{false};                   ///< it read the safe state back
  bool controller_lives{false};           ///< the controller was left alive: it drives nothing any more
  bool ended_controller{false};           ///< the guard ended the controller
  bool released{false};                   ///< a person ended the guard's tries
  driver::IoResult last_error{};          ///< error of the last failed try
  int tries{0};                           ///< number of attempts to write the safe state
  std::int64_t silence_ns{0};             ///< time without a heartbeat when the guard decided to act
  std::int64_t noticed_ns{0};             ///< when the guard decided to act, monotonic clock
  std::int64_t controller_gone_ns{0};     ///< when the controller was seen to have ended; 0: never
  std::int64_t first_written_ns{0};       ///< when the first try was over
  std::int64_t verified_ns{0};            ///< when the safe state had been read back
};

/// The report as several lines of text, for log and file. `controller` is the process id of the controller.
[[nodiscard]] std::string to_text(const GuardianReport& report, int controller);

/// What the talker asks of the guard.
enum class OrderWord : std::uint32_t {
  grant = 1,  ///< a lease for process `pid`
  cover,      ///< watch the run of lease `lease` with `timeout_ns`
  close,      ///< the holder of lease `lease` has closed its connection
  take_back,  ///< end the lease for `reason`
  look,       ///< look at the board now
};
struct Order {
  OrderWord word{};
  std::uint32_t lease{0};
  pid_t pid{0};
  rig::Reason reason{rig::Reason::none};
  std::int64_t timeout_ns{0};
  [[nodiscard]] bool operator==(const Order&) const = default;
};

/// What the guard tells the talker.
enum class NewsWord : std::uint32_t {
  board = 1,  ///< the board's state has changed
  looked,     ///< answer to `look`
  granted,    ///< with copies of the descriptors of the run's and the guard's page
  refused,    ///< no lease, or no cover, for `why`
  covered,    ///< the guard watches the run of `lease`
  ended,      ///< ... no more: the run has ended in order
  acted,      ///< the guard made the outputs safe: `report`
  over,       ///< lease `lease` has ended
};
enum class Refusal : std::uint32_t { none, held, former_lives, not_safe, cannot_end_it, no_memory, too_late };
struct News {
  NewsWord word{};
  std::uint32_t lease{0};
  Refusal why{Refusal::none};
  bool safe{false};          ///< outputs read back as zero, and nobody is left who could change them
  pid_t former_pid{0};       ///< a holder that was ended and is not gone yet
  driver::IoResult board{};  ///< of the latest look at the board
  GuardianReport report{};
};
static_assert(std::is_trivially_copyable_v<Order> && std::is_trivially_copyable_v<News>);

/// The two ways between guard and talker, which are two processes: orders through a pipe, news through a packet socket.
/// No call waits, and none takes a descriptor from the talker. If the talker does not read, news are lost.
class Mail {
 public:
  /// Throws std::system_error.
  Mail();

  /// Talker's end. False if the guard has not taken enough of the earlier orders: repeat it later.
  [[nodiscard]] bool order(const Order& order) noexcept;
  /// The next piece of news, if there is one. `pages` gets the descriptors of `granted`: the run's page, the
  /// guard's.
  [[nodiscard]] bool next(News& news, std::vector<driver::FileDescriptor>& pages);
  [[nodiscard]] int news_descriptor() const noexcept { return news_in_.get(); }
  [[nodiscard]] int order_end() const noexcept { return orders_out_.get(); }

  /// Guard's end. Real-time safe.
  [[nodiscard]] bool next(Order& order) noexcept;
  void tell(const News& news, const Pages::Descriptors& pages = {}) noexcept;
  [[nodiscard]] int order_descriptor() const noexcept { return orders_in_.get(); }

 private:
  driver::FileDescriptor orders_in_{-1};
  driver::FileDescriptor orders_out_{-1};
  driver::FileDescriptor news_in_{-1};
  driver::FileDescriptor news_out_{-1};
};

/// Memory of the resident guard that its two companions read: the talker and the standby. Only the guard writes it,
/// except for the talker's beats.
struct ServicePage {
  alignas(64) std::atomic<std::uint64_t> guard_beats{0};
  std::atomic<bool> accesses_board{false};    ///< it waits for the board, perhaps
  std::atomic<pid_t> holder{0};               ///< the process that has the lease; 0: none
  std::atomic<std::int64_t> run_needs_ns{0};  ///< how long it takes a run to notice that the guard is silent
  std::atomic<bool> over{false};              ///< the service ends in order
  alignas(64) std::atomic<std::uint64_t> talker_beats{0};
};
static_assert(std::atomic<pid_t>::is_always_lock_free && std::atomic<std::int64_t>::is_always_lock_free);

}  // namespace abs_hil::guardian
