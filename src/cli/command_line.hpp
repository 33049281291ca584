// A program's command line as rows of options.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace CLI {
class App;
}

// Options and subcommands of a program, one row each:
//
//   cli::Parser parser("abs_hil", "Drives the rig");
//   parser.add("--backend", &o.backend, "sim or rig", {.one_of = {"sim", "rig"}});
//   if (const auto status = parser.parse(argc, argv)) return *status;
//
// Only command_line.cpp includes the library behind it, CLI11, which takes long to compile.

namespace abs_hil::cli {

constexpr int usage_error = 2;  ///< exit status of a wrong command line

/// Where the value goes. The pointer must stay valid until the command line is parsed.
using Target = std::variant<bool*, int*, std::uint16_t*, std::uint32_t*, std::uint64_t*, double*, std::string*,
                            std::optional<int>*, std::optional<std::string>*, std::vector<std::string>*>;

/// Valid numbers, both ends included. Equal ends: any number is valid.
struct Range {
  double least{0.0};
  double most{0.0};
};

/// How many may be given. `most` 0: as many as the target holds.
struct Count {
  int least{0};
  int most{0};
};

/// What more there is to say of an option.
struct Option {
  bool sets{true};                      ///< the value that a flag gives its target
  std::string type{};                   ///< name of the value in the help; "FILE.csv", "DIR": its ending must fit
  Range range{};                        ///< of integers unless the target is a double
  std::vector<std::string> one_of{};    ///< valid values; empty: any
  Count count{};                        ///< of values
  bool repeated{false};                 ///< takes one value each time; without it, all that follow
  bool required{false};                 ///< the command line must have it
  bool show_default{false};             ///< the help shows the target's value at this moment
  std::string default_text{};           ///< the help shows this as the default
  std::vector<std::string> excludes{};  ///< names of options that must not
};

/// What a program, a subcommand or a group of options reads from a command line. A copy is the same parser.
class Parser {
 public:
  /// Is empty: assign another parser before use.
  Parser() = default;
  /// Knows --help. Without a name the program is called what the user typed, and its errors are in CLI11's own form.
  Parser(std::string name, const std::string& help);

  /// Adds an option. Those that it excludes come first. Throws std::exception for an invalid row.
  /// @param names  "--rate" or "-r,--rate"; without dashes, an argument known by its place
  /// @param to  a bool makes the option a flag, which takes no value
  void add(const std::string& names, const Target& to, const std::string& help, const Option& row = {});
  /// Adds --version, which prints this text.
  void set_version(const std::string& version);
  /// Sets the last lines of the help.
  void set_footer(const std::string& footer);
  /// An error that says `why`, in place of "unknown subcommand", for a word that people try.
  void explain(const std::string& word, const std::string& why);
  /// Adds a subcommand; a command line may have one.
  [[nodiscard]] Parser add_subcommand(const std::string& name, const std::string& help);
  /// Adds a group of options, of which a command line must have as many as `count` says.
  [[nodiscard]] Parser add_group(const std::string& name, const std::string& help, Count count);

  /// Reads the command line into the targets. Returns the exit status if the program must end: it has printed help or
  /// version, or an error on stderr.
  [[nodiscard]] std::optional<int> parse(int argc, const char* const* argv);
  /// Prints an error as `parse` does. Returns the exit status.
  [[nodiscard]] int refuse(const std::string& why) const;
  /// True if the command line had this subcommand.
  [[nodiscard]] bool parsed() const;
  /// Names of the options that were given, without those of groups and subcommands.
  [[nodiscard]] std::vector<std::string> given() const;

 private:
  explicit Parser(std::shared_ptr<CLI::App> app) : app_(std::move(app)) {}

  std::shared_ptr<CLI::App> app_{};
  std::map<std::string, std::string> explained_{};
};

/// Writes to stdout or stderr. Never throws, since a reader such as `head` may end early; with_stdout tells lost
/// results.
void put(std::FILE* stream, std::string_view text) noexcept;
template <typename... Values>
void print(std::FILE* stream, fmt::format_string<Values...> text, Values&&... values) {
  put(stream, fmt::format(text, std::forward<Values>(values)...));
}
template <typename... Values>
void print(fmt::format_string<Values...> text, Values&&... values) {
  put(stdout, fmt::format(text, std::forward<Values>(values)...));
}

/// Flushes standard output at the end of a program. Results that did not reach it are lost data: a message on stderr,
/// and 1 in place of status 0. A reader or a terminal that has gone wanted no more.
[[nodiscard]] int with_stdout(const char* program, int status);

}  // namespace abs_hil::cli
