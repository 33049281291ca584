// The emulated CAN node on a CAN interface or a Unix socket.
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "control.hpp"
#include "emulator/can_node.hpp"

namespace abs_hil::program {

namespace {

[[noreturn]] void refuse(const std::string& what) { throw std::runtime_error("--can " + what + std::strerror(errno)); }

/// Removes the socket that a killed emulator has left behind. Any other file is somebody's.
void remove_old_socket(const std::string& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return;
  if (!S_ISSOCK(status.st_mode)) {
    throw std::invalid_argument("--can unix:" + path + ": this file exists and is no socket; give another path");
  }
  ::unlink(path.c_str());
}

/// The emulated node's end of the bus: a raw CAN socket, or for "unix:PATH" a listening AF_UNIX socket of type
/// SOCK_SEQPACKET with one client at a time.
class BusSocket {
 public:
  explicit BusSocket(const std::string& interface) {
    if (interface.starts_with("unix:")) {
      listen_at(interface.substr(5));
    } else {
      open_can(interface);
    }
  }
  ~BusSocket() {
    if (!path_.empty()) ::unlink(path_.c_str());
  }

  [[nodiscard]] int descriptor() const noexcept { return client_.get() >= 0 ? client_.get() : listening_.get(); }
  [[nodiscard]] bool can_fd() const noexcept { return can_fd_; }
  /// Takes the next frame; false if there is none.
  [[nodiscard]] bool receive(emulator::BusFrame& frame) {
    if (client_.get() < 0) {
      client_ = driver::FileDescriptor(::accept4(listening_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    }
    if (client_.get() < 0) return false;
    canfd_frame raw{};
    const ssize_t size = ::recv(client_.get(), &raw, sizeof raw, MSG_DONTWAIT);
    if (size == 0 && listening_.get() >= 0) client_ = driver::FileDescriptor();
    // An interface that goes down returns one error. The node then continues and receives nothing.
    if (size != CAN_MTU && size != CANFD_MTU) return false;
    frame = {.id = raw.can_id, .length = std::min<std::uint8_t>(raw.len, CANFD_MAX_DLEN), .fd = size == CANFD_MTU};
    std::memcpy(frame.data.data(), raw.data, frame.length);
    return true;
  }
  /// Sends a frame. If that is not possible at once, the frame is lost, as on a blocked bus.
  void send(const emulator::BusFrame& frame) {
    canfd_frame raw{};
    raw.can_id = frame.id;
    raw.len = frame.length;
    if (frame.fd) raw.flags = CANFD_BRS;
    std::memcpy(raw.data, frame.data.data(), frame.length);
    static_cast<void>(::send(client_.get(), &raw, frame.fd ? CANFD_MTU : CAN_MTU, MSG_DONTWAIT | MSG_NOSIGNAL));
  }

 private:
  void open_can(const std::string& interface) {
    client_ = driver::FileDescriptor(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW));
    if (client_.get() < 0) refuse(interface + ": no CAN socket (sudo modprobe can_raw): ");
    // ABS_TIME, ABS_SYNC, ABS_COMMAND, ABS_CONTROL.
    constexpr canid_t exactly = CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG;
    const can_filter filters[] = {{0x7F, exactly}, {0x80, exactly}, {0x81, exactly}, {0x82, exactly}};
    const int on = 1;
    if (::setsockopt(client_.get(), SOL_CAN_RAW, CAN_RAW_FILTER, filters, sizeof filters) != 0 ||
        ::setsockopt(client_.get(), SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0) {
      refuse(interface + ": ");
    }
    ifreq request{};
    std::strncpy(request.ifr_name, interface.c_str(), IFNAMSIZ - 1);
    can_fd_ = ::ioctl(client_.get(), SIOCGIFMTU, &request) == 0 && request.ifr_mtu >= static_cast<int>(CANFD_MTU);
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
    if (address.can_ifindex == 0) refuse(interface + ": ");
    if (::bind(client_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      refuse(interface + ": ");
  }
  void listen_at(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.empty() || path.size() >= sizeof address.sun_path) {
      throw std::invalid_argument("--can unix:" + path + ": give a path of 1 to 107 characters");
    }
    std::memcpy(address.sun_path, path.c_str(), path.size());
    listening_ = driver::FileDescriptor(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    remove_old_socket(path);
    if (listening_.get() < 0 ||
        ::bind(listening_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::listen(listening_.get(), 1) != 0) {
      refuse("unix:" + path + ": ");
    }
    path_ = path;
  }

  driver::FileDescriptor listening_{};
  driver::FileDescriptor client_{};
  bool can_fd_{true};
  std::string path_{};
};

const char* name_of(emulator::CanNode::State state) {
  constexpr std::array<const char*, 3> names{"inactive", "active", "latched"};
  return names[static_cast<std::size_t>(state)];
}

/// The CAN I/O node on its bus.
class EmulatedNode final : public BoardOf<EmulatedNode> {
 public:
  /// The bus decides about CAN FD.
  explicit EmulatedNode(const EmulatorOptions& options)
      : BoardOf(options),
        interface_(options.can_interface),
        bus_(interface_),
        options_(options.board),
        node_(options_),
        faults_(options.seed) {
    options_.can_fd = bus_.can_fd();
    power_on();
  }

  [[nodiscard]] int descriptor() const override { return bus_.descriptor(); }
  bool serve() override {
    emulator::BusFrame frame;
    while (bus_.receive(frame)) {
      if (!faults_.hears(frame)) continue;
      time_.catch_up(node_);
      node_.receive(frame);
      for (const emulator::BusFrame& answer : faults_.answer(node_.take_answers())) bus_.send(answer);
    }
    log_events();
    return true;
  }
  [[nodiscard]] std::string status() const override {
    constexpr int microseconds = 6;
    return fmt::format("{}, trip flags {:#x}, {}, {} commands rejected", state_text(node_, microseconds),
                       node_.trip_flags(), name_of(node_.state()), node_.rejected());
  }
  [[nodiscard]] std::string place() const override { return "CAN node on " + interface_; }
  [[nodiscard]] static std::span<const ControlRow<EmulatedNode>> rows() {
    using Node = EmulatedNode;
    using Command = ControlCommand;
    static constexpr std::array<ControlRow<Node>, 7> all{{
        {"fault NAME[=NUMBER]",
         "ok silent deaf no-deactivate drop= no-status no-outputs stale= ahead= stuck duplicate swapped wrong-size= "
         "corrupt nonsense babble=",
         [](Node& node, const Command& c) { node.faults_.set(c.text(1)); }},
        {"restart", "the node is switched off and on: inactive, its clock at 0",
         [](Node& node, const Command&) { node.power_on(); }},
        estop_row<Node>,
        supply_row<Node>,
        temperature_row<Node>,
        overspeed_row<Node>,
        {"brake-error DUTY", "the brake's duty is off by this from what is commanded",
         [](Node& node, const Command& c) { node.node_.break_brake_output(c.number(1)); }},
    }};
    return all;
  }
  [[nodiscard]] emulator::CanNode& model() noexcept { return node_; }

 private:
  void power_on() {
    node_ = emulator::CanNode(options_);
    time_.restart();
  }

  std::string interface_;
  BusSocket bus_;
  emulator::BoardOptions options_;
  emulator::CanNode node_;
  emulator::NodeFaults faults_;
};

}  // namespace

BoardKind can_node_kind() { return kind_of<EmulatedNode>("a CAN node"); }

}  // namespace abs_hil::program
