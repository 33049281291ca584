// Time of the hm2 driver's cycle (one read, one write) over UDP on the loopback, as a ratio to a bare ping-pong of the
// same datagrams: both against the same board in a thread, alternately in one run. `ratio` is that of the medians.

#include <arpa/inet.h>
#include <benchmark/benchmark.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <thread>
#include <vector>

#include "driver/hm2/hm2_driver.hpp"
#include "driver/hm2/register_board.hpp"
#include "driver/monotonic_time.hpp"

namespace {

using namespace abs_hil;

/// The board of the tests behind a socket. Its time stands still, so its watchdog never bites.
class BoardOnUdp {
 public:
  BoardOnUdp() : socket_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address_;
    if (::bind(socket_, reinterpret_cast<sockaddr*>(&address_), size) != 0 ||
        ::getsockname(socket_, reinterpret_cast<sockaddr*>(&address_), &size) != 0) {
      std::abort();
    }
    thread_ = std::thread([this] { serve(); });
  }
  BoardOnUdp(const BoardOnUdp&) = delete;
  BoardOnUdp& operator=(const BoardOnUdp&) = delete;
  ~BoardOnUdp() {
    const std::uint8_t last = 0;
    static_cast<void>(::sendto(socket_, &last, 1, 0, reinterpret_cast<sockaddr*>(&address_), sizeof address_));
    thread_.join();
    ::close(socket_);
  }
  [[nodiscard]] const sockaddr_in& address() const { return address_; }

 private:
  void serve() {
    std::array<std::uint8_t, 1500> request{};
    for (;;) {
      sockaddr_in from{};
      socklen_t size = sizeof from;
      const ssize_t came =
          ::recvfrom(socket_, request.data(), request.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
      if (came <= 1) return;
      const auto answer = board_.handle(std::span(request).first(static_cast<std::size_t>(came)));
      if (answer.empty()) continue;
      static_cast<void>(::sendto(socket_, answer.data(), answer.size(), 0, reinterpret_cast<sockaddr*>(&from), size));
    }
  }
  test::RegisterBoard board_{};
  int socket_;
  sockaddr_in address_{};
  std::thread thread_;
};

double median(std::vector<double>& times) {
  const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
  std::nth_element(times.begin(), middle, times.end());
  return *middle;
}

void hm2_cycle(benchmark::State& state) {
  BoardOnUdp board;
  BoardOnUdp other;  // a board of the ping-pong's own: a driver would take its datagrams for another program's
  driver::hm2::Hm2Driver driver(
      {.answer_timeout_us = 8000, .rate_Hz = 100.0},
      [&board] { return std::make_unique<driver::hm2::UdpLink>(board.address()); }, driver::monotonic_ns);
  driver.configure();
  driver.activate(driver::monotonic_ns());
  const int bare = ::socket(AF_INET, SOCK_DGRAM, 0);
  if (::connect(bare, reinterpret_cast<const sockaddr*>(&other.address()), sizeof(sockaddr_in)) != 0) std::abort();
  const driver::hm2::CycleWire wire{.ports = 2,
                                    .port_data = 0x1000,
                                    .direction = 0x1100,
                                    .bitten = 0x0D00,
                                    .pet = 0x0E00,
                                    .stamp_clock = 0x3300,
                                    .count = {0x3004, 0x3000},
                                    .control = {0x3104, 0x3100},
                                    .pwm = {0x4000, 0x4004}};
  const driver::hm2::Packet read = wire.read(1);
  const driver::hm2::Packet write = wire.write({}, {0, 0}, 1);
  std::vector<double> cycles;
  std::vector<double> ping_pongs;
  rig::Measurement measurement;
  for (auto _ : state) {
    const std::int64_t begin_ns = driver::monotonic_ns();
    if (!driver.read(begin_ns, measurement).ok() || !driver.write({.brake_duty = 0.3}).ok()) std::abort();
    const std::int64_t middle_ns = driver::monotonic_ns();
    std::array<std::uint8_t, 256> answer{};
    if (::send(bare, read.bytes().data(), read.bytes().size(), 0) < 0 ||
        ::recv(bare, answer.data(), answer.size(), 0) != static_cast<ssize_t>(read.answer_bytes()) ||
        ::send(bare, write.bytes().data(), write.bytes().size(), 0) < 0) {
      std::abort();
    }
    const std::int64_t end_ns = driver::monotonic_ns();
    cycles.push_back(static_cast<double>(middle_ns - begin_ns));
    ping_pongs.push_back(static_cast<double>(end_ns - middle_ns));
  }
  ::close(bare);
  const double cycle_ns = median(cycles);
  const double ping_pong_ns = median(ping_pongs);
  state.counters["cycle_us"] = 1e-3 * cycle_ns;
  state.counters["ping_pong_us"] = 1e-3 * ping_pong_ns;
  state.counters["ratio"] = cycle_ns / ping_pong_ns;
}
BENCHMARK(hm2_cycle)->Iterations(20'000)->Unit(benchmark::kMicrosecond);

}  // namespace
