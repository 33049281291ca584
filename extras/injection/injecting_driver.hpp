// A driver that injects faults in front of any other, and what a fault does to one signal.

#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "config/injection.hpp"
#include "rig/encoder_scale.hpp"

// The effect of an injected fault on one signal. All functions except the constructors are real-time safe.

namespace abs_hil::injection {

/// A number in [0, 1) from the generator's upper 32 bits: the same with every standard library.
[[nodiscard]] inline double uniform(std::mt19937_64& random) noexcept {
  return static_cast<double>(random() >> 32U) * 0x1p-32;
}

/// The fault that currently acts on a signal.
struct ActiveFault {
  config::InjectionKind kind{config::InjectionKind::ok};
  double parameter{0.0};
  config::InjectionSignal signal{};  ///< for which it was given
  /// True if the encoder shows the other wheel's counts.
  [[nodiscard]] bool swaps() const noexcept {
    return kind == config::InjectionKind::wrong && signal == config::InjectionSignal::encoders;
  }
};

/// Queue of values that are delivered late. If it overflows, the oldest value is lost.
template <typename Value>
class DelayLine {
 public:
  DelayLine() : waiting_(capacity) {}
  void push(std::int64_t now_ns, const Value& value) noexcept {
    waiting_[(first_ + size_) % capacity] = {now_ns, value};
    if (size_ < capacity) {
      ++size_;
    } else {
      first_ = (first_ + 1) % capacity;
    }
  }
  /// Takes the oldest value if it was pushed at `until_ns` or before.
  [[nodiscard]] bool pop(std::int64_t until_ns, Value& value) noexcept {
    if (size_ == 0 || waiting_[first_].came_ns > until_ns) return false;
    value = waiting_[first_].value;
    first_ = (first_ + 1) % capacity;
    --size_;
    return true;
  }
  void clear() noexcept { size_ = 0; }

 private:
  static constexpr std::size_t capacity = 5001;  ///< half a second at 10 kHz
  struct Entry {
    std::int64_t came_ns{0};
    Value value{};
  };
  std::vector<Entry> waiting_;
  std::size_t first_{0};
  std::size_t size_{0};
};

[[nodiscard]] inline std::int64_t ns_of(double seconds) noexcept { return std::llround(seconds * 1e9); }

/// One encoder's counter. As with a real incremental encoder, lost counts stay lost: after the fault the counter
/// continues from its current value.
class EncoderChannel {
 public:
  /// Starts anew with the counter's first reading.
  void start(std::int32_t counts) noexcept {
    last_ = delivered_ = counts;
    fraction_ = 0.0;
    held_ = 0;
    renewed_ns_ = 0;
    line_.clear();
  }
  /// Counts travelled since the previous reading.
  [[nodiscard]] std::int32_t travel(std::int32_t counts) noexcept {
    const std::int32_t travelled = rig::counts_between(last_, counts);
    last_ = counts;
    return travelled;
  }
  /// The part of `travel` that is delivered under the fault.
  [[nodiscard]] std::int32_t pass(std::int32_t travel, const ActiveFault& fault, std::int64_t now_ns,
                                  std::mt19937_64& random) noexcept {
    switch (fault.kind) {
      case config::InjectionKind::off: delivered_ = 0; break;
      case config::InjectionKind::stuck: break;
      case config::InjectionKind::garbage:
        delivered_ = std::bit_cast<std::int32_t>(static_cast<std::uint32_t>(random() >> 32U));
        break;
      case config::InjectionKind::wrong: {
        const double counted = fraction_ + fault.parameter * travel;
        fraction_ = counted - std::trunc(counted);
        advance(static_cast<std::int64_t>(std::trunc(counted)));
        break;
      }
      case config::InjectionKind::intermittent:
        if (uniform(random) >= fault.parameter) advance(travel);
        break;
      case config::InjectionKind::slow:
        held_ += travel;
        if (now_ns - renewed_ns_ >= ns_of(fault.parameter)) {
          renewed_ns_ = now_ns;
          advance(held_);
          held_ = 0;
        }
        break;
      case config::InjectionKind::delayed: {
        line_.push(now_ns, travel);
        std::int64_t late = 0;
        while (line_.pop(now_ns - ns_of(fault.parameter), late)) advance(late);
        break;
      }
      case config::InjectionKind::ok:
        advance(travel + held_);
        held_ = 0;
        for (std::int64_t late = 0; line_.pop(now_ns, late);) advance(late);
        renewed_ns_ = now_ns;
        break;
    }
    return delivered_;
  }

 private:
  void advance(std::int64_t travel) noexcept {
    delivered_ =
        std::bit_cast<std::int32_t>(std::bit_cast<std::uint32_t>(delivered_) + static_cast<std::uint32_t>(travel));
  }

  std::int32_t last_{0};
  std::int32_t delivered_{0};
  double fraction_{0.0};  ///< fraction of a count left over (kind `wrong`)
  std::int64_t held_{0};  ///< counts to be delivered later
  std::int64_t renewed_ns_{0};
  DelayLine<std::int64_t> line_{};
};

/// How a number fails.
struct NumberFaults {
  double off{0.0};
  double garbage_least{0.0};
  double garbage_most{1.0};
  bool whole{false};  ///< garbage values are whole numbers
  double (*wrong)(double value, double parameter) noexcept;
  bool intermittently_wrong{false};  ///< an intermittent fault acts as `wrong`, not as `off`
};

/// A signal that is a number: a duty, a voltage, a flag, a time.
class NumberChannel {
 public:
  NumberChannel(const NumberFaults& faults) : faults_(faults) {}
  /// Starts anew, with nothing delivered.
  void start() noexcept {
    delivered_ = 0.0;
    renewed_ns_ = 0;
    line_.clear();
  }
  [[nodiscard]] double pass(double value, const ActiveFault& fault, std::int64_t now_ns,
                            std::mt19937_64& random) noexcept {
    if (fault.kind != config::InjectionKind::delayed) line_.clear();
    switch (fault.kind) {
      case config::InjectionKind::ok:
        delivered_ = value;
        renewed_ns_ = now_ns;
        break;
      case config::InjectionKind::off: delivered_ = faults_.off; break;
      case config::InjectionKind::stuck: break;
      case config::InjectionKind::garbage: {
        const double drawn = faults_.garbage_least + (faults_.garbage_most - faults_.garbage_least) * uniform(random);
        delivered_ = faults_.whole ? std::floor(drawn) : drawn;
        break;
      }
      case config::InjectionKind::wrong: delivered_ = faults_.wrong(value, fault.parameter); break;
      case config::InjectionKind::intermittent: {
        const bool fails = uniform(random) < fault.parameter;
        const double failed = faults_.intermittently_wrong ? faults_.wrong(value, 0.0) : faults_.off;
        delivered_ = fails ? failed : value;
        break;
      }
      case config::InjectionKind::slow:
        if (now_ns - renewed_ns_ >= ns_of(fault.parameter)) {
          renewed_ns_ = now_ns;
          delivered_ = value;
        }
        break;
      case config::InjectionKind::delayed:
        line_.push(now_ns, value);
        while (line_.pop(now_ns - ns_of(fault.parameter), delivered_)) {
        }
        break;
    }
    return delivered_;
  }

 private:
  NumberFaults faults_;
  double delivered_{0.0};
  std::int64_t renewed_ns_{0};
  DelayLine<double> line_{};
};

/// Injects faults between the executive and any backend except real hardware. The same faults and seed give the same
/// run. No fault affects making safe (`deactivate`, and after a failed write): guardian and E-stop are there for the
/// case that no command reaches the board. A fault of the outputs lies behind the board's registers, where no driver
/// sees it: `write` tells the command that would have gone out without it. As real-time safe as the backend.
class InjectingDriver final : public driver::RigDriver {
 public:
  /// Lets this time pass in the calling thread, ns; used for slow calls.
  using PassTime = std::function<void(std::int64_t duration_ns)>;
  /// @param pass_time may be empty; then slow calls take no time
  InjectingDriver(std::unique_ptr<driver::RigDriver> inner, const std::vector<config::Injection>& injections,
                  std::uint64_t seed, PassTime pass_time);
  ~InjectingDriver() override { static_cast<void>(deactivate()); }

  [[nodiscard]] std::string_view name() const noexcept override { return inner_->name(); }
  [[nodiscard]] rig::Command as_sent(const rig::Command& command) const noexcept override {
    return inner_->as_sent(command);
  }
  [[nodiscard]] rig::PlantTruth truth() const noexcept override { return inner_->truth(); }
  [[nodiscard]] std::vector<std::string> notes() const override;
  [[nodiscard]] driver::IoResult try_write() noexcept override { return inner_->try_write(); }
  [[nodiscard]] driver::BoardIdentity identity() const override { return inner_->identity(); }
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override { return inner_->outputs_now(applied); }
  [[nodiscard]] std::vector<std::string> tally() const override;
  [[nodiscard]] std::optional<AnswerTimes> answer_times() const override { return inner_->answer_times(); }
  [[nodiscard]] std::vector<std::string> traffic() const override { return inner_->traffic(); }
  [[nodiscard]] std::string_view watched_cable() const noexcept override { return inner_->watched_cable(); }
  [[nodiscard]] bool took_other_command(rig::Command& command) const noexcept override {
    return inner_->took_other_command(command);
  }
  [[nodiscard]] std::string_view what_holds_unsafe() const noexcept override { return inner_->what_holds_unsafe(); }
  [[nodiscard]] std::vector<std::string> inspection() override { return inner_->inspection(); }
  [[nodiscard]] std::int64_t make_safe_bound_ns() const noexcept override { return inner_->make_safe_bound_ns(); }
  void tell_before_making_safe(driver::MakingSafeListener* listener) noexcept override {
    inner_->tell_before_making_safe(listener);
  }
  void note_phase(rig::Phase phase) noexcept override;
  void note_wheels_apart(bool apart) noexcept override { inner_->note_wheels_apart(apart); }
  [[nodiscard]] const driver::RigDriver& inner() const noexcept { return *inner_; }
  /// Time of the first read or write that a fault changed; -1 before that.
  [[nodiscard]] std::int64_t first_effect_ns() const noexcept { return first_effect_ns_; }

 private:
  struct Planned {
    config::Injection injection{};
    std::int64_t entered_ns{-1};  ///< when the run first entered its phase; < 0: not yet
  };

  void do_configure() override { inner_->configure(); }
  void do_activate(std::int64_t now_ns) override;
  driver::IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override;
  driver::IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override;
  driver::IoResult do_make_safe() noexcept override { return inner_->deactivate(); }
  driver::IoResult do_rest() noexcept override { return inner_->rest(); }

  [[nodiscard]] ActiveFault fault_of(config::InjectionSignal signal) const noexcept { return fault_of(signal, signal); }
  /// Of faults given for either signal.
  [[nodiscard]] ActiveFault fault_of(config::InjectionSignal signal, config::InjectionSignal or_of) const noexcept;
  void note_effect(bool differs) noexcept;
  /// What the fault of `signal` makes of a value.
  [[nodiscard]] double pass(std::size_t number, config::InjectionSignal signal, double value) noexcept {
    return numbers_[number].pass(value, fault_of(signal), now_ns_, random_);
  }
  void fail_encoders(rig::Measurement& measurement) noexcept;
  void fail_numbers(rig::Measurement& measurement) noexcept;
  /// A fault of a whole answer or command. `last` is the one before, `garble` makes random values of this one, `spoil`
  /// makes it wrong by a factor.
  template <class Value, class Garble, class Spoil>
  driver::IoResult fail_whole(config::InjectionSignal signal, Value& value, const Value& last, DelayLine<Value>& line,
                              Garble garble, Spoil spoil) noexcept;

  std::unique_ptr<driver::RigDriver> inner_;
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
  std::array<NumberChannel, 8> numbers_;  ///< by the numbers' place in the table of their faults
};

/// Lets runs inject faults by this driver (run::inject_by).
void begin();

}  // namespace abs_hil::injection
