#pragma once

#include <sys/types.h>

#include <memory>
#include <optional>
#include <string>

#include "config/settings.hpp"
#include "driver/factory.hpp"
#include "driver/file_descriptor.hpp"
#include "guardian/guard.hpp"
#include "guardian/lease_wire.hpp"

namespace abs_hil::guardian {

/// A lease of the outputs from the resident service (docs/dead-man.md). Ask for it before the driver opens the board:
/// until then the service has the board. While the lease lasts the service lets go of the board, and guards it from
/// `arm` to `end`. Both may be repeated.
class GuardianLease final : public Guard {
 public:
  /// Null if no service listens at `socket`. Throws driver::Unavailable, in the service's own words, if it refuses.
  /// @param board  which board the run will drive (LeaseTerms::board)
  [[nodiscard]] static std::unique_ptr<GuardianLease> ask(const std::string& socket, const std::string& board);
  ~GuardianLease() override;

  /// What the service is to guard from the next `arm` on. `recorder` must outlive this object, or the next `cover`.
  void cover(const SharedRecorder& recorder, std::string launch_config_json);

  void arm(const runtime::Scheduling& controller) override;
  [[nodiscard]] bool alive() const noexcept override;
  [[nodiscard]] bool armed() const noexcept override { return armed_; }
  [[nodiscard]] pid_t pid() const noexcept override { return service_; }
  GuardEnd end(Stage stage = Stage::closed) noexcept override;

 private:
  GuardianLease(driver::FileDescriptor socket, pid_t service, driver::FileDescriptor process, Pages pages);

  driver::FileDescriptor socket_;
  pid_t service_;
  driver::FileDescriptor guard_process_{-1};  ///< -1: not visible from here, as in a container
  const SharedRecorder* recorder_{nullptr};
  std::string launch_config_{};
  std::uint32_t ends_before_{0};  ///< of the guard's page
  bool armed_{false};
};

/// What the resident service answers to a caller that is not a run.
struct ServiceAnswer {
  pid_t service{0};
  bool answered{false};
  bool keeps_it{false};  ///< it keeps the board that the caller named, or named none
  bool safe{false};      ///< outputs zero and verified, and no lease
  std::string text{};    ///< its board, then who has or had the lease; or why there is no answer
};

/// Asks the service at `socket` for its state. Nothing if none listens there. Takes at most 2 s.
[[nodiscard]] std::optional<ServiceAnswer> service_state(const std::string& socket);
/// Has the service end its lease, if there is one, and make the outputs safe. Waits at most 300 ms for its answer: a
/// service that is stopped, or whose queue is full of silent visitors, gives none.
/// @param boards  names of the board (kept_board), one a line; a service of another board does nothing
[[nodiscard]] std::optional<ServiceAnswer> service_makes_safe(const std::string& socket, const std::string& boards);

/// Kind and place of the board that the options name, as text. Two processes that mean the same board have the same
/// text.
[[nodiscard]] std::string kept_board(const driver::DriverOptions& options);

/// Whether a run needs a guardian: only in real time on a board. In simulation and in virtual time nothing real moves.
[[nodiscard]] bool needs_guardian(const config::Settings& settings, bool virtual_time);

/// Asks the resident service for the outputs, if `guardian.resident` and the board call for it. Call it before the
/// driver opens the board: the service has the board until then. Null: the run starts a guardian of its own, or needs
/// none. Throws driver::Unavailable if the service refuses, if there is none and there must be one, and for a guardian
/// of the run's own that would end together with the run.
[[nodiscard]] std::unique_ptr<GuardianLease> ask_for_lease(const config::Settings& settings, bool virtual_time);

/// Which guardian stands by, and what it does not cover, in words.
[[nodiscard]] std::string who_guards(const Guard& guard, bool resident, const config::Settings& settings);

}  // namespace abs_hil::guardian
