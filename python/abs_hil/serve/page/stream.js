// The connection to the server, and what has come over it: envelopes and facts of the newest runs.
const BINS = 1, ROWS = 2, HEAD = 32;
const MOST_BINS = 30000;  // of all runs, as many as the server keeps

export class Stream extends EventTarget {
  constructor() {
    super();
    this.runs = new Map();  // number -> {facts, numbers, low: {signal: []}, high: {signal: []}}
    this.hello = null;
    this.signals = [];
    this.version = 0;
    this.dropped = 0;
    this.rows = null;  // cycles of a window: {run, names, columns}
    this.connected = false;
    this.heard = 0;
    this.wait = 500;
    this.connect();
  }

  connect() {
    const url = new URL('ws', location.href);
    url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
    const socket = this.socket = new WebSocket(url);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.connected = true;
      this.wait = 500;
      this.runs.clear();
      if (this.signals.length) this.show(this.signals);
    };
    socket.onmessage = (event) => {
      if (typeof event.data === 'string') this.take(JSON.parse(event.data));
      else this.unpack(event.data);
    };
    socket.onclose = () => {
      this.connected = false;
      setTimeout(() => this.connect(), this.wait);
      this.wait = Math.min(this.wait * 2, 8000);
    };
  }

  send(request) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }

  show(signals) {
    this.signals = signals;
    this.version += 1;
    for (const run of this.runs.values()) Object.assign(run, { numbers: [], low: {}, high: {} });
    this.send({ do: 'show', signals, version: this.version });
  }

  run(number) {
    if (!this.runs.has(number)) this.runs.set(number, { number, facts: null, numbers: [], low: {}, high: {} });
    return this.runs.get(number);
  }

  get current() {
    let last = null;
    for (const run of this.runs.values()) if (run.facts && (!last || run.number > last.number)) last = run;
    return last;
  }

  take(message) {
    if (message.kind === 'hello') this.hello = message;
    if (message.kind === 'run') {
      const run = this.run(message.run);
      const grown = !run.facts || String(run.facts.own) !== String(message.own);
      run.facts = message;
      if (grown) this.dispatchEvent(new CustomEvent('new-run', { detail: run }));
    }
    this.dispatchEvent(new CustomEvent(message.kind, { detail: message }));
  }

  unpack(buffer) {
    const [kind, version, number, count, width, dropped] = new Int32Array(buffer, 0, 8);
    if (kind === ROWS) {
      const values = new Float64Array(buffer, HEAD);
      const columns = Array.from({ length: width }, (_, i) => values.subarray(i * count, (i + 1) * count));
      this.rows = { run: number, version, count, columns };
      this.dispatchEvent(new CustomEvent('rows', { detail: this.rows }));
      return;
    }
    if (kind !== BINS || version !== this.version) return;
    this.heard = performance.now();
    this.dropped = dropped;
    const run = this.run(number);
    const numbers = new Int32Array(buffer, HEAD, count);
    const values = new Float64Array(buffer, HEAD + 4 * (count + (count % 2)));
    for (const n of numbers) run.numbers.push(n);
    this.signals.forEach((signal, i) => {
      const low = run.low[signal] ||= [], high = run.high[signal] ||= [];
      for (let k = 0; k < count; ++k) {
        low.push(values[i * count + k]);
        high.push(values[(width + i) * count + k]);
      }
    });
    this.forget();
    this.dispatchEvent(new CustomEvent('bins'));
  }

  // Memory has a bound: the oldest run goes, and of a single long run its beginning.
  forget() {
    let kept = 0;
    for (const run of this.runs.values()) kept += run.numbers.length;
    while (kept > MOST_BINS * 1.1) {
      const [oldest] = [...this.runs.values()].filter((run) => run.numbers.length).sort((a, b) => a.number - b.number);
      const gone = Math.min(oldest.numbers.length, kept - MOST_BINS);
      for (const list of [oldest.numbers, ...Object.values(oldest.low), ...Object.values(oldest.high)]) list.splice(0, gone);
      if (!oldest.numbers.length) this.runs.delete(oldest.number);
      kept -= gone;
    }
    while (this.runs.size > 20) this.runs.delete(Math.min(...this.runs.keys()));
  }
}

// The newest known value of a signal in a run; NaN if there is none.
export function newest(run, signal) {
  const values = run && run.high[signal];
  return values && values.length ? values[values.length - 1] : NaN;
}
