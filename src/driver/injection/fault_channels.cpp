#include "driver/injection/fault_channels.hpp"

#include <bit>

namespace abs_hil::driver {

void EncoderChannel::start(std::int32_t counts) noexcept {
  last_ = delivered_ = counts;
  fraction_ = 0.0;
  held_ = 0;
  renewed_ns_ = 0;
  line_.clear();
}

std::int32_t EncoderChannel::travel(std::int32_t counts) noexcept {
  const std::int32_t travelled = rig::counts_between(last_, counts);
  last_ = counts;
  return travelled;
}

void EncoderChannel::advance(std::int64_t travel) noexcept {
  delivered_ =
      std::bit_cast<std::int32_t>(std::bit_cast<std::uint32_t>(delivered_) + static_cast<std::uint32_t>(travel));
}

std::int32_t EncoderChannel::pass(std::int32_t travel, const ActiveFault& fault, std::int64_t now_ns,
                                  std::mt19937_64& random) noexcept {
  switch (fault.kind) {
    case InjectionKind::off: delivered_ = 0; break;
    case InjectionKind::stuck: break;
    case InjectionKind::garbage:
      delivered_ = std::bit_cast<std::int32_t>(static_cast<std::uint32_t>(random() >> 32U));
      break;
    case InjectionKind::wrong: {
      const double counted = fraction_ + fault.parameter * travel;
      fraction_ = counted - std::trunc(counted);
      advance(static_cast<std::int64_t>(std::trunc(counted)));
      break;
    }
    case InjectionKind::intermittent:
      if (uniform(random) >= fault.parameter) advance(travel);
      break;
    case InjectionKind::slow:
      held_ += travel;
      if (now_ns - renewed_ns_ >= ns_of(fault.parameter)) {
        renewed_ns_ = now_ns;
        advance(held_);
        held_ = 0;
      }
      break;
    case InjectionKind::delayed: {
      line_.push(now_ns, travel);
      std::int64_t late = 0;
      while (line_.pop(now_ns - ns_of(fault.parameter), late)) advance(late);
      break;
    }
    case InjectionKind::ok:
      advance(travel + held_);
      held_ = 0;
      for (std::int64_t late = 0; line_.pop(now_ns, late);) advance(late);
      renewed_ns_ = now_ns;
      break;
  }
  return delivered_;
}

void NumberChannel::start() noexcept {
  delivered_ = 0.0;
  renewed_ns_ = 0;
  line_.clear();
}

double NumberChannel::pass(double value, const ActiveFault& fault, std::int64_t now_ns,
                           std::mt19937_64& random) noexcept {
  if (fault.kind != InjectionKind::delayed) line_.clear();
  switch (fault.kind) {
    case InjectionKind::ok:
      delivered_ = value;
      renewed_ns_ = now_ns;
      break;
    case InjectionKind::off: delivered_ = faults_.off; break;
    case InjectionKind::stuck: break;
    case InjectionKind::garbage: {
      const double drawn = faults_.garbage_least + (faults_.garbage_most - faults_.garbage_least) * uniform(random);
      delivered_ = faults_.whole ? std::floor(drawn) : drawn;
      break;
    }
    case InjectionKind::wrong: delivered_ = faults_.wrong(value, fault.parameter); break;
    case InjectionKind::intermittent: {
      const bool fails = uniform(random) < fault.parameter;
      const double failed = faults_.intermittently_wrong ? faults_.wrong(value, 0.0) : faults_.off;
      delivered_ = fails ? failed : value;
      break;
    }
    case InjectionKind::slow:
      if (now_ns - renewed_ns_ >= ns_of(fault.parameter)) {
        renewed_ns_ = now_ns;
        delivered_ = value;
      }
      break;
    case InjectionKind::delayed:
      line_.push(now_ns, value);
      while (line_.pop(now_ns - ns_of(fault.parameter), delivered_)) {
      }
      break;
  }
  return delivered_;
}

}  // namespace abs_hil::driver
