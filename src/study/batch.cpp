#include "study/batch.hpp"

#include <stdexcept>
#include <utility>

#include "config/config_error.hpp"
#include "study/parallel.hpp"

namespace abs_hil::study {

namespace {

Outcome outcome_of(const Job& job) {
  try {
    return {.run = simulate(*job.settings, job.plant, job.seed)};
  } catch (const config::ConfigError& error) {
    return {.refusal = error.what()};
  } catch (const std::invalid_argument& error) {
    return {.refusal = error.what()};
  }
}

}  // namespace

void run_batch(std::size_t count, std::size_t threads, const std::function<Job(std::size_t)>& job_of,
               const std::function<void(std::size_t, Outcome)>& take) {
  for_each_index(count, threads, [&](std::size_t index) { take(index, outcome_of(job_of(index))); });
}

}  // namespace abs_hil::study
