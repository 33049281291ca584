#include "study/run_part.hpp"

#include <algorithm>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "study/workbench.hpp"

namespace abs_hil::study {

namespace {

/// Workbenches, one for each thread that asks at the same time.
class Workshop {
 public:
  explicit Workshop(const Study& study) : study_(study) {}

  template <class Work>
  auto with_bench(const Work& work) {
    std::unique_ptr<Workbench> bench = borrow();
    auto result = work(*bench);
    const std::scoped_lock lock(mutex_);
    free_.push_back(std::move(bench));
    return result;
  }

 private:
  std::unique_ptr<Workbench> borrow() {
    {
      const std::scoped_lock lock(mutex_);
      if (!free_.empty()) {
        std::unique_ptr<Workbench> bench = std::move(free_.back());
        free_.pop_back();
        return bench;
      }
    }
    return std::make_unique<Workbench>(study_);
  }

  const Study& study_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Workbench>> free_{};
};

/// Settings by the index of the first run that uses them, each made once.
class OwnSettings {
 public:
  explicit OwnSettings(std::size_t count) : settings_(count), made_(count) {}

  template <class Make>
  const config::Settings* at(std::size_t index, const Make& make) {
    std::call_once(made_[index], [&] { settings_[index] = std::make_unique<const config::Settings>(make()); });
    return settings_[index].get();
  }

 private:
  std::vector<std::unique_ptr<const config::Settings>> settings_;
  std::vector<std::once_flag> made_;
};

}  // namespace

void run_part(const Study& study, std::size_t count, std::size_t threads,
              const std::function<std::uint64_t(std::size_t)>& run_of,
              const std::function<void(std::size_t, Outcome)>& take) {
  Workshop workshop(study);
  // The settings of a job must outlive the batch. Runs that differ in their varied plant alone share them, since what a
  // batch makes of settings costs more than a copy.
  OwnSettings own(study.shares_settings() ? 0 : count);
  const auto job_of = [&](std::size_t i) {
    const RunIndex index = study.index_of(run_of(i));
    return workshop.with_bench([&](Workbench& bench) -> Job {
      const config::Settings* settings = &study.contenders(index.study_case)[index.contender].settings;
      if (!study.shares_settings()) {
        const std::size_t kinds = study.contenders(index.study_case).size();
        const std::size_t back = std::min<std::size_t>(index.repetition, i / kinds) * kinds;
        const bool same = study.index_of(run_of(i - back)).same_settings(index);
        settings = own.at(same ? i - back : i, [&] { return bench.settings_of(index); });
      }
      Workbench::Drawn drawn = bench.drawn(index);
      return {.settings = settings, .plant = std::move(drawn.plant), .seed = drawn.seed};
    });
  };
  run_batch(count, threads, job_of, take);
}

}  // namespace abs_hil::study
