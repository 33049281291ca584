// The scope: what is shown, frozen and compared; the trigger; the cursors; keys and buttons.
import { Chart, drawRibbon } from './charts.js';
import { drawLatency, drawSlipCurve, drawWheels, short, table, tell } from './panels.js';
import { Stream, newest } from './stream.js';

const $ = (id) => document.getElementById(id);
const ALWAYS = ['omega1_est_rad_s', 'omega2_est_rad_s', 'slip_est', 'slip_ref', 'theta_est_N', 'tyre_slip', 'tyre_force_N'];
const FIRST = [['slip', ['slip', 'slip_est', 'slip_ref'], [-0.2, 1.05]], ['wheel speeds, rad/s', ['omega1_est_rad_s', 'omega2_est_rad_s']],
  ['brake torque, N m', ['brake_torque_Nm', 'brake_torque_ref_Nm', 'brake_torque_est_Nm']],
  ['peak tyre force, N', ['theta_N', 'theta_est_N']]];

const stream = new Stream();
const chosen = new Set();  // runs to compare, beside the current one
let charts = [], frozen = null, line = null, cursors = {}, armed = false, caught = null, dirty = true;

const scope = {
  rows: null, theme: 0,
  get bin() { return stream.hello?.bin_s ?? 0.02; },
  meaning: (name) => { const s = stream.hello?.signals[name]; return s ? `${s.meaning}${s.unit ? ', ' + s.unit : ''}` : 'controller\'s own'; },
  shift: (run) => ($('align').value === 'brake' ? run.facts.marks.find((mark) => mark.phase === 'brake')?.time_s ?? 0 : 0),
  shown() {
    const first = frozen ? stream.runs.get(frozen.run) : stream.current;
    const others = [...chosen].map((number) => stream.runs.get(number)).filter((run) => run?.facts && run !== first);
    return [first, ...others].filter((run) => run?.facts).map((run) => ({ run, shift: scope.shift(run) }));
  },
  window() {
    if (frozen) return [frozen.from, frozen.to];
    const [first] = scope.shown();
    const end = first ? Math.max(first.run.facts.last_s, ((first.run.numbers.at(-1) ?? 0) + 1) * scope.bin) - first.shift : 0;
    return [end - $('window').value, end];
  },
  lines() {
    const found = [];
    if (line != null) found.push({ at: line, name: '', style: '--text' });
    for (const [name, at] of Object.entries(cursors)) found.push({ at, name, style: '--cursor' });
    if (caught && frozen?.run === caught.run) found.push({ at: caught.time_s - shiftOf(caught.run), name: 'trigger', style: '--bad' });
    return found;
  },
  place(time) { line = time; changed(); },
  zoom(from, to) { freeze(from, to); },
  drawn(chart) { if (chart === charts[0]) drawRibbon(scope, chart); },  // only now the plot knows where its axes stand
  whole() { if (frozen) freeze(frozen.to - $('window').value, frozen.to); },
};

window.scope = scope;  // for tests and the curious

function shiftOf(number) { const run = stream.runs.get(number); return run?.facts ? scope.shift(run) : 0; }
function changed() { dirty = true; }

// ---- charts
function ask() {
  scope.rows = null;
  stream.show([...new Set([...charts.flatMap((chart) => chart.signals), ...ALWAYS])].slice(0, 40));
}
function add(title, signals, range) {
  charts.push(new Chart($('charts'), scope, title, signals, range, (chart) => {
    chart.remove();
    charts = charts.filter((other) => other !== chart);
    changed();
  }));
}
function names() {
  const own = [...new Set([...stream.runs.values()].flatMap((run) => run.facts?.own ?? []))];
  return [...own, ...stream.hello.derived, ...Object.keys(stream.hello.signals)];
}
function offer() {
  for (const [id, first] of [['add', [['', '…'], ['own', "all of the controller's own"]]], ['signal', []]]) {
    const select = $(id), before = select.value || 'slip_est';
    select.replaceChildren(...[...first, ...names().map((name) => [name, name])].map(([value, text]) => new Option(text, value)));
    if (id === 'signal') select.value = before;
  }
}

// ---- freeze and zoom
function freeze(from, to) {
  const [first] = scope.shown();
  if (!first) return;
  [from, to] = from < to ? [from, to] : [to, from];
  frozen = { run: first.run.number, from, to: Math.max(to, from + 1e-3) };
  scope.rows = null;  // those of the window before
  if (frozen.to - frozen.from <= 20) {
    stream.send({ do: 'rows', run: frozen.run, from_s: from + first.shift, to_s: frozen.to + first.shift, signals: stream.signals,
      version: stream.version });
  }
  changed();
}
function live() {
  frozen = scope.rows = null;
  changed();
}
function zoomBy(factor) {
  const [from, to] = scope.window();
  const middle = line != null && line > from && line < to ? line : (from + to) / 2;
  freeze(middle - (middle - from) * factor, middle + (to - middle) * factor);
}

// ---- trigger
function disarm() {
  armed = false;
  stream.send({ do: 'trigger', on: 'off' });
}
function arm() {
  if (!$('trigger').reportValidity()) return;
  armed = true;
  caught = null;
  $('caught').textContent = 'waiting';
  const on = $('on').value;
  stream.send({ do: 'trigger', on, ...(on === 'level' ? { signal: $('signal').value, edge: $('edge').value,
    level: $('level').valueAsNumber } : on === 'phase' ? { phase: $('phase').value } : { event: $('event').value }) });
  changed();
}
stream.addEventListener('caught', ({ detail }) => {
  caught = { ...detail, pending: true, since: performance.now() };
  armed = false;
  $('caught').textContent = `caught at ${detail.time_s.toFixed(4)} s, cycle ${detail.cycle}, ${detail.text || `value ${short(detail.value)}`}`;
});
function showCaught() {
  if (!caught?.pending) return;
  const run = stream.runs.get(caught.run), after = $('after').valueAsNumber || 0;
  const ended = performance.now() - caught.since > (after + 1) * 1000 || stream.current?.number !== caught.run;
  if (!run?.facts || (run.facts.last_s < caught.time_s + after && !ended)) return;
  caught.pending = false;
  const at = caught.time_s - scope.shift(run);
  frozen = { run: caught.run };
  freeze(at - ($('before').valueAsNumber || 0), at + after);
  line = at;
  if ($('again').checked) {
    const shown = caught;
    arm();
    caught = shown;
  }
}

// ---- cursors
function valueAt(name, time, { run, shift }) {
  const rows = scope.rows?.run === run.number ? scope.rows : null;
  if (rows?.signals.includes(name)) {
    const times = rows.columns[0];
    let best = 0;
    times.forEach((t, i) => { if (Math.abs(t - shift - time) < Math.abs(times[best] - shift - time)) best = i; });
    return [rows.columns[2 + rows.signals.indexOf(name)][best], null];
  }
  const i = run.numbers.indexOf(Math.floor((time + shift) / scope.bin));
  return i < 0 ? [NaN, null] : [run.low[name]?.[i] ?? NaN, run.high[name]?.[i] ?? NaN];
}
function tellCursors() {
  const [first] = scope.shown(), { A, B } = cursors;
  $('cursors').hidden = A == null && B == null;
  if (!first || $('cursors').hidden) return;
  const text = ([low, high]) => (high == null || low === high ? short(low, 5) : `${short(low)} … ${short(high)}`);
  const lines = [['', 'A', 'B', 'B − A'], ['time, s', short(A, 7), short(B, 7), A != null && B != null ? short(B - A, 5) : '–']];
  for (const name of new Set(charts.flatMap((chart) => chart.signals))) {
    const [a, b] = [A, B].map((time) => (time == null ? [NaN, null] : valueAt(name, time, first)));
    lines.push([name, text(a), text(b), short((b[1] ?? b[0]) - (a[1] ?? a[0]), 4)]);
  }
  table('values', lines);
}
function move(steps) {
  const [from, to] = scope.window();
  if (!frozen) freeze(from, to);
  const step = scope.rows && scope.rows.count > 1 ? (scope.rows.columns[0].at(-1) - scope.rows.columns[0][0]) / (scope.rows.count - 1)
    : scope.bin;
  line = Math.min(to, Math.max(from, (line ?? (from + to) / 2) + steps * step));
  changed();
}
function putCursor(name) {
  const [from, to] = scope.window();
  if (!frozen) freeze(from, to);
  cursors[name] = line ?? (from + to) / 2;
  changed();
}

// ---- saving, commands
function save(kind) {
  const [first] = scope.shown();
  if (!first) return;
  const [from, to] = scope.window();
  const link = $(kind);
  link.href = `download.${kind}?run=${first.run.number}&from_s=${from + first.shift}&to_s=${to + first.shift}`;
}
const command = (name, more) => stream.send({ do: 'command', command: name, ...more });
stream.addEventListener('answer', ({ detail }) => {
  $('answer').textContent = detail.text;
  $('answer').className = detail.accepted ? '' : 'bad';
});
stream.addEventListener('refused', ({ detail }) => { $('caught').textContent = detail.text; });
function stop() {
  if (!stream.hello?.commands) return;
  $('answer').textContent = 'stop sent';
  command('stop');
}

// ---- what comes
stream.addEventListener('hello', () => {
  offer();
  $('phase').replaceChildren(new Option('any', ''), ...stream.hello.phases.map((name) => new Option(name, name)));
  $('event').replaceChildren(new Option('any kind', ''), ...stream.hello.reason_kinds.map((name) => new Option(name, name)));
  $('stop').hidden = $('order').hidden = $('stop-key').hidden = !stream.hello.commands;
  document.title = `abs_hil serve: ${stream.hello.source}`;
  if (!charts.length) FIRST.forEach((chart) => add(...chart));
  ask();
});
stream.addEventListener('new-run', offer);
stream.addEventListener('run', changed);
stream.addEventListener('bins', changed);
stream.addEventListener('rows', ({ detail }) => {
  if (frozen && detail.run === frozen.run && detail.version === stream.version && detail.count) {
    scope.rows = { ...detail, signals: stream.signals };
    changed();
  }
});

function tellRuns() {
  const list = [...stream.runs.values()].filter((run) => run.facts).reverse();
  $('runs').replaceChildren(...list.map((run) => {
    const item = document.createElement('li'), label = item.appendChild(document.createElement('label'));
    const box = Object.assign(document.createElement('input'), { type: 'checkbox', checked: chosen.has(run.number) || run === stream.current,
      disabled: run === stream.current, id: `run-${run.number}` });
    box.onchange = () => { chosen[box.checked ? 'add' : 'delete'](run.number); changed(); };
    const { names: n, last_s, lost } = run.facts;
    const place = scope.shown().findIndex((other) => other.run === run);
    label.append(box, Object.assign(document.createElement('span'), { className: place < 0 ? '' : `key line-${place % 4 + 1}`, textContent:
      `${run.number}: ${[n.experiment, n.controller, n.plant].filter(Boolean).join(' · ') || 'names not received yet'}, `
      + `${last_s.toFixed(1)} s${lost ? `, ${lost} messages lost` : ''}` }));
    return item;
  }));
}

let runsTold = '';
function facts() {
  const run = scope.shown()[0]?.run, quiet = performance.now() - stream.heard > 1500;
  const f = run?.facts, mark = f?.marks.at(-1);
  $('state').textContent = !stream.connected ? 'no connection to abs_hil serve' : !f ? 'waiting for a run'
    : frozen ? 'frozen' : quiet ? 'no messages' : 'live';
  $('state').dataset.state = !stream.connected ? 'lost' : frozen ? 'frozen' : quiet ? 'quiet' : 'live';
  $('freeze').setAttribute('aria-pressed', String(!!frozen));
  $('arm').setAttribute('aria-pressed', String(armed));
  if (!f) return;
  const values = [['phase', mark?.name ?? '–'], ['time', `${f.last_s.toFixed(2)} s`], ['slip', short(newest(run, 'slip_est'), 3)],
    ['wanted', short(newest(run, 'slip_ref'), 3)], ['θ̂', `${short(newest(run, 'theta_est_N'), 3)} N`]];
  $('readouts').replaceChildren(...values.map(([name, value]) => {
    const pair = document.createElement('div');
    pair.append(Object.assign(document.createElement('dt'), { textContent: name }),
      Object.assign(document.createElement('dd'), { textContent: value }));
    return pair;
  }));
  $('readouts').dataset.phase = mark?.phase ?? '';
  $('counts').textContent = `lost on the way ${f.lost} · not sent to this page ${stream.dropped}`;
  $('counts').className = f.lost || stream.dropped ? 'bad' : '';
  const told = JSON.stringify([...stream.runs.values()].map((r) => [r.number, r.facts?.names, Math.round(r.facts?.last_s ?? 0), r.facts?.lost]))
    + [...chosen] + scope.shown().map(({ run: { number } }) => number);
  if (told !== runsTold && !$('runs').contains(document.activeElement)) {
    runsTold = told;
    tellRuns();
  }
  tell(f);
  drawLatency(f);
}

let nextFacts = 0;
function frame(now) {
  requestAnimationFrame(frame);
  showCaught();
  const shown = scope.shown();
  if (shown.length) drawWheels(shown[0].run, !frozen && now - stream.heard < 500);
  if (now > nextFacts) {
    nextFacts = now + 250;
    facts();
    drawSlipCurve(shown);
  }
  if (!dirty) return;
  dirty = false;
  for (const chart of charts) chart.draw();
  if (!charts.length) drawRibbon(scope);
  tellCursors();
}

// ---- keys and buttons
const toggle = () => (frozen ? live() : freeze(...scope.window()));
const keys = { f: toggle, t: () => (armed ? disarm() : arm()), a: () => putCursor('A'), b: () => putCursor('B'),
  x: () => { cursors = {}; line = null; changed(); }, '+': () => zoomBy(0.5), '=': () => zoomBy(0.5), '-': () => zoomBy(2), 0: () => scope.whole(),
  c: () => $('csv').click(), m: () => $('mcap').click(), '?': () => $('keys').click() };
document.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === 'Escape') { stop(); return; }  // from anywhere
  if (event.target.matches('input:not([type=checkbox]), select')) return;
  if (event.key === 'ArrowLeft' || event.key === 'ArrowRight') {
    event.preventDefault();
    move((event.key === 'ArrowLeft' ? -1 : 1) * (event.shiftKey ? 20 : 1));
    return;
  }
  const action = keys[event.key.toLowerCase()];
  if (action) { event.preventDefault(); action(); }
});
$('freeze').onclick = toggle;
$('stop').onclick = stop;
$('keys').onclick = () => { $('help').hidden = !$('help').hidden; $('keys').setAttribute('aria-expanded', String(!$('help').hidden)); };
$('csv').onclick = () => save('csv');
$('mcap').onclick = () => save('mcap');
$('window').onchange = () => { if (frozen) scope.whole(); changed(); };
$('align').onchange = () => { live(); cursors = {}; line = null; };
$('add').onchange = () => {
  const name = $('add').value, own = stream.current?.facts.own ?? [];
  (name === 'own' ? own : [name]).forEach((signal) => signal && add(scopeTitle(signal), [signal]));
  $('add').value = '';
  ask();
};
const scopeTitle = (name) => { const unit = stream.hello.signals[name]?.unit; return unit ? `${name}, ${unit}` : name; };
$('on').onchange = () => {
  for (const kind of ['level', 'phase', 'event'])
    for (const label of document.querySelectorAll(`.of-${kind}`)) label.hidden = $('on').value !== kind;
};
$('trigger').onsubmit = (event) => { event.preventDefault(); (armed ? disarm : arm)(); $('caught').textContent ||= ''; };
$('command').onchange = () => {
  $('of-name').hidden = $('command').value !== 'gain';
  $('of-value').hidden = !['gain', 'slip-ref'].includes($('command').value);
};
$('order').onsubmit = (event) => {
  event.preventDefault();
  command($('command').value, { name: $('name').value, value: $('value').valueAsNumber || 0 });
};
new ResizeObserver(() => { charts.forEach((chart) => chart.resize()); changed(); }).observe($('charts'));
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { scope.theme += 1; changed(); });
requestAnimationFrame(frame);
