#pragma once

#include <string>

namespace abs_hil::guardian_program {

/// Messages to systemd; nothing happens without it.
class ServiceManager {
 public:
  static void ready();
  static void alive();
  /// One line for `systemctl status`. Sends it only if it has changed.
  void status(const std::string& text);

 private:
  std::string told_{};
};

}  // namespace abs_hil::guardian_program
