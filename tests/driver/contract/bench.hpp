#pragma once

#include <cstdint>
#include <memory>

#include "abs_hil/driver/rig_driver.hpp"

namespace abs_hil::test {

/// One backend with a rig behind it whose wheels turn at 60 rad/s when it is made, in virtual time.
class Bench {
 public:
  Bench() = default;
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;
  virtual ~Bench() = default;

  [[nodiscard]] virtual driver::RigDriver& driver() = 0;
  /// Runs the driver's destructor.
  virtual void destroy_driver() = 0;
  /// What acts on the rig now.
  struct Wire {
    double drive_duty{0.0};
    double brake_duty{0.0};
  };
  [[nodiscard]] virtual Wire wire() = 0;
  /// Number of writes to the board since the bench was made. A simulator has no registers and counts none.
  [[nodiscard]] virtual std::uint64_t writes() = 0;
  [[nodiscard]] virtual bool has_registers() const { return true; }
  /// Whether the board tells its supply and temperature.
  [[nodiscard]] virtual bool tells_health() const { return has_registers(); }
  /// From now on the brake output does not take what is written; false if this backend cannot fail so.
  [[nodiscard]] virtual bool break_brake_output() = 0;
  /// Another writer than the driver puts the drive's duty on the outputs, with a handle of its own; false if this
  /// backend has outputs that nothing else can reach.
  [[nodiscard]] virtual bool write_as_other(double drive_duty) = 0;
  /// Cycles until a broken output shows in `read`; 0: the next `write` looks.
  [[nodiscard]] virtual int read_back_cycles() const { return 0; }
};

/// Each backend's own file defines it. If the bench is not available it prints the cause and returns null.
[[nodiscard]] std::unique_ptr<Bench> make_bench();

inline constexpr double bench_speed_rad_s = 60.0;

}  // namespace abs_hil::test
