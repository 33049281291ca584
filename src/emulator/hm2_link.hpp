#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <string_view>
#include <vector>

namespace abs_hil::emulator {

/// A datagram to or from a host. `peer` stands for the host's address.
struct Hm2Datagram {
  std::vector<std::uint8_t> bytes{};
  std::uint64_t peer{0};
};

/// The cable between host and board, with its faults. `set` takes the text of the control command `fault`.
class Hm2Link {
 public:
  explicit Hm2Link(std::uint64_t seed) : random_(seed) {}

  /// Sets a fault such as "loss=5". Throws std::invalid_argument with the valid faults.
  void set(std::string_view text);
  /// Pulls or plugs the cable. What was under way is lost.
  void plug(bool in);
  [[nodiscard]] bool plugged() const noexcept { return plugged_; }

  /// True if the board receives the next request.
  [[nodiscard]] bool request_arrives();
  /// Takes the board's answer.
  void send(Hm2Datagram answer, std::int64_t now_ns);
  /// The answers that reach their hosts by now.
  [[nodiscard]] std::vector<Hm2Datagram> take_due(std::int64_t now_ns);
  /// When the next answer is due.
  [[nodiscard]] std::optional<std::int64_t> next_due_ns() const noexcept;

 private:
  enum class Kind : std::uint8_t {
    ok,             ///< heals all of them
    loss,           ///< each datagram of both directions is lost with this probability
    lose_requests,  ///< the next ones are lost, as many as the number says
    lose_answers,
    delay,      ///< every answer comes later
    reorder,    ///< answers leave in pairs, the later one first
    duplicate,  ///< every answer comes twice
    stale,      ///< the answer before comes in place of each
    too_short,  ///< answers end after so many bytes
    garbage,    ///< every answer is random bytes of its length
  };
  struct Waiting {
    std::int64_t due_ns{0};
    Hm2Datagram answer{};
  };
  [[nodiscard]] bool lost(Kind counted);

  bool plugged_{true};
  Kind kind_{Kind::ok};
  double number_{0.0};
  std::optional<Hm2Datagram> kept_{};
  std::vector<Waiting> waiting_{};
  std::mt19937_64 random_;
};

}  // namespace abs_hil::emulator
