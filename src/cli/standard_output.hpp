#pragma once

namespace abs_hil::cli {

/// Flushes standard output at the end of a program. Results that did not reach it are lost data: a message on stderr,
/// and 1 in place of status 0. A reader or a terminal that has gone wanted no more.
[[nodiscard]] int with_stdout(const char* program, int status);

}  // namespace abs_hil::cli
