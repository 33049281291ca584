// Judges whether a sender knows the key: HMAC-SHA256 over the command and its sequence number.
#include "commands/authority.hpp"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <openssl/rand.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <span>
#include <stdexcept>
#include <utility>

#include "config/config_error.hpp"
#include "rig/formatted_text.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::commands {

namespace {

constexpr std::size_t key_min_characters = 16;
constexpr std::size_t session_bytes = 16;
constexpr std::string_view tag_begin = " [mac ";
constexpr std::string_view tag_end = "]";

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& why) {
  throw config::ConfigError("commands.key_file: '" + file.string() + "' " + why);
}

template <class Message>
std::string hmac_of(const Message& message, const std::string& key) {
  telemetry::EncodeBuffer buffer;
  const auto bytes = buffer.encode(message);
  std::array<unsigned char, EVP_MAX_MD_SIZE> mac{};
  unsigned int size = 0;
  if (HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()), bytes.data(), bytes.size(), mac.data(), &size) ==
      nullptr) {
    throw std::runtime_error("OpenSSL cannot make an HMAC-SHA-256");
  }
  return telemetry::hexadecimal(std::span(mac).first(size));
}

/// In constant time: the duration must not reveal how much of a guess was right.
bool same(std::string_view given, std::string_view expected) {
  return given.size() == expected.size() && CRYPTO_memcmp(given.data(), expected.data(), expected.size()) == 0;
}

}  // namespace

std::string read_key(const std::filesystem::path& file) {
  const std::string make_one = "; create one:  (umask 077; openssl rand -hex 32 > " + file.string() + ")";
  if (file.empty()) {
    throw config::ConfigError(
        "commands.key_file: not set; remote commands need a secret key: (umask 077; openssl rand -hex 32 "
        "> commands.key), then --set commands.key_file=commands.key");
  }
  struct stat facts {};
  if (::stat(file.c_str(), &facts) != 0) {
    const int why = errno;
    refuse(file, "cannot be read: " +
                     (why == ENOENT ? std::strerror(why) + make_one : rig::refusal(why, file, rig::reading)));
  }
  if (!S_ISREG(facts.st_mode)) refuse(file, "is not a regular file" + make_one);
  if ((facts.st_mode & S_IRWXO) != 0) refuse(file, "is accessible to all users: chmod o= " + file.string());
  std::ifstream stream(file, std::ios::binary);
  std::string key{std::istreambuf_iterator<char>(stream), {}};
  if (!stream) refuse(file, "cannot be read; choose a file that you may read");
  key.erase(key.find_last_not_of(" \t\r\n") + 1);
  if (key.size() < key_min_characters) refuse(file, "holds fewer than 16 characters" + make_one);
  return key;
}

std::string mac_of(const command_t& command, const std::string& key) {
  command_t bare = command;
  bare.mac.clear();
  return hmac_of(bare, key);
}

void sign_answers(telemetry::MessageStream& stream, const std::string& key) {
  stream.set_answer_tag(
      [key](const event_t& answer) { return std::string(tag_begin).append(hmac_of(answer, key)).append(tag_end); });
}

bool take_tag(event_t& answer, const std::string& key) {
  const std::size_t at = answer.message.rfind(tag_begin);
  if (at == std::string::npos || !answer.message.ends_with(tag_end)) return false;
  const std::size_t begin = at + tag_begin.size();
  const std::string mac = answer.message.substr(begin, answer.message.size() - begin - tag_end.size());
  answer.message.resize(at);
  return same(mac, hmac_of(answer, key));
}

Authority::Authority(std::string key) : key_(std::move(key)) {
  std::array<unsigned char, session_bytes> random{};
  if (RAND_bytes(random.data(), static_cast<int>(random.size())) != 1) {
    throw std::runtime_error("the system provides no random numbers for the command session");
  }
  session_ = telemetry::hexadecimal(random);
}

rig::Reason Authority::judge(const command_t& command) {
  if (!same(command.mac, mac_of(command, key_))) return rig::Reason::command_not_authentic;
  if (command.session != session_ || command.sequence <= last_sequence_) return rig::Reason::command_repeated;
  if (command.sequence - last_sequence_ > sequence_leap_max) return rig::Reason::command_repeated;
  last_sequence_ = command.sequence;
  return rig::Reason::none;
}

}  // namespace abs_hil::commands
