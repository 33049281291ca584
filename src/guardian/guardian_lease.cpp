// Decides who guards a run; asks the resident service for a lease of the outputs, arms it and ends it.
#include "guardian/guardian_lease.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>
#include <variant>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "config/board_policy.hpp"
#include "driver/monotonic_time.hpp"
#include "guardian/linux_process.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::guardian {

namespace {

/// The service may be busy with a board that does not answer.
constexpr int answers_within_ms = 20'000;
constexpr int covers_within_ms = 5'000;
constexpr int dismissed_within_ms = 500;
constexpr int looks_every_ms = 1;

constexpr std::int64_t state_within_ns = 2000 * rig::ns_per_ms;
constexpr std::int64_t safe_within_ns = 300 * rig::ns_per_ms;

std::string why_not(int error) {
  if (error == EAGAIN) return "its queue of visitors is full; end it and start it again";
  if (error == EACCES) return "Permission denied; join the group abs_hil and log in again";
  return rig::refusal(error, "guardian.socket", rig::reaching);
}

std::optional<ServiceAnswer> call(const std::string& path, const LeaseMessage& message, std::int64_t within_ns) {
  const std::int64_t end_ns = driver::monotonic_ns() + within_ns;
  const driver::FileDescriptor socket(connect_to(path, within_ns));
  if (socket.get() < 0) {
    if (errno == ENOENT || errno == ECONNREFUSED) return std::nullopt;
    return ServiceAnswer{.text = why_not(errno)};
  }
  ServiceAnswer said{.service = peer_of(socket.get()).pid,
                     .text = "it gave no answer within " + std::to_string(within_ns / rig::ns_per_ms) + " ms"};
  static_cast<void>(send_message(socket.get(), message));
  const std::int64_t left_ms = std::max<std::int64_t>(0, end_ns - driver::monotonic_ns()) / rig::ns_per_ms;
  if (const auto answer = receive_message(socket.get(), static_cast<int>(left_ms))) {
    said.answered = true;
    said.keeps_it = answer->word == LeaseWord::answer;
    said.safe = said.keeps_it && answer->safe;
    said.text = answer->text;
  }
  return said;
}

/// The same folder has one name, whatever links lead to it.
std::string plain(const std::string& text) {
  if (!text.starts_with('/')) return text.empty() ? "the only one" : text;
  std::error_code error;
  const std::filesystem::path path = std::filesystem::weakly_canonical(text, error);
  return error ? text : path.string();
}

/// The end of a namespace's first process ends all others in it, the guardian too, before anybody can write.
void refuse_own_guardian_of_first_process(const driver::DriverOptions& driver) {
  if (::getpid() != 1 || (driver.emulated && !config::is_real_board(driver))) return;
  throw driver::Unavailable(
      "guardian: this program is process 1 of its namespace (a container's entry point): its end would end its own "
      "guardian too, and the board would hold its duties. Use the resident service of the computer: give the container "
      "/run/abs_hil and set guardian.resident=require (docs/dead-man.md)");
}

}  // namespace

std::unique_ptr<GuardianLease> GuardianLease::ask(const std::string& path, const std::string& board) {
  driver::FileDescriptor socket(connect_to(path));
  if (socket.get() < 0) {
    if (errno == ENOENT || errno == ECONNREFUSED) return nullptr;
    const std::string why = why_not(errno);
    refuse_run("cannot reach the resident service at " + path + " (guardian.socket): " + why);
  }
  const driver::FileDescriptor self(open_pidfd(::getpid()));
  if (self.get() < 0) refuse_run(std::string("cannot open a pidfd of this process: ") + std::strerror(errno));
  const Peer peer = peer_of(socket.get());
  driver::FileDescriptor process(open_pidfd(peer.pid));
  // A service that refuses at once has closed its end already. Its answer is still to be read.
  static_cast<void>(send_message(socket.get(), {.word = LeaseWord::ask, .text = board}, {self.get()}));
  const auto answer = receive_message(socket.get(), answers_within_ms);
  const std::string service = "the resident service (process " + std::to_string(peer.pid) + ", " + path + ") ";
  if (!answer) refuse_run(service + "gave no answer");
  if (answer->word != LeaseWord::granted) refuse_run(service + "refused a lease: " + answer->text);
  if (answer->files.size() != 2) refuse_run(service + "comes from another build of abs_hil");
  Pages pages = Pages::as_run({answer->files[0].get(), answer->files[1].get()});
  return std::unique_ptr<GuardianLease>(
      new GuardianLease(std::move(socket), peer.pid, std::move(process), std::move(pages)));
}

GuardianLease::GuardianLease(driver::FileDescriptor socket, pid_t service, driver::FileDescriptor process, Pages pages)
    : Guard(std::move(pages)), socket_(std::move(socket)), service_(service), guard_process_(std::move(process)) {}

GuardianLease::~GuardianLease() { static_cast<void>(end()); }

void GuardianLease::cover(const SharedRecorder& recorder, std::string launch_config_json) {
  recorder_ = &recorder;
  launch_config_ = std::move(launch_config_json);
}

void GuardianLease::arm(const runtime::Scheduling& controller) {
  const driver::FileDescriptor launch_config(text_in_memory(launch_config_));
  if (recorder_ == nullptr || launch_config.get() < 0) refuse_run("cannot hand the run over to the resident service");
  ends_before_ = pages().guard().ends.load(std::memory_order_acquire);
  reset_page();
  if (!send_message(socket_.get(), {.word = LeaseWord::cover}, {recorder_->descriptor(), launch_config.get()})) {
    refuse_run(std::string("the resident service ended the lease: ") + std::strerror(errno));
  }
  const auto answer = receive_message(socket_.get(), covers_within_ms);
  if (!answer) refuse_run("the resident service ended the lease, or gave no answer");
  if (answer->word != LeaseWord::ready) refuse_run("the resident service does not guard this run: " + answer->text);
  armed_ = true;
  notes_ = answer->text;
  refuse_weaker(answer->scheduling, controller, "the service abs-guardian");
}

bool GuardianLease::alive() const noexcept {
  if (guard_process_.get() >= 0) return !has_ended(guard_process_.get());
  pollfd closed{socket_.get(), POLLRDHUP, 0};
  return ::poll(&closed, 1, 0) <= 0;
}

GuardEnd GuardianLease::end(Stage stage) noexcept {
  if (!std::exchange(armed_, false)) return GuardEnd::none;
  const bool handed_over = close_page(stage);
  const GuardPage& guard = pages().guard();
  for (int waited_ms = 0; waited_ms < dismissed_within_ms && alive(); waited_ms += looks_every_ms) {
    if (guard.ends.load(std::memory_order_acquire) != ends_before_) {
      return guard.ended_safe.load(std::memory_order_relaxed) ? GuardEnd::ended : GuardEnd::insisting;
    }
    ::poll(nullptr, 0, looks_every_ms);
  }
  return handed_over && alive() ? GuardEnd::insisting : GuardEnd::failed;
}

std::optional<ServiceAnswer> service_state(const std::string& socket) {
  return call(socket, {.word = LeaseWord::state}, state_within_ns);
}

std::optional<ServiceAnswer> service_makes_safe(const std::string& socket, const std::string& boards) {
  return call(socket, {.word = LeaseWord::make_safe, .text = boards}, safe_within_ns);
}

std::string kept_board(const driver::DriverOptions& options) {
  if (!driver::is_known(options.kind)) return options.kind;
  const driver::ChosenBackend chosen = driver::chosen_backend(options);
  // The texts among the free options say where the board is.
  std::string text = options.kind;
  driver::BoardOptions copy = chosen.options;
  copy.visit_options("", [&](const std::string& name, const rig::OptionFacts&, const auto& value) {
    const auto& free = chosen.entry.free_options;
    if (std::ranges::find(free, std::string_view(name)) == free.end()) return;
    if (const auto* const* place = std::get_if<std::string*>(&value)) text += ", " + name + " " + plain(**place);
  });
  return text;
}

bool needs_guardian(const config::Settings& settings, bool virtual_time) {
  return settings.backend == "rig" && !virtual_time && settings.guardian.enabled;
}

std::unique_ptr<GuardianLease> ask_for_lease(const config::Settings& settings, bool virtual_time) {
  if (!needs_guardian(settings, virtual_time)) return nullptr;
  const config::GuardianOptions& options = settings.guardian;
  const driver::DriverOptions& driver = settings.driver;
  const bool wanted = options.resident == "require" || (options.resident == "auto" && config::is_real_board(driver));
  if (wanted) {
    auto lease = GuardianLease::ask(options.socket, kept_board(driver));
    if (lease) return lease;
    if (options.resident == "require") {
      throw driver::Unavailable(
          fmt::format("guardian: no resident service listens at {} (guardian.socket), and guardian.resident = require; "
                      "start it: sudo systemctl start abs-guardian, or abs_guardian serve (docs/dead-man.md)",
                      options.socket));
    }
  }
  refuse_own_guardian_of_first_process(driver);
  return nullptr;
}

std::string who_guards(const Guard& guard, bool resident, const config::Settings& settings) {
  if (resident) {
    return fmt::format("the resident service guards this run (process {}, {})", guard.pid(), settings.guardian.socket);
  }
  std::string text = fmt::format("process {}, which this run started, stands by", guard.pid());
  if (config::is_real_board(settings.driver)) {
    text +=
        "; what ends or stops both at once (a container, a systemd scope, a suspension) leaves the outputs as they "
        "are: the resident service covers that (sudo systemctl enable --now abs-guardian, docs/dead-man.md)";
  }
  return text;
}

}  // namespace abs_hil::guardian
