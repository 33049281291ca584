#pragma once

#include "watch/cell_grid.hpp"

namespace abs_hil::watch {

/// The terminal at stdin and stdout as a screen (ncurses); what libraries write to stderr does not get into it. The
/// destructor gives it back as it was, and so do the signals that end a program without destructors (SIGQUIT, SIGSEGV,
/// SIGABRT ...). One at a time.
class Terminal {
 public:
  /// Throws std::runtime_error when stdin or stdout is no terminal, or of a type (TERM) that nobody knows.
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  [[nodiscard]] int columns() const noexcept;
  [[nodiscard]] int rows() const noexcept;
  /// True where the locale's characters are UTF-8.
  [[nodiscard]] bool unicode() const noexcept { return unicode_; }

  void show(const CellGrid& grid);
  /// The next key typed, 0 if there is none. Also takes note of a new size.
  [[nodiscard]] int key();

 private:
  bool unicode_;
  int stderr_{-1};  ///< kept for later if it is a terminal too
  bool colours_{false};
};

/// True if stdin and stdout are terminals.
[[nodiscard]] bool is_terminal() noexcept;

/// True where the locale that the environment names writes UTF-8. Sets the program's LC_CTYPE to it.
[[nodiscard]] bool locale_is_utf8();

}  // namespace abs_hil::watch
