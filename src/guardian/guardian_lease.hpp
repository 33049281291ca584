#pragma once

#include <memory>
#include <optional>
#include <string>

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
  [[nodiscard]] pid_t pid() const noexcept override { return service_.pid; }
  GuardEnd end(Stage stage = Stage::closed) noexcept override;
  [[nodiscard]] Pages& pages() noexcept override { return *pages_; }

 private:
  explicit GuardianLease(driver::FileDescriptor socket);

  driver::FileDescriptor socket_;
  Peer service_;
  driver::FileDescriptor guard_process_{-1};  ///< -1: not visible from here, as in a container
  std::optional<Pages> pages_{};
  const SharedRecorder* recorder_{nullptr};
  std::string launch_config_{};
  std::uint32_t ends_before_{0};  ///< of the guard's page
  bool armed_{false};
};

}  // namespace abs_hil::guardian
