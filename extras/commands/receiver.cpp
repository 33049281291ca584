// Receives what other programs publish over LCM, and finds a tcpq server again that restarts; one channel of LCM's UDP
// multicast without liblcm, whole messages only.
#include "commands/receiver.hpp"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <boost/endian/conversion.hpp>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <new>
#include <system_error>
#include <utility>

#include "rig/formatted_text.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::commands {
namespace {

/// LCM's queue holds 30 messages by default, which is 30 ms of telemetry.
constexpr int queue_messages = 20'000;
constexpr std::chrono::seconds look_period{1};
constexpr int look_timeout_ms = 100;

std::string well_formed(std::string url) {
  if (!url.empty()) static_cast<void>(telemetry::parse_lcm_url(url));  // wrong input, not a missing network
  return url;
}

constexpr std::uint32_t whole_magic = 0x4C433032;
constexpr std::uint32_t fragment_magic = 0x4C433033;
constexpr std::size_t whole_header_bytes = 8;
constexpr std::size_t fragment_header_bytes = 20;
constexpr std::size_t fragment_number_at = 16;

/// The bytes after `channel` and its NUL; null if the datagram has another channel.
const std::uint8_t* after_channel(std::span<const std::uint8_t> bytes, std::string_view channel) {
  if (bytes.size() <= channel.size() || bytes[channel.size()] != 0) return nullptr;
  const auto same = [](char c, std::uint8_t byte) { return static_cast<std::uint8_t>(c) == byte; };
  if (!std::equal(channel.begin(), channel.end(), bytes.begin(), same)) return nullptr;
  return bytes.data() + channel.size() + 1;
}

constexpr int datagrams_per_look = 256;

/// A number in the URL's options, "name=" before it; 0 if there is none.
int number_in(std::string_view options, std::string_view name) {
  const std::size_t at = options.find(name);
  int number = 0;
  if (at == std::string_view::npos) return number;
  const std::string_view digits = options.substr(at + name.size());
  std::from_chars(digits.data(), digits.data() + digits.size(), number);
  return number;
}

/// True if this computer has the address: only then a socket can be bound to it. Makes system calls, allocates nothing.
bool is_own_address(const in_addr& address) noexcept {
  const telemetry::Socket socket(SOCK_DGRAM);
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_addr = address;
  return ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) == 0;
}

bool set(int socket, int level, int option, int value) {
  return ::setsockopt(socket, level, option, &value, sizeof value) == 0;
}

/// Returns true, or false with errno set.
bool join(int socket, const sockaddr_in& group, int buffer_bytes) {
  // LCM's own sockets at this port, and our other sockets, set it too.
  if (!set(socket, SOL_SOCKET, SO_REUSEADDR, 1)) return false;
  // Bound to the group, so that the socket does not receive packets to this computer's own address.
  if (::bind(socket, reinterpret_cast<const sockaddr*>(&group), sizeof group) != 0) return false;
  ip_mreq membership{};
  membership.imr_multiaddr = group.sin_addr;
  membership.imr_interface.s_addr = htonl(INADDR_ANY);
  if (::setsockopt(socket, IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership) != 0) return false;
  // Requests the largest buffer (net.core.rmem_max) and a count of dropped datagrams. The receiver works without both.
  if (buffer_bytes > 0) static_cast<void>(set(socket, SOL_SOCKET, SO_RCVBUF, buffer_bytes));
  static_cast<void>(set(socket, SOL_SOCKET, SO_RXQ_OVFL, 1));
  return true;
}

}  // namespace

Receiver::Receiver(std::string url, std::string channels, Take take)
    : own_(std::in_place, well_formed(std::move(url))),
      network_(*own_),
      channels_(std::move(channels)),
      take_(std::move(take)) {
  subscribe();
}

Receiver::Receiver(telemetry::LcmOutlet& network, std::string channels, Take take)
    : network_(network), channels_(std::move(channels)), take_(std::move(take)) {
  subscribe();
}

Receiver::~Receiver() {
  // A network of its own unsubscribes by itself; with tcpq an explicit call would search for the server again.
  if (!own_) lcm_unsubscribe(network_.lcm().getUnderlyingLCM(), subscription_);
}

void Receiver::subscribe() {
  subscription_ = lcm_subscribe(network_.lcm().getUnderlyingLCM(), channels_.c_str(), &on_packet, this);
  if (subscription_ == nullptr) {
    throw telemetry::LcmError("LCM cannot subscribe to the channels \"" + channels_ + "\" at '" + network_.url() + "'");
  }
  lcm_subscription_set_queue_capacity(subscription_, queue_messages);
}

void Receiver::look_for_server() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_look_) return;
  next_look_ = now + look_period;
  if (ask_tcpq_server(endpoint_of(telemetry::parse_lcm_url(network_.url())), look_timeout_ms) !=
      telemetry::TcpqServer::answers)
    return;
  // This connects again. lcm_handle would connect too, but then wait for a message without limit.
  lcm_unsubscribe(network_.lcm().getUnderlyingLCM(), subscription_);
  subscribe();
}

void Receiver::on_packet(const lcm_recv_buf_t* received, const char* channel, void* self) noexcept {
  Receiver& receiver = *static_cast<Receiver*>(self);
  // No exception may pass through LCM's C code.
  try {
    receiver.take_(channel, {static_cast<const std::uint8_t*>(received->data), received->data_size});
  } catch (const std::bad_alloc&) {
    receiver.out_of_memory_ = true;
  }
}

void Receiver::poll(int packets_max) {
  for (int i = 0; i < packets_max; ++i) {
    // Not lcm_handle_timeout: its select() does not survive descriptors of -1 (tcpq without server) or above 1023.
    pollfd ready{file_descriptor(), POLLIN, 0};
    if (ready.fd < 0) return look_for_server();
    if (::poll(&ready, 1, 0) <= 0) return;
    const bool handled = network_.lcm().handle() == 0;
    if (std::exchange(out_of_memory_, false)) throw std::bad_alloc();
    if (!handled) return;
  }
}

LcmPacket look_at(std::span<const std::uint8_t> datagram, std::string_view channel) noexcept {
  if (datagram.size() < whole_header_bytes) return {};
  const std::uint32_t magic = boost::endian::load_big_u32(datagram.data());
  if (magic == whole_magic) {
    const std::uint8_t* payload = after_channel(datagram.subspan(whole_header_bytes), channel);
    if (payload == nullptr) return {};
    return {LcmPacket::Kind::message, {payload, datagram.data() + datagram.size()}};
  }
  if (magic != fragment_magic || datagram.size() < fragment_header_bytes) return {};
  const bool first = datagram[fragment_number_at] == 0 && datagram[fragment_number_at + 1] == 0;
  if (!first || after_channel(datagram.subspan(fragment_header_bytes), channel) == nullptr) return {};
  return {LcmPacket::Kind::fragmented, {}};
}

UdpmReceiver::UdpmReceiver(const std::string& url, std::string channel) : channel_(std::move(channel)) {
  const int why_no_socket = errno;
  const telemetry::LcmUrl parts = telemetry::parse_lcm_url(url);
  own_computer_only_ = number_in(parts.options, "ttl=") == 0;
  const telemetry::Endpoint endpoint = endpoint_of(parts);
  const auto group = telemetry::socket_address_of(endpoint);
  if (group && join(socket_.get(), *group, number_in(parts.options, "recv_buf_size="))) return;
  const int problem = !group ? EINVAL : socket_.get() < 0 ? why_no_socket : errno;
  throw telemetry::LcmError("commands cannot be received at " + endpoint.address + ":" + std::to_string(endpoint.port) +
                            ": " + rig::refusal(problem, endpoint.address, rig::reaching));
}

bool UdpmReceiver::is_from_here(const in_addr& sender) noexcept {
  if (sender.s_addr == known_own_address_) return true;
  if (!is_own_address(sender)) return false;
  known_own_address_ = sender.s_addr;
  return true;
}

UdpmReceiver::Arrival UdpmReceiver::next() noexcept {
  for (int i = 0; i < datagrams_per_look; ++i) {
    iovec into{datagram_.data(), datagram_.size()};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(std::uint32_t)) + 64> control{};
    msghdr message{};
    sockaddr_in from{};
    message.msg_name = &from;
    message.msg_namelen = sizeof from;
    message.msg_iov = &into;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t size = ::recvmsg(socket_.get(), &message, 0);
    if (size < 0) return {};
    for (cmsghdr* note = CMSG_FIRSTHDR(&message); note != nullptr; note = CMSG_NXTHDR(&message, note)) {
      if (note->cmsg_level != SOL_SOCKET || note->cmsg_type != SO_RXQ_OVFL) continue;
      std::uint32_t seen = 0;
      std::memcpy(&seen, CMSG_DATA(note), sizeof seen);
      dropped_ += seen - std::exchange(dropped_seen_, seen);
    }
    if (own_computer_only_ && !is_from_here(from.sin_addr)) continue;
    const LcmPacket packet = look_at(std::span(datagram_).first(static_cast<std::size_t>(size)), channel_);
    if (packet.kind == LcmPacket::Kind::other) continue;
    const bool cut = (message.msg_flags & MSG_TRUNC) != 0;
    const bool too_long = cut || packet.kind == LcmPacket::Kind::fragmented || packet.payload.size() > payload_max;
    return {.any = true, .too_long = too_long, .payload = packet.payload};
  }
  return {};
}

}  // namespace abs_hil::commands
