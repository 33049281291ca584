#pragma once

#include <cstdint>
#include <string>

namespace abs_hil::commands {

/// A command and its destination.
struct Order {
  std::string command{};  ///< "stop", "slip-ref", "gain", "start", "continue"
  std::string name{};     ///< for "gain"
  double value{0.0};
};
struct SenderOptions {
  std::string url{};
  std::string channel_prefix{"ABS_"};
  std::string key_file{};  ///< not needed for "stop"; with it only an answer with the key's tag counts
  double timeout_s{3.0};
};

/// The result of sending.
enum class Outcome : std::uint8_t { accepted, refused, no_answer };
struct Reply {
  Outcome outcome{Outcome::no_answer};
  std::string message{};  ///< the program's answer, or why there is none
  bool authentic{false};  ///< the answer has the key's tag: it is that of a run that holds the key
};

/// Sends a command to a running abs_hil and waits for its answer. A stop needs no key and is repeated until it is
/// answered. Throws telemetry::LcmError without a network and config::ConfigError for the key.
[[nodiscard]] Reply send(const Order& order, const SenderOptions& options);

}  // namespace abs_hil::commands
