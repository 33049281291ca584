// The simulation core as a WebAssembly module: words of the command line in, columns, events and figures of merit out.
async function unpacked(id) {
  const text = document.getElementById(id).textContent;
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip')));
}

class Engine {
  static async load() {
    const module = await WebAssembly.compile(await (await unpacked('module')).arrayBuffer());
    const engine = new Engine();
    engine.exports = (await WebAssembly.instantiate(module, {})).exports;
    engine.exports._initialize();
    engine.tables = JSON.parse(engine.text(engine.exports.lab_tables()));
    return engine;
  }

  text(address) {
    return new TextDecoder().decode(new Uint8Array(this.exports.memory.buffer, address, this.exports.lab_size()));
  }

  passed(text) {
    const bytes = new TextEncoder().encode(text);
    const address = this.exports.lab_take(bytes.length);
    new Uint8Array(this.exports.memory.buffer, address, bytes.length).set(bytes);
    return [address, bytes.length];
  }

  // From now on there is a file of this name.
  give(name, text) {
    this.exports.lab_give_file(...this.passed(name), ...this.passed(text));
  }

  // Throws an Error with the program's own message for words that it refuses.
  run(words) {
    const answer = JSON.parse(this.text(this.exports.lab_run(...this.passed(JSON.stringify(words)))));
    if (answer.error) throw new Error(answer.error);
    const columns = new Map();
    for (const { name, unit, own, address: at } of answer.columns) {
      columns.set(name, { unit, own, values: new Float64Array(this.exports.memory.buffer, at, answer.rows).slice() });
    }
    const gate = new Uint16Array(this.exports.memory.buffer, answer.gate, answer.rows).slice();
    return { ...answer, columns, gate, values: flat(answer.config) };
  }

  // The run's rows as `abs_hil --csv` writes them.
  csv(words) {
    this.run(words);
    return this.text(this.exports.lab_csv());
  }
}

// {"plant": {"B": 28}} -> Map {"plant.B" => 28}
function flat(config, prefix = '', into = new Map()) {
  for (const [key, value] of Object.entries(config)) {
    if (value !== null && typeof value === 'object' && !Array.isArray(value)) flat(value, `${prefix}${key}.`, into);
    else into.set(prefix + key, value);
  }
  return into;
}
