// Exchanges observation and torque with a learning agent through shared memory.
#include "interchange/agent_controller.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <bit>
#include <cerrno>
#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/brake_map.hpp"
#include "driver/file_descriptor.hpp"
#include "rig/error_words.hpp"

namespace abs_hil::interchange {

namespace {

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

}  // namespace

AgentController::AgentController(const std::string& file, const control::ControllerContext& context)
    : page_(mapped(file)),
      hold_s_(std::min(longest_hold_s, page_->hold_s)),
      r2_m_(context.rig.wheels.r2_m),
      full_torque_Nm_(rig::brake_torque_at(context.rig.brake, 1.0)) {}

AgentController::~AgentController() { ::munmap(page_, AgentPage::size); }

void AgentController::reset(const control::SlipInput& input) noexcept {
  number_ = static_cast<std::uint32_t>(page_->action.load(std::memory_order_acquire) >> 32U);
  acts_ = false;
  action_ = age_s_ = time_s_ = late_cycles_ = refused_ = 0.0;
  show(input);
}

void AgentController::take_action(double dt_s) noexcept {
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

void AgentController::show(const control::SlipInput& input) noexcept {
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

control::SlipOutput AgentController::step(const control::SlipInput& input) noexcept {
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

}  // namespace abs_hil::interchange
