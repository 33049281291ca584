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

#include "identification_lanes.hpp"

namespace abs_hil::python {

namespace {

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
