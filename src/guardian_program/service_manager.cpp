#include "guardian_program/service_manager.hpp"

#ifdef ABS_HIL_HAVE_LIBSYSTEMD
#include <systemd/sd-daemon.h>
#endif

namespace abs_hil::guardian_program {

namespace {

void notify([[maybe_unused]] const char* text) {
#ifdef ABS_HIL_HAVE_LIBSYSTEMD
  static_cast<void>(::sd_notify(0, text));
#endif
}

}  // namespace

void ServiceManager::ready() { notify("READY=1"); }

void ServiceManager::alive() { notify("WATCHDOG=1"); }

void ServiceManager::status(const std::string& text) {
  if (text == told_) return;
  told_ = text;
  notify(("STATUS=" + text).c_str());
}

}  // namespace abs_hil::guardian_program
