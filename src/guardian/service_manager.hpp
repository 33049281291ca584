#pragma once

#include <string>

namespace abs_hil::guardian {

/// Messages to systemd over its datagram socket ($NOTIFY_SOCKET, sd_notify(3)); nothing happens without it. No call
/// waits: a message that systemd cannot take at once is left out.
class ServiceManager {
 public:
  static void ready() noexcept;
  static void alive() noexcept;
  /// Of the socket; -1 without systemd.
  [[nodiscard]] static int descriptor() noexcept;
  /// One line for `systemctl status`. Sends it only if it has changed.
  void status(const std::string& text);

 private:
  std::string told_{};
};

}  // namespace abs_hil::guardian
