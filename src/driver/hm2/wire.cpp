// LBP16 packets and the UDP socket.
#include "driver/hm2/wire.hpp"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>

#include "abs_hil/rig/time_units.hpp"
#include "driver/monotonic_time.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::hm2 {

using rig::formatted;

void Packet::put(std::uint32_t value, unsigned bytes) noexcept {
  for (unsigned i = 0; i < bytes && size_ < bytes_.size(); ++i) bytes_[size_++] = (value >> (8U * i)) & 0xFFU;
}

namespace {

bool has_32_bit(unsigned space) noexcept { return space == space::hostmot2 || space == space::emulator; }

}  // namespace

void Packet::command(bool write, unsigned in_space, unsigned units, std::uint16_t address, bool increment) noexcept {
  const unsigned width = has_32_bit(in_space) ? 2 : 1;
  put((write ? 0x8000U : 0U) | 0x4000U | in_space << 10U | width << 8U | (increment ? 0x80U : 0U) | units, 2);
  put(address, 2);
}

std::size_t Packet::read(unsigned from_space, std::uint16_t address, unsigned units) noexcept {
  const std::size_t where = answer_bytes_;
  command(false, from_space, units, address, from_space == space::hostmot2 || units > 1);
  answer_bytes_ += units * (has_32_bit(from_space) ? 4U : 2U);
  return where;
}

void Packet::write32(std::uint16_t address, std::span<const std::uint32_t> values) noexcept {
  command(true, space::hostmot2, static_cast<unsigned>(values.size()), address, true);
  for (const std::uint32_t value : values) put(value, 4);
}

void Packet::write_time(std::uint64_t time_ns) noexcept {
  command(true, space::emulator, 2, 0, true);
  put(static_cast<std::uint32_t>(time_ns), 4);
  put(static_cast<std::uint32_t>(time_ns >> 32U), 4);
}

void Packet::write_number(std::uint16_t address, std::uint32_t number) noexcept {
  command(true, space::timers, 2, address, true);
  put(number, 4);
}

NoSocket::NoSocket(int error)
    : Unavailable("backend rig: no UDP socket to the hm2 board: " +
                  rig::refusal(error, "driver.hm2.address", rig::reaching)),
      errno_value(error) {}

UdpLink::UdpLink(const sockaddr_in& board) : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
  // A connected socket takes datagrams of this address and port alone.
  if (socket_.get() < 0 || ::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&board), sizeof board) != 0) {
    throw NoSocket(errno);
  }
}

int UdpLink::send(std::span<const std::uint8_t> bytes) noexcept {
  // An ICMP message about an earlier datagram is reported once, in place of sending this one.
  for (int attempt = 0; attempt < 2; ++attempt) {
    if (::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL) >= 0) return 0;
    if (errno != ECONNREFUSED && errno != EHOSTUNREACH && errno != ENETUNREACH) break;
  }
  return errno;
}

std::size_t UdpLink::receive(std::span<std::uint8_t> buffer, std::int64_t deadline_ns) noexcept {
  for (;;) {
    const std::int64_t left_ns = std::max<std::int64_t>(deadline_ns - monotonic_ns(), 0);
    const timespec left{.tv_sec = left_ns / rig::ns_per_s, .tv_nsec = left_ns % rig::ns_per_s};
    pollfd waiting{socket_.get(), POLLIN, 0};
    if (::ppoll(&waiting, 1, &left, nullptr) > 0) {
      const ssize_t size = ::recv(socket_.get(), buffer.data(), buffer.size(), 0);
      if (size > 0) return static_cast<std::size_t>(size);
    }
    if (monotonic_ns() >= deadline_ns) return 0;
  }
}

int RecordedLink::send(std::span<const std::uint8_t> bytes) noexcept {
  const int error = link_->send(bytes);
  if (error == 0) ++sent_;
  keep(true, bytes);
  return error;
}

std::size_t RecordedLink::receive(std::span<std::uint8_t> buffer, std::int64_t deadline_ns) noexcept {
  const std::size_t size = link_->receive(buffer, deadline_ns);
  if (size > 0) keep(false, buffer.first(size));
  return size;
}

void RecordedLink::keep(bool sent, std::span<const std::uint8_t> bytes) noexcept {
  Datagram& datagram = datagrams_[kept_++ % datagrams_.size()];
  datagram = {.time_ns = monotonic_ns(), .sent = sent, .size = static_cast<std::uint16_t>(bytes.size())};
  std::copy_n(bytes.begin(), std::min(bytes.size(), datagram.bytes.size()), datagram.bytes.begin());
}

std::vector<std::string> RecordedLink::lines() const {
  std::vector<std::string> lines;
  const std::uint64_t first = kept_ > datagrams_.size() ? kept_ - datagrams_.size() : 0;
  for (std::uint64_t i = first; i < kept_; ++i) {
    const Datagram& datagram = datagrams_[i % datagrams_.size()];
    std::string line = formatted("%.6f %s %3u", 1e-9 * static_cast<double>(datagram.time_ns),
                                 datagram.sent ? "sent" : "got ", static_cast<unsigned>(datagram.size));
    line += ' ';
    for (std::size_t at = 0; at < std::min<std::size_t>(datagram.size, datagram.bytes.size()); ++at) {
      line += formatted("%02x", static_cast<unsigned>(datagram.bytes[at]));
    }
    lines.push_back(std::move(line));
  }
  return lines;
}

sockaddr_in parse_address(const std::string& text) {
  const std::size_t colon = text.find(':');
  sockaddr_in address{};
  address.sin_family = AF_INET;
  const auto port =
      colon == std::string::npos ? standard_port : rig::parse_number<std::uint16_t>(text.substr(colon + 1)).value_or(0);
  address.sin_port = htons(port);
  if (port != 0 && ::inet_pton(AF_INET, text.substr(0, colon).c_str(), &address.sin_addr) == 1) return address;
  throw std::invalid_argument("driver.hm2.address = \"" + text +
                              "\": give an IPv4 address or address:port, such as 192.168.1.121:27181");
}

bool ask(Link& link, const Packet& packet, std::span<std::uint8_t> answer, std::uint32_t& number, std::int64_t wait_ns,
         int tries) noexcept {
  std::array<std::uint8_t, most_bytes> request{};
  std::array<std::uint8_t, most_bytes> taken{};
  for (int attempt = 0; attempt < tries; ++attempt) {
    Packet numbered;
    numbered.write_number(at::read_number, ++number);
    const std::size_t number_at = numbered.read(space::timers, at::read_number, 2);
    const auto head = numbered.bytes();
    const auto body = packet.bytes();
    if (head.size() + body.size() > request.size()) return false;
    std::copy(body.begin(), body.end(), std::copy(head.begin(), head.end(), request.begin()));
    if (link.send({request.data(), head.size() + body.size()}) != 0) continue;
    const std::int64_t deadline_ns = monotonic_ns() + wait_ns;
    const std::size_t size = numbered.answer_bytes() + packet.answer_bytes();
    constexpr int most_stale = 64;  // a board that floods must not hold the caller
    for (int i = 0; i < most_stale; ++i) {
      const std::size_t came = link.receive(taken, deadline_ns);
      if (came == 0) break;
      if (came != size || word32(taken, number_at) != number) continue;
      std::copy_n(taken.begin() + static_cast<std::ptrdiff_t>(numbered.answer_bytes()),
                  std::min(answer.size(), packet.answer_bytes()), answer.begin());
      return true;
    }
  }
  return false;
}

void write_pair(Packet& packet, const RegisterPair& address, const std::array<std::uint32_t, 2>& values) noexcept {
  const auto [a, b] = address;
  if (b == a + 4) {
    packet.write32(a, values);
  } else if (a == b + 4) {
    packet.write32(b, std::array{values[1], values[0]});
  } else {
    packet.write32(a, values[0]);
    packet.write32(b, values[1]);
  }
}

namespace {

/// The lower one of two neighbours comes first in the answer.
void read_pair(Packet& packet, const RegisterPair& address) noexcept {
  const auto [a, b] = address;
  if (b == a + 4 || a == b + 4) {
    packet.read(space::hostmot2, std::min(a, b), 2);
  } else {
    packet.read(space::hostmot2, a);
    packet.read(space::hostmot2, b);
  }
}

}  // namespace

Packet CycleWire::read(std::uint32_t number) const noexcept {
  Packet packet;
  packet.read(space::timers, at::microseconds);
  packet.read(space::hostmot2, port_data, ports);
  packet.read(space::hostmot2, direction, ports);
  packet.read(space::hostmot2, bitten);
  packet.read(space::hostmot2, stamp_clock);  // must come before the counts
  read_pair(packet, count);
  read_pair(packet, control);
  packet.read(space::status, at::received, 2);
  packet.write_number(at::read_number, number);
  packet.read(space::timers, at::read_number, 4);
  return packet;
}

bool CycleWire::decode(std::span<const std::uint8_t> bytes, CycleAnswer& answer) const noexcept {
  if (bytes.size() != read(0).answer_bytes()) return false;
  std::size_t at = 0;
  const auto half = [&] { return word16(bytes, std::exchange(at, at + 2)); };
  const auto word = [&] { return word32(bytes, std::exchange(at, at + 4)); };
  const auto pair = [&](const RegisterPair& address, std::array<std::uint32_t, 2>& values) {
    const std::size_t first = address[0] == address[1] + 4 ? 1 : 0;
    values[first] = word();
    values[1 - first] = word();
  };
  answer.clock_us = half();
  for (unsigned port = 0; port < ports; ++port) answer.levels[port] = word();
  for (unsigned port = 0; port < ports; ++port) answer.direction[port] = word();
  answer.bitten = word();
  answer.stamp_clock = static_cast<std::uint16_t>(word());
  pair(count, answer.count);
  pair(control, answer.control);
  answer.received.all = half();
  answer.received.udp = half();
  answer.read_number = word();
  answer.write_number = word();
  return true;
}

Packet CycleWire::write(const PortWords& data, const std::array<std::uint32_t, 2>& pwm_values,
                        std::uint32_t write_number) const noexcept {
  Packet packet;
  packet.write32(port_data, {data.data(), ports});
  packet.write32(pet, reload);
  write_pair(packet, pwm, pwm_values);
  packet.write_number(at::write_number, write_number);
  return packet;
}

}  // namespace abs_hil::driver::hm2
