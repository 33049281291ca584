#include "guardian/service_manager.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string_view>

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

}  // namespace

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
