#include "config/command_keys.hpp"

namespace abs_hil::config {

void add_command_keys(std::vector<Key>& keys, Settings& s) {
  keys.insert(
      keys.end(),
      {
          {"commands.enabled", "", "take commands other than stop over LCM (docs/telemetry.md)", &s.commands.enabled},
          {"commands.key_file", "", "file with the secret that senders of commands must know", &s.commands.key_file},
          {"experiment.wait_for_start", "", "stay idle until a command gives the start", &s.experiment.wait_for_start},
      });
}

}  // namespace abs_hil::config
