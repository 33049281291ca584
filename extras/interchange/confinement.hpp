#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
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

/// File descriptor of the host's socket (SOCK_SEQPACKET). The first packet is the setup as JSON, and its answer is
/// JSON: {"signals": [...], "source": "..."} or {"error": "..."}. Then each packet is a HostRequest, and its answer a
/// HostAnswer.
inline constexpr int host_socket = 3;
inline constexpr std::size_t host_packet_max = 65'536;

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ForeignSetup, file, folder, mapping, period_s, files_unprotected, parameters)

enum class HostAction : std::uint32_t {
  reset,
  step,
  warm_up,  ///< `count` trial steps
  probe,    ///< `count` trial steps under watch; only `end` may follow
};

struct HostRequest {
  HostAction action{HostAction::step};
  std::uint32_t count{0};
  double period_s{0.0};
  abs_hil_input input{};
};

struct HostAnswer {
  abs_hil_output output{};
  StepTimes times{};
  Offences offences{};
  std::array<char, 128> failure{};  ///< ForeignCode::failure
};

/// The last word of a host whose code asked for a forbidden system call; shorter than any answer.
struct HostRefusal {
  std::int32_t system_call{-1};
};

/// Serves foreign code to the process at the other end of `host_socket` until that closes it. Returns the exit status.
/// @param make  loads the code, in a process that is confined by then
/// @param allocations  calls of malloc and its like in this process so far
int run_host(const std::function<std::unique_ptr<ForeignCode>(const ForeignSetup&)>& make,
             const std::function<std::uint64_t()>& allocations);

}  // namespace abs_hil::interchange
