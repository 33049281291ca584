// Decides who guards a run: the resident service, a guardian of its own, or nobody in simulation.
#include "guardian/guarding.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <variant>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/driver/io_result.hpp"
#include "runtime/board_policy.hpp"

namespace abs_hil::guardian {

namespace {

/// The same folder has one name, whatever links lead to it.
std::string plain(const std::string& text) {
  if (!text.starts_with('/')) return text.empty() ? "the only one" : text;
  std::error_code error;
  const std::filesystem::path path = std::filesystem::weakly_canonical(text, error);
  return error ? text : path.string();
}

/// The end of a namespace's first process ends all others in it, the guardian too, before anybody can write.
void refuse_own_guardian_of_first_process(const driver::DriverOptions& driver) {
  if (::getpid() != 1 || (driver.emulated && !runtime::is_real_board(driver))) return;
  throw driver::Unavailable(
      "guardian: this program is process 1 of its namespace (a container's entry point): its end would end its own "
      "guardian too, and the board would hold its duties. Use the resident service of the computer: give the container "
      "/run/abs_hil and set guardian.resident=require (docs/dead-man.md)");
}

}  // namespace

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
  const runtime::GuardianOptions& options = settings.guardian;
  const driver::DriverOptions& driver = settings.driver;
  const bool wanted = options.resident == "require" || (options.resident == "auto" && runtime::is_real_board(driver));
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
  if (runtime::is_real_board(settings.driver)) {
    text +=
        "; what ends or stops both at once (a container, a systemd scope, a suspension) leaves the outputs as they "
        "are: the resident service covers that (sudo systemctl enable --now abs-guardian, docs/dead-man.md)";
  }
  return text;
}

}  // namespace abs_hil::guardian
