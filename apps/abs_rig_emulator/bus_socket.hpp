#pragma once

#include <string>

#include "emulator/can_node.hpp"

namespace abs_hil::program {

/// The emulated node's end of the bus: a raw CAN socket, or for "unix:PATH" a listening AF_UNIX socket of type
/// SOCK_SEQPACKET with one client at a time.
class BusSocket {
 public:
  /// Throws std::runtime_error if the socket cannot be opened.
  explicit BusSocket(const std::string& interface);
  BusSocket(const BusSocket&) = delete;
  BusSocket& operator=(const BusSocket&) = delete;
  ~BusSocket();

  /// Descriptor for poll().
  [[nodiscard]] int descriptor() const noexcept { return client_ >= 0 ? client_ : listening_; }
  [[nodiscard]] bool can_fd() const noexcept { return can_fd_; }
  /// Takes the next frame; false if there is none.
  [[nodiscard]] bool receive(emulator::BusFrame& frame);
  /// Sends a frame. If that is not possible at once, the frame is lost, as on a blocked bus.
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
