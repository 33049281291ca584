# The warnings of all our targets; each is an error.
add_library(abs_hil_warnings INTERFACE)
target_compile_options(abs_hil_warnings INTERFACE -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror)
