// Writes and reads the flight recorder's ring, which survives the death of its writer.
#include "runtime/heartbeat.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace abs_hil::runtime {

namespace {

using Words = std::array<std::uint64_t, FlightSlot::words>;

/// The record in a slot and its version. Version 0: the slot holds no complete record.
std::pair<std::uint64_t, rig::CycleRecord> whole_record(const FlightSlot& slot) noexcept {
  Words words{};
  const std::uint64_t before = slot.version.load(std::memory_order_acquire);
  for (std::size_t i = 0; i < words.size(); ++i) words[i] = slot.record[i].load(std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_acquire);
  if (before % 2 != 0 || slot.version.load(std::memory_order_relaxed) != before) return {0, {}};
  rig::CycleRecord record;
  std::memcpy(static_cast<void*>(&record), words.data(), sizeof record);  // trivially copyable
  return {before, record};
}

}  // namespace

std::size_t FlightRing::slots_for(double duration_s, double rate_Hz) noexcept {
  return std::max<std::size_t>(1, static_cast<std::size_t>(std::ceil(duration_s * rate_Hz)));
}

void FlightRing::push(const rig::CycleRecord& record) noexcept {
  Words words;
  std::memcpy(words.data(), &record, sizeof record);
  FlightSlot& slot = slots_[next_];
  slot.version.store(2 * pushed_ + 1, std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_release);
  for (std::size_t i = 0; i < words.size(); ++i) slot.record[i].store(words[i], std::memory_order_relaxed);
  slot.version.store(2 * ++pushed_, std::memory_order_release);
  if (++next_ == slots_.size()) next_ = 0;
}

std::vector<rig::CycleRecord> FlightRing::contents() const {
  std::vector<std::pair<std::uint64_t, rig::CycleRecord>> found;
  found.reserve(slots_.size());
  for (const FlightSlot& slot : slots_) {
    if (auto entry = whole_record(slot); entry.first != 0) found.push_back(entry);
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<rig::CycleRecord> records;
  records.reserve(found.size());
  for (const auto& entry : found) records.push_back(entry.second);
  return records;
}

}  // namespace abs_hil::runtime
