#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>

#include "interchange/foreign_code.hpp"

namespace abs_hil::interchange {

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
