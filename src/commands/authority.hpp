#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "abs_hil/command2_t.hpp"
#include "abs_hil/rig/reason.hpp"

namespace abs_hil::commands {

/// Reads the secret that senders and the program share: the file's text without white space at its end. Throws
/// config::ConfigError for a file that cannot be read, is open to everybody, or holds less than 16 characters.
[[nodiscard]] std::string read_key(const std::filesystem::path& file);

/// HMAC-SHA-256, with `key`, of the message encoded with an empty mac, as 64 hexadecimal digits.
[[nodiscard]] std::string mac_of(const command2_t& command, const std::string& key);

/// Who may command this run. A message is authentic if its mac fits its content, so that who listens to the network can
/// neither make one nor change one; it names this run's random session and a sequence greater than any before, so that
/// one that was recorded, in this run or in another, is of no use. It is not kept secret: anybody can read it.
class Authority {
 public:
  /// A new session. Throws std::runtime_error where the system gives no random numbers.
  explicit Authority(std::string key);

  /// Why the message is refused, none if it is to be obeyed; its sequence is then used up.
  [[nodiscard]] rig::Reason judge(const command2_t& command);

  [[nodiscard]] const std::string& session() const noexcept { return session_; }
  [[nodiscard]] std::int64_t last_sequence() const noexcept { return last_sequence_; }

 private:
  std::string key_;
  std::string session_;
  std::int64_t last_sequence_{0};
};

}  // namespace abs_hil::commands
