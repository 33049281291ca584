// Asks rtnetlink for the CAN interfaces and reads its answers.
#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <functional>

#include "abs_hil/driver/io_result.hpp"
#include "driver/can/bus.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::can {

namespace {

constexpr std::uint32_t canfd_mtu = 72;

using Visit = std::function<void(unsigned type, const void* data, std::size_t size)>;

/// Calls a function for each attribute of a list.
void for_each(const void* data, std::size_t size, const Visit& visit) {
  const auto* at = static_cast<const unsigned char*>(data);
  while (size >= sizeof(rtattr)) {
    rtattr head{};
    std::memcpy(&head, at, sizeof head);
    if (head.rta_len < sizeof head || head.rta_len > size) return;
    visit(head.rta_type & NLA_TYPE_MASK, at + RTA_LENGTH(0), head.rta_len - RTA_LENGTH(0));
    const std::size_t step = std::min<std::size_t>(RTA_ALIGN(head.rta_len), size);
    at += step;
    size -= step;
  }
}

template <typename Value>
Value value_of(const void* data, std::size_t size) {
  Value value{};
  std::memcpy(&value, data, std::min(size, sizeof value));
  return value;
}

std::string text_of(const void* data, std::size_t size) {
  const auto* text = static_cast<const char*>(data);
  return {text, ::strnlen(text, size)};
}

std::string state_name(std::uint32_t state) {
  constexpr std::array<const char*, 6> names{"error-active", "error-warning", "error-passive",
                                             "bus-off",      "stopped",       "sleeping"};
  static_assert(CAN_STATE_SLEEPING + 1 == names.size());
  return state < names.size() ? names[state] : "unknown";
}

void read_controller(InterfaceFacts& facts, const void* data, std::size_t size) {
  for_each(data, size, [&](unsigned type, const void* value, std::size_t bytes) {
    switch (type) {
      case IFLA_CAN_BITTIMING: facts.bit_rate = value_of<can_bittiming>(value, bytes).bitrate; break;
      case IFLA_CAN_DATA_BITTIMING: facts.data_bit_rate = value_of<can_bittiming>(value, bytes).bitrate; break;
      case IFLA_CAN_STATE: facts.state = state_name(value_of<std::uint32_t>(value, bytes)); break;
      case IFLA_CAN_BERR_COUNTER: {
        const auto errors = value_of<can_berr_counter>(value, bytes);
        facts.transmit_errors = errors.txerr;
        facts.receive_errors = errors.rxerr;
        break;
      }
      default: break;
    }
  });
}

void read_link_kind(InterfaceFacts& facts, const void* data, std::size_t size) {
  for_each(data, size, [&](unsigned type, const void* value, std::size_t bytes) {
    if (type == IFLA_INFO_KIND) facts.kind = text_of(value, bytes);
    if (type == IFLA_INFO_DATA && facts.kind != "vcan" && facts.kind != "vxcan") read_controller(facts, value, bytes);
  });
}

InterfaceFacts facts_in(const ifinfomsg& info, const void* attributes, std::size_t size) {
  InterfaceFacts facts{.up = (info.ifi_flags & IFF_UP) != 0, .running = (info.ifi_flags & IFF_RUNNING) != 0};
  for_each(attributes, size, [&](unsigned type, const void* value, std::size_t bytes) {
    switch (type) {
      case IFLA_IFNAME: facts.name = text_of(value, bytes); break;
      case IFLA_MTU: facts.can_fd = value_of<std::uint32_t>(value, bytes) >= canfd_mtu; break;
      case IFLA_LINKINFO: read_link_kind(facts, value, bytes); break;
      default: break;
    }
  });
  return facts;
}

[[noreturn]] void refuse_interfaces(const char* what) {
  throw Unavailable(std::string("CAN interfaces: ") + what + ": " + rig::refusal(errno, what, rig::reaching));
}

void ask_for_links(int descriptor) {
  struct {
    nlmsghdr head{};
    ifinfomsg info{};
  } request{};
  request.head.nlmsg_len = sizeof request;
  request.head.nlmsg_type = RTM_GETLINK;
  request.head.nlmsg_flags = NLM_F_REQUEST | NLM_F_DUMP;
  request.info.ifi_family = AF_UNSPEC;
  if (::send(descriptor, &request, sizeof request, 0) < 0)
    refuse_interfaces("cannot send a request to the kernel (rtnetlink)");
}

}  // namespace

bool take_links(std::span<const unsigned char> answer, std::vector<InterfaceFacts>& found) {
  while (answer.size() >= sizeof(nlmsghdr)) {
    nlmsghdr head{};
    std::memcpy(&head, answer.data(), sizeof head);
    if (head.nlmsg_len < sizeof head || head.nlmsg_len > answer.size() || head.nlmsg_type == NLMSG_DONE ||
        head.nlmsg_type == NLMSG_ERROR) {
      return true;
    }
    ifinfomsg info{};
    const std::size_t body = NLMSG_ALIGN(sizeof info);
    if (head.nlmsg_type == RTM_NEWLINK && head.nlmsg_len >= NLMSG_LENGTH(body)) {
      std::memcpy(&info, answer.data() + NLMSG_LENGTH(0), sizeof info);
      if (info.ifi_type == ARPHRD_CAN) {
        found.push_back(facts_in(info, answer.data() + NLMSG_LENGTH(body), head.nlmsg_len - NLMSG_LENGTH(body)));
      }
    }
    answer = answer.subspan(std::min<std::size_t>(NLMSG_ALIGN(head.nlmsg_len), answer.size()));
  }
  return false;
}

std::vector<InterfaceFacts> can_interfaces() {
  const FileDescriptor netlink(::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE));
  if (netlink.get() < 0) refuse_interfaces("cannot open an rtnetlink socket");
  ask_for_links(netlink.get());
  std::vector<InterfaceFacts> found;
  alignas(nlmsghdr) static thread_local std::array<unsigned char, 65536> buffer;
  for (bool done = false; !done;) {
    const ssize_t got = ::recv(netlink.get(), buffer.data(), buffer.size(), 0);
    if (got < 0) refuse_interfaces("cannot read the kernel's answer (rtnetlink)");
    done = take_links(std::span(buffer).first(static_cast<std::size_t>(got)), found);
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return found;
}

std::optional<InterfaceFacts> find_interface(const std::string& name) {
  for (InterfaceFacts& facts : can_interfaces()) {
    if (facts.name == name) return std::move(facts);
  }
  return std::nullopt;
}

std::optional<FoundBoard::Obstacle> problem_of(const InterfaceFacts& facts) {
  const std::string set_link = "sudo ip link set " + facts.name;
  const bool has_controller = !facts.state.empty();
  if (!facts.up) {
    return FoundBoard::Obstacle{
        "down", has_controller ? set_link + " type can bitrate 1000000 && " + set_link + " up" : set_link + " up"};
  }
  if (facts.state == "bus-off" || facts.state == "stopped") {
    return FoundBoard::Obstacle{facts.state,
                                "repair the wiring (docs/can.md), then " + set_link + " down && " + set_link + " up"};
  }
  if (facts.state == "error-passive") {
    return FoundBoard::Obstacle{
        "error-passive",
        "no node acknowledges, or the bit rates differ: check the node, the wiring, the two 120 ohm "
        "terminations and the bit rate (docs/can.md)"};
  }
  if (!facts.running) return FoundBoard::Obstacle{"without carrier", set_link + " down && " + set_link + " up"};
  return std::nullopt;
}

}  // namespace abs_hil::driver::can
