// The strip charts: for each signal the band between the least and the greatest value of each fiftieth of a second, or
// the cycles themselves where the server has sent them; the line, the cursors, the trigger's place; the phase ribbon.
const AXIS_PX = 58, GAP_S = 0.1;
export const PHASE_COLOURS = { idle: '--idle', accelerate: '--accelerate', coast: '--coast', brake: '--brake', hold: '--hold',
  stopped: '--stopped', fault: '--bad' };

export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const known = (value) => (Number.isNaN(value) ? null : value);

function lowerBound(list, value) {
  let low = 0, high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle] < value) low = middle + 1; else high = middle;
  }
  return low;
}

// [x, low, high, low, high, ...] of the signals of one run over a window of its own time.
export function envelope(run, signals, from, to, shift, bin) {
  const first = Math.max(0, lowerBound(run.numbers, Math.floor(from / bin)) - 1);
  const end = Math.min(run.numbers.length, lowerBound(run.numbers, Math.ceil(to / bin)) + 1);
  const columns = Array.from({ length: 1 + 2 * signals.length }, () => []);
  for (let i = first; i < end; ++i) {
    const at = (run.numbers[i] + 0.5) * bin - shift;
    if (i > first && (run.numbers[i] - run.numbers[i - 1]) * bin > GAP_S) {  // messages are missing
      columns[0].push(at - bin);
      for (let c = 1; c < columns.length; ++c) columns[c].push(null);
    }
    columns[0].push(at);
    signals.forEach((signal, s) => {
      columns[1 + 2 * s].push(known(run.low[signal]?.[i] ?? NaN));
      columns[2 + 2 * s].push(known(run.high[signal]?.[i] ?? NaN));
    });
  }
  return columns;
}

function exact(rows, signals, shift) {
  const columns = [Array.from(rows.columns[0], (time) => time - shift)];
  for (const signal of signals) {
    const values = Array.from(rows.columns[2 + rows.signals.indexOf(signal)], known);
    columns.push(values, values);
  }
  return columns;
}

export class Chart {
  // scope: {window(), lines(), shown() -> [{run, shift}], rows, bin, place(time), zoom(from, to), whole(), drawn(chart)}
  constructor(parent, scope, title, signals, range, remove) {
    Object.assign(this, { scope, title, signals, range });
    this.element = document.createElement('figure');
    this.element.className = 'chart';
    const head = this.element.appendChild(document.createElement('figcaption'));
    head.append(Object.assign(document.createElement('b'), { textContent: title }));
    this.legend = head.appendChild(document.createElement('span'));
    const close = Object.assign(document.createElement('button'), { type: 'button', textContent: '×', className: 'close' });
    close.setAttribute('aria-label', `remove the chart ${title}`);
    close.onclick = () => remove(this);
    head.append(close);
    this.plotted = this.element.appendChild(document.createElement('div'));
    parent.append(this.element);
    this.key = '';
  }

  // The plot is made again when runs or colours change.
  make(runs) {
    this.plot?.destroy();
    const series = [{}], bands = [];
    this.legend.replaceChildren();
    runs.forEach(({ run }, r) => this.signals.forEach((signal, s) => {
      const stroke = colour(`--line-${s + 1}`);
      const dash = r ? [[6, 3], [2, 3], [8, 3, 2, 3]][(r - 1) % 3] : undefined;
      for (const side of ['low', 'high'])
        series.push({ label: `${signal} ${side}`, stroke, width: side === 'high' ? 1.25 : 1, dash, points: { show: false } });
      bands.push({ series: [series.length - 1, series.length - 2], fill: stroke + '55' });
      if (r) return;
      const item = this.legend.appendChild(document.createElement('span'));
      item.className = `key line-${s + 1}`;
      item.textContent = signal;
      item.title = this.scope.meaning(signal);
    }));
    const grid = { stroke: colour('--grid'), width: 1 };
    const axis = { stroke: colour('--text'), grid, ticks: grid, font: '11px system-ui, sans-serif' };
    this.plot = new uPlot({
      width: Math.max(200, this.plotted.clientWidth), height: 150, series, bands, legend: { show: false },
      cursor: { drag: { x: true, y: false, setScale: false }, sync: { key: 'scope' }, points: { show: false } },
      scales: { x: { time: false, range: () => this.scope.window() }, y: { range: (_, low, high) => this.limits(low, high) } },
      axes: [{ ...axis, size: 26, values: (_, ticks) => ticks.map((tick) => `${+tick.toFixed(4)} s`) },
        { ...axis, size: AXIS_PX }],
      hooks: {
        draw: [(plot) => { this.lines(plot); this.scope.drawn(this); }],
        setSelect: [(plot) => {
          if (plot.select.width < 4) return;
          const [from, to] = [plot.select.left, plot.select.left + plot.select.width].map((px) => plot.posToVal(px, 'x'));
          plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          this.scope.zoom(from, to);
        }],
      },
    }, [[]], this.plotted);
    let down = 0;
    this.plot.over.addEventListener('mousedown', (event) => { down = event.clientX; });
    this.plot.over.addEventListener('mouseup', (event) => {
      if (Math.abs(event.clientX - down) < 4) this.scope.place(this.plot.posToVal(event.offsetX, 'x'));
    });
    this.plot.over.addEventListener('dblclick', () => this.scope.whole());
  }

  limits(low, high) {
    if (low == null || !Number.isFinite(low)) [low, high] = [0, 1];
    if (this.range) [low, high] = [Math.max(low, this.range[0]), Math.min(high, this.range[1])];
    const margin = 0.06 * (high - low) || 0.05 * Math.abs(high) || 0.5;
    return [low - margin, high + margin];
  }

  lines(plot) {
    const { ctx, bbox } = plot;
    for (const { at: time, name, style } of this.scope.lines()) {
      const x = plot.valToPos(time, 'x', true);
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = colour(style);
      ctx.lineWidth = devicePixelRatio;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
      ctx.textAlign = 'left';
      const at = [x + 3 * devicePixelRatio, bbox.top + 11 * devicePixelRatio];
      ctx.lineWidth = 2 * devicePixelRatio;  // readable over curves, which stay visible
      ctx.strokeStyle = colour('--card');
      ctx.strokeText(name, ...at);
      ctx.fillText(name, ...at);
      ctx.restore();
    }
  }

  draw() {
    const runs = this.scope.shown();
    const key = `${runs.map(({ run }) => run.number)} ${this.scope.theme}`;
    if (key !== this.key) {
      this.key = key;
      this.make(runs);
    }
    const [from, to] = this.scope.window();
    const parts = runs.map(({ run, shift }) => {
      const rows = this.scope.rows;
      return rows && rows.run === run.number && this.signals.every((signal) => rows.signals.includes(signal))
        ? exact(rows, this.signals, shift) : envelope(run, this.signals, from + shift, to + shift, shift, this.scope.bin);
    });
    if (!parts.length) return;
    this.plot.setData(parts.length > 1 ? uPlot.join(parts) : parts[0]);
  }

  resize() {
    this.plot?.setSize({ width: Math.max(200, this.plotted.clientWidth), height: 150 });
  }

  remove() {
    this.plot?.destroy();
    this.element.remove();
  }
}

// A canvas in its own pixels: {ctx, width, height} in CSS pixels, cleared.
export function canvas(id) {
  const element = document.getElementById(id);
  const { clientWidth: width, clientHeight: height } = element;
  const [w, h] = [Math.round(width * devicePixelRatio), Math.round(height * devicePixelRatio)];
  if (element.width !== w || element.height !== h) Object.assign(element, { width: w, height: h });
  const ctx = element.getContext('2d');
  ctx.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
  ctx.clearRect(0, 0, width, height);
  ctx.font = '11px system-ui, sans-serif';
  return { ctx, width, height };
}

// Over the plot of a chart, so that its times are those of the chart.
export function drawRibbon(scope, chart) {
  const { ctx, height } = canvas('ribbon');
  const [first] = scope.shown();
  if (!first || !chart?.plot) return;
  const start = chart.plot.bbox.left / devicePixelRatio, width = chart.plot.bbox.width / devicePixelRatio;
  document.getElementById('ribbon').dataset.end = start + width;
  const [from, to] = scope.window();
  const marks = first.run.facts.marks;
  const x = (time) => start + (time - first.shift - from) / (to - from) * width;
  marks.forEach((mark, i) => {
    const left = Math.max(start, x(mark.time_s));
    const right = Math.min(start + width, x(i + 1 < marks.length ? marks[i + 1].time_s : first.run.facts.last_s));
    if (right <= left) return;
    ctx.fillStyle = colour(PHASE_COLOURS[mark.phase] || '--idle');
    ctx.fillRect(left, 0, right - left, height);
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, 0, right - left, height);
    ctx.clip();
    ctx.fillStyle = colour('--on-phase');
    ctx.fillText(mark.name, left + 4, height / 2 + 4);
    ctx.restore();
  });
}
