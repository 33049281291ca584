#include "guardian/process_set_up.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>

namespace abs_hil::guardian {

void ignore_signals(std::initializer_list<int> signals) {
  for (const int signal : signals) std::signal(signal, SIG_IGN);
}

void spare_from_oom() {
  const int file = ::open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
  if (file < 0) return;
  [[maybe_unused]] const auto written = ::write(file, "-1000", 5);
  ::close(file);
}

runtime::RealtimeOptions realtime_options(const config::Settings& settings, runtime::RealtimeMode mode) {
  constexpr int highest = 99;
  runtime::RealtimeOptions options{.priority = std::min(settings.realtime.priority + 1, highest)};
  options.mode = mode;
  return options;
}

runtime::RealtimeMode realtime_mode_of(const std::string& name) {
  return name == "off"       ? runtime::RealtimeMode::off
         : name == "require" ? runtime::RealtimeMode::require
                             : runtime::RealtimeMode::prefer;
}

}  // namespace abs_hil::guardian
