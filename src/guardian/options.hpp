#pragma once

namespace abs_hil::guardian {

/// Everything below `guardian.` in the configuration.
struct GuardianOptions {
  bool enabled{true};       ///< false only with an emulated board
  double timeout_ms{20.0};  ///< without a sign of life of the cycle, > 0
  double insist_s{10.0};    ///< how long it goes on trying when the safe state cannot be verified, > 0
};

}  // namespace abs_hil::guardian
