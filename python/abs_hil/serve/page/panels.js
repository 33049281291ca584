// Everything beside the charts: wheels, slip curve, verdicts of the gate, faults, timing, events.
import { canvas, colour } from './charts.js';
import { newest } from './stream.js';

const SLOWER = 20;  // the wheels turn this much slower than they do, or they would blur
const angles = [0, 0];
let turned = performance.now();

export const short = (value, digits = 4) => (value == null || Number.isNaN(value) ? '–' : String(+value.toPrecision(digits)));

function rows(id, lines) {
  document.getElementById(id).replaceChildren(...lines.map((cells, l) => {
    const line = document.createElement('tr');
    for (const text of cells) {
      line.append(Object.assign(document.createElement(l ? 'td' : 'th'),
        { textContent: text, className: String(text).length < 12 ? 'short' : '' }));
    }
    return line;
  }));
}

export function drawWheels(run, live) {
  const { ctx, width, height } = canvas('wheels');
  const omega = ['omega1_est_rad_s', 'omega2_est_rad_s'].map((name) => newest(run, name));
  const now = performance.now();
  const passed = Math.min(0.1, (now - turned) / 1000);
  turned = now;
  const radius = Math.min(width / 2 - 6, (height - 8) / 4);
  [-1, 1].forEach((turn, i) => {  // one turns against the other
    if (live && Number.isFinite(omega[i])) angles[i] += turn * omega[i] * passed / SLOWER;
    const y = height / 2 + (i ? radius : -radius);
    ctx.strokeStyle = colour(i ? '--line-2' : '--line-1');
    ctx.lineWidth = 3;
    ctx.beginPath();
    ctx.arc(width / 2, y, radius - 2, 0, 2 * Math.PI);
    ctx.stroke();
    ctx.lineWidth = 1.5;
    for (let spoke = 0; spoke < 5; ++spoke) {
      const angle = angles[i] + spoke * 2 * Math.PI / 5;
      ctx.beginPath();
      ctx.moveTo(width / 2, y);
      ctx.lineTo(width / 2 + (radius - 3) * Math.sin(angle), y - (radius - 3) * Math.cos(angle));
      ctx.stroke();
    }
  });
  document.getElementById('wheel-text').textContent =
    `upper ${short(omega[0], 3)}, lower ${short(omega[1], 3)} rad/s; drawn ${SLOWER} times slower`;
}

// 0 and multiples of 1, 2 or 5 times a power of ten up to `most`: two to five.
function ticks(most) {
  const power = 10 ** Math.floor(Math.log10(most / 2));
  const step = power * [5, 2, 1].find((factor) => factor * power * 2 <= most);
  return Array.from({ length: Math.floor(most / step + 1e-9) + 1 }, (_, i) => +(i * step).toPrecision(3));
}

export function drawSlipCurve(runs) {
  const { ctx, width, height } = canvas('slip');
  const left = 30, bottom = 18, most = [0.3, 10];
  const points = runs.map(({ run }) => (run.high.tyre_slip || []).map((slip, i) => [slip, run.high.tyre_force_N[i]])
    .filter(([slip, force]) => slip > -0.05 && slip <= 1 && Number.isFinite(force)));
  for (const [slip, force] of points.flat()) {
    most[0] = Math.max(most[0], slip);
    most[1] = Math.max(most[1], force);
  }
  const x = (slip) => left + slip / most[0] * (width - left - 6);
  const y = (force) => height - bottom - force / (1.1 * most[1]) * (height - bottom - 4);
  ctx.strokeStyle = colour('--grid');
  ctx.fillStyle = colour('--text');
  const line = (x1, y1, x2, y2) => {
    ctx.beginPath();
    ctx.moveTo(x1, y1);
    ctx.lineTo(x2, y2);
    ctx.stroke();
  };
  for (const slip of ticks(most[0])) {
    ctx.textAlign = x(slip) > width - 14 ? 'right' : 'center';
    line(x(slip), 4, x(slip), height - bottom);
    ctx.fillText(String(slip), x(slip), height - 5);
  }
  ctx.textAlign = 'right';
  for (const force of ticks(1.1 * most[1])) {
    line(left, y(force), width - 6, y(force));
    ctx.fillText(String(force), left - 4, y(force) + 4);
  }
  points.forEach((list, r) => {
    ctx.fillStyle = colour(`--line-${r % 4 + 1}`);
    list.forEach(([slip, force]) => ctx.fillRect(x(slip) - 1, y(force) - 1, 2.5, 2.5));
  });
  document.getElementById('slip').dataset.points = points.flat().length;
}

export function drawLatency(facts) {
  const { ctx, width, height } = canvas('latency');
  const names = ['wakeup_latency_ns', 'cycle_ns'], bottom = 16;
  const counts = names.map((name) => facts.counts[name]);
  const classes = counts[0].length;
  const most = Math.max(1, ...counts.flat());
  const level = (count) => (count ? Math.log10(count + 1) / Math.log10(most + 1) * (height - bottom - 4) : 0);
  counts.forEach((list, n) => {
    ctx.fillStyle = colour(`--line-${n + 1}`) + '99';
    list.forEach((count, i) => ctx.fillRect(i / classes * width, height - bottom - level(count), width / classes - 1, level(count)));
  });
  ctx.fillStyle = colour('--text');
  ['1 µs', '10 µs', '100 µs', '1 ms', '10 ms', '100 ms'].forEach((text, i) => {
    ctx.textAlign = i === 0 ? 'left' : i === 5 ? 'right' : 'center';
    ctx.fillText(text, (1 + 10 * i) / classes * width, height - 4);
  });
  const s = facts.status;
  const of = (name) => ['p50', 'p99', 'p99_9', 'max'].map((part) => short(s[`${name}_${part}_us`], 3)).join(' / ');
  document.getElementById('latency-text').textContent = s.cycles == null ? 'cycles by lateness and length, logarithmic' :
    `wake-up ${of('wakeup_latency')}, cycle ${of('cycle_time')} µs (p50 / p99 / p99.9 / max); late cycles: `
    + `${s.overruns}; records dropped by the run: ${s.telemetry_drops}`;
}

const withUnit = (value, unit) => `${short(value)}${unit ? ' ' + unit : ''}`;

export function tell(facts) {
  rows('verdicts', facts.verdicts.length ? [['verdict', 'times', 'last at', 'value', 'bound'], ...facts.verdicts.map((v) =>
    [v.text, v.count, `${v.last_s.toFixed(3)} s`, v.quantity ? `${v.quantity} ${withUnit(v.value, v.unit)}` : '', v.bound])]
    : [['nothing refused, no fault']]);
  const fault = facts.events.filter((event) => event.kind === 'fault').at(-1);
  const banner = document.getElementById('fault');
  banner.hidden = !fault;
  if (fault) {
    banner.textContent = `Fault at ${fault.time_s.toFixed(3)} s: ${fault.reason || fault.text}`
      + (fault.quantity ? ` (${fault.quantity} ${withUnit(fault.value, fault.unit)}, bound ${fault.bound || 'none'})` : '')
      + '. The outputs are at their safe values; only a new run can go on.';
  }
  document.getElementById('events').replaceChildren(...facts.events.slice(-50).reverse().map((event) =>
    Object.assign(document.createElement('li'), { className: event.kind, textContent: `${event.time_s.toFixed(3)} s  ${event.text}` })));
}

export function table(id, lines) { rows(id, lines); }
