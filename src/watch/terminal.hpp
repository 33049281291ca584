#pragma once

#include "watch/cell_grid.hpp"

namespace abs_hil::watch {

/// Uses the terminal at stdin and stdout as a screen (ncurses) and keeps stderr output of libraries out of it. The
/// destructor restores the terminal. Signals that end a program without destructors (SIGQUIT, SIGSEGV, SIGABRT ...)
/// restore it too. Only one object may exist at a time.
class Terminal {
 public:
  /// Throws std::runtime_error if stdin or stdout is no terminal, or if its type (TERM) is unknown.
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  [[nodiscard]] int columns() const noexcept;
  [[nodiscard]] int rows() const noexcept;
  /// True if the locale uses UTF-8.
  [[nodiscard]] bool unicode() const noexcept { return unicode_; }

  void show(const CellGrid& grid);
  /// Returns the next typed key, 0 if there is none. Also handles a change of the terminal's size.
  [[nodiscard]] int key();

 private:
  bool unicode_;
  int stderr_{-1};  ///< the saved stderr if it is a terminal too
  bool colours_{false};
};

/// True if stdin and stdout are terminals.
[[nodiscard]] bool is_terminal() noexcept;

/// True if the locale named in the environment uses UTF-8. Sets the program's LC_CTYPE to it.
[[nodiscard]] bool locale_is_utf8();

}  // namespace abs_hil::watch
