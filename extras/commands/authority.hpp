#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "abs_hil/command_t.hpp"
#include "abs_hil/event_t.hpp"
#include "abs_hil/rig/reason.hpp"
#include "telemetry/message_stream.hpp"

namespace abs_hil::commands {

/// A sender takes its sequence number from ABS_COMMAND_STATE, which anybody can forge. A larger leap could use up the
/// numbers and lock all senders out.
inline constexpr std::int64_t sequence_leap_max = 1000;

/// Reads the secret that senders and the program share: the file's text without trailing white space. Throws
/// config::ConfigError for a file that cannot be read, is accessible to all users, or holds fewer than 16 characters.
[[nodiscard]] std::string read_key(const std::filesystem::path& file);

/// HMAC-SHA-256, with `key`, of the message encoded with an empty mac: 64 hexadecimal digits.
[[nodiscard]] std::string mac_of(const command_t& command, const std::string& key);

/// Ends the message of every answer that the stream sends with a tag: the HMAC-SHA-256, with `key`, of the event
/// encoded without it. Nobody without the key can make or change such an answer.
void sign_answers(telemetry::MessageStream& stream, const std::string& key);

/// Takes the tag off the answer's message. True if it is that of this answer and this key.
[[nodiscard]] bool take_tag(event_t& answer, const std::string& key);

/// Decides who may command this run. A message is authentic if its mac fits its content: somebody who listens to the
/// network can neither forge nor change one. A message names this run's random session and a sequence number greater
/// than all before, but by at most `sequence_leap_max`: a recorded message cannot be replayed, in this run or in
/// another. Messages are not encrypted: anybody can read them.
class Authority {
 public:
  /// Starts a new session. Throws std::runtime_error if the system provides no random numbers.
  explicit Authority(std::string key);

  /// Returns why the message is refused. `none`: the run obeys it, and its sequence number is used up.
  [[nodiscard]] rig::Reason judge(const command_t& command);

  [[nodiscard]] const std::string& session() const noexcept { return session_; }
  [[nodiscard]] std::int64_t last_sequence() const noexcept { return last_sequence_; }

 private:
  std::string key_;
  std::string session_;
  std::int64_t last_sequence_{0};
};

}  // namespace abs_hil::commands
