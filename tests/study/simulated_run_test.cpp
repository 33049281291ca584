// One run of a study has the figures of a whole run.
#include "experiment/simulated_run.hpp"

#include "catch.hpp"
#include "paper_plan.hpp"
#include "study/batch.hpp"

using namespace abs_hil;
using study::simulate;

TEST_CASE("a simulated run gives the metrics of a whole run session, bit for bit") {
  for (const char* controller : {"adaptive", "nominal", "locked"}) {
    INFO(controller);
    experiment::test::Setup setup = experiment::test::braking(controller);
    setup.seed = 11;
    const analysis::Metrics whole = experiment::test::simulated(setup).metrics;
    config::Settings settings = study::test::paper_settings();
    settings.control.controller = controller;
    const study::RunResult run = simulate(settings, settings.plant, 11);
    CHECK(run.stopped());
    CHECK(run.metrics.stop_time_s == whole.stop_time_s);
    CHECK(run.metrics.stop_distance_m == whole.stop_distance_m);
    CHECK(run.metrics.torque_total_variation_Nm == whole.torque_total_variation_Nm);
    CHECK(run.metrics.slip_rms == whole.slip_rms);
    CHECK(run.metrics.time_locked_s == whole.time_locked_s);
  }
}

TEST_CASE("the plant differs from the controller's parameters only where requested") {
  config::Settings settings = study::test::paper_settings();
  settings.control.controller = "nominal";
  plant_sim::PlantOptions grippy = settings.plant;
  grippy.rig.tyre.theta_N *= 1.2;
  const study::RunResult run = simulate(settings, grippy, 1);
  // The nominal controller keeps Table 1's 23 N; the truth is 27.6 N.
  CHECK(run.metrics.theta_final_N == 23.0);
  CHECK(run.metrics.theta_error_final == Catch::Detail::Approx(23.0 / 27.6 - 1.0));
  CHECK(run.metrics.stop_time_s < 0.95 * simulate(settings, settings.plant, 1).metrics.stop_time_s);
}

TEST_CASE("the controllers use the model, whatever the plant is") {
  config::Settings settings = study::test::paper_settings();
  settings.control.controller = "nominal";
  settings.model.tyre.theta_N = 18.0;
  const study::RunResult run = simulate(settings, settings.plant, 1);
  CHECK(run.metrics.theta_final_N == 18.0);
  CHECK(run.metrics.theta_error_final == Catch::Detail::Approx(18.0 / 23.0 - 1.0));
}

TEST_CASE("a run that stops braking while the car moves has not stopped") {
  config::Settings settings = study::test::paper_settings();
  settings.plant.rig.encoder_counts_per_rev = settings.model.encoder_counts_per_rev = 100;
  settings.control.observer.standstill_time_s = 0.005;
  const study::RunResult run = simulate(settings, settings.plant, 1);
  CHECK_FALSE(run.stopped());
  CHECK(run.fault == rig::Reason::braking_without_stop);
}

TEST_CASE("a run that ends by a limit reports it") {
  config::Settings settings = study::test::paper_settings();
  settings.experiment.brake_limit_s = 0.5;
  const study::RunResult run = simulate(settings, settings.plant, 1);
  CHECK_FALSE(run.stopped());
  CHECK(run.fault == rig::Reason::phase_time_limit);
}
