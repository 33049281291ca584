// Messages to systemd, and a watch for the computer's sleep over its bus.
#include "guardian/systemd.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <utility>

#include "runtime/realtime_setup.hpp"

#ifdef ABS_HIL_HAVE_LIBSYSTEMD
#include <systemd/sd-bus.h>
#endif

namespace abs_hil::guardian {

namespace {

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

void notify(std::string_view text) noexcept {
  if (ServiceManager::descriptor() < 0) return;
  static_cast<void>(::send(ServiceManager::descriptor(), text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT));
}

void signal_event(const driver::FileDescriptor& event) {
  constexpr std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(event.get(), &one, sizeof one);
}

bool take_event(const driver::FileDescriptor& event) {
  std::uint64_t count = 0;
  return ::read(event.get(), &count, sizeof count) == sizeof count;
}

driver::FileDescriptor new_event() { return driver::FileDescriptor(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)); }

}  // namespace

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
    signal_event(logind_watch.watch_.happened_);
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
    std::array<pollfd, 2> files{pollfd{bus.descriptor(), bus.events(), 0}, pollfd{dealt_with_.get(), POLLIN, 0}};
    static_cast<void>(::poll(files.data(), files.size(), look_ms));
    if (take_event(dealt_with_)) bus.let_sleep();
  }
  if (!stop.stop_requested()) tell_("lost logind: a suspension is noticed only after it");
}

#else

void SleepWatch::watch(const std::stop_token& /*stop*/) {
  tell_("built without libsystemd: a suspension is noticed only after it");
}

#endif

SleepWatch::SleepWatch(std::function<void(const std::string&)> tell)
    : tell_(std::move(tell)), happened_(new_event()), dealt_with_(new_event()) {
  thread_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

SleepWatch::~SleepWatch() = default;

Interruption SleepWatch::interruption() {
  return {.descriptor = happened_.get(),
          .take =
              [this] {
                static_cast<void>(take_event(happened_));
                return going_to_sleep_ ? rig::Reason::computer_will_suspend : rig::Reason::none;
              },
          .bars_leases =
              [this] { return going_to_sleep_ ? std::string("the computer is about to be suspended") : std::string(); },
          .dealt_with =
              [this](bool) {
                if (going_to_sleep_) signal_event(dealt_with_);
              }};
}

int ServiceManager::descriptor() noexcept {
  static const int fd = open_socket();
  return fd;
}

void ServiceManager::ready() noexcept { notify("READY=1"); }

void ServiceManager::alive() noexcept { notify("WATCHDOG=1"); }

void ServiceManager::status(const std::string& text) {
  if (text == told_) return;
  told_ = text;
  notify("STATUS=" + text);
}

}  // namespace abs_hil::guardian
