#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "interchange/foreign_code.hpp"

namespace abs_hil::interchange {

/// Limits of the process that runs foreign code in a simulation or a trial (docs/interchange.md has the table).
inline constexpr std::uint64_t host_data_bytes_max = std::uint64_t{1} << 30U;     ///< private memory that it may write
inline constexpr std::uint64_t host_address_bytes_max = std::uint64_t{4} << 30U;  ///< all its addresses
inline constexpr std::uint64_t host_file_bytes_max = std::uint64_t{64} << 20U;    ///< a file that it writes
inline constexpr std::uint64_t host_descriptors_max = 128;                        ///< files open at once
inline constexpr std::uint64_t host_threads_max = 256;                            ///< counted by the run

/// The folder in which foreign code may write, and FMUs are unpacked: TMPDIR, else /tmp.
[[nodiscard]] std::filesystem::path temporary_folder();

/// From now on this process may use no more than the limits above; it may start no process, touch no other process,
/// take no priority, open no socket and write no file outside the folder for temporary files. System calls that are on
/// no list fail with ENOSYS. What asks for a socket or a file gets an error, as honest code expects it. The forbidden
/// system calls end the process: it sends `HostRefusal` on `socket`. Descriptors above `socket` are closed,
/// capabilities dropped. Holds for its threads to come. Works for root and without.
/// @param files_unprotected  go on where the kernel has no Landlock, which keeps the files
/// Returns why the kernel cannot do that; empty if it can.
[[nodiscard]] std::string confine(int socket, bool files_unprotected);

/// Name of a system call; "another one" for a number that is none.
[[nodiscard]] std::string name_of_call(std::int32_t number);

/// From now on this process may only send on `socket`, ask for memory, and end. Any other system call is counted and
/// fails with ENOSYS. False if the kernel cannot do that.
[[nodiscard]] bool trap_system_calls(int socket);
/// What was counted of them.
[[nodiscard]] Offences trapped_system_calls() noexcept;

}  // namespace abs_hil::interchange
