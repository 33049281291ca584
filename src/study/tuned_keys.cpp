// The keys that the search for gains may set, by controller.

#include <array>

#include "study/tuning.hpp"

namespace abs_hil::study {

namespace {

constexpr std::array adaptive{
    TunedKey{"control.adaptive.gamma", 1, 1000},      TunedKey{"control.adaptive.ks0", 1, 500},
    TunedKey{"control.adaptive.ks1", 4, 200},         TunedKey{"control.adaptive.ka1", 0.05, 20},
    TunedKey{"control.adaptive.zeta0", 0, 40, false},
};
constexpr std::array sliding_mode{
    TunedKey{"control.sliding_mode.gain_m_s2", 0.5, 100},
    TunedKey{"control.sliding_mode.gamma", 1, 1000},
    TunedKey{"control.sliding_mode.theta0_N", 0, 40, false},
};
constexpr std::array sliding_mode_smooth{
    TunedKey{"control.sliding_mode_smooth.gain_m_s2", 0.5, 100},
    TunedKey{"control.sliding_mode_smooth.boundary_m_s", 0.01, 5},
    TunedKey{"control.sliding_mode_smooth.gamma", 1, 1000},
    TunedKey{"control.sliding_mode_smooth.theta0_N", 0, 40, false},
};
constexpr std::array super_twisting{
    TunedKey{"control.super_twisting.k1", 0.5, 100},
    TunedKey{"control.super_twisting.k2", 1, 2000},
    TunedKey{"control.super_twisting.gamma", 1, 1000},
    TunedKey{"control.super_twisting.theta0_N", 0, 40, false},
};
constexpr std::array pi{
    TunedKey{"control.pi.kp_per_s", 2, 300},
    TunedKey{"control.pi.ki_per_s2", 0.1, 2000},
    TunedKey{"control.pi.feed_forward", 0, 1, false},
};
constexpr std::array relay{
    TunedKey{"control.relay.threshold", 0.01, 0.6},
};
constexpr std::array five_phase{
    TunedKey{"control.five_phase.hold_below_m_s2", -150, -5, false},
    TunedKey{"control.five_phase.release_below_m_s2", -200, -5, false},
    TunedKey{"control.five_phase.recover_above_m_s2", -50, 50, false},
    TunedKey{"control.five_phase.reapply_below_m_s2", -20, 60, false},
    TunedKey{"control.five_phase.hold_limit_s", 0.005, 0.3},
    TunedKey{"control.five_phase.recover_limit_s", 0.01, 0.5},
    TunedKey{"control.five_phase.apply_Nm_s", 10, 500},
    TunedKey{"control.five_phase.release_Nm_s", 10, 1000},
    TunedKey{"control.five_phase.reapply_Nm_s", 1, 300},
};

struct Entry {
  std::string_view controller;
  std::span<const TunedKey> keys;
};
constexpr std::array<Entry, 7> tuned_controllers{{
    {"adaptive", adaptive},
    {"sliding-mode", sliding_mode},
    {"sliding-mode-smooth", sliding_mode_smooth},
    {"super-twisting", super_twisting},
    {"pi", pi},
    {"relay", relay},
    {"five-phase", five_phase},
}};

}  // namespace

std::span<const TunedKey> tuned_keys(std::string_view controller) noexcept {
  for (const Entry& entry : tuned_controllers) {
    if (entry.controller == controller) return entry.keys;
  }
  return {};
}

bool follows_slip_reference(std::string_view controller) noexcept { return controller != "five-phase"; }

std::vector<std::string_view> tunable_controllers() {
  std::vector<std::string_view> names;
  names.reserve(tuned_controllers.size());
  for (const Entry& entry : tuned_controllers) names.push_back(entry.controller);
  return names;
}

}  // namespace abs_hil::study
