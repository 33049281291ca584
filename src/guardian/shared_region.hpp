#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "runtime/flight_ring.hpp"
#include "runtime/heartbeat.hpp"

namespace abs_hil::guardian {

/// How far a run has come, as the controller tells its guardian.
enum class Stage : std::uint32_t {
  guarded = 0,      ///< outputs may be driven
  released = 1,     ///< the controller has brought the outputs into the safe state and verified it
  handed_over = 2,  ///< the controller has given the outputs up without knowing them safe: it writes zeros only
  closed = 3,       ///< the run is over, its files are written; never after handed_over
  making_safe = 4,  ///< the controller waits for the board to confirm the safe state, which takes its time
};

/// Memory of one run, shared by the controller and its guardian: signs of life and the flight recorder. It outlives
/// either of them as long as the other one lives. Nothing in it is a lock.
class SharedRegion {
 public:
  /// Makes one. Throws std::system_error.
  /// @param slots  of the flight recorder, >= 1
  explicit SharedRegion(std::size_t slots);
  /// Takes the one behind an inherited descriptor, which stays the caller's. Throws std::runtime_error if it is none,
  /// or one of another build.
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
    std::uint64_t layout{0};  ///< sizes of all that is shared: two builds that differ in one do not fit
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
