// usage: node bits_test.mjs MODULE TABLE
//
// The WebAssembly module computes the bits of the table of runs, which every platform is held to (tests/core/run_bits.cpp),
// and refuses what the program refuses. Status 77 without the module: scripts/lab.sh makes it.
import assert from 'node:assert';
import crypto from 'node:crypto';
import fs from 'node:fs';

import { load } from './lab_module.mjs';

const [file, table] = process.argv.slice(2);
if (!fs.existsSync(file)) {
  console.log(`SKIPPED: ${file} is missing: scripts/lab.sh makes it`);
  process.exit(77);
}
const lab = await load(file);

let rows = 0;
for (const line of fs.readFileSync(table, 'utf8').trim().split('\n')) {
  const [checksum, words] = line.split('\t');
  const answer = lab.run(words.split(' '));
  assert.equal(answer.error, undefined, words);
  const csv = lab.csv();
  const got = crypto.createHash('sha256').update(csv.slice(csv.indexOf('\n') + 1)).digest('hex');
  assert.equal(got, checksum, `other bits: ${words}`);
  // The columns are those of the CSV.
  const [header, ...lines] = csv.trimEnd().split('\n').map((text) => text.split(','));
  assert.equal(answer.rows, lines.length);
  for (const name of ['slip', 'omega2_rad_s', 'brake_torque_ref_Nm', 'theta_est_N']) {
    const place = header.indexOf(name);
    assert.deepEqual(Array.from(lab.column(answer, name)), lines.map((values) => Number(values[place])), name);
  }
  ++rows;
}
assert.equal(rows, 15);

assert.match(lab.run(['--set', 'plant.thetaN=3']).error, /thetaN.*plant\.theta_N/);
assert.match(lab.run(['--set', 'plant.theta_N=-3']).error, /theta_N.*\(0, /);
assert.match(lab.run(['--plant', 'nowhere']).error, /unknown plant "nowhere".*paper-table1/);
assert.match(lab.run(['--experiment', 'series-of-ten']).error, /series/);

const { keys, controllers, plants, experiments, figures } = lab.tables();
assert.ok(keys.length > 300 && controllers.length > 10 && plants.length === 3 && experiments.length > 8 && figures.length === 16);
const theta = keys.find(({ name }) => name === 'plant.theta_N');
assert.deepEqual([theta.type, theta.unit, theta.value], ['number', 'N', 23]);
console.log(`${rows} runs with the program's bits`);
