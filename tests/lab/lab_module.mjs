// The module of `abs_hil lab`, for tests in Node.js: runs of words of the command line.
import fs from 'node:fs';

export async function load(file) {
  const module = await WebAssembly.compile(fs.readFileSync(file));
  const { exports } = await WebAssembly.instantiate(module, {});  // it imports nothing
  exports._initialize();
  const text = (address) => new TextDecoder().decode(new Uint8Array(exports.memory.buffer, address, exports.lab_size()));
  const give = (words) => {
    const bytes = new TextEncoder().encode(words);
    const address = exports.lab_take(bytes.length);
    new Uint8Array(exports.memory.buffer, address, bytes.length).set(bytes);
    return [address, bytes.length];
  };
  return {
    tables: () => JSON.parse(text(exports.lab_tables())),
    run: (words) => JSON.parse(text(exports.lab_run(...give(JSON.stringify(words))))),
    csv: () => text(exports.lab_csv()),
    column: (answer, name) => {
      const { address } = answer.columns.find((column) => column.name === name);
      return new Float64Array(exports.memory.buffer, address, answer.rows);
    },
  };
}
