#include "watch/terminal.hpp"

// Selects the wide-character functions of ncurses.
#define NCURSES_WIDECHAR 1
#define NCURSES_NOMACROS 1
#include <curses.h>
#include <fcntl.h>
#include <langinfo.h>
#include <term.h>
#include <termios.h>
#include <unistd.h>
#undef columns  // one of term.h's many macros

#include <algorithm>
#include <array>
#include <clocale>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

namespace abs_hil::watch {
namespace {

/// Signals that end the program without unwinding.
constexpr std::array fatal_signals{SIGQUIT, SIGILL, SIGABRT, SIGBUS, SIGFPE, SIGSEGV};

/// What a signal handler needs to restore the terminal. Prepared in advance, as a handler may call very little.
struct Rescue {
  termios modes{};
  std::array<char, 128> text{};
  std::size_t size{0};
};
Rescue rescue;

void append_capability(const char* name) {
  const char* text = ::tigetstr(name);
  if (text == nullptr || reinterpret_cast<std::intptr_t>(text) == -1) return;  // terminfo: -1 is "no string"
  const std::size_t size = std::min(std::strlen(text), rescue.text.size() - rescue.size);
  std::memcpy(rescue.text.data() + rescue.size, text, size);
  rescue.size += size;
}

extern "C" void give_back_and_die(int signal) {
  [[maybe_unused]] const auto written = ::write(STDOUT_FILENO, rescue.text.data(), rescue.size);
  ::tcsetattr(STDIN_FILENO, TCSANOW, &rescue.modes);
  ::raise(signal);  // SA_RESETHAND has restored the default action
}

void catch_fatal_signals() {
  struct sigaction action {};
  action.sa_handler = give_back_and_die;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_NODEFER);
  sigemptyset(&action.sa_mask);
  for (const int signal : fatal_signals) sigaction(signal, &action, nullptr);
}

void leave_fatal_signals() {
  for (const int signal : fatal_signals) std::signal(signal, SIG_DFL);
}

short colour_of(Style style) {
  switch (style) {
    case Style::alarm: return COLOR_RED;
    case Style::good: return COLOR_GREEN;
    case Style::first_line: return COLOR_CYAN;
    case Style::second_line: return COLOR_YELLOW;
    default: return -1;
  }
}

attr_t attributes_of(Style style) {
  switch (style) {
    case Style::dim: return A_DIM;
    case Style::bold: return A_BOLD;
    case Style::alarm: return A_BOLD | A_REVERSE;
    default: return A_NORMAL;
  }
}

}  // namespace

bool locale_is_utf8() {
  // Only the character set: numbers keep their decimal points.
  return std::setlocale(LC_CTYPE, "") != nullptr && std::string_view(::nl_langinfo(CODESET)) == "UTF-8";
}

bool is_terminal() noexcept { return ::isatty(STDIN_FILENO) == 1 && ::isatty(STDOUT_FILENO) == 1; }

Terminal::Terminal() : unicode_(locale_is_utf8()) {
  if (!is_terminal()) throw std::runtime_error("stdin and stdout must be a terminal; use --plain without one");
  ::tcgetattr(STDIN_FILENO, &rescue.modes);
  if (::newterm(nullptr, stdout, stdin) == nullptr) {
    const char* type = std::getenv("TERM");
    throw std::runtime_error(std::string("the terminal's type TERM='") + (type == nullptr ? "" : type) +
                             "' is unknown on this computer; set TERM=vt100, or use --plain");
  }
  rescue.size = 0;
  // liblcm writes connection messages to stderr, which would disturb the screen.
  if (::isatty(STDERR_FILENO) == 1) {
    const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
    stderr_ = ::fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3);
    if (nowhere >= 0 && stderr_ >= 0) ::dup2(nowhere, STDERR_FILENO);
    if (nowhere >= 0) ::close(nowhere);
  }
  for (const char* capability : {"sgr0", "cnorm", "rmcup"}) append_capability(capability);
  catch_fatal_signals();
  ::cbreak();
  ::noecho();
  ::nodelay(stdscr, TRUE);
  ::keypad(stdscr, TRUE);
  ::curs_set(0);
  const char* no_colour = std::getenv("NO_COLOR");
  if ((no_colour == nullptr || *no_colour == '\0') && ::has_colors() && ::start_color() == OK) {
    ::use_default_colors();
    colours_ = true;
    for (const Style style : {Style::alarm, Style::good, Style::first_line, Style::second_line}) {
      ::init_pair(static_cast<short>(style), colour_of(style), -1);
    }
  }
}

Terminal::~Terminal() {
  ::endwin();
  if (stderr_ >= 0) {
    ::dup2(stderr_, STDERR_FILENO);
    ::close(stderr_);
  }
  leave_fatal_signals();
}

int Terminal::columns() const noexcept { return ::getmaxx(stdscr); }
int Terminal::rows() const noexcept { return ::getmaxy(stdscr); }

void Terminal::show(const CellGrid& grid) {
  ::werase(stdscr);
  for (int row = 0; row < grid.rows(); ++row) {
    for (int column = 0; column < grid.columns(); ++column) {
      const Cell cell = grid.at(column, row);
      if (cell.glyph == U' ' && cell.style != Style::alarm) continue;
      const std::array<wchar_t, 3> text{static_cast<wchar_t>(cell.glyph), static_cast<wchar_t>(cell.mark), L'\0'};
      const short pair = colours_ && colour_of(cell.style) >= 0 ? static_cast<short>(cell.style) : short{0};
      cchar_t character{};
      ::setcchar(&character, text.data(), attributes_of(cell.style), pair, nullptr);
      ::mvwadd_wch(stdscr, row, column, &character);  // returns ERR for the last cell of the screen, but draws it
    }
  }
  ::wrefresh(stdscr);
}

int Terminal::key() {
  const int key = ::wgetch(stdscr);
  return key == ERR || key == KEY_RESIZE ? 0 : key;
}

}  // namespace abs_hil::watch
