// What settings imply: the rig's identity and the seed of the encoders.
#include "config/settings.hpp"

#include <fmt/format.h>

#include <charconv>

#include "config/config_error.hpp"

namespace abs_hil::config {

rig::RigParameters identity(const Settings& s) {
  return s.on_rig() ? s.rig.parameters : plant_sim::identity_of(s.plant);
}

std::uint64_t sensor_seed(const Settings& s) {
  if (s.sensor_seed.empty()) return static_cast<std::uint64_t>(s.seed);
  std::uint64_t seed = 0;
  const char* end = s.sensor_seed.data() + s.sensor_seed.size();
  const auto [at, problem] = std::from_chars(s.sensor_seed.data(), end, seed);
  if (problem == std::errc() && at == end) return seed;
  throw ConfigError(fmt::format("run.sensor_seed = \"{}\" is not valid; give a whole number in [0, 2^64), or nothing",
                                s.sensor_seed));
}

}  // namespace abs_hil::config
