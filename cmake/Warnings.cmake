# Warnings that every target of ours is built with; all are errors.
add_library(abs_hil_warnings INTERFACE)
target_compile_options(abs_hil_warnings INTERFACE -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror)
