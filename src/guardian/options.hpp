#pragma once

namespace abs_hil::guardian {

/// Everything below `guardian.` in the configuration.
struct GuardianOptions {
  bool enabled{true};       ///< false only with an emulated board
  double timeout_ms{20.0};  ///< the guardian acts after this time without a heartbeat of the cycle, > 0
  double insist_s{10.0};    ///< longest time that the guardian retries an unverified safe state, > 0
};

}  // namespace abs_hil::guardian
