// Exchanges observation and torque with a learning agent through shared memory.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <array>
#include <atomic>
#include <bit>
#include <cerrno>
#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/brake_map.hpp"
#include "driver/file_descriptor.hpp"
#include "interchange/foreign_controller.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::interchange {

namespace {

/// What a program and the agent that brakes its rig share: a file of `size` bytes that the agent makes and both map
/// (abs_hil.learning.rig_environment). Numbers have the computer's byte order.
struct AgentPage {
  static constexpr std::size_t size = 4096;
  static constexpr std::array<char, 8> right_mark{'a', 'b', 's', 'a', 'g', 't', '0', '1'};

  std::array<char, 8> mark;
  double hold_s;  ///< an action that is older brakes no more
  /// The agent's: a number that it raises with each action (high half), the action as a float (low half). One word, so
  /// that both always belong together.
  std::atomic<std::uint64_t> action;
  /// The program's: odd while it writes the values.
  std::atomic<std::uint64_t> version;
  /// In the order of AgentController::Value.
  std::array<std::atomic<double>, 11> values;
};
static_assert(sizeof(AgentPage) <= AgentPage::size && std::atomic<double>::is_always_lock_free);

constexpr double longest_hold_s = 1.0;

[[noreturn]] void refuse_agent(const std::string& file, const std::string& why) {
  throw std::invalid_argument("controller " + file + ": " + why +
                              "; abs_hil.learning.rig_environment makes this file and starts the program with it");
}

AgentPage* mapped(const std::string& file) {
  const driver::FileDescriptor opened(::open(file.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW));
  if (opened.get() < 0) refuse_agent(file, rig::refusal(errno, file, rig::reading));
  struct stat facts {};
  if (::fstat(opened.get(), &facts) != 0 || !S_ISREG(facts.st_mode) ||
      facts.st_size != static_cast<off_t>(AgentPage::size)) {
    refuse_agent(file, "no file of 4096 bytes");
  }
  void* const memory =
      ::mmap(nullptr, AgentPage::size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, opened.get(), 0);
  if (memory == MAP_FAILED) refuse_agent(file, rig::refusal(errno, file, rig::reading));
  auto* const page = static_cast<AgentPage*>(memory);
  if (page->mark == AgentPage::right_mark && page->hold_s > 0.0 && page->hold_s <= longest_hold_s) return page;
  ::munmap(memory, AgentPage::size);
  refuse_agent(file, "its mark is not abs_agt01, or it holds an action for a time outside (0, 1] s");
}

/// A slip controller from a file FILE.agent, whose torque an agent in another process chooses at its own pace, such as
/// a learner. Each step it shows the agent what controllers get, and brakes with the agent's latest action: a share of
/// the largest torque, in [0, 1]. It never waits. An action that is older than the page's hold_s, that is no number or
/// lies outside [0, 1], brakes with 0. Real-time safe but for its construction.
class AgentController final : public control::SlipController {
 public:
  enum Value : std::size_t {
    time_s,  ///< of braking
    slip,
    slip_ref,
    car_speed_m_s,
    alpha1_rad_s2,
    alpha2_rad_s2,
    brake_torque_Nm,
    max_brake_torque_Nm,
    acting_number,  ///< of the action that acts now; 0: none
    late_cycles,    ///< so far without an action in time
    refused,        ///< actions that were no number in [0, 1]
  };

  AgentController(const std::string& file, const control::ControllerContext& context)
      : page_(mapped(file)),
        hold_s_(std::min(longest_hold_s, page_->hold_s)),
        r2_m_(context.rig.wheels.r2_m),
        full_torque_Nm_(rig::brake_torque_at(context.rig.brake, 1.0)) {}
  AgentController(const AgentController&) = delete;
  AgentController& operator=(const AgentController&) = delete;
  ~AgentController() override { ::munmap(page_, AgentPage::size); }

  void reset(const control::SlipInput& input) noexcept override {
    number_ = static_cast<std::uint32_t>(page_->action.load(std::memory_order_acquire) >> 32U);
    acts_ = false;
    action_ = age_s_ = time_s_ = late_cycles_ = refused_ = 0.0;
    show(input);
  }
  [[nodiscard]] control::SlipOutput step(const control::SlipInput& input) noexcept override {
    time_s_ += input.dt_s;
    take_action(input.dt_s);
    show(input);
    const double largest_Nm = std::isinf(input.max_brake_torque_Nm) ? full_torque_Nm_ : input.max_brake_torque_Nm;
    control::SlipOutput output{
        .brake_torque_Nm = action_ * largest_Nm, .slip_velocity_error_m_s = rig::unknown, .theta_est_N = rig::unknown};
    output.signals[0] = action_;
    output.signals[1] = age_s_;
    return output;
  }
  [[nodiscard]] std::span<const rig::Signal> signals() const noexcept override { return signals_; }

 private:
  void take_action(double dt_s) noexcept {
    const std::uint64_t word = page_->action.load(std::memory_order_acquire);
    const auto number = static_cast<std::uint32_t>(word >> 32U);
    age_s_ += dt_s;
    if (number != number_) {
      number_ = number;
      age_s_ = 0.0;
      const auto asked = static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(word)));
      acts_ = asked >= 0.0 && asked <= 1.0;
      if (acts_) action_ = asked;
      if (!acts_) ++refused_;
    }
    if (age_s_ > hold_s_) acts_ = false;
    if (!acts_) {
      action_ = 0.0;
      ++late_cycles_;
    }
  }
  void show(const control::SlipInput& input) noexcept {
    const double largest_Nm = std::isinf(input.max_brake_torque_Nm) ? full_torque_Nm_ : input.max_brake_torque_Nm;
    const std::array<double, std::tuple_size_v<decltype(AgentPage::values)>> values{
        time_s_,
        input.slip,
        input.slip_ref,
        r2_m_ * input.speeds.omega2_rad_s,
        input.alpha1_rad_s2,
        input.alpha2_rad_s2,
        input.brake_torque_Nm,
        largest_Nm,
        acts_ ? static_cast<double>(number_) : 0.0,
        late_cycles_,
        refused_};
    const std::uint64_t version = page_->version.load(std::memory_order_relaxed);
    page_->version.store(version + 1, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_release);
    for (std::size_t i = 0; i < values.size(); ++i) page_->values[i].store(values[i], std::memory_order_relaxed);
    page_->version.store(version + 2, std::memory_order_release);
  }

  AgentPage* page_{nullptr};
  double hold_s_;  ///< of the page, which the agent may change, as it was at first
  double r2_m_;
  double full_torque_Nm_;  ///< of a brake without an upper end
  std::uint32_t number_{0};
  double action_{0.0};
  double age_s_{0.0};
  bool acts_{false};
  double time_s_{0.0};
  double late_cycles_{0.0};
  double refused_{0.0};
  std::array<rig::Signal, 2> signals_{
      {{"agent_action", "action of the agent that acts, as a share of the largest torque"},
       {"agent_age_s", "time since the agent's latest action"}}};
};

}  // namespace

std::unique_ptr<control::SlipController> make_agent_controller(const std::string& file,
                                                               const control::ControllerContext& context) {
  return std::make_unique<AgentController>(file, context);
}

}  // namespace abs_hil::interchange
