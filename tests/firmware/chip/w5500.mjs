// A W5500 behind the emulated chip's SPI0: common block, socket 0 with its two rings of 2 KB, UDP. Source: WIZnet's
// datasheet. It answers byte by byte, 256 ns each (31.25 MHz), while its select line is low.

const SELECT = 17;
const RING = 2048;
const NS_PER_BYTE = 256;

export class W5500 {
  constructor(chip) {
    this.common = new Uint8Array(64);
    this.common[0x39] = 4;
    this.socket = new Uint8Array(48);
    this.tx = new Uint8Array(RING);
    this.rx = new Uint8Array(RING);
    this.received = 0; // bytes that wait in `rx`
    this.rxWrite = 0;
    this.sent = []; // datagrams that the chip has sent: {to, bytes, ns}
    this.linked = true;
    this.torn = null; // a datagram that comes between the two bytes of the next read of how many bytes wait
    this.chip = chip;
    this.place = 0;
    chip.gpio[SELECT].addListener((state) => { if (state === 0) this.place = 0; });
    chip.spi[0].onTransmit = (byte) => {
      const answer = this.exchange(byte);
      chip.clock.createAlarm(() => chip.spi[0].completeTransmit(answer)).schedule(NS_PER_BYTE);
    };
  }

  get open() { return this.socket[3] === 0x22; }

  exchange(byte) {
    const place = this.place++;
    if (place === 0) this.address = byte << 8;
    else if (place === 1) this.address |= byte;
    else if (place === 2) this.control = byte;
    else {
      const at = this.address++ & 0xffff;
      const block = this.control >> 3;
      if (this.control & 4) this.write(block, at, byte);
      else return this.read(block, at);
    }
    return 0;
  }

  read(block, at) {
    if (block === 0) return this.common[at];
    if (block === 3) return this.rx[at % RING];
    if (block !== 1) return 0;
    if (at === 0x26) {
      const high = this.received >> 8;
      if (this.torn) this.deliver(this.torn);
      this.torn = null;
      return high;
    }
    if (at === 0x27) return this.received & 0xff;
    return this.socket[at];
  }

  write(block, at, byte) {
    if (block === 0) this.common[at] = at === 0 ? byte & 0x7f : byte;
    else if (block === 2) this.tx[at % RING] = byte;
    else if (block === 1 && at === 1) this.command(byte);
    else if (block === 1 && at === 2) this.socket[2] &= ~byte;
    else if (block === 1) this.socket[at] = byte;
  }

  word(at) { return this.socket[at] << 8 | this.socket[at + 1]; }
  setWord(at, value) { this.socket[at] = value >> 8 & 0xff; this.socket[at + 1] = value & 0xff; }

  command(what) {
    if (what === 0x01 && this.socket[0] === 2) this.socket[3] = 0x22;
    if (what === 0x40) this.received = (this.rxWrite - this.word(0x28)) & 0xffff;
    if (what === 0x20) {
      const from = this.word(0x22), to = this.word(0x24), bytes = [];
      for (let i = from; i !== to; i = i + 1 & 0xffff) bytes.push(this.tx[i % RING]);
      this.setWord(0x22, to);
      this.socket[2] |= 0x10;
      if (this.linked) this.sent.push({ to: [...this.socket.slice(0x0c, 0x12)], bytes, ns: this.chip.clock.nanos });
    }
  }

  /** A datagram from the network. */
  deliver(bytes, from = [192, 168, 1, 1, 0x30, 0x39]) {
    if (!this.linked) return;
    const all = [...from, bytes.length >> 8, bytes.length & 0xff, ...bytes];
    if (this.received + all.length > RING) throw new Error('the receive buffer is full');
    for (const byte of all) {
      this.rx[this.rxWrite % RING] = byte;
      this.rxWrite = this.rxWrite + 1 & 0xffff;
    }
    this.received += all.length;
  }
}
