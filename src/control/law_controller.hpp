// A slip controller from a law that is written over its scalar.
#pragma once

#include <type_traits>

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::control {

/// The slip controller of a law that is written over its scalar: `Law<double>` runs in the cycle, a `Law` of packs in
/// many simulated runs side by side. A law has `reset` and `step` as SlipController has them, `take_over` if it can,
/// and nothing but scalars of type S as members. Only a `Law<double>` is made from a context; its constructor throws
/// std::invalid_argument for options out of range. With signals of its own it has the table `signals`, and `show`,
/// which writes their values into an output of `step`; `learnt` if a braking leaves something.
template <template <class> class Law>
class LawController : public SlipController {
 public:
  explicit LawController(const ControllerContext& context) : law_{context} {}

  void reset(const SlipInput& input) noexcept override { law_.reset(input); }
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override {
    SlipOutput output = law_.step(input);
    if constexpr (has_signals) law_.show(output);
    return output;
  }
  [[nodiscard]] std::span<const rig::Signal> signals() const noexcept override {
    if constexpr (has_signals) return Law<double>::signals;
    return {};
  }
  [[nodiscard]] std::vector<Learnt> learnt() const override {
    if constexpr (requires(const Law<double>& law) { law.learnt(); }) return law_.learnt();
    return {};
  }
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override {
    if constexpr (requires(const Law<double>& other) { law_.take_over(other); }) {
      const auto* other = dynamic_cast<const LawController*>(&before);
      if (other == nullptr) return false;
      law_.take_over(other->law_);
      return true;
    } else {
      return SlipController::take_over(before);
    }
  }

  [[nodiscard]] bool exchange_state(rig::StateBytes& state) override {
    static_assert(std::is_trivially_copyable_v<Law<double>>, "the state of a law is a copy of its scalars");
    state(law_);
    return true;
  }

  [[nodiscard]] const Law<double>& law() const noexcept { return law_; }

 private:
  static constexpr bool has_signals = requires { Law<double>::signals; };

  Law<double> law_;
};

}  // namespace abs_hil::control
