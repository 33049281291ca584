#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "driver/injection/fault_channels.hpp"
#include "driver/injection/injection.hpp"

namespace abs_hil::driver {

/// Injects faults between the executive and any backend except real hardware. The same faults and seed give the same
/// run. No fault affects making safe (`deactivate`, and after a failed write): guardian and E-stop are there for the
/// case that no command reaches the board. A fault of the outputs lies behind the board's registers, where no driver
/// sees it: `write` tells the command that would have gone out without it. As real-time safe as the backend.
class InjectingDriver final : public RigDriver {
 public:
  /// Lets this time pass in the calling thread, ns; used for slow calls.
  using PassTime = std::function<void(std::int64_t duration_ns)>;
  /// @param pass_time may be empty; then slow calls take no time
  InjectingDriver(std::unique_ptr<RigDriver> inner, const std::vector<Injection>& injections, std::uint64_t seed,
                  PassTime pass_time);
  ~InjectingDriver() override;

  [[nodiscard]] std::string_view name() const noexcept override { return inner_->name(); }
  [[nodiscard]] rig::Command as_sent(const rig::Command& command) const noexcept override {
    return inner_->as_sent(command);
  }
  [[nodiscard]] rig::PlantTruth truth() const noexcept override { return inner_->truth(); }
  [[nodiscard]] std::vector<std::string> notes() const override;
  [[nodiscard]] IoResult try_write() noexcept override { return inner_->try_write(); }
  [[nodiscard]] BoardIdentity identity() const override { return inner_->identity(); }
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override { return inner_->outputs_now(applied); }
  [[nodiscard]] std::vector<std::string> tally() const override { return inner_->tally(); }
  [[nodiscard]] std::string_view what_holds_unsafe() const noexcept override { return inner_->what_holds_unsafe(); }
  [[nodiscard]] std::vector<std::string> inspection() override { return inner_->inspection(); }
  [[nodiscard]] std::int64_t make_safe_bound_ns() const noexcept override { return inner_->make_safe_bound_ns(); }
  void tell_before_making_safe(MakingSafeListener* listener) noexcept override {
    inner_->tell_before_making_safe(listener);
  }
  void note_phase(rig::Phase phase) noexcept override;
  void note_wheels_apart(bool apart) noexcept override { inner_->note_wheels_apart(apart); }
  [[nodiscard]] const RigDriver& inner() const noexcept { return *inner_; }
  /// Time of the first read or write that a fault changed; -1 before that.
  [[nodiscard]] std::int64_t first_effect_ns() const noexcept { return first_effect_ns_; }

 private:
  struct Planned {
    Injection injection{};
    std::int64_t entered_ns{-1};  ///< when the run first entered its phase; < 0: not yet
  };

  void do_configure() override { inner_->configure(); }
  void do_activate(std::int64_t now_ns) override;
  IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override;
  IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override;
  IoResult do_make_safe() noexcept override { return inner_->deactivate(); }

  [[nodiscard]] ActiveFault fault_of(InjectionSignal signal) const noexcept;
  void note_effect(bool differs) noexcept;
  IoResult fail_whole_answer(rig::Measurement& measurement) noexcept;
  void fail_encoders(rig::Measurement& measurement) noexcept;
  void fail_numbers(rig::Measurement& measurement) noexcept;
  IoResult fail_whole_command(rig::Command& command) noexcept;

  std::unique_ptr<RigDriver> inner_;
  std::vector<Planned> planned_;
  std::uint64_t seed_;
  PassTime pass_time_;
  std::mt19937_64 random_{};
  std::int64_t now_ns_{0};
  std::int64_t first_effect_ns_{-1};
  bool first_read_{true};

  EncoderChannel upper_{};
  EncoderChannel lower_{};
  rig::Measurement delivered_{};  ///< last measurement passed on
  rig::Command passed_{};         ///< last command passed on
  DelayLine<rig::Measurement> answers_{};
  DelayLine<rig::Command> commands_{};
  NumberChannel stamp_;
  NumberChannel supply_;
  NumberChannel temperature_;
  NumberChannel trip_;
  NumberChannel motor_;
  NumberChannel brake_;
  NumberChannel brake_torque_;  ///< for the ideal actuator; has the faults of the brake's duty
  NumberChannel enable_;
};

}  // namespace abs_hil::driver
