// The set-up for real time: each step says what it saw.
#include "runtime/realtime_setup.hpp"

#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <csignal>
#include <thread>

#include "catch.hpp"

using namespace abs_hil::runtime;

namespace {

RealtimeReport report_of(const RealtimeOptions& options) {
  RealtimeReport report;
  std::jthread([&] { report = RealtimeScope(options).report(); }).join();
  return report;
}

}  // namespace

TEST_CASE("off sets nothing up and does not claim real time") {
  const RealtimeReport report = report_of({.mode = RealtimeMode::off});
  CHECK(report.steps.empty());
  CHECK_FALSE(report.realtime());
  CHECK(report.shortcomings().empty());
}

TEST_CASE("every step says what was observed, and how to fix what failed") {
  const RealtimeReport report = report_of({.cpu = 0});
  REQUIRE(report.steps.size() == 7);
  for (const RealtimeStep& step : report.steps) {
    CAPTURE(step.what);
    CHECK_FALSE(step.detail.empty());
    CHECK(step.detail != "Success");  // an errno read too late
    CHECK(step.obtained == step.fix.empty());
  }
}

TEST_CASE("what the report says of scheduling is what the kernel says") {
  int policy = -1;
  sched_param parameters{};
  RealtimeReport report;
  std::jthread([&] {
    const RealtimeScope scope({.priority = 33});
    report = scope.report();
    pthread_getschedparam(pthread_self(), &policy, &parameters);
  }).join();
  const auto fifo = std::find_if(report.steps.begin(), report.steps.end(),
                                 [](const RealtimeStep& step) { return step.what == "SCHED_FIFO priority 33"; });
  REQUIRE(fifo != report.steps.end());
  CHECK(fifo->obtained == (policy == SCHED_FIFO && parameters.sched_priority == 33));
}

TEST_CASE("a missing CPU is a shortcoming, with the command that lists the CPUs") {
  const RealtimeReport report = report_of({.cpu = 1023});
  CHECK_FALSE(report.realtime());
  CHECK(report.shortcomings().find("bound to CPU 1023") != std::string::npos);
  CHECK(report.shortcomings().find("taskset") != std::string::npos);
}

TEST_CASE("the caller's own scheduling is left alone") {
  static_cast<void>(report_of({}));
  int policy = -1;
  sched_param parameters{};
  pthread_getschedparam(pthread_self(), &policy, &parameters);
  CHECK(policy == SCHED_OTHER);
}

TEST_CASE("signals are kept away from the cycle's thread and left to the others") {
  sigset_t cycle, other;
  std::jthread([&] {
    keep_signals_away();
    pthread_sigmask(SIG_SETMASK, nullptr, &cycle);
  }).join();
  pthread_sigmask(SIG_SETMASK, nullptr, &other);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    CHECK(sigismember(&cycle, signal) == 1);
    CHECK(sigismember(&other, signal) == 0);
  }
}

TEST_CASE("steps that are only helpful do not decide; each fix is given once") {
  RealtimeReport report;
  report.steps = {{.what = "needed", .obtained = true},
                  {.what = "helpful", .obtained = false, .required = false, .detail = "absent", .fix = "do this"}};
  CHECK(report.realtime());
  report.steps.push_back({.what = "also needed", .obtained = false, .detail = "refused", .fix = "do this"});
  CHECK_FALSE(report.realtime());
  const std::string text = report.shortcomings();
  CHECK(text.find("helpful, not required") != std::string::npos);
  CHECK(text.find("do this") == text.rfind("do this"));
}
