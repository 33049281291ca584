// What the service hears of its machine: systemd's socket, sleep over logind's bus, and pauses of a virtual machine.
#include "guardian/machine.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "abs_hil/rig/time_units.hpp"
#include "driver/monotonic_time.hpp"
#include "driver/sysfs.hpp"
#include "runtime/realtime_setup.hpp"

#ifdef ABS_HIL_HAVE_LIBSYSTEMD
#include <systemd/sd-bus.h>
#endif

namespace abs_hil::guardian {

namespace {

using rig::ns_per_s;

constexpr std::int64_t least_pause_ns = ns_per_s / 2;
/// Longer than any pause: somebody has set the clock.
constexpr std::int64_t longest_pause_ns = 43'200 * ns_per_s;
constexpr std::int64_t drift_divisor = 1000;

/// A socket connected to systemd's, made once. A path that begins with '@' is in the abstract namespace.
int open_socket() noexcept {
  const char* const path = std::getenv("NOTIFY_SOCKET");  // NOLINT(concurrency-mt-unsafe): before any thread
  sockaddr_un address{};
  if (path == nullptr || *path == '\0' || std::strlen(path) >= sizeof address.sun_path) return -1;
  const int fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return -1;
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path, std::strlen(path) + 1);
  if (*path == '@') address.sun_path[0] = '\0';
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + std::strlen(path));
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), size) == 0) return fd;
  ::close(fd);
  return -1;
}

}  // namespace

int systemd_socket() noexcept {
  static const int fd = open_socket();
  return fd;
}

void tell_systemd(std::string_view message) noexcept {
  if (systemd_socket() < 0) return;
  static_cast<void>(::send(systemd_socket(), message.data(), message.size(), MSG_NOSIGNAL | MSG_DONTWAIT));
}

Event::Event() : file_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

void Event::signal() const noexcept {
  constexpr std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(file_.get(), &one, sizeof one);
}

bool Event::take() const noexcept {
  std::uint64_t count = 0;
  return ::read(file_.get(), &count, sizeof count) == sizeof count;
}

#ifdef ABS_HIL_HAVE_LIBSYSTEMD

namespace {

constexpr const char* logind = "org.freedesktop.login1";
constexpr const char* logind_path = "/org/freedesktop/login1";
constexpr const char* logind_manager = "org.freedesktop.login1.Manager";

}  // namespace

/// The connection to logind and the inhibitor.
class SleepWatch::Logind {
 public:
  explicit Logind(SleepWatch& watch) : watch_(watch) {}
  Logind(const Logind&) = delete;
  Logind& operator=(const Logind&) = delete;
  ~Logind() { ::sd_bus_unref(bus_); }

  /// 0, or what failed as a negative errno.
  int start() {
    int result = ::sd_bus_open_system(&bus_);
    if (result >= 0) {
      result =
          ::sd_bus_match_signal(bus_, nullptr, logind, logind_path, logind_manager, "PrepareForSleep", on_sleep, this);
    }
    return result < 0 ? result : inhibit();
  }

  /// False after the bus has gone.
  bool process() {
    int result = 1;
    while (result > 0) result = ::sd_bus_process(bus_, nullptr);
    return result == 0;
  }
  [[nodiscard]] int descriptor() const { return ::sd_bus_get_fd(bus_); }
  [[nodiscard]] short events() const { return static_cast<short>(::sd_bus_get_events(bus_)); }
  void let_sleep() { inhibitor_ = driver::FileDescriptor(-1); }

 private:
  int inhibit() {
    sd_bus_message* answer = nullptr;
    int result = ::sd_bus_call_method(bus_, logind, logind_path, logind_manager, "Inhibit", nullptr, &answer, "ssss",
                                      "sleep", "abs_guardian", "the rig's outputs are made safe first", "delay");
    int fd = -1;
    if (result >= 0) result = ::sd_bus_message_read(answer, "h", &fd);
    if (result >= 0) inhibitor_ = driver::FileDescriptor(::dup(fd));
    ::sd_bus_message_unref(answer);
    return result < 0 ? result : 0;
  }

  static int on_sleep(sd_bus_message* message, void* self, sd_bus_error* /*error*/) {
    auto& logind_watch = *static_cast<Logind*>(self);
    int going = 0;
    if (::sd_bus_message_read(message, "b", &going) < 0) return 0;
    logind_watch.watch_.going_to_sleep_ = going != 0;
    if (going == 0) static_cast<void>(logind_watch.inhibit());
    logind_watch.watch_.happened_.signal();
    return 0;
  }

  SleepWatch& watch_;
  sd_bus* bus_{nullptr};
  driver::FileDescriptor inhibitor_{-1};
};

void SleepWatch::watch(const std::stop_token& stop) {
  runtime::keep_signals_away();
  Logind bus(*this);
  if (const int result = bus.start(); result < 0) {
    tell_(std::string("no sleep inhibitor (logind: ") + std::strerror(-result) +
          "): a suspension is noticed only after it");
    return;
  }
  tell_("logind delays a suspension until the outputs are safe");
  constexpr int look_ms = 500;
  while (!stop.stop_requested() && bus.process()) {
    std::array<pollfd, 2> files{pollfd{bus.descriptor(), bus.events(), 0}, pollfd{dealt_with_.descriptor(), POLLIN, 0}};
    static_cast<void>(::poll(files.data(), files.size(), look_ms));
    if (dealt_with_.take()) bus.let_sleep();
  }
  if (!stop.stop_requested()) tell_("lost logind: a suspension is noticed only after it");
}

#else

void SleepWatch::watch(const std::stop_token& /*stop*/) {
  tell_("built without libsystemd: a suspension is noticed only after it");
}

#endif

SleepWatch::SleepWatch(std::function<void(const std::string&)> tell) : tell_(std::move(tell)) {
  thread_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

Interruption SleepWatch::interruption() {
  return {.descriptor = happened_.descriptor(),
          .take =
              [this] {
                happened_.take();
                return going_to_sleep_ ? rig::Reason::computer_will_suspend : rig::Reason::none;
              },
          .bars_leases =
              [this] { return going_to_sleep_ ? std::string("the computer is about to be suspended") : std::string(); },
          .dealt_with =
              [this] {
                if (going_to_sleep_) dealt_with_.signal();
              }};
}

bool ClockLead::leapt(std::int64_t clock_s, std::int64_t monotonic_ns) noexcept {
  const std::int64_t least_ns = clock_s * ns_per_s - monotonic_ns;
  const std::int64_t most_ns = least_ns + ns_per_s;
  const std::int64_t ahead_ns = least_ns - most_ns_;
  const std::int64_t drift_ns = (monotonic_ns - looked_ns_) / drift_divisor;
  looked_ns_ = monotonic_ns;
  if (first_ || ahead_ns > least_pause_ns) {
    most_ns_ = most_ns;
    return !std::exchange(first_, false) && ahead_ns < longest_pause_ns;
  }
  most_ns_ = std::min(most_ns, most_ns_ + drift_ns);
  return false;
}

MachinePause::MachinePause(std::function<void()> found) : found_(std::move(found)) {
  if (driver::value_in("/proc/cpuinfo", "flags").find(" hypervisor") == std::string::npos) return;
  // Not /dev/rtc0: only one process may have that open.
  clock_ = driver::FileDescriptor(::open("/sys/class/rtc/rtc0/since_epoch", O_RDONLY | O_CLOEXEC));
  if (!works()) return;
  thread_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

std::int64_t MachinePause::clock_s() const {
  std::array<char, 32> text{};
  const ssize_t size = ::pread(clock_.get(), text.data(), text.size(), 0);
  std::int64_t seconds = -1;
  if (size > 0) std::from_chars(text.data(), text.data() + size, seconds);
  return seconds;
}

void MachinePause::watch(const std::stop_token& stop) {
  using std::chrono::milliseconds;
  runtime::keep_signals_away();
  while (!stop.stop_requested()) {
    if (const std::int64_t now_s = clock_s(); now_s >= 0 && lead_.leapt(now_s, driver::monotonic_ns())) {
      if (leased_) found_();
      happened_.signal();
    }
    std::this_thread::sleep_for(leased_ ? milliseconds(1) : milliseconds(100));
  }
}

Interruption MachinePause::interruption() {
  return {.descriptor = happened_.descriptor(),
          .take =
              [this] {
                happened_.take();
                return rig::Reason::none;  // the guard knows: it need only look
              },
          .lease_changed = [this](bool held) { leased_ = held; }};
}

}  // namespace abs_hil::guardian
