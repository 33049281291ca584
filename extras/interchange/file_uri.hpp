// URIs of files by RFC 8089 and RFC 3986: made for the FMUs that we start, and read by the FMUs that we export.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <string>
#include <string_view>

#include "rig/formatted_text.hpp"

namespace abs_hil::interchange {

#ifdef _WIN32
inline constexpr bool on_windows = true;
#else
inline constexpr bool on_windows = false;
#endif

/// The URI of an absolute path by RFC 8089, file:///tmp/50%25: its bytes but RFC 3986's unreserved ones and '/' are
/// %XX.
[[nodiscard]] inline std::string file_uri(std::string_view path) {
  constexpr std::string_view plain = "-._~/0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
  std::string uri = "file://";
  for (const char c : path)
    uri += plain.find(c) != plain.npos ? std::string(1, c) : rig::formatted("%%%02X", static_cast<unsigned char>(c));
  return uri;
}

/// The path, in UTF-8, of an URI such as file:///tmp/a%20b, file:/tmp or file://localhost/tmp. A text without "file:"
/// is a path already; a '%' that begins no escape stands for itself. On Windows file:///C:/a is C:/a, and another
/// computer's name stays: //server/share. Throws std::invalid_argument for a zero byte, and elsewhere for another
/// computer.
[[nodiscard]] inline std::string path_of_uri(std::string_view uri, bool windows = on_windows) {
  constexpr std::string_view scheme = "file:";
  const auto same = [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; };
  if (!std::ranges::equal(uri.substr(0, scheme.size()), scheme, same)) return std::string(uri);
  std::string_view rest = uri.substr(scheme.size());
  const std::string_view host = rest.starts_with("//") ? rest.substr(2, rest.find('/', 2) - 2) : std::string_view();
  const bool own = host.empty() || std::ranges::equal(host, std::string_view("localhost"), same);
  if (!own && !windows)
    throw std::invalid_argument(std::string(uri) + " names a file of the computer " + std::string(host));
  if (own && rest.starts_with("//")) rest.remove_prefix(2 + host.size());
  std::string path;
  for (std::size_t n = 0; n < rest.size(); ++n) {
    const auto code = rig::parse_number<unsigned>(rest.substr(n + 1, 2), 16);
    const bool escape = rest[n] == '%' && n + 2 < rest.size() && code;
    if (escape && *code == 0) throw std::invalid_argument(std::string(uri) + " holds a zero byte");
    path += escape ? static_cast<char>(*code) : rest[n];
    if (escape) n += 2;
  }
  const bool drive = windows && path.size() > 2 && path[0] == '/' && (path[2] == ':' || path[2] == '|');
  return drive ? path[1] + (':' + path.substr(3)) : path;
}

}  // namespace abs_hil::interchange
