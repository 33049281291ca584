// Greets a tcpq server with a time limit, which liblcm lacks.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>

#include "telemetry/lcm_url.hpp"

namespace abs_hil::telemetry {
namespace {

constexpr std::uint32_t server_greeting = 0x287617fa;
constexpr std::uint32_t client_greeting = 0x287617fb;
constexpr std::uint32_t protocol_version = 0x0100;
/// The kernel grants at most twice net.core.wmem_max, about 400 kB by default. It reports room while a third is free.
constexpr int send_buffer_bytes = 1 << 20;

class Socket {
 public:
  Socket() : descriptor_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {}
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  [[nodiscard]] int get() const noexcept { return descriptor_; }

 private:
  int descriptor_;
};

class Deadline {
 public:
  explicit Deadline(int timeout_ms) : end_(Clock::now() + std::chrono::milliseconds(timeout_ms)) {}
  /// False if it does not become ready in time.
  [[nodiscard]] bool wait(int socket, short events) const noexcept {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end_ - Clock::now()).count();
    pollfd ready{socket, events, 0};
    return left > 0 && ::poll(&ready, 1, static_cast<int>(left)) > 0;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point end_;
};

}  // namespace

TcpqServer ask_tcpq_server(const Endpoint& endpoint, int timeout_ms) noexcept {
  const Deadline deadline(timeout_ms);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(endpoint.port);
  const Socket socket;
  if (socket.get() < 0 || ::inet_pton(AF_INET, endpoint.address.c_str(), &to.sin_addr) != 1) return TcpqServer::absent;
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) {
    if (errno != EINPROGRESS) return TcpqServer::absent;
    if (!deadline.wait(socket.get(), POLLOUT)) return TcpqServer::silent;
    int error = 0;
    socklen_t size = sizeof error;
    if (::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &error, &size) != 0 || error != 0) return TcpqServer::absent;
  }
  const std::array<std::uint32_t, 2> greeting{htonl(client_greeting), htonl(protocol_version)};
  if (::send(socket.get(), greeting.data(), sizeof greeting, MSG_NOSIGNAL) != sizeof greeting) {
    return TcpqServer::absent;
  }
  constexpr std::size_t answer_bytes = 8;
  std::array<std::uint8_t, answer_bytes> answer{};
  for (std::size_t got = 0; got < answer.size();) {
    if (!deadline.wait(socket.get(), POLLIN)) return TcpqServer::silent;
    const ssize_t size = ::recv(socket.get(), answer.data() + got, answer.size() - got, 0);
    if (size <= 0) return TcpqServer::absent;
    got += static_cast<std::size_t>(size);
  }
  std::uint32_t magic = 0;
  for (std::size_t i = 0; i < sizeof magic; ++i) magic = magic << 8U | answer[i];
  return magic == server_greeting ? TcpqServer::answers : TcpqServer::silent;
}

bool takes_without_waiting(int socket) noexcept {
  // Set at every call, because LCM may have connected again.
  static_cast<void>(::setsockopt(socket, SOL_SOCKET, SO_SNDBUF, &send_buffer_bytes, sizeof send_buffer_bytes));
  pollfd ready{socket, POLLOUT, 0};
  return ::poll(&ready, 1, 0) > 0;
}

}  // namespace abs_hil::telemetry
