// The plant's sensitivities over the windows of a log: differences of simulations, side by side in lanes where both
// wheels turn, one after the other where one stands.
//
// With x(t; x0, p, u) the plant's motion from the window's start x0 (angles, rad, speeds, rad/s, brake torque, N m),
// with parameters p under the duties u, and c the change of the fit that a step of a parameter is,
//
//     H   = [I2, (x(t; x0 + h e_j, p, u) - x(t; x0, p, u)) / h]   of both angles, by speeds and torque
//     D_i = (x(t; x0, p + dp_i, u_i) - x(t; x0, p, u)) / c_i      of both angles
//
// with h = 1e-5 max(1, |x0_j|). F and G are those of all states at the window's end.
//
// The angles only add up. Where flaws of the brake turn its duties into others (brake_flaws.py), u_i are those that the
// moved parameter asks for.

#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <variant>

#include "identification_plant.hpp"
#include "plant_sim/lanes/lane_plant.hpp"
#include "study/lanes/lane_jobs.hpp"

namespace abs_hil::python {

namespace {

using plant_sim::lanes::WindowKernel;
using plant_sim::lanes::WindowWork;

/// What a parameter belongs to: in windows in which that does not act its derivative is exactly 0.
enum class Acts { always, in_contact, with_brake, with_motor };

Acts acts_of(const std::string& name) {
  if (name == "always") return Acts::always;
  if (name == "contact") return Acts::in_contact;
  if (name == "brake") return Acts::with_brake;
  if (name == "motor") return Acts::with_motor;
  throw std::invalid_argument("a parameter acts always, contact, brake or motor, not " + name);
}

struct Varied {
  DelayedPlant plant;
  double step;
  Acts acts;
  std::unique_ptr<Inputs> own;  // duties of its own, if there are any
};

struct Window {
  std::ptrdiff_t first;  // row
  std::ptrdiff_t last;   // row at which the next window begins
  bool contact{false};
  bool brake{false};
  bool motor{false};
};

Window window_of(const Inputs& inputs, std::ptrdiff_t first, std::ptrdiff_t last, double brake_torque_Nm) {
  if (first < 0 || last <= first || last >= inputs.rows()) throw std::invalid_argument("a window outside its log");
  Window window{first, last, false, brake_torque_Nm > 1e-9, false};
  for (std::ptrdiff_t row = std::max<std::ptrdiff_t>(first - 1, 0); row < last; ++row) {
    const plant_sim::PlantInput input = inputs.at(row);
    window.contact = window.contact || !inputs.apart(row);
    window.brake = window.brake || input.brake_duty > 0.0;
    window.motor = window.motor || input.motor_duty > 0.0;
  }
  return window;
}

bool is_needed(Acts acts, const Window& window) {
  switch (acts) {
    case Acts::in_contact: return window.contact;
    case Acts::with_brake: return window.brake;
    case Acts::with_motor: return window.motor;
    case Acts::always: break;
  }
  return true;
}

// ---- lanes

/// Plants of the same kind as words for lanes: the undisturbed one for each state that is moved, and each varied one.
class Lanes {
 public:
  virtual ~Lanes() = default;
  /// Simulates the window from `starts` (columns of plants, states). False where lanes cannot.
  virtual bool pass(const std::vector<const Inputs*>& inputs, const Window& window,
                    const std::vector<std::array<double, states>>& starts) = 0;
  [[nodiscard]] double angle(std::ptrdiff_t row, std::ptrdiff_t wheel, std::size_t column) const {
    return angles_[static_cast<std::size_t>(row * angles + wheel) * lanes_ + column];
  }
  /// Of the states in the order of `values_of`.
  [[nodiscard]] double end(std::ptrdiff_t state, std::size_t column) const {
    constexpr std::size_t place[states] = {plant_sim::angle1, plant_sim::angle2, plant_sim::omega1, plant_sim::omega2,
                                           plant_sim::brake_torque};
    return ends_[place[state] * lanes_ + column];
  }

 protected:
  std::size_t lanes_{0};
  std::vector<double> angles_, ends_;
};

template <template <class> class Tyre, template <class> class Load>
class LanesOf : public Lanes {
 public:
  using Plant = plant_sim::lanes::LanePlant<double, Tyre<double>, Load<double>>;

  /// Null if these plants are of another kind.
  static std::unique_ptr<Lanes> of(const std::vector<const DelayedPlant*>& plants, study::lanes::InstructionSet set) {
    std::vector<Plant> words;
    for (const DelayedPlant* plant : plants) {
      const auto one = words_of(*plant);
      if (!one) return nullptr;
      words.push_back(*one);
    }
    return std::make_unique<LanesOf>(std::move(words), kernel_of(set));
  }
  LanesOf(std::vector<Plant> plants, WindowKernel kernel) : plants_(std::move(plants)), kernel_(kernel) {
    const std::size_t groups = (plants_.size() + kernel.lanes - 1) / kernel.lanes;
    lanes_ = groups * kernel.lanes;
    ends_.resize(static_cast<std::size_t>(states) * lanes_);
    for (Plant& plant : plants_) pointers_.push_back(reinterpret_cast<double*>(&plant));
  }

  bool pass(const std::vector<const Inputs*>& inputs, const Window& window,
            const std::vector<std::array<double, states>>& starts) override {
    const bool apart = inputs[0]->apart(window.first);
    if (!take_durations(*inputs[0], window, apart)) return false;
    bool late = false;
    for (std::size_t i = 0; i < plants_.size(); ++i) {
      plant_sim::StateVector& x = plants_[i].x;
      x[plant_sim::angle1] = starts[i][0];
      x[plant_sim::angle2] = starts[i][1];
      x[plant_sim::omega1] = starts[i][2];
      x[plant_sim::omega2] = starts[i][3];
      x[plant_sim::brake_torque] = starts[i][4];
      // No torque lets a wheel break away that touches nothing.
      plants_[i].upper_turns = apart && starts[0][2] == 0.0 ? 0.0 : 1.0;
      if (plants_[i].upper_turns == 0.0) x[plant_sim::omega1] = 0.0;
      late = late || plants_[i].delay_s > 0.0;
    }
    const std::size_t rows = durations_s_.size();
    angles_.resize(static_cast<std::size_t>(angles) * rows * lanes_);
    const bool whole = lanes_ == kernel_.lanes;  // one pass fills the arrays themselves
    part_angles_.resize(whole ? 0 : static_cast<std::size_t>(angles) * rows * kernel_.lanes);
    part_ends_.resize(whole ? 0 : static_cast<std::size_t>(states) * kernel_.lanes);
    std::vector<double>&to_angles = whole ? angles_ : part_angles_, &to_ends = whole ? ends_ : part_ends_;
    for (std::size_t begin = 0; begin < plants_.size(); begin += kernel_.lanes) {
      const std::size_t count = std::min(kernel_.lanes, plants_.size() - begin);
      take_duties(inputs, window, begin, count);
      if (!kernel_.pass({pointers_.data() + begin, count, durations_s_.data(), duties_.data(), rows, apart, late,
                         to_angles.data(), to_ends.data()}))
        return false;
      if (whole) continue;
      copy(part_angles_, angles_, begin);
      copy(part_ends_, ends_, begin);
    }
    return true;
  }

 private:
  static std::optional<Plant> words_of(const DelayedPlant& delayed) {
    const PlantOptions& options = delayed.plant.options();
    const plant_sim::TyreModel tyres = plant_sim::make_tyre_model(options);
    const auto* tyre = std::get_if<Tyre<double>>(&tyres);
    if (tyre == nullptr || options.ideal_actuator || !options.friction_profile.empty() ||
        plant_sim::Drift(options.drift).any() || options.rig.brake.brake_dead_time_s > 0.0 ||
        options.rig.motor.start_until_rad_s > 0.0 || options.rig.motor.middle_until_rad_s > 0.0 ||
        options.brake_flaws != plant_sim::BrakeFlaws{.release_ratio = options.brake_flaws.release_ratio})
      return std::nullopt;
    const plant_sim::LoadModel loads = plant_sim::make_load_model(options, tyre->peak_mu(), 1.0);
    const auto* load = std::get_if<Load<double>>(&loads);
    if (load == nullptr) return std::nullopt;
    Plant plant;
    plant.tyre = *tyre;
    plant.load = *load;
    plant.wheels = plant_sim::BasicWheels<double>(options.rig.wheels);
    plant.brake = rig::BasicBrake<double>(options.rig.brake);
    if (const double limit = options.rig.brake.brake_rate_limit_Nm_s; limit > 0.0) plant.brake_limit_Nm_s = limit;
    plant.brake_release_ratio = options.brake_flaws.release_ratio;
    plant.motor_stall_Nm = options.rig.motor.stall_torque_Nm;
    plant.motor_no_load_rad_s = options.rig.motor.no_load_speed_rad_s;
    plant.max_step_s = options.max_step_s;
    plant.delay_s = delayed.delay_s;
    return plant;
  }
  static WindowKernel kernel_of(study::lanes::InstructionSet set) {
    using Kind = plant_sim::lanes::WindowKind<Tyre, Load>;
    using plant_sim::lanes::window_kernel;
#ifdef ABS_HIL_WIDE_LANES
    if (set == study::lanes::InstructionSet::avx512) return window_kernel<rig::Avx512, Kind>();
    if (set == study::lanes::InstructionSet::avx2) return window_kernel<rig::Avx2, Kind>();
#endif
    return window_kernel<rig::Portable, Kind>();
  }
  /// False if the wheels part or join within the window.
  bool take_durations(const Inputs& inputs, const Window& window, bool apart) {
    durations_s_.clear();
    for (std::ptrdiff_t row = window.first; row < window.last; ++row) {
      if (inputs.apart(row) != apart) return false;
      durations_s_.push_back(inputs.time_s.data()[row + 1] - inputs.time_s.data()[row]);
    }
    return true;
  }
  /// Of the plants from `begin` on; free lanes repeat the first of them.
  void take_duties(const std::vector<const Inputs*>& inputs, const Window& window, std::size_t begin,
                   std::size_t count) {
    duties_.resize(durations_s_.size() * plant_sim::lanes::duties * kernel_.lanes);
    double* to = duties_.data();
    for (std::ptrdiff_t row = window.first; row < window.last; ++row) {
      for (std::size_t lane = 0; lane < kernel_.lanes; ++lane, ++to) {
        const Inputs& own = *inputs[begin + (lane < count ? lane : 0)];
        const plant_sim::PlantInput now = own.at(row), earlier = own.before(row);
        to[plant_sim::lanes::motor_duty * kernel_.lanes] = now.motor_duty;
        to[plant_sim::lanes::brake_duty * kernel_.lanes] = now.brake_duty;
        to[plant_sim::lanes::earlier_motor_duty * kernel_.lanes] = earlier.motor_duty;
        to[plant_sim::lanes::earlier_brake_duty * kernel_.lanes] = earlier.brake_duty;
      }
      to += (plant_sim::lanes::duties - 1) * kernel_.lanes;
    }
  }
  void copy(const std::vector<double>& from, std::vector<double>& to, std::size_t begin) const {
    for (std::size_t i = 0; i * kernel_.lanes < from.size(); ++i)
      std::copy_n(from.data() + i * kernel_.lanes, kernel_.lanes, to.data() + i * lanes_ + begin);
  }

  std::vector<Plant> plants_;
  std::vector<double*> pointers_;
  WindowKernel kernel_;
  std::vector<double> durations_s_, duties_;
  std::vector<double> part_angles_, part_ends_;
};

/// Null if there are no lanes for these plants, or ABS_HIL_LANES=none.
std::unique_ptr<Lanes> lanes_of(const std::vector<const DelayedPlant*>& plants) {
  const study::lanes::InstructionSet set = study::lanes::instruction_set();
  if (set == study::lanes::InstructionSet::none) return nullptr;
  std::unique_ptr<Lanes> found;
#define ABS_HIL_TRY(tyre, load) \
  if (!found) found = LanesOf<tyre, load>::of(plants, set);
  ABS_HIL_WINDOW_KINDS(ABS_HIL_TRY)
#undef ABS_HIL_TRY
  return found;
}

// ---- one simulation after the other

/// Where the plant goes from `start`: calls `keep(row, angle1, angle2)` at each row of the window, returns the end.
template <class Keep>
std::array<double, states> run(DelayedPlant& plant, const Inputs& inputs, const Window& window,
                               const std::array<double, states>& start, const Keep& keep) {
  plant.plant.reset({start[0], start[1], start[2], start[3], start[4]});
  for (std::ptrdiff_t row = window.first; row < window.last; ++row) {
    const PlantState& s = plant.plant.state();
    keep(row, s.angle1_rad, s.angle2_rad);
    plant.advance(inputs, row);
  }
  return values_of(plant.plant.state());
}

/// The arrays that `linearise` returns.
struct Sensitivities {
  Sensitivities(std::ptrdiff_t rows, std::ptrdiff_t windows, std::ptrdiff_t count)
      : parameters(count),
        angle(new_array<Array>({rows, angles})),
        by_state(new_array<Array>({rows, angles, moving})),
        by_parameter(new_array<Array>({rows, angles, count})),
        end(new_array<Array>({windows, states})),
        end_by_state(new_array<Array>({windows, states, moving})),
        end_by_parameter(new_array<Array>({windows, states, count})),
        angle_at(angle.mutable_data()),
        by_state_at(by_state.mutable_data()),
        by_parameter_at(by_parameter.mutable_data()),
        end_at(end.mutable_data()),
        end_by_state_at(end_by_state.mutable_data()),
        end_by_parameter_at(end_by_parameter.mutable_data()) {
    std::fill_n(by_parameter_at, by_parameter.size(), 0.0);
    std::fill_n(end_by_parameter_at, end_by_parameter.size(), 0.0);
  }
  py::dict as_dict() const {
    py::dict result;
    result["angles"] = angle;
    result["by_state"] = by_state;
    result["by_parameter"] = by_parameter;
    result["end"] = end;
    result["end_by_state"] = end_by_state;
    result["end_by_parameter"] = end_by_parameter;
    return result;
  }

  std::ptrdiff_t parameters;
  Array angle, by_state, by_parameter, end, end_by_state, end_by_parameter;
  double *angle_at, *by_state_at, *by_parameter_at, *end_at, *end_by_state_at, *end_by_parameter_at;
};

class Lineariser {
 public:
  Lineariser(const PlantOptions& base, const Values& nominal, const py::list& parameters) : plant_(base, nominal) {
    for (const py::handle item : parameters) {
      const auto parameter = item.cast<py::tuple>();  // values, step, acts and, if it has its own, inputs
      varied_.push_back({DelayedPlant(base, parameter[0].cast<Values>()), parameter[1].cast<double>(),
                         acts_of(parameter[2].cast<std::string>()),
                         parameter.size() > 3 ? std::make_unique<Inputs>(parameter[3].cast<py::dict>()) : nullptr});
    }
    std::vector<const DelayedPlant*> columns(1 + moving, &plant_);
    for (const Varied& one : varied_) columns.push_back(&one.plant);
    lanes_ = lanes_of(columns);
    inputs_.resize(columns.size());
    starts_.resize(columns.size());
    steps_.resize(columns.size());
  }
  [[nodiscard]] std::ptrdiff_t parameters() const { return static_cast<std::ptrdiff_t>(varied_.size()); }

  /// Window number `w`, whose rows are counted from `origin` in the arrays.
  void pass(const Inputs& inputs, const Window& window, const double* start, std::ptrdiff_t w, std::ptrdiff_t origin,
            Sensitivities& to) {
    for (std::size_t i = 0; i < starts_.size(); ++i) {
      inputs_[i] = i > moving && varied_[i - 1 - moving].own ? varied_[i - 1 - moving].own.get() : &inputs;
      std::copy_n(start, states, starts_[i].begin());
      steps_[i] = i > moving ? varied_[i - 1 - moving].step : 0.0;
      if (i == 0 || i > moving) continue;
      steps_[i] = 1e-5 * std::max(1.0, std::abs(start[angles + i - 1]));
      starts_[i][angles + i - 1] += steps_[i];
    }
    if (lanes_ != nullptr && lanes_->pass(inputs_, window, starts_)) {
      keep_lanes(window, w, origin, to);
    } else {
      one_by_one(window, w, origin, to);
    }
  }

 private:
  [[nodiscard]] bool needed(std::size_t column, const Window& window) const {
    return column <= moving || is_needed(varied_[column - 1 - moving].acts, window);
  }
  void keep_lanes(const Window& window, std::ptrdiff_t w, std::ptrdiff_t origin, Sensitivities& to) const {
    const Lanes& from = *lanes_;
    for (std::ptrdiff_t i = 0; i < states; ++i) to.end_at[w * states + i] = from.end(i, 0);
    const std::ptrdiff_t rows = window.last - window.first;
    double* angle = to.angle_at + (window.first - origin) * angles;
    for (std::ptrdiff_t at = 0; at < rows * angles; ++at) angle[at] = from.angle(at / angles, at % angles, 0);
    for (std::size_t column = 1; column < starts_.size(); ++column) {
      if (!needed(column, window)) continue;
      const double per_step = 1.0 / steps_[column];
      const auto [rows_at, ends_at, columns] = place(column, window.first - origin, w, to);
      for (std::ptrdiff_t at = 0; at < rows * angles; ++at)
        rows_at[at * columns] = (from.angle(at / angles, at % angles, column) - angle[at]) * per_step;
      for (std::ptrdiff_t i = 0; i < states; ++i)
        ends_at[i * columns] = (from.end(i, column) - to.end_at[w * states + i]) * per_step;
    }
  }
  void one_by_one(const Window& window, std::ptrdiff_t w, std::ptrdiff_t origin, Sensitivities& to) {
    double* const angle = to.angle_at - origin * angles;
    const auto ends = run(plant_, *inputs_[0], window, starts_[0], [&](std::ptrdiff_t row, double a1, double a2) {
      angle[row * angles] = a1;
      angle[row * angles + 1] = a2;
    });
    std::copy(ends.begin(), ends.end(), to.end_at + w * states);
    for (std::size_t column = 1; column < starts_.size(); ++column) {
      if (!needed(column, window)) continue;
      DelayedPlant& plant = column <= moving ? plant_ : varied_[column - 1 - moving].plant;
      const double step = steps_[column];
      const auto [rows_at, ends_at, columns] = place(column, window.first - origin, w, to);
      const auto moved = run(plant, *inputs_[column], window, starts_[column],
                             [&, rows_at = rows_at, columns = columns](std::ptrdiff_t row, double a1, double a2) {
                               const std::ptrdiff_t at = (row - window.first) * angles;
                               rows_at[at * columns] = (a1 - angle[row * angles]) / step;
                               rows_at[(at + 1) * columns] = (a2 - angle[row * angles + 1]) / step;
                             });
      for (std::ptrdiff_t i = 0; i < states; ++i)
        ends_at[i * columns] = (moved[static_cast<std::size_t>(i)] - ends[static_cast<std::size_t>(i)]) / step;
    }
  }
  struct Place {
    double* rows;
    double* ends;
    std::ptrdiff_t columns;
  };
  static Place place(std::size_t column, std::ptrdiff_t row, std::ptrdiff_t w, Sensitivities& to) {
    const auto i = static_cast<std::ptrdiff_t>(column) - 1;
    if (i < moving)
      return {to.by_state_at + row * angles * moving + i, to.end_by_state_at + w * states * moving + i, moving};
    const std::ptrdiff_t p = to.parameters;
    return {to.by_parameter_at + row * angles * p + i - moving, to.end_by_parameter_at + w * states * p + i - moving,
            p};
  }

  DelayedPlant plant_;
  std::vector<Varied> varied_;
  std::unique_ptr<Lanes> lanes_;
  std::vector<const Inputs*> inputs_;
  std::vector<std::array<double, states>> starts_;
  std::vector<double> steps_;
};

}  // namespace

/// Simulates each window from its own start and differentiates it. `first` has windows + 1 rows: window w has the rows
/// from first[w] to first[w + 1] - 1. Shapes: `angles` (rows, 2) from the first window's first row on; `by_state`
/// (rows, 2, 3): derivatives by omega1, omega2 and brake torque at the window's start; `by_parameter` (rows, 2,
/// parameters); `end` (windows, 5); `end_by_state` (windows, 5, 3); `end_by_parameter` (windows, 5, parameters).
py::dict linearise(const PlantOptions& base, const Values& nominal, const py::list& parameters, const py::dict& log,
                   const Indices& first, const Array& starts) {
  const Inputs inputs(log);
  Lineariser lineariser(base, nominal, parameters);
  const std::ptrdiff_t windows = first.size() - 1;
  if (windows < 1 || starts.ndim() != 2 || starts.shape(0) != windows || starts.shape(1) != states) {
    throw std::invalid_argument("give one start of five values for each window");
  }
  const std::ptrdiff_t origin = first.data()[0];
  Sensitivities found(first.data()[windows] - origin, windows, lineariser.parameters());
  {
    const py::gil_scoped_release release;
    for (std::ptrdiff_t w = 0; w < windows; ++w) {
      const double* start = starts.data() + w * states;
      lineariser.pass(inputs, window_of(inputs, first.data()[w], first.data()[w + 1], start[4]), start, w, origin,
                      found);
    }
  }
  return found.as_dict();
}

}  // namespace abs_hil::python
