#include "config/guardian_keys.hpp"

namespace abs_hil::config {

void add_guardian_keys(std::vector<Key>& keys, guardian::GuardianOptions& g) {
  keys.insert(keys.end(), {
                              {"guardian.enabled", "",
                               "dead-man process beside a run on a board; off only with driver.emulated", &g.enabled},
                              {"guardian.timeout_ms",
                               "ms",
                               "time without a sign of life of the cycle after which the guardian acts",
                               &g.timeout_ms,
                               {2, 1000}},
                              {"guardian.insist_s",
                               "s",
                               "how long the guardian goes on trying to verify the safe state",
                               &g.insist_s,
                               {0.1, 600}},
                          });
}

}  // namespace abs_hil::config
