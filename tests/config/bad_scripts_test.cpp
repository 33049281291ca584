// Every bad/NAME.toml must be refused with the message in bad/NAME.expected, word for word.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "abs_hil/control/registry.hpp"
#include "catch.hpp"
#include "config/config_error.hpp"
#include "config/script.hpp"

using namespace abs_hil;
namespace fs = std::filesystem;

namespace {

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

/// The message without the folder, which depends on the computer; empty if the script is valid.
std::string refusal_of(const fs::path& path) try {
  static_cast<void>(config::load(path.string()));
  return {};
} catch (const config::ConfigError& error) {
  std::string message = error.what();
  const std::string folder = path.parent_path().string() + '/';
  if (message.starts_with(folder)) message.erase(0, folder.size());
  return message + '\n';
}

/// The message of the file, with the names of the controllers in place of @controllers@.
std::string expected_in(const fs::path& path) {
  std::string text = text_of(path);
  constexpr std::string_view mark = "@controllers@";
  const std::size_t at = text.find(mark);
  if (at == std::string::npos) return text;
  std::string names;
  for (const control::ControllerEntry& entry : control::controllers()) {
    names.append(names.empty() ? "" : ", ").append(entry.name);
  }
  return text.replace(at, mark.size(), names);
}

}  // namespace

TEST_CASE("every bad script is refused with the exact message") {
  std::vector<fs::path> scripts;
  for (const auto& entry : fs::directory_iterator(ABS_HIL_BAD_SCRIPTS)) {
    if (entry.path().extension() == ".toml") scripts.push_back(entry.path());
  }
  std::sort(scripts.begin(), scripts.end());
  CHECK(scripts.size() >= 40);
  // For a new script: write the message to the file, then check it with care.
  const bool write_down = std::getenv("ABS_HIL_WRITE_EXPECTED") != nullptr;
  for (const fs::path& path : scripts) {
    fs::path expected = path;
    expected.replace_extension(".expected");
    if (write_down && !fs::exists(expected)) std::ofstream(expected, std::ios::binary) << refusal_of(path);
    INFO(path.filename().string());
    CHECK(refusal_of(path) == expected_in(expected));
    CHECK_FALSE(text_of(expected).empty());
  }
}
