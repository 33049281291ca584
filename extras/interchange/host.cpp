// The process that foreign code runs in: answers steps until the other end closes.
#include "interchange/host.hpp"

#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <exception>
#include <string>

#include "interchange/confinement.hpp"

namespace abs_hil::interchange {

namespace {

bool send_packet(const void* data, std::size_t size) {
  return ::send(host_socket, data, size, MSG_NOSIGNAL) == static_cast<ssize_t>(size);
}

bool send_json(const nlohmann::json& json) {
  const std::string text = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return send_packet(text.data(), text.size());
}

/// Trial steps of code that is warm, with an eye on what it asks of the system. Its system calls are not done.
Offences probe(ForeignCode& code, const HostRequest& request, const std::function<std::uint64_t()>& allocations) {
  constexpr std::int64_t warming = 200;
  static_cast<void>(warm_up(code, request.period_s, warming));
  code.reset(trial_input(0, request.period_s));
  if (!trap_system_calls(host_socket)) return {};
  const std::uint64_t before = allocations();
  for (std::int64_t step = 0; step < request.count; ++step) {
    abs_hil_output output = no_output();
    code.step(trial_input(step, request.period_s), output);
  }
  Offences found = trapped_system_calls();
  found.allocations = allocations() - before;
  return found;
}

}  // namespace

int run_host(const std::function<std::unique_ptr<ForeignCode>(const ForeignSetup&)>& make,
             const std::function<std::uint64_t()>& allocations) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::dup2(STDERR_FILENO, STDOUT_FILENO);  // what foreign code prints must not mix with the program's results
  std::string packet(host_packet_max, '\0');
  const ssize_t size = ::recv(host_socket, packet.data(), packet.size(), 0);
  if (size <= 0) return 2;
  packet.resize(static_cast<std::size_t>(size));
  std::unique_ptr<ForeignCode> code;
  try {
    const auto setup = nlohmann::json::parse(packet).get<ForeignSetup>();
    if (const std::string why = confine(host_socket, setup.files_unprotected); !why.empty()) {
      throw std::runtime_error("this kernel cannot confine a controller from a file (" + why + ")");
    }
    code = make(setup);
  } catch (const std::exception& error) {
    static_cast<void>(send_json({{"error", error.what()}}));
    return 2;
  }
  if (!send_json({{"signals", code->signals()}, {"source", code->source()}})) return 2;
  HostRequest request;
  while (::recv(host_socket, &request, sizeof request, 0) == static_cast<ssize_t>(sizeof request)) {
    HostAnswer answer{.output = no_output()};
    switch (request.action) {
      case HostAction::reset: code->reset(request.input); break;
      case HostAction::step: code->step(request.input, answer.output); break;
      case HostAction::warm_up: answer.times = warm_up(*code, request.period_s, request.count); break;
      case HostAction::probe:
        answer.offences = probe(*code, request, allocations);
        static_cast<void>(send_packet(&answer, sizeof answer));
        ::_exit(0);  // no system call but this one is done any more
    }
    // A step that works costs no text.
    if (request.action != HostAction::step || std::isnan(answer.output.brake_torque_Nm)) {
      code->failure().copy(answer.failure.data(), answer.failure.size() - 1);
    }
    if (!send_packet(&answer, sizeof answer)) break;
  }
  return 0;
}

}  // namespace abs_hil::interchange
