// Carries out the rows of a command line with CLI11, and tells of results that standard output has lost.
#include "cli/command_line.hpp"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <sstream>
#include <type_traits>

#include "rig/formatted_text.hpp"
#include "rig/nearest_name.hpp"

namespace abs_hil::cli {

namespace {

int why_lost = 0;  ///< errno of the first write to stdout that failed

bool is_integer(const Target& target) {
  return std::visit([](auto* to) { return std::is_integral_v<std::remove_pointer_t<decltype(to)>>; }, target);
}

/// A comparison with NaN is false, so CLI::Range takes it.
std::string refuse_infinite(const std::string& text) {
  double value = 0.0;
  return CLI::detail::lexical_cast(text, value) && !std::isfinite(value) ? "Value " + text + " is not a finite number"
                                                                         : std::string();
}

/// A file whose name promises another format than `type`, "FILE.csv" or "DIR", has.
std::string refuse_ending(const std::string& path, const std::string& type) {
  for (const char* format : {".csv", ".json", ".html", ".lcmlog", ".mcap", ".parquet", ".pdf", ".svg", ".png", ".md",
                             ".toml", ".mat", ".fmu", ".xlsx", ".txt"}) {
    if (path.ends_with(format) && type.find(format) == std::string::npos) return path + ": give " + type;
  }
  return {};
}

void limit_values(CLI::Option& option, const Target& to, const Option& row) {
  const bool real = std::holds_alternative<double*>(to);
  if (real) option.check(refuse_infinite, "");
  if (row.type == "DIR" || row.type.find("FILE.") != std::string::npos) {
    option.check([type = row.type](const std::string& path) { return refuse_ending(path, type); }, "");
  }
  const auto [least, most] = row.range;
  if (least < most) {
    option.check(real ? CLI::Range(least, most) : CLI::Range(static_cast<int>(least), static_cast<int>(most)));
  }
  if (!row.one_of.empty() && is_integer(to)) {
    std::vector<int> numbers(row.one_of.size());
    std::ranges::transform(row.one_of, numbers.begin(), [](const std::string& text) { return std::stoi(text); });
    option.check(CLI::IsMember(numbers));
  } else if (!row.one_of.empty()) {
    option.check(CLI::IsMember(row.one_of));
  }
}

/// As argparse has it: COLUMNS, or those of the terminal, or 80.
std::size_t columns() {
  const char* given = std::getenv("COLUMNS");
  int columns = given == nullptr ? 0 : rig::parse_number<int>(given).value_or(0);
  winsize terminal{};
  if (columns <= 0 && ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &terminal) == 0) columns = terminal.ws_col;
  constexpr int usual = 80;
  constexpr int least = 40;
  return static_cast<std::size_t>(columns <= 0 ? usual : std::max(columns, least));
}

/// Breaks long lines between words. The rest goes below the text of its row, which stands after two spaces.
std::string wrapped(const std::string& text) {
  const std::size_t width = columns();
  std::istringstream lines(text);
  std::string out;
  for (std::string line; std::getline(lines, line); out += line + '\n') {
    const std::size_t gap = line.rfind("  ");
    const std::size_t row = gap == std::string::npos ? 0 : gap + 2;
    const std::size_t indent = row <= width / 2 ? row : line.find_first_not_of(' ') + 4;
    while (line.size() > width) {
      std::size_t cut = line.rfind(' ', width);
      if (cut == std::string::npos || cut < line.find_first_not_of(' ')) cut = line.find(' ', width);
      if (cut == std::string::npos) break;
      out += line.substr(0, cut) + '\n';
      line.erase(0, cut + 1);
      const std::size_t word = std::min(line.find(' '), line.size());  // a long one begins further left
      line.insert(0, std::min(indent, width - std::min(word, width)), ' ');
    }
  }
  return out;
}

/// The first word that the command line should not have, and the valid one that is nearest to it.
std::string unexpected(const CLI::App& program, const std::map<std::string, std::string>& explained) {
  const CLI::App* app = &program;
  while (app->remaining().empty() && !app->get_subcommands().empty()) app = app->get_subcommands().front();
  std::string word = app->remaining().front();
  std::vector<std::string> names;
  if (word.starts_with('-')) {
    word.resize(std::min(word.find('='), word.size()));
    for (const CLI::Option* option : app->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
    return "unknown option " + word + rig::nearest_hint(word, names);
  }
  if (word.find_first_of("=.0123456789") == 0) {
    return "unexpected word " + word + ": write key=value without spaces, or in quotes";
  }
  if (const auto why = explained.find(word); why != explained.end()) return why->second;
  for (const CLI::App* subcommand : app->get_subcommands({})) {
    if (!subcommand->get_name().empty()) names.push_back(subcommand->get_name());
  }
  if (names.empty() || !app->get_subcommands().empty()) return "unexpected argument " + word;
  return "unknown subcommand " + word + rig::nearest_hint(word, names) + "; known: " + rig::joined(names);
}

}  // namespace

Parser::Parser(std::string name, const std::string& help) : app_(std::make_shared<CLI::App>(help, std::move(name))) {
  app_->formatter_fn([](const CLI::App* app, const std::string& called, CLI::AppFormatMode mode) {
    return wrapped(CLI::Formatter().make_help(app, called, mode));
  });
}

void Parser::add(const std::string& names, const Target& to, const std::string& help, const Option& row) {
  const auto bind = [&](auto* target) {
    if constexpr (std::is_same_v<decltype(target), bool*>) {
      return app_->add_flag((row.sets ? "" : "!") + names, *target, help);
    } else {
      return app_->add_option(names, *target, help);
    }
  };
  CLI::Option& option = *std::visit(bind, to);
  limit_values(option, to, row);
  if (!row.type.empty()) option.type_name(row.type);
  if (row.count.most > 0) option.expected(row.count.least, row.count.most);
  if (row.repeated) option.allow_extra_args(false);
  if (row.required) option.required();
  if (row.show_default) option.capture_default_str();
  if (!row.default_text.empty()) option.default_str(row.default_text);
  for (const std::string& other : row.excludes) option.excludes(other);
}

void Parser::set_version(const std::string& version) { app_->set_version_flag("--version", version); }

void Parser::set_footer(const std::string& footer) { app_->footer(footer); }

void Parser::explain(const std::string& word, const std::string& why) { explained_[word] = why; }

Parser Parser::add_subcommand(const std::string& name, const std::string& help) {
  app_->require_subcommand(0, 1);
  return Parser(app_->get_subcommand_ptr(app_->add_subcommand(name, help)));
}

Parser Parser::add_group(const std::string& name, const std::string& help, Count count) {
  CLI::App* group = app_->add_option_group(name, help);
  group->require_option(static_cast<std::size_t>(count.least), static_cast<std::size_t>(count.most));
  return Parser(app_->get_subcommand_ptr(group));
}

std::optional<int> Parser::parse(int argc, const char* const* argv) {
  const bool named = !app_->get_name().empty();
  try {
    app_->parse(argc, argv);
    return std::nullopt;
  } catch (const CLI::ExtrasError& error) {
    return named ? refuse(unexpected(*app_, explained_)) : app_->exit(error) == 0 ? 0 : usage_error;
  } catch (const CLI::ParseError& error) {
    if (named && error.get_exit_code() != 0) return refuse(error.what());
    // The help of something else would pass for that of the unknown word.
    if (named && !app_->remaining(true).empty()) return refuse(unexpected(*app_, explained_));
    return app_->exit(error) == 0 ? 0 : usage_error;
  }
}

int Parser::refuse(const std::string& why) const {
  std::string command = app_->get_name();
  for (const CLI::App* subcommand : app_->get_subcommands()) command += " " + subcommand->get_name();
  std::cerr << app_->get_name() << ": " << why << " (" << command << " --help shows all options)\n" << std::flush;
  return usage_error;
}

bool Parser::parsed() const { return app_->parsed(); }

std::vector<std::string> Parser::given() const {
  std::vector<std::string> names;
  for (const CLI::Option* option : app_->get_options()) {
    if (option->count() > 0) names.push_back(option->get_name());
  }
  return names;
}

void put(std::FILE* stream, std::string_view text) noexcept {
  const bool whole = std::fwrite(text.data(), 1, text.size(), stream) == text.size();
  if (!whole && stream == stdout && why_lost == 0) why_lost = errno;
}

int with_stdout(const char* program, int status) {
  if (std::fflush(stdout) != 0 && why_lost == 0) why_lost = errno;
  if (why_lost == 0 && std::ferror(stdout) == 0) return status;
  pollfd output{STDOUT_FILENO, POLLOUT, 0};
  if (::poll(&output, 1, 0) > 0 && (output.revents & (POLLERR | POLLHUP)) != 0) return status;
  std::fprintf(stderr, "%s: cannot write to standard output%s%s\n", program, why_lost != 0 ? ": " : "",
               why_lost != 0 ? rig::refusal(why_lost, "", rig::writing).c_str() : "");
  return status == 0 ? 1 : status;
}

}  // namespace abs_hil::cli
