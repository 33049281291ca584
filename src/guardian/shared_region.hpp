#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "runtime/flight_ring.hpp"
#include "runtime/heartbeat.hpp"

namespace abs_hil::guardian {

/// State of the run's outputs, as the controller tells its guardian.
enum class Stage : std::uint32_t {
  guarded = 0,   ///< the controller may drive the outputs
  released = 1,  ///< the controller has brought the outputs into the safe state and verified it
  handed_over =
      2,       ///< the controller could not verify the safe state and leaves it to the guardian: it writes zeros only
  closed = 3,  ///< the run is over and its files are written; never after handed_over
  making_safe = 4,  ///< the controller waits for the board to confirm the safe state, which may take seconds
};

/// Memory of one run that controller and guardian share: heartbeat counters and flight recorder. It lives until both
/// processes have ended. It contains no lock.
class SharedRegion {
 public:
  /// Creates the memory. Throws std::system_error.
  /// @param slots  slots of the flight recorder, >= 1
  explicit SharedRegion(std::size_t slots);
  /// Maps the memory behind an inherited descriptor; the caller keeps the descriptor. Throws std::runtime_error if the
  /// descriptor is not such memory, or if another build created it.
  [[nodiscard]] static SharedRegion attach(int fd) { return SharedRegion(Inherited{fd}); }
  SharedRegion(const SharedRegion&) = delete;
  SharedRegion& operator=(const SharedRegion&) = delete;
  ~SharedRegion();

  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  [[nodiscard]] runtime::HeartbeatPanel& panel() noexcept { return header_->panel; }
  [[nodiscard]] runtime::FlightRing& recorder() noexcept { return recorder_; }
  [[nodiscard]] const runtime::FlightRing& recorder() const noexcept { return recorder_; }
  [[nodiscard]] Stage stage() const noexcept { return header_->stage.load(std::memory_order_acquire); }
  void set_stage(Stage stage) noexcept { header_->stage.store(stage, std::memory_order_release); }

 private:
  struct Inherited {
    int fd;
  };
  struct Header {
    std::uint64_t magic{0};
    std::uint64_t layout{0};  ///< sizes of all shared types; builds with different sizes do not fit together
    std::uint64_t slots{0};
    std::atomic<Stage> stage{Stage::guarded};
    runtime::HeartbeatPanel panel{};
  };
  static_assert(std::atomic<Stage>::is_always_lock_free);

  explicit SharedRegion(Inherited inherited);
  void map(std::size_t bytes);
  [[nodiscard]] static std::size_t bytes_for(std::size_t slots) noexcept;
  [[nodiscard]] static std::uint64_t expected_layout() noexcept;
  [[nodiscard]] runtime::FlightSlot* first_slot() const noexcept;

  int fd_{-1};
  bool owns_fd_{true};
  std::size_t bytes_{0};
  Header* header_{nullptr};
  runtime::FlightRing recorder_{{}};
};

}  // namespace abs_hil::guardian
