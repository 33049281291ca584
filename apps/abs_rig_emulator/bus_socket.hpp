#pragma once

#include <string>

#include "emulator/can_node.hpp"

namespace abs_hil::program {

/// The emulated node's end of the bus: a raw CAN socket, or for "unix:PATH" an AF_UNIX socket of type SOCK_SEQPACKET
/// that it listens on, one client at a time.
class BusSocket {
 public:
  /// Throws std::runtime_error if it cannot be had.
  explicit BusSocket(const std::string& interface);
  BusSocket(const BusSocket&) = delete;
  BusSocket& operator=(const BusSocket&) = delete;
  ~BusSocket();

  /// To wait on.
  [[nodiscard]] int descriptor() const noexcept { return client_ >= 0 ? client_ : listening_; }
  [[nodiscard]] bool can_fd() const noexcept { return can_fd_; }
  /// False once there is none.
  [[nodiscard]] bool receive(emulator::BusFrame& frame);
  /// What cannot be sent now is lost, as on a bus that is blocked.
  void send(const emulator::BusFrame& frame);

 private:
  void open_can(const std::string& interface);
  void listen_at(const std::string& path);

  int listening_{-1};
  int client_{-1};
  bool can_fd_{true};
  std::string path_{};
};

}  // namespace abs_hil::program
