// The table of all configuration keys: name, unit, meaning, place, range.

#include <array>

#include "abs_hil/control/registry.hpp"
#include "config/command_keys.hpp"
#include "config/driver_keys.hpp"
#include "config/guardian_keys.hpp"
#include "config/key_table.hpp"

namespace abs_hil::config {

namespace {

constexpr Range positive(double most) { return {0.0, most, true, false}; }
constexpr Range from_zero(double most) { return {0.0, most, false, false}; }
constexpr Range between(double least, double most) { return {least, most, false, false}; }
constexpr Range open(double least, double most) { return {least, most, true, true}; }

void add_plant_keys(std::vector<Key>& keys, plant_sim::PlantOptions& p) {
  rig::WheelParameters& w = p.rig.wheels;
  rig::BrakeParameters& b = p.rig.brake;
  keys.insert(keys.end(),
              {
                  {"plant.theta_N", "N",
                   "peak tyre force, theta = mu D of (10); with load lever only what controllers are told",
                   &p.rig.tyre.theta_N, positive(500)},
                  {"plant.B", "", "tyre stiffness factor of (4)", &p.rig.tyre.B, positive(200)},
                  {"plant.C", "", "tyre shape factor of (4)", &p.rig.tyre.C, positive(2)},
                  {"plant.r1_m", "m", "upper wheel radius", &w.r1_m, between(0.01, 1)},
                  {"plant.r2_m", "m", "lower wheel radius", &w.r2_m, between(0.01, 1)},
                  {"plant.J1_kg_m2", "kg m^2", "upper wheel moment of inertia", &w.J1_kg_m2, between(1e-4, 1)},
                  {"plant.J2_kg_m2", "kg m^2", "lower wheel moment of inertia", &w.J2_kg_m2, between(1e-4, 1)},
                  {"plant.d1_Nms_rad", "N m s/rad", "upper wheel viscous friction", &w.d1_Nms_rad, from_zero(0.1)},
                  {"plant.d2_Nms_rad", "N m s/rad", "lower wheel viscous friction", &w.d2_Nms_rad, from_zero(0.1)},
                  {"plant.M10_Nm", "N m", "upper wheel Coulomb friction", &w.M10_Nm, from_zero(10)},
                  {"plant.M20_Nm", "N m", "lower wheel Coulomb friction", &w.M20_Nm, from_zero(10)},
                  {"plant.b1_Nm", "N m", "slope of the brake map (7)", &b.b1_Nm, positive(1000)},
                  {"plant.b2_Nm", "N m", "offset of the brake map (7)", &b.b2_Nm, between(-1000, 1000)},
                  {"plant.u0", "", "brake duty below which there is no torque (7)", &b.u0, {0, 1, false, true}},
                  {"plant.c31_per_s", "1/s", "inverse time constant of the brake (6)", &b.c31_per_s, positive(1000)},
                  {"plant.motor_stall_torque_Nm", "N m", "drive motor's torque at standstill and full duty",
                   &p.rig.motor.stall_torque_Nm, positive(100)},
                  {"plant.motor_no_load_speed_rad_s", "rad/s", "drive motor's no-load speed",
                   &p.rig.motor.no_load_speed_rad_s, positive(2000)},
                  {"plant.encoder_counts_per_rev", "", "encoder counts per revolution", &p.rig.encoder_counts_per_rev,
                   between(4, 1'000'000)},
                  {"plant.ideal_actuator", "", "simulation: the torque asked for acts at once", &p.ideal_actuator},
                  {"plant.ideal_sensors", "", "simulation: controllers get the true speeds", &p.ideal_sensors},
                  {"plant.slip_regularisation_m_s", "m/s", "simulation: least car speed that (5) divides by",
                   &p.slip_regularisation_m_s, between(1e-3, 0.1)},
                  {"plant.max_step_s", "s", "simulation: largest integration step", &p.max_step_s, between(1e-6, 2e-3)},
              });
}

/// Tyre, load and road: simulation only.
void add_contact_keys(std::vector<Key>& keys, plant_sim::PlantOptions& p) {
  plant_sim::IntecoMuParameters& mu = p.inteco_mu;
  keys.insert(
      keys.end(),
      {
          {"plant.tyre", "", "simulation: friction curve", &p.tyre, {}, {"magic-formula", "inteco-mu"}},
          {"plant.load", "", "simulation: normal force", &p.load, {}, {"constant", "lever"}},
          {"plant.mu_peak", "", "simulation: peak friction coefficient of tyre magic-formula under load lever",
           &p.mu_peak, positive(5)},
          {"plant.mu_w1", "", "simulation: tyre inteco-mu, coefficient of slip", &mu.w1, between(-10, 10)},
          {"plant.mu_w2", "", "simulation: tyre inteco-mu, coefficient of slip^2", &mu.w2, between(-10, 10)},
          {"plant.mu_w3", "", "simulation: tyre inteco-mu, coefficient of slip^3", &mu.w3, between(-10, 10)},
          {"plant.mu_w4", "", "simulation: tyre inteco-mu, height of the saturating term", &mu.w4, between(-10, 10)},
          {"plant.mu_a", "", "simulation: tyre inteco-mu, slip^p at half of the saturating term", &mu.a, positive(10)},
          {"plant.mu_p", "", "simulation: tyre inteco-mu, exponent of the saturating term", &mu.p, between(1, 10)},
          {"plant.lever_Mg_Nm", "N m", "simulation: load lever, moment of its weight", &p.lever.Mg_Nm, positive(1000)},
          {"plant.lever_L_m", "m", "simulation: load lever, from pivot to contact", &p.lever.L_m, between(0.01, 10)},
          {"plant.lever_phi_deg", "deg", "simulation: load lever, angle between its line and the contact's normal",
           &p.lever.phi_deg, positive(90)},
          {"plant.friction_profile", "", "simulation: friction over time or distance (docs/plants.md)",
           &p.friction_profile},
          {"plant.brake_torque_profile", "", "simulation: factor over the brake's torque, over time (docs/plants.md)",
           &p.drift.brake_torque},
          {"plant.motor_torque_profile", "", "simulation: factor over the motor's torque, over time (docs/plants.md)",
           &p.drift.motor_torque},
          {"plant.upper_bearing_profile", "", "simulation: factor over M10 and d1, over time (docs/plants.md)",
           &p.drift.upper_bearing},
          {"plant.lower_bearing_profile", "", "simulation: factor over M20 and d2, over time (docs/plants.md)",
           &p.drift.lower_bearing},
      });
}

void add_control_keys(std::vector<Key>& keys, control::ControlOptions& c) {
  std::vector<std::string_view> names;
  for (const control::ControllerEntry& entry : control::controllers()) names.push_back(entry.name);
  control::AdaptiveOptions& a = c.adaptive;
  keys.insert(
      keys.end(),
      {
          {"control.controller", "", "slip controller", &c.controller, {}, names},
          {"control.rate_Hz", "Hz", "control cycles per second", &c.rate_Hz, between(100, 10'000)},
          {"control.slip_ref", "", "wanted slip", &c.slip_ref, open(0, 1)},
          {"control.v_min_m_s", "m/s", "car speed below which slip control ends", &c.v_min_m_s, between(0.05, 5)},
          {"control.adaptive.gamma", "kg^2/s^2", "adaptation gain of (17)", &a.gamma, positive(1e4)},
          {"control.adaptive.ks0", "1/s^2", "integral gain of (16), (18)", &a.ks0, positive(1e6)},
          {"control.adaptive.ks1", "1/s", "proportional gain of (16), (18)", &a.ks1, positive(1e4)},
          {"control.adaptive.ka1", "s/kg^2", "innovation's weight in (18)", &a.ka1, positive(1e3)},
          {"control.adaptive.zeta0", "N", "zeta(0) of (17)", &a.zeta0, between(-500, 500)},
          {"control.adaptive.q11", "1/s^3", "Q of PA + A'P = -2Q", &a.q11, positive(1e6)},
          {"control.adaptive.q12", "1/s^2", "Q of PA + A'P = -2Q", &a.q12, between(-1e6, 1e6)},
          {"control.adaptive.q22", "1/s", "Q of PA + A'P = -2Q", &a.q22, positive(1e6)},
          {"control.adaptive.theta_min_N", "N", "least theta the estimate may take", &a.theta_min_N, from_zero(500)},
          {"control.adaptive.theta_max_N", "N", "largest theta the estimate may take", &a.theta_max_N, positive(1000)},
          {"control.nominal.theta0_N", "N", "theta that (16) believes in; 0: the plant's", &c.nominal.theta0_N,
           from_zero(500)},
          {"control.observer.bandwidth_rad_s", "rad/s", "speed observer's triple pole", &c.observer.bandwidth_rad_s,
           between(5, 2000)},
          {"control.observer.standstill_time_s", "s", "time without a count after which a wheel stands",
           &c.observer.standstill_time_s, between(0.005, 1)},
      });
}

void add_switching_keys(std::vector<Key>& keys, control::SwitchingAdaptationOptions& o,
                        const std::array<std::string_view, 4>& names) {
  keys.insert(keys.end(),
              {
                  {names[0], "kg^2 m/s^3", "gain of theta_hat' = -gamma k phi sign(e_v)", &o.gamma, from_zero(1e4)},
                  {names[1], "N", "first estimate of theta", &o.theta0_N, from_zero(500)},
                  {names[2], "N", "least theta the estimate may take", &o.theta_min_N, from_zero(500)},
                  {names[3], "N", "largest theta the estimate may take", &o.theta_max_N, positive(1000)},
              });
}

void add_sliding_keys(std::vector<Key>& keys, control::ControlOptions& c) {
  keys.insert(
      keys.end(),
      {
          {"control.sliding_mode.gain_m_s2", "m/s^2", "K of -K sign(e_v)", &c.sliding_mode.gain_m_s2, positive(200)},
          {"control.sliding_mode_smooth.gain_m_s2", "m/s^2", "K of -K sat(e_v/width)", &c.sliding_mode_smooth.gain_m_s2,
           positive(200)},
          {"control.sliding_mode_smooth.boundary_m_s", "m/s", "width of the boundary layer in e_v",
           &c.sliding_mode_smooth.boundary_m_s, between(1e-3, 10)},
          {"control.super_twisting.k1", "m^0.5/s^1.5", "gain of sqrt|e_v|", &c.super_twisting.k1, positive(200)},
          {"control.super_twisting.k2", "m/s^3", "gain of the integral of sign(e_v)", &c.super_twisting.k2,
           positive(5000)},
      });
  add_switching_keys(keys, c.sliding_mode.adaptation,
                     {"control.sliding_mode.gamma", "control.sliding_mode.theta0_N", "control.sliding_mode.theta_min_N",
                      "control.sliding_mode.theta_max_N"});
  add_switching_keys(keys, c.sliding_mode_smooth.adaptation,
                     {"control.sliding_mode_smooth.gamma", "control.sliding_mode_smooth.theta0_N",
                      "control.sliding_mode_smooth.theta_min_N", "control.sliding_mode_smooth.theta_max_N"});
  add_switching_keys(keys, c.super_twisting.adaptation,
                     {"control.super_twisting.gamma", "control.super_twisting.theta0_N",
                      "control.super_twisting.theta_min_N", "control.super_twisting.theta_max_N"});
}

void add_classic_keys(std::vector<Key>& keys, control::ControlOptions& c) {
  control::FivePhaseOptions& f = c.five_phase;
  keys.insert(keys.end(),
              {
                  {"control.relay.threshold", "", "slip that releases the brake; 0: control.slip_ref",
                   &c.relay.threshold, from_zero(0.99)},
                  {"control.pi.kp_per_s", "1/s", "proportional gain on e_v", &c.pi.kp_per_s, positive(1000)},
                  {"control.pi.ki_per_s2", "1/s^2", "integral gain on e_v", &c.pi.ki_per_s2, from_zero(1e4)},
                  {"control.pi.feed_forward", "", "share of the measured tyre force fed forward", &c.pi.feed_forward,
                   between(0, 1)},
                  {"control.five_phase.hold_below_m_s2",
                   "m/s^2",
                   "wheel acceleration below which the torque is held",
                   &f.hold_below_m_s2,
                   {-500, 0, false, true}},
                  {"control.five_phase.release_below_m_s2",
                   "m/s^2",
                   "... below which it is released",
                   &f.release_below_m_s2,
                   {-500, 0, false, true}},
                  {"control.five_phase.recover_above_m_s2", "m/s^2", "... above which releasing ends",
                   &f.recover_above_m_s2, between(-500, 500)},
                  {"control.five_phase.reapply_below_m_s2", "m/s^2",
                   "... below which, after its peak, it is re-applied", &f.reapply_below_m_s2, between(-500, 500)},
                  {"control.five_phase.hold_limit_s", "s", "longest hold before the torque is re-applied",
                   &f.hold_limit_s, positive(5)},
                  {"control.five_phase.recover_limit_s", "s", "longest wait for the wheel to come back",
                   &f.recover_limit_s, positive(5)},
                  {"control.five_phase.apply_Nm_s", "N m/s", "torque ramp of the first application", &f.apply_Nm_s,
                   positive(1e4)},
                  {"control.five_phase.release_Nm_s", "N m/s", "torque ramp down", &f.release_Nm_s, positive(1e4)},
                  {"control.five_phase.reapply_Nm_s", "N m/s", "torque ramp of the re-application", &f.reapply_Nm_s,
                   positive(1e4)},
              });
}

void add_adaptive_actuator_keys(std::vector<Key>& keys, control::AdaptiveActuatorOptions& c) {
  control::AdaptiveOptions& a = c.law;
  keys.insert(
      keys.end(),
      {
          {"control.adaptive_actuator.gamma", "kg^2/s^2", "adaptation gain of (17)", &a.gamma, positive(1e4)},
          {"control.adaptive_actuator.ks0", "1/s^2", "integral gain of (18)", &a.ks0, positive(1e6)},
          {"control.adaptive_actuator.ks1", "1/s", "proportional gain of (18)", &a.ks1, positive(1e4)},
          {"control.adaptive_actuator.ka1", "s/kg^2", "innovation's weight in (18)", &a.ka1, positive(1e3)},
          {"control.adaptive_actuator.zeta0", "N", "zeta(0) of (17)", &a.zeta0, between(-500, 500)},
          {"control.adaptive_actuator.q11", "1/s^3", "Q of PA + A'P = -2Q", &a.q11, positive(1e6)},
          {"control.adaptive_actuator.q12", "1/s^2", "Q of PA + A'P = -2Q", &a.q12, between(-1e6, 1e6)},
          {"control.adaptive_actuator.q22", "1/s", "Q of PA + A'P = -2Q", &a.q22, positive(1e6)},
          {"control.adaptive_actuator.theta_min_N", "N", "least theta the estimate may take", &a.theta_min_N,
           from_zero(500)},
          {"control.adaptive_actuator.theta_max_N", "N", "largest theta the estimate may take", &a.theta_max_N,
           positive(1000)},
          {"control.adaptive_actuator.lag_gain_per_s", "1/s", "decay of the torque error that the brake's lag leaves",
           &c.lag_gain_per_s, positive(1e4)},
          {"control.adaptive_actuator.lag_weight_s2", "s^2", "weight of that error in the Lyapunov function",
           &c.lag_weight_s2, positive(1e3)},
          {"control.adaptive_actuator.force_rate_N2_s", "N^2/s", "force observer: how fast the tyre force may change",
           &c.observer.force_rate_N2_s, positive(1e9)},
          {"control.adaptive_actuator.brake_rate_Nm2_s", "(N m)^2/s",
           "force observer: how fast the brake model's error may change", &c.observer.brake_rate_Nm2_s, positive(1e6)},
      });
}

void add_adaptive_peak_keys(std::vector<Key>& keys, control::AdaptivePeakOptions& c) {
  control::SlipPeakOptions& p = c.peak;
  keys.insert(
      keys.end(),
      {
          {"control.adaptive_peak.ks0", "1/s^2", "integral gain of the slip loop", &c.ks0, positive(1e6)},
          {"control.adaptive_peak.ks1", "1/s", "proportional gain of the slip loop", &c.ks1, positive(1e4)},
          {"control.adaptive_peak.lag_gain_per_s", "1/s", "decay of the torque error that the brake's lag leaves",
           &c.lag_gain_per_s, positive(1e4)},
          {"control.adaptive_peak.slip_min", "", "least slip reference", &c.slip_min, open(0, 1)},
          {"control.adaptive_peak.slip_max", "", "largest slip reference", &c.slip_max, open(0, 1)},
          {"control.adaptive_peak.slip_start", "", "slip reference at the start of braking", &c.slip_start, open(0, 1)},
          {"control.adaptive_peak.slip_rate_per_s", "1/s", "fastest change of the slip reference", &c.slip_rate_per_s,
           positive(100)},
          {"control.adaptive_peak.search_part",
           "",
           "amplitude of the search as a part of the reference",
           &c.search_part,
           {0, 1, false, true}},
          {"control.adaptive_peak.search_min", "", "least amplitude of the search, as a slip", &c.search_min,
           between(0, 0.1)},
          {"control.adaptive_peak.search_rad_s", "rad/s", "frequency of the search", &c.search_rad_s, positive(1000)},
          {"control.adaptive_peak.peak_slip0", "", "first guess of the peak's slip", &p.peak_slip0, open(0, 1)},
          {"control.adaptive_peak.peak_force0_N", "N", "first guess of the peak's force", &p.peak_force0_N,
           positive(500)},
          {"control.adaptive_peak.force_drift_per_s", "1/s", "variance of ln force gained per second",
           &p.force_drift_per_s, positive(100)},
          {"control.adaptive_peak.slip_drift_per_s", "1/s", "variance of ln slip gained per second",
           &p.slip_drift_per_s, positive(100)},
          {"control.adaptive_peak.shape_drift_per_s", "1/s", "variance of the curve's shape gained per second",
           &p.shape_drift_per_s, positive(100)},
          {"control.adaptive_peak.force_noise_N2_s", "N^2 s", "intensity of the force estimate's noise",
           &p.force_noise_N2_s, positive(100)},
          {"control.adaptive_peak.jump_level", "", "unexplained part of the peak force that is a friction jump",
           &p.jump_level, positive(10)},
          {"control.adaptive_peak.jump_hold_s", "s", "time after a jump in which only the level is learnt",
           &p.jump_hold_s, from_zero(1)},
          {"control.adaptive_peak.force_rate_N2_s", "N^2/s", "force observer: how fast the tyre force may change",
           &c.observer.force_rate_N2_s, positive(1e9)},
          {"control.adaptive_peak.brake_rate_Nm2_s", "(N m)^2/s",
           "force observer: how fast the brake model's error may change", &c.observer.brake_rate_Nm2_s, positive(1e6)},
      });
}

void add_experiment_keys(std::vector<Key>& keys, experiment::ExperimentOptions& e) {
  keys.insert(
      keys.end(),
      {
          {"experiment.name", "", "experiment by name or TOML file", &e.name},
          {"experiment.start_speed_rad_s", "rad/s", "simulation: brake at once from this speed; 0: accelerate first",
           &e.start_speed_rad_s, from_zero(1000)},
          {"experiment.end_speed_m_s", "m/s", "car speed at which braking counts as done", &e.end_speed_m_s,
           between(0.02, 50)},
          {"experiment.cut", "", "what cuts the motor", &e.cut, {}, {"threshold", "peak"}},
          {"experiment.cut_speed_rad_s", "rad/s", "upper wheel's speed that cuts the motor", &e.cut_speed_rad_s,
           positive(1000)},
          {"experiment.peak_wait_s", "s", "time without a new maximum that counts as a peak", &e.peak_wait_s,
           between(0.05, 10)},
          {"experiment.motor_duty", "", "drive PWM while accelerating", &e.motor_duty, positive(1)},
          {"experiment.idle_s", "s", "time before the motor starts", &e.idle_s, from_zero(60)},
          {"experiment.coast_s", "s", "time between motor off and brake on", &e.coast_s, from_zero(60)},
          {"experiment.hold_torque_Nm", "N m", "brake torque from the end of slip control to standstill",
           &e.hold_torque_Nm, from_zero(100)},
          {"experiment.stopped_s", "s", "time recorded after standstill", &e.stopped_s, from_zero(60)},
          {"experiment.accelerate_limit_s", "s", "time limit of acceleration", &e.accelerate_limit_s, positive(600)},
          {"experiment.brake_limit_s", "s", "time limit of braking", &e.brake_limit_s, positive(600)},
          {"experiment.hold_limit_s", "s", "time limit of holding", &e.hold_limit_s, positive(600)},
          {"experiment.stop_brake_duty", "", "brake PWM from a stop request to standstill; 0: released at once",
           &e.stop_brake_duty, from_zero(1)},
          {"experiment.stop_brake_limit_s", "s", "... but no longer than this", &e.stop_brake_limit_s, positive(60)},
      });
}

}  // namespace

KeyTable::KeyTable(Settings& s) {
  add_plant_keys(keys_, s.plant);
  add_contact_keys(keys_, s.plant);
  add_control_keys(keys_, s.control);
  add_sliding_keys(keys_, s.control);
  add_classic_keys(keys_, s.control);
  add_adaptive_actuator_keys(keys_, s.control.adaptive_actuator);
  add_adaptive_peak_keys(keys_, s.control.adaptive_peak);
  add_experiment_keys(keys_, s.experiment);
  add_driver_keys(keys_, s.driver);
  add_guardian_keys(keys_, s.guardian);
  add_command_keys(keys_, s);
  keys_.insert(
      keys_.end(),
      {
          {"gate.motor_duty_max", "", "largest drive PWM that may reach the rig", &s.gate.motor_duty_max, positive(1)},
          {"gate.brake_duty_max", "", "largest brake PWM that may reach the rig", &s.gate.brake_duty_max, positive(1)},
          {"gate.overspeed_rad_s", "rad/s", "speed of either wheel that is a fault", &s.gate.overspeed_rad_s,
           positive(2000)},
          {"gate.supply_min_V", "V", "a board that reports a lower supply is a fault; 0: never", &s.gate.supply_min_V,
           from_zero(100)},
          {"gate.temperature_max_C", "deg C", "a board that reports more is a fault", &s.gate.temperature_max_C,
           positive(300)},
          {"gate.motor_rate_per_s", "1/s", "fastest rise of the drive PWM", &s.gate.motor_rate_per_s, positive(1e6)},
          {"gate.brake_rate_per_s", "1/s", "fastest rise of the brake PWM", &s.gate.brake_rate_per_s, positive(1e6)},
          {"gate.sample_age_max_s", "s", "so long without a fresh measurement is a fault", &s.gate.sample_age_max_s,
           between(0.002, 1)},
          {"gate.free_slip_max", "", "share by which the wheels may differ, brake long released, before it is a fault",
           &s.gate.free_slip_max, between(0.02, 1)},
          {"realtime.priority", "", "SCHED_FIFO priority", &s.realtime.priority, between(1, 98)},
          {"realtime.cpu", "", "CPU that the cycle is bound to; -1: any", &s.realtime.cpu, between(-1, 1023)},
          {"realtime.startup_cycles", "", "first cycles of a run, not counted as late or measured",
           &s.realtime.overruns.startup_cycles, from_zero(100'000)},
          {"realtime.max_consecutive_overruns", "", "late cycles in a row that are a fault; 0: never",
           &s.realtime.overruns.max_consecutive, from_zero(1'000'000)},
          {"telemetry.channel_prefix", "", "prefix of the LCM channels", &s.telemetry.channel_prefix},
          {"telemetry.decimation", "", "cycles for each telemetry message", &s.telemetry.decimation,
           between(1, 10'000)},
          {"telemetry.status_period_s", "s", "from one status message to the next", &s.telemetry.status_period_s,
           between(0.01, 3600)},
          {"telemetry.experiment_period_s", "s", "from one message with the configuration to the next",
           &s.telemetry.experiment_period_s, between(0.01, 3600)},
          {"run.inject", "", "faults to inject, separated by commas (docs/fault-injection.md); never on hardware",
           &s.inject},
          {"run.seed", "", "seed of everything random in the simulator", &s.seed, from_zero(9e15)},
      });
}

}  // namespace abs_hil::config
