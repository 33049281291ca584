// Facts about interfaces from the kernel's messages, which are built here after linux/rtnetlink.h and linux/if_link.h.

#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <net/if_arp.h>

#include <cstring>
#include <string_view>
#include <utility>

#include "catch.hpp"
#include "driver/can/bus.hpp"

using namespace abs_hil::driver::can;

namespace {

using Bytes = std::vector<unsigned char>;

void put(Bytes& bytes, const void* data, std::size_t size) {
  const auto* from = static_cast<const unsigned char*>(data);
  bytes.insert(bytes.end(), from, from + size);
  bytes.resize((bytes.size() + NLMSG_ALIGNTO - 1) / NLMSG_ALIGNTO * NLMSG_ALIGNTO);
}

void put_attribute(Bytes& bytes, unsigned short type, const void* data, std::size_t size) {
  const rtattr head{.rta_len = static_cast<unsigned short>(RTA_LENGTH(size)), .rta_type = type};
  put(bytes, &head, sizeof head);
  put(bytes, data, size);
}
void put_attribute(Bytes& bytes, unsigned short type, const Bytes& nested) {
  put_attribute(bytes, type, nested.data(), nested.size());
}
void put_attribute(Bytes& bytes, unsigned short type, std::string_view text) {
  put_attribute(bytes, type, std::string(text).c_str(), text.size() + 1);  // with its end, as the kernel does
}
void put_number(Bytes& bytes, unsigned short type, std::uint32_t value) {
  put_attribute(bytes, type, &value, sizeof value);
}

void put_message(Bytes& bytes, unsigned short type, const Bytes& content) {
  nlmsghdr head{};
  head.nlmsg_len = static_cast<std::uint32_t>(NLMSG_LENGTH(content.size()));
  head.nlmsg_type = type;
  put(bytes, &head, sizeof head);
  put(bytes, content.data(), content.size());
}
void put_link(Bytes& bytes, unsigned flags, const Bytes& attributes, unsigned short kind = ARPHRD_CAN) {
  ifinfomsg info{};
  info.ifi_type = kind;
  info.ifi_flags = flags;
  Bytes content;
  put(content, &info, sizeof info);
  put(content, attributes.data(), attributes.size());
  put_message(bytes, RTM_NEWLINK, content);
}

Bytes named(std::string_view name) {
  Bytes attributes;
  put_attribute(attributes, IFLA_IFNAME, name);
  return attributes;
}

/// A CAN interface with a controller in this state.
Bytes with_controller(std::uint32_t state, std::string_view kind = "can") {
  can_bittiming nominal{};
  nominal.bitrate = 1'000'000;
  can_bittiming data{};
  data.bitrate = 5'000'000;
  const can_berr_counter errors{.txerr = 96, .rxerr = 7};
  Bytes controller;
  put_attribute(controller, IFLA_CAN_BITTIMING, &nominal, sizeof nominal);
  put_attribute(controller, IFLA_CAN_DATA_BITTIMING, &data, sizeof data);
  put_number(controller, IFLA_CAN_STATE, state);
  put_number(controller, IFLA_CAN_RESTART_MS, 100);
  put_attribute(controller, IFLA_CAN_BERR_COUNTER, &errors, sizeof errors);
  put_number(controller, IFLA_CAN_TERMINATION, 120);  // of no interest here
  Bytes link_info;
  put_attribute(link_info, IFLA_INFO_KIND, kind);
  put_attribute(link_info, IFLA_INFO_DATA | NLA_F_NESTED, controller);
  Bytes attributes = named("can0");
  put_number(attributes, IFLA_MTU, 72);
  put_number(attributes, IFLA_TXQLEN, 10);
  put_attribute(attributes, IFLA_LINKINFO | NLA_F_NESTED, link_info);
  return attributes;
}

std::pair<std::vector<InterfaceFacts>, bool> taken(const Bytes& answer) {
  std::vector<InterfaceFacts> found;
  const bool done = take_links(answer, found);
  return {std::move(found), done};
}

InterfaceFacts only(const Bytes& attributes, unsigned flags = IFF_UP | IFF_RUNNING) {
  Bytes answer;
  put_link(answer, flags, attributes);
  auto [found, done] = taken(answer);
  REQUIRE(found.size() == 1);
  CHECK_FALSE(done);  // the kernel says when it has told all
  return found.front();
}

}  // namespace

TEST_CASE("A controller's rates, state, errors and queue are read") {
  const InterfaceFacts facts = only(with_controller(CAN_STATE_ERROR_WARNING));
  CHECK(facts.name == "can0");
  CHECK(facts.kind == "can");
  CHECK(facts.up);
  CHECK(facts.running);
  CHECK(facts.can_fd);
  CHECK(facts.state == "error-warning");
  CHECK(facts.bit_rate == 1'000'000);
  CHECK(facts.data_bit_rate == 5'000'000);
  CHECK(facts.transmit_errors == 96);
  CHECK(facts.receive_errors == 7);
  CHECK_FALSE(problem_of(facts));
}

TEST_CASE("Every state of a controller has the name that ip link shows, and prevents its use or not") {
  const auto state_of = [](std::uint32_t state) { return only(with_controller(state)); };
  CHECK(state_of(CAN_STATE_ERROR_ACTIVE).state == "error-active");
  CHECK(state_of(CAN_STATE_ERROR_PASSIVE).state == "error-passive");
  CHECK(state_of(CAN_STATE_BUS_OFF).state == "bus-off");
  CHECK(state_of(CAN_STATE_STOPPED).state == "stopped");
  CHECK(state_of(CAN_STATE_SLEEPING).state == "sleeping");
  CHECK(state_of(99).state == "unknown");
  CHECK_FALSE(problem_of(state_of(CAN_STATE_ERROR_ACTIVE)));
  CHECK(problem_of(state_of(CAN_STATE_ERROR_PASSIVE)).value().what == "error-passive");
  CHECK(problem_of(state_of(CAN_STATE_BUS_OFF)).value().what == "bus-off");
  CHECK(problem_of(state_of(CAN_STATE_STOPPED)).value().what == "stopped");
}

TEST_CASE("Flags: an interface that is down, one without carrier") {
  CHECK(problem_of(only(with_controller(CAN_STATE_STOPPED), 0)).value().what == "down");
  const auto no_carrier = problem_of(only(named("vcan0"), IFF_UP));
  REQUIRE(no_carrier);
  CHECK(no_carrier->what == "without carrier");
  CHECK(no_carrier->fix == "sudo ip link set vcan0 down && sudo ip link set vcan0 up");
}

TEST_CASE("The facts of a virtual interface are not those of a controller") {
  for (const char* kind : {"vcan", "vxcan"}) {
    const InterfaceFacts facts = only(with_controller(CAN_STATE_BUS_OFF, kind));
    CHECK(facts.kind == kind);
    CHECK(facts.state.empty());
    CHECK(facts.bit_rate == 0);
  }
}

TEST_CASE("Classic CAN only: an MTU below that of CAN FD") {
  Bytes attributes = named("can0");
  put_number(attributes, IFLA_MTU, 16);
  CHECK_FALSE(only(attributes).can_fd);
}

TEST_CASE("Several interfaces in one answer are read to its end, without those of other types") {
  Bytes answer;
  put_link(answer, IFF_UP, named("can1"));
  put_link(answer, IFF_UP, named("eth0"), ARPHRD_ETHER);
  put_message(answer, RTM_NEWADDR, Bytes(sizeof(ifinfomsg)));
  put_link(answer, 0, named("can0"));
  put_message(answer, NLMSG_DONE, Bytes(4));
  put_link(answer, 0, named("after the end"));
  const auto [found, done] = taken(answer);
  CHECK(done);
  REQUIRE(found.size() == 2);
  CHECK(found[0].name == "can1");
  CHECK(found[1].name == "can0");
}

TEST_CASE("An error or an invalid length ends the answer; earlier interfaces remain") {
  Bytes start;
  put_link(start, IFF_UP, named("can0"));
  Bytes refused = start;
  put_message(refused, NLMSG_ERROR, Bytes(sizeof(nlmsgerr)));
  put_link(refused, IFF_UP, named("can1"));
  for (const std::uint32_t length : {0U, 15U, 100'000U}) {
    Bytes lying = start;
    put_link(lying, IFF_UP, named("can1"));
    std::memcpy(lying.data() + start.size(), &length, sizeof length);
    const auto [found, done] = taken(lying);
    CHECK(done);
    CHECK(found.size() == 1);
  }
  const auto [found, done] = taken(refused);
  CHECK(done);
  CHECK(found.size() == 1);
  CHECK_FALSE(taken({}).second);
  // A link message too short for its own head names nothing.
  Bytes stump;
  put_message(stump, RTM_NEWLINK, Bytes(sizeof(ifinfomsg) - 4));
  CHECK(taken(stump).first.empty());
}

TEST_CASE("An attribute with an invalid length ends the list; a truncated number is read from the bytes it has") {
  for (const unsigned short length : {std::uint16_t{0}, std::uint16_t{3}, std::uint16_t{60'000}}) {
    Bytes attributes = named("can0");
    const std::size_t lying = attributes.size();
    put_number(attributes, IFLA_MTU, 72);
    std::memcpy(attributes.data() + lying, &length, sizeof length);
    const InterfaceFacts facts = only(attributes);
    CHECK(facts.name == "can0");
    CHECK_FALSE(facts.can_fd);
  }
  Bytes attributes = named("can0");
  const std::uint8_t one_byte = 72;
  put_attribute(attributes, IFLA_MTU, &one_byte, sizeof one_byte);
  CHECK(only(attributes).can_fd);  // little-endian, as every machine that this is built for
}
