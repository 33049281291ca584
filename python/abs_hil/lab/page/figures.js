// The paper's figures of up to three runs, over the time since the start of braking; and what was at one moment.
const CHARTS = [
  { id: 'slip', paper: 'figure 7', unit: '', columns: { slip: 'Slip', slip_ref: 'and what was asked for' } },
  { id: 'speeds', paper: 'figures 5 and 6', unit: 'rad/s', 
    columns: { omega1_rad_s: 'Speed of the upper wheel', omega2_rad_s: 'and of the lower one' } },
  { id: 'torque', paper: 'figure 8', unit: 'N m', 
    columns: { brake_torque_Nm: 'Brake torque', brake_torque_ref_Nm: 'and what was asked for' } },
  { id: 'theta', paper: 'figure 9', unit: 'N', 
    columns: { theta_est_N: 'Estimated peak tyre force', theta_N: 'and the true one' } },
  { id: 'distance', paper: 'figure 10', unit: 'm', columns: { distance_m: 'Distance since the start of braking' } },
  { id: 'duty', paper: '', unit: '', columns: { brake_pwm: 'Brake duty as it was sent' } }];
const DASHES = [[], [5, 4]];
const BEFORE_S = 0.05;  // shown before the start of braking
const HEIGHT_PX = 170;

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const braked = (run) => run.figures.brake_start_s ?? 0;  // null in JSON: the run did not brake

// A run's rows as a table for uPlot: time since the start of braking, then the columns. A value that is unknown is null.
function tableOf(run, names, whole) {
  const time = run.columns.get('time_s').values;
  const shift = braked(run);
  const from = whole ? 0 : Math.max(0, time.findIndex((t) => t >= shift - BEFORE_S));
  const table = [Array.from(time.subarray(from), (t) => Math.round((t - shift) * 1e6) / 1e6)];
  for (const name of names) {
    table.push(Array.from(run.columns.get(name).values.subarray(from), (value) => (value === value ? value : null)));
  }
  return table;
}

class Figures {
  // moved(time): the pointer is at this time
  constructor(place, hidden, moved) {
    this.charts = CHARTS.map((chart) => {
      const columns = Object.keys(chart.columns).filter((name) => !hidden.includes(name));
      return { ...chart, columns, title: columns.map((name) => chart.columns[name]).join(', ') };
    }).filter(({ columns }) => columns.length);
    this.moved = moved;
    for (const chart of this.charts) {
      chart.plotted = element('div', { className: 'plotted', role: 'img', id: `plot-${chart.id}` });
      chart.element = element('figure', { className: 'chart' }, element('figcaption', {},
        element('b', { textContent: chart.title }), ` ${chart.unit && `in ${chart.unit} `}`,
        element('span', { className: 'soft', textContent: chart.paper && `(the paper’s ${chart.paper})` })),
      chart.plotted);
      place.append(chart.element);
    }
    addEventListener('resize', () => this.resize());
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
      this.key = '';
      this.draw(this.runs, this.whole);
    });
  }

  make(count) {
    const sync = uPlot.sync('lab');
    for (const chart of this.charts) {
      chart.plot?.destroy();
      const lines = { stroke: colour('--grid'), width: 1 };
      const axis = { stroke: colour('--text'), grid: lines, ticks: lines,
        font: '11px system-ui, sans-serif' };
      const series = Array.from({ length: count }, (_, run) => chart.columns.map((name, n) => ({
        label: name, stroke: colour(`--line-${run + 1}`), dash: DASHES[n], width: n ? 1 : 1.5,
        points: { show: false }, spanGaps: false })));
      chart.plot = new uPlot({
        width: Math.max(200, chart.plotted.clientWidth), height: HEIGHT_PX, legend: { show: false }, padding: [6, 8, 0, 0],
        cursor: { sync: { key: sync.key }, drag: { x: true, y: false }, points: { show: false }, y: false },
        scales: { x: { time: false } }, series: [{}, ...series.flat()],
        axes: [{ ...axis, size: 26, space: 60 }, { ...axis, size: 46, space: 30 }],
        hooks: { setCursor: [({ cursor, data }) => { if (cursor.event && cursor.idx != null) this.moved(data[0][cursor.idx]); }] },
      }, [[], ...series.flat().map(() => [])], chart.plotted);
      chart.plotted.querySelector('canvas').setAttribute('aria-hidden', 'true');
    }
  }

  draw(runs, whole) {
    Object.assign(this, { runs, whole });
    const key = `${runs.length} ${matchMedia('(prefers-color-scheme: dark)').matches}`;
    if (key !== this.key) {
      this.key = key;
      this.make(runs.length);
    }
    const names = [...new Set(this.charts.flatMap(({ columns }) => columns))];
    const tables = runs.map((run) => tableOf(run, names, whole));
    const joined = tables.length > 1 ? uPlot.join(tables) : tables[0];
    for (const chart of this.charts) {
      const data = [joined[0]];
      runs.forEach((_, n) => {
        for (const name of chart.columns) data.push(joined[1 + n * names.length + names.indexOf(name)]);
      });
      chart.plot.setData(data);
      chart.plotted.setAttribute('aria-label', this.alternative(chart, runs));
    }
  }

  // What a reader without the picture is told.
  alternative(chart, runs) {
    const parts = runs.map((run, n) => {
      const [least, most] = extremes(run.columns.get(chart.columns[0]).values);
      return `run ${n + 1}: ${short(least, 3)} to ${short(most, 3)} ${chart.unit}`.trim();
    });
    return `${chart.title}. ${parts.join('; ')}`;
  }

  mark(time) {
    for (const { plot } of this.charts) {
      if (plot?.data[0].length) plot.setCursor({ left: plot.valToPos(time, 'x'), top: 10 }, false);
    }
  }

  resize() {
    for (const { plot, plotted } of this.charts) plot?.setSize({ width: Math.max(200, plotted.clientWidth), height: HEIGHT_PX });
  }
}

function extremes(values) {
  let least = Infinity, most = -Infinity;
  for (const value of values) {
    if (value < least) least = value;
    if (value > most) most = value;
  }
  return Number.isFinite(least) ? [least, most] : [NaN, NaN];
}

// ---- figures of merit
function drawFigures(place, rows, runs, hidden, goals) {
  const shown = rows.filter(({ name }) => !hidden.includes(name) && runs.some((run) => run.figures[name] != null));
  const head = element('tr', {}, element('th', { scope: 'col', textContent: 'figure of merit' }),
    ...runs.map((_, n) => element('th', { scope: 'col', className: `run-${n + 1}`, textContent: `run ${n + 1}` })));
  const lines = shown.map((row) => {
    const values = runs.map((run) => run.figures[row.name]);
    const size = (value) => (row.better === 'nearer zero' ? Math.abs(value) : value);
    const known = values.filter((value) => value != null).map(size);
    const best = row.better !== 'neither' && known.length > 1 ? Math.min(...known) : NaN;
    return element('tr', { title: row.meaning },
      element('th', { scope: 'row', textContent: row.title + (row.unit && `, ${row.unit}`) }),
      ...values.map((value) => element('td', { className: value != null && size(value) === best ? 'best' : '',
        textContent: value == null ? '–' : value.toFixed(row.decimals) })));
  });
  const changed = ({ summary: { gate } }) => Object.entries(gate).filter(([action, count]) => action !== 'passed' && count)
    .map(([action, count]) => `${action.replaceAll('_', ' ')}: ${count}`).join(', ');
  const gate = element('tr', { title: 'cycles in which the command gate changed the command' },
    element('th', { scope: 'row', textContent: 'the gate changed' }),
    ...runs.map((run) => element('td', { textContent: changed(run) || 'nothing' })));
  const ended = element('tr', {}, element('th', { scope: 'row', textContent: 'end' }),
    ...runs.map(({ summary: { result, reason } }) =>
      element('td', { className: result === 'fault' ? 'bad' : '', textContent: reason })));
  place.replaceChildren(element('thead', {}, head), element('tbody', {}, ...lines, gate, ended));
  return goals.map((goal) => {
    const met = runs.some(({ figures: { [goal.figure]: value } }) =>
      value != null && value <= (goal.at_most ?? Infinity) && value >= (goal.at_least ?? -Infinity));
    return { says: goal.says, met };
  });
}

// ---- why did it do that: everything about one cycle
const TOLD = [
  ['slip', 'slip'], ['slip_est', 'slip, estimated'], ['slip_ref', 'slip asked for'], ['omega1_rad_s', 'upper wheel'],
  ['omega1_est_rad_s', 'upper wheel, estimated'], ['omega2_rad_s', 'lower wheel'], ['omega2_est_rad_s', 'lower wheel, estimated'],
  ['slip_velocity_error_m_s', 'slip velocity error e_v'], ['theta_est_N', 'θ̂, estimated peak force'],
  ['theta_N', 'θ, true peak force'],
  ['brake_torque_ref_Nm', 'torque asked for'], ['brake_torque_est_Nm', 'torque, estimated'], ['brake_torque_Nm', 'torque, true'],
  ['brake_pwm', 'brake duty sent'], ['motor_pwm', 'motor duty sent']];

function rowAt(run, time) {
  const times = run.columns.get('time_s').values;
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time + braked(run) + 1e-9) low = middle; else high = middle - 1;
  }
  return low;
}

function phaseOf(run, row) {
  const kind = run.columns.get('phase').values[row];
  const phase = run.phases[run.columns.get('phase_index').values[row]];
  return phase && phase.kind === PHASES[kind] && phase.name ? phase.name : PHASES[kind];
}

// What the command gate did, in words; `most` gives the value of an option.
const GATE = {
  passed: () => 'passed',
  motor_clamped: (most) => `kept the motor duty between 0 and ${most('motor_duty_max')}`,
  brake_clamped: (most) => `kept the brake duty between 0 and ${most('brake_duty_max')}`,
  motor_blocked_by_brake: () => 'motor off, the brake goes first',
  motor_blocked_by_disable: () => 'motor off, it was not enabled',
  refused: (most, fault) => fault?.message ?? 'sent the safe command',
  motor_rate_limited: (most) => `held the rise of the motor duty to ${most('motor_rate_per_s')} /s`,
  brake_rate_limited: (most) => `held the rise of the brake duty to ${most('brake_rate_per_s')} /s`,
  motor_blocked_by_phase: () => 'motor off in this phase',
  brake_blocked_by_phase: () => 'brake off in this phase' };

// The gate may find a fault after the sequence: its event is in the next cycle then.
function gateOf(actions, run, row, fault, hidden) {
  const most = (key) => (`gate.${key}` in hidden.set ? 'its limit' : short(run.values.get(`gate.${key}`)));
  return actions.filter((_, bit) => (run.gate[row] >> bit) & 1)
    .map((action) => GATE[action](most, fault ?? run.events.find(({ kind }) => kind === 'fault'))).join('; ');
}

let PHASES = [];
function drawWhy(place, tables, runs, time, hidden) {
  PHASES = tables.phases;
  const rows = runs.map((run) => rowAt(run, time));
  const line = (title, unit, texts) => element('tr', {}, element('th', { scope: 'row', textContent: title + (unit && `, ${unit}`) }),
    ...texts.map((text) => element('td', { textContent: text })));
  const at = (run, n, name) => run.columns.get(name)?.values[rows[n]];
  const latest = (run, n, wanted) =>
    run.events.filter(({ time_s: time, kind }) => kind === wanted && time <= at(run, n, 'time_s') + 1e-9).at(-1);
  const lines = [line('phase', '', runs.map((run, n) => phaseOf(run, rows[n]))),
    line('why this phase', '', runs.map((run, n) => {
      const event = latest(run, n, 'phase');
      return event ? `${event.message.replace(/^.*: /, '')}, ${short(event.time_s - braked(run))} s` : '–';
    })),
    line('gate', '', runs.map((run, n) => gateOf(tables.gate_actions, run, rows[n], latest(run, n, 'fault'), hidden)))];
  for (const [name, title] of TOLD) {
    if (hidden.columns.includes(name)) continue;
    lines.push(line(title, runs[0].columns.get(name).unit, runs.map((run, n) => short(at(run, n, name)))));
  }
  const own = new Set(runs.flatMap(({ columns }) => [...columns].filter(([, column]) => column.own).map(([name]) => name)));
  for (const name of own) {
    lines.push(line(name, '', runs.map((run, n) => (run.columns.has(name) ? short(at(run, n, name)) : ''))));
  }
  place.replaceChildren(element('thead', {}, element('tr', {}, element('th', { scope: 'col', textContent: `at ${short(time)} s` }),
    ...runs.map((_, n) => element('th', { scope: 'col', className: `run-${n + 1}`, textContent: `run ${n + 1}` })))),
  element('tbody', {}, ...lines));
}

// ---- the two wheels, at the moment or turning
const SLOWER = 10;  // they would blur otherwise
class Wheels {
  constructor(svg, text) {
    Object.assign(this, { svg, text, angles: null });
    this.wheels = ['upper', 'lower'].map((name) => svg.querySelector(`#wheel-${name}`));
  }

  use(run) {
    this.run = run;
    this.angles = null;
  }

  // Angles over the run's rows, by the trapezoid of the true speeds.
  turned() {
    if (!this.angles) {
      const time = this.run.columns.get('time_s').values;
      this.angles = ['omega1_rad_s', 'omega2_rad_s'].map((name) => {
        const omega = this.run.columns.get(name).values;
        const angle = new Float64Array(omega.length);
        for (let n = 1; n < omega.length; ++n) {
          angle[n] = angle[n - 1] + 0.5 * (omega[n] + omega[n - 1]) * (time[n] - time[n - 1]);
        }
        return angle;
      });
    }
    return this.angles;
  }

  show(time) {
    if (!this.run) return;
    const row = rowAt(this.run, time);
    this.turned().forEach((angle, n) => {  // one turns against the other
      const degrees = ((n ? 1 : -1) * angle[row] * 180 / Math.PI) % 360;
      this.wheels[n].setAttribute('transform', `${this.wheels[n].dataset.place} rotate(${degrees})`);
    });
    const at = (name) => short(this.run.columns.get(name).values[row], 3);
    this.text.textContent =
      `${short(time, 3)} s: upper ${at('omega1_rad_s')}, lower ${at('omega2_rad_s')} rad/s, slip ${at('slip')}`;
    this.svg.setAttribute('aria-label', `The two wheels at ${this.text.textContent}`);
  }
}
