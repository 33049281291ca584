// Whether a tcpq server takes data.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <future>
#include <stdexcept>
#include <string>
#include <vector>

#include "catch.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::telemetry {
namespace {

/// Listens on a port of the kernel's choice of the loopback interface; accepts nobody unless told to.
class Listening {
 public:
  Listening() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof at;
    auto* address = reinterpret_cast<sockaddr*>(&at);
    if (::bind(socket_, address, size) != 0 || ::listen(socket_, 4) != 0) throw std::runtime_error("no socket");
    ::getsockname(socket_, address, &size);
    port_ = ntohs(at.sin_port);
  }
  Listening(const Listening&) = delete;
  Listening& operator=(const Listening&) = delete;
  ~Listening() { ::close(socket_); }

  [[nodiscard]] Endpoint endpoint() const { return {"127.0.0.1", port_}; }
  /// Takes one connection, reads the greeting, answers with `words` and hangs up.
  void greet(std::vector<std::uint32_t> words) const {
    const int connection = ::accept(socket_, nullptr, nullptr);
    std::array<char, 8> greeting{};
    static_cast<void>(::recv(connection, greeting.data(), greeting.size(), MSG_WAITALL));
    for (std::uint32_t& word : words) word = htonl(word);
    static_cast<void>(::send(connection, words.data(), words.size() * sizeof(std::uint32_t), MSG_NOSIGNAL));
    ::close(connection);
  }

 private:
  int socket_;
  std::uint16_t port_{0};
};

TEST_CASE("a tcpq server is distinguished from a stopped one, from none and from another program") {
  const Listening server;
  CHECK(ask_tcpq_server(server.endpoint(), 20) == TcpqServer::silent);  // the kernel connects, but no program accepts
  CHECK(ask_tcpq_server({"127.0.0.1", 1}, 1000) == TcpqServer::absent);
  CHECK(ask_tcpq_server({"nowhere", 7700}, 1000) == TcpqServer::absent);

  const Listening lcm, web, cut;
  const auto answer = [](const Listening& to, std::vector<std::uint32_t> words) {
    const auto taken = std::async(std::launch::async, [&] { to.greet(std::move(words)); });
    return ask_tcpq_server(to.endpoint(), 5000);
  };
  CHECK(answer(lcm, {0x287617fa, 0x0100}) == TcpqServer::answers);
  CHECK(answer(web, {0x48545450, 0x2f312e31}) == TcpqServer::silent);
  CHECK(answer(cut, {0x287617fa}) == TcpqServer::absent);
}

TEST_CASE("a stopped server is refused with the fix") {
  const Listening server;
  const std::string url = "tcpq://127.0.0.1:" + std::to_string(server.endpoint().port);
  CHECK_THROWS_WITH(LcmOutlet(url), Catch::Matchers::Contains("does not answer"));
}

TEST_CASE(
    "a connection whose reader reads nothing takes no more in the end, and a broken one says so when written to") {
  std::array<int, 2> ends{};
  REQUIRE(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends.data()) == 0);
  CHECK(takes_without_waiting(ends[0]));
  const std::vector<char> much(1 << 16);
  int messages = 0;
  while (takes_without_waiting(ends[0]) && messages < 1000) {
    REQUIRE(::send(ends[0], much.data(), much.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(much.size()));
    ++messages;
  }
  CHECK(messages > 0);
  CHECK(messages < 1000);
  ::close(ends[1]);
  CHECK(takes_without_waiting(ends[0]));
  ::close(ends[0]);
}

}  // namespace
}  // namespace abs_hil::telemetry
