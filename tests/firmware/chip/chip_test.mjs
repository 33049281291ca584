// usage: node chip_test.mjs IMAGE.bin SECONDS [NAME]. The node's firmware in an emulated RP2040 (rp2040js) with a model of
// the W5500: packets in, counts out, PWM, watchdogs, latch. SECONDS is the length of each counted piece. With a NAME: only
// that the image presents itself by it. Prints what it measures.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { LogLevel, ConsoleLogger, RP2040 } from 'rp2040js';
import { W5500 } from './w5500.mjs';

const image = readFileSync(process.argv[2]);
const name = process.argv[4] ?? 'abs-node';
const piece_ns = Number(process.argv[3] ?? 0.5) * 1e9;
const NS_PER_CYCLE = 8;
const LOWER = 2, UPPER = 4, DRIVE = 6, BRAKE = 8;
const PHASES = [0, 1, 3, 2]; // A leads
// What docs/hm2.md calls one cycle.
const DRIVER_READ = '01510000 82420010 82420011 8142000D 81420033 82420030 82420031 01590800 82D11000 01000000 84511000';
const DRIVER_WRITE = '82C20010 0000000000000000 81C2000E 0000005A 82C20040 0000000000000000 82D11400 01000000';
const levels = Object.getOwnPropertyDescriptor(RP2040.prototype, 'gpioValues').get;

class Wheel {
  constructor(node, pin) { Object.assign(this, { node, pin, count: 0, next_ns: Infinity, period_ns: 0, step: 1 }); }
  turn(counts_per_s) {
    this.step = Math.sign(counts_per_s);
    this.period_ns = 1e9 / Math.abs(counts_per_s);
    this.next_ns = counts_per_s === 0 ? Infinity : this.node.now + this.period_ns;
  }
  advance() {
    while (this.next_ns <= this.node.now) {
      this.count += this.step;
      this.next_ns += this.period_ns;
      const lines = PHASES[((this.count % 4) + 4) % 4];
      this.node.chip.gpio[this.pin].setInputValue((lines & 1) !== 0);
      this.node.chip.gpio[this.pin + 1].setInputValue((lines & 2) !== 0);
    }
  }
}

class Node {
  constructor() {
    const chip = this.chip = new RP2040();
    chip.logger = new ConsoleLogger(LogLevel.Error, true);
    chip.flash.set(image);
    // What the chip's ROM does: the first 256 bytes into RAM, and there.
    chip.sram.set(image.subarray(0, 256), 0x41f00);
    chip.core.SP = 0x20041f00;
    chip.core.PC = 0x20041f00;
    chip.pio[0].run = () => {}; // stepped by us, a cycle of the processor each
    // The PIO reads all pins in each of its loops. They are looked up once an edge and once a ms, which is ten times faster.
    this.levels = 0;
    Object.defineProperty(chip, 'gpioValues', { get: () => this.levels });
    this.net = new W5500(chip);
    this.wheels = [new Wheel(this, LOWER), new Wheel(this, UPPER)];
    for (let pin = LOWER; pin < UPPER + 2; ++pin) chip.gpio[pin].setInputValue(false);
    this.bitten_ns = -1;
    const watchdog = chip.peripherals[0x40058];
    watchdog.onWatchdogTrigger = () => {
      watchdog.alarm.enable = false;
      this.bitten_ns = this.now;
    };
    this.fed_ns = -1;
    this.longest_loop_ns = 0;
    const write = watchdog.writeUint32.bind(watchdog);
    watchdog.writeUint32 = (offset, value) => {
      if (offset === 4) {
        if (this.fed_ns >= 0 && this.net.open) this.longest_loop_ns = Math.max(this.longest_loop_ns, this.now - this.fed_ns);
        this.fed_ns = this.now;
      }
      write(offset, value);
    };
  }
  get now() { return this.chip.clock.nanos; }
  drives(pin) { return this.chip.gpio[pin].rawOutputEnable; }
  compare(pin) { return this.chip.readUint32(0x40050000 + 0x14 * (pin / 2) + 0x0c) & 0xffff; }

  run(done, at_most_ns) {
    const { chip } = this, end = this.now + at_most_ns, [first, second] = chip.pio[0].machines;
    let look_ns = 0;
    while (!done() && this.now < end) {
      const cycles = chip.core.executeInstruction();
      if (first.enabled) {
        for (let i = 0; i < cycles; ++i) {
          first.step();
          second.step();
        }
      }
      chip.clock.tick(cycles * NS_PER_CYCLE);
      const now = this.now;
      if (now < look_ns && now < this.wheels[0].next_ns && now < this.wheels[1].next_ns) continue;
      for (const wheel of this.wheels) wheel.advance();
      this.levels = levels.call(chip);
      look_ns = now + 1e6;
    }
    return done();
  }
  pass(ns) { this.run(() => false, ns); }

  ask(text) {
    const before = this.net.sent.length;
    this.net.deliver(hex(text));
    assert.ok(this.run(() => this.net.sent.length > before, 2e6), `no answer to ${text}`);
    return Buffer.from(this.net.sent.at(-1).bytes);
  }
  send(text) {
    this.net.deliver(hex(text));
    this.run(() => this.net.received === 0, 2e6);
    for (let loops = 0; loops < 2; ++loops) {  // the one that obeys it, and the next
      const fed_ns = this.fed_ns;
      this.run(() => this.fed_ns !== fed_ns, 1e6);
    }
  }
  activate() { // after a bite, which a host that has gone on must ask for
    this.send('81C2000C 01000000');
    this.send('82C20040 00000000 00000000 82C20041 03000000 03000000 81C20042 D6000000 82C20012 02000000 02000000' +
              '81C2000C 1FA10700 81C2000D 00000000 82C20011 02000000 02000000');
  }
}

function hex(text) { return [...Buffer.from(text.replaceAll(' ', ''), 'hex')]; }
function value(steps) { return `0000${(steps & 0xff).toString(16).padStart(2, '0')}${(steps >> 8).toString(16).padStart(2, '0')}`; }
function told(text) { console.log(text); }

function started() {
  const node = new Node();
  assert.ok(node.run(() => node.net.open, 20e6), 'the socket was not opened');
  return node;
}

function identity() {
  const node = started();
  told(`${name}:`);
  told(`socket open after ${(node.now / 1e6).toFixed(2)} ms`);
  assert.equal(node.ask('885D0000').toString().replaceAll('\0', ''), name);
  assert.equal(node.ask('81420001').toString('hex'), 'fecaaa55');
  assert.deepEqual(node.net.sent.at(-1).to, [192, 168, 1, 1, 0x30, 0x39]);
  assert.equal(node.ask('8142000D').readUInt32LE(), 1);
  for (const pin of [DRIVE, BRAKE]) assert.ok(!node.drives(pin));
}

// A datagram whose bytes are counted up while the chip reads how many there are.
function torn() {
  const node = started();
  const long = '84D11000 0102030405060708' + '81420001'.repeat(63) + '84511000'; // 268 bytes
  const before = node.net.sent.length;
  node.net.torn = hex(long);
  assert.ok(node.run(() => node.net.sent.length > before, 2e6), 'no answer to a long datagram');
  const answer = Buffer.from(node.net.sent.at(-1).bytes);
  assert.equal(answer.length, 63 * 4 + 8);
  assert.equal(answer.subarray(63 * 4).toString('hex'), '0102030405060708');
  assert.equal(node.ask('885D0000').subarray(0, 8).toString(), 'abs-node');
  told('a datagram that comes while its size is read is taken whole');
}

function counting() {
  const node = started();
  node.longest_loop_ns = 0;
  for (const [lower, upper] of [[120e3, -120e3], [-120e3, 120e3]]) {
    node.wheels[0].turn(lower);
    node.wheels[1].turn(upper);
    const end = node.now + piece_ns;
    let asked = 0;
    while (node.now < end) {
      node.pass(1e6);
      node.ask(DRIVER_READ);
      node.net.deliver(hex(DRIVER_WRITE));
      ++asked;
    }
    for (const wheel of node.wheels) wheel.turn(0);
    node.pass(1e5);
    const answer = node.ask('82420038');
    node.wheels.forEach((wheel, i) => assert.equal(answer.readInt32LE(4 * i), wheel.count));
    told(`${asked} answers at 120 kcounts/s, counts ${node.wheels.map((w) => w.count)} exact`);
  }
  told(`longest loop in the driver's cycles ${node.longest_loop_ns / NS_PER_CYCLE} cycles of the chip, ${node.longest_loop_ns / 1e3} us`);
}

// The datagram that takes longest: as many commands as a packet holds, each for a counter with its stamp.
function longest() {
  const node = started();
  node.send('81C20032 30000000');
  node.longest_loop_ns = 0;
  const before = node.net.sent.length;
  node.net.deliver(hex('81420030'.repeat(368)));
  assert.ok(node.run(() => node.net.sent.length > before, 20e6), 'no answer');
  node.pass(1e6);
  assert.equal(node.net.sent.at(-1).bytes.length, 1472);
  told(`longest loop of all ${node.longest_loop_ns / NS_PER_CYCLE} cycles, ${node.longest_loop_ns / 1e3} us`);
  assert.ok(node.longest_loop_ns < 5e6); // the shortest armed time of the driver
}

function duties() {
  const node = started();
  node.activate();
  assert.ok(node.drives(DRIVE) && node.drives(BRAKE));
  let number = 0;
  for (const steps of [0, 1, 1024, 2866, 4095]) {
    ++number;
    node.send(`82C20040 ${value(steps)} ${value(4095 - steps)} 81C2000E 0000005A 82D11400 0${number}000000`);
    node.pass(1e5);
    assert.equal(node.compare(DRIVE), steps);
    assert.equal(node.compare(BRAKE), 4095 - steps);
  }
  told('PWM compare as commanded');
  return node;
}

function silence() {
  const node = duties();
  const fed = node.now;
  node.net.deliver(hex('81C2000E 0000005A 82D11400 06000000'));
  node.pass(2e6);
  node.net.deliver(hex('81C2000E 0000005A')); // without a number: not of the owner, and no feed
  assert.ok(node.run(() => !node.drives(DRIVE) && !node.drives(BRAKE), 30e6), 'the outputs stay on');
  const late_ms = (node.now - fed) / 1e6 - 5;
  told(`silence: pins are inputs ${(late_ms * 1e3).toFixed(1)} us after the armed 5 ms, counted from the last reload on the wire`);
  assert.ok(late_ms > 0 && late_ms < 1);
  // The cable comes back, and the host goes on as if nothing had happened, with a soft reset as LinuxCNC's.
  node.net.linked = false;
  node.pass(20e6);
  node.net.linked = true;
  for (const [drive, brake] of [[2866, 1023], [0, 0], [2866, 0], [0, 0], [2866, 1023]]) {
    node.send(`81C2000E 0000005A 82C20040 ${value(drive)} ${value(brake)} 81C2000C 1FA10700
               81C2000D 00000000 82C20011 02000000 02000000`.replaceAll(/\s/g, ''));
    node.pass(1e6);
    assert.ok(!node.drives(DRIVE) && !node.drives(BRAKE));
  }
  assert.equal(node.ask('8142000D').readUInt32LE(), 1);
  node.activate();
  assert.ok(node.drives(DRIVE) && node.drives(BRAKE));
  told('the latch holds after the link has returned; an activation opens it');
}

function hung() {
  const node = duties();
  assert.equal(node.chip.readUint32(0x40010008), 0x1fffc); // the watchdog resets all but the oscillators
  // The loop hangs: a branch to itself in RAM.
  node.chip.writeUint16(0x20030000, 0xe7fe);
  node.chip.core.PC = 0x20030000;
  const fed = node.fed_ns;
  assert.ok(node.run(() => node.bitten_ns >= 0, 40e6), 'no reset');
  told(`hung loop: the chip's watchdog bites ${((node.bitten_ns - fed) / 1e6).toFixed(4)} ms after it was fed`);
  assert.ok(Math.abs((node.bitten_ns - fed) / 1e6 - 30) < 0.1);
  // The emulated chip resets nothing by itself: a new one with the same flash.
  const again = new Node();
  let drove = false;
  again.run(() => {
    drove ||= again.drives(DRIVE) || again.drives(BRAKE);
    return again.net.open;
  }, 20e6);
  again.pass(1e6);
  assert.ok(!drove);
  assert.equal(again.ask('8142000D').readUInt32LE(), 1);
  told('after the reset no pin is driven, and the node is latched');
}

for (const test of process.argv[4] ? [identity] : [identity, torn, counting, longest, silence, hung]) {
  const start = performance.now();
  test();
  told(`${test.name}: ${((performance.now() - start) / 1000).toFixed(1)} s`);
}
