/* The node without its chip (node_core.h). A command of LBP16 is a word, little-endian: 15 write | 14 address follows |
   13 info area | 12-10 space | 9-8 log2 of a unit's bytes | 7 increment | 6-0 number of units. Sources: the manual of
   Mesa's 7I92, chapter LBP16; the register map of HostMot2. */

#include "node_core.h"

enum { SPACE_HOSTMOT2, SPACE_CHIP, SPACE_EEPROM, SPACE_FLASH, SPACE_TIMERS, SPACE_UNUSED, SPACE_CONTROL, SPACE_BOARD };
enum { PORT_OUTPUT, PORT_DDR, PORT_ALTERNATE, PORT_OPEN_DRAIN, PORT_INVERT };
enum { CONTROL_PARSE = 1, CONTROL_MEMORY = 2, CONTROL_WRITE = 3, CONTROL_RX = 4, CONTROL_TX = 7 };

#define PIN_MASK 0x1FFFFU
#define PWM_PIN 2U /* bit of I/O 1 and 18 */
#define COUNTER_PIN 13U
#define PINS_PER_PORT 17U
#define WATCHDOG_OFF 0x80000000U
#define FEED_MARK 0x5AU
#define WRITE_NUMBER 0x14U
#define MOST_AHEAD 1024U /* no host sends more datagrams in the watchdog's longest time */

/* The page 0x400: the IDROM, in which the board's name stands at 3 and 4, then the modules at 16: tag, version, clock,
   instances | base, registers | registers of each instance. */
static const uint32_t idrom[64] = {
    3, 0x40, 0x200, 0, 0, 0, 0, NODE_CHANNELS, NODE_CHANNELS * PINS_PER_PORT, PINS_PER_PORT, NODE_CLOCK_MHZ * 1000000U,
    200000000U, 4, 64, 256, 4, 0x01010002U, 0x00030C00U, 0, 0x02010003U, 0x00051000U, 0x1FU, 0x02010204U, 0x00053000U,
    3, 0x02020006U, 0x00054000U, 3};

static uint32_t word16(const uint8_t *bytes) { return bytes[0] | (uint32_t)bytes[1] << 8; }

static uint32_t word32(const uint8_t *bytes) { return word16(bytes) | word16(bytes + 2) << 16; }

static void count_error(struct node_core *node, unsigned which) {
  node->control[0] |= (uint16_t)(1U << (which - 1));
  ++node->control[which];
}

/* Watchdog and latch. */

static void bite(struct node_core *node) {
  node->armed = false;
  node->latched = true;
  node->fed_since_bite = false;
  for (unsigned i = 0; i < NODE_CHANNELS; ++i) {
    node->port[PORT_DDR][i] = node->port[PORT_OPEN_DRAIN][i] = 0;
    node->pwm_value[i] = 0;
  }
}

/* (clocks + 1) / ClockLow. Less than a us, or off while armed, is "now". Off says that the host knows. */
static void load_watchdog(struct node_core *node, uint32_t clocks) {
  const bool off = clocks >= WATCHDOG_OFF;
  const uint32_t us = (clocks + 1) / NODE_CLOCK_MHZ;
  const bool now = off ? node->armed : us == 0;
  if (off) node->fed_since_bite = false;
  node->watchdog_clocks = clocks;
  node->armed = !off;
  node->allowed_us = us < NODE_LONGEST_US ? us : NODE_LONGEST_US;
  node->fed_us = node->now_us;
  node->feeds = true;
  if (now) bite(node);
}

static void feed(struct node_core *node) {
  load_watchdog(node, node->watchdog_clocks);
  node->fed_since_bite = true; /* also if the time that it reloads is off, or now */
}

/* A host that feeds a latched node has not noticed the bite; what it writes is no activation. */
static void write_status(struct node_core *node, uint32_t value) {
  if (value != 0 || !node->latched) return;
  if (node->fed_since_bite || node->pwm_value[0] != 0 || node->pwm_value[1] != 0) {
    node->refused = CONTROL_WRITE;
    return;
  }
  node->latched = false;
  node->fed_us = node->now_us; /* the time to arm the watchdog runs from now on */
  node->number_known = false;  /* unless this datagram has a number */
}

void node_poll(struct node_core *node, uint32_t now_us) {
  node->now_us = now_us;
  const uint32_t most_us = node->armed ? node->allowed_us : NODE_LONGEST_US;
  if ((node->armed || !node->latched) && now_us - node->fed_us >= most_us) bite(node);
}

void node_init(struct node_core *node, const struct node_identity *identity) {
  const struct node_core off = {.identity = *identity};
  *node = off;
  node->watchdog_clocks = WATCHDOG_OFF;
  node->latched = true;
}

/* Outputs. */

static bool permitted(const struct node_core *node) { return node->armed && !node->latched; }

bool node_drives(const struct node_core *node, unsigned channel) {
  return permitted(node) && (node->port[PORT_DDR][channel] & node->port[PORT_ALTERNATE][channel] & PWM_PIN) != 0;
}

uint32_t node_duty(const struct node_core *node, unsigned channel) {
  const uint32_t mode = node->pwm_mode[channel];
  const uint32_t bits = 9 + (mode & 3);
  const bool plain = (mode >> 3 & 3) == 0 && node->pwm_value[channel] >> 31 == 0;
  if (!node_drives(node, channel) || !plain) return 0;
  return (node->pwm_value[channel] >> 16 & ((1U << bits) - 1)) << (12 - bits);
}

bool node_output(const struct node_core *node) {
  const bool high = ((node->port[PORT_OUTPUT][0] ^ node->port[PORT_INVERT][0]) & 1) != 0;
  return permitted(node) && (node->port[PORT_DDR][0] & 1) != 0 && !high;
}

uint32_t node_pwm_divider(const struct node_core *node) {
  /* 125 MHz / (4096 f) with f = 200 MHz rate / 2^28, in 1/16; a slower one than the chip has is the slowest */
  const uint32_t divider = node->pwm_rate > 160 ? 655360U / node->pwm_rate : 4095U;
  return divider < 16 ? 16 : divider;
}

/* Counters. */

void node_count(struct node_core *node, unsigned channel, uint16_t hardware, uint32_t now_us) {
  const uint16_t step = (uint16_t)(hardware - node->hardware[channel]);
  if (step == 0) return;
  node->hardware[channel] = hardware;
  node->count[channel] += step < 0x8000U ? step : step - 0x10000U;
  node->counted_us[channel] = now_us;
}

static uint32_t stamp(const struct node_core *node, uint32_t us) {
  return (uint32_t)((uint64_t)us * NODE_CLOCK_MHZ / (node->stamp_divisor + 2)) & 0xFFFFU;
}

static uint32_t read_counter(const struct node_core *node, uint32_t group, uint32_t i) {
  if (group == 0x33 && i == 0) return stamp(node, node->now_us);
  if (i >= NODE_CHANNELS) return 0;
  if (group == 0x30) return (node->count[i] & 0xFFFFU) | stamp(node, node->counted_us[i]) << 16;
  if (group == 0x31) return node->counter_control[i];
  return group == 0x38 ? node->count[i] : 0;
}

/* Registers of space 0. */

static uint32_t pin_descriptor(uint32_t pin) {
  const uint32_t unit = pin / PINS_PER_PORT;
  const uint32_t place = pin % PINS_PER_PORT;
  if (place == 1) return 0x03000681U | unit << 16;
  if (place >= COUNTER_PIN && place < COUNTER_PIN + 3) return 0x03000400U | unit << 16 | (place - COUNTER_PIN + 1);
  return 0x03000000U;
}

static uint32_t read_cookie(uint32_t address) {
  switch (address) {
    case 0x100: return 0x55AACAFEU;
    case 0x104: return 0x54534F48U; /* HOST */
    case 0x108: return 0x32544F4DU; /* MOT2 */
    case 0x10C: return 0x400;       /* where the IDROM is */
    default: return 0;
  }
}

static uint32_t read_idrom(const struct node_core *node, uint32_t i) {
  const uint8_t *name = (const uint8_t*)node->identity.idrom_name;
  return i == 3 ? word32(name) : i == 4 ? word32(name + 4) : idrom[i];
}

/* The levels that the pins of a 7I92 in the rig's wiring would have: high is off. */
static uint32_t read_levels(const struct node_core *node, uint32_t i) {
  return node_duty(node, i) != 0 ? PIN_MASK & ~PWM_PIN : PIN_MASK;
}

static uint32_t read_register(const struct node_core *node, uint32_t address) {
  const uint32_t group = address >> 8;
  const uint32_t i = (address & 0xFFU) / 4;
  if (address == 0x0C00) return node->watchdog_clocks;
  if (address == 0x0D00) return node->latched;
  switch (group) {
    case 0x01: return read_cookie(address);
    case 0x04: return read_idrom(node, i);
    case 0x06: return i < NODE_CHANNELS * PINS_PER_PORT ? pin_descriptor(i) : 0;
    case 0x10: return i < NODE_CHANNELS ? read_levels(node, i) : 0;
    case 0x11: return i < NODE_CHANNELS ? node->port[PORT_DDR][i] : 0;
    default: return read_counter(node, group, i);
  }
}

static void write_port(struct node_core *node, uint32_t which, uint32_t i, uint32_t value) {
  if ((which == PORT_DDR || which == PORT_OPEN_DRAIN) && node->latched && value != 0) {
    node->refused = CONTROL_WRITE;
  } else {
    node->port[which][i] = value & PIN_MASK;
  }
}

static void write_of_channel(struct node_core *node, uint32_t group, uint32_t i, uint32_t value) {
  if (group >= 0x10 && group <= 0x14) write_port(node, group - 0x10, i, value);
  if (group == 0x30) node->count[i] = 0;
  if (group == 0x31) node->counter_control[i] = value & 0x0FF8U;
  if (group == 0x40) node->pwm_value[i] = value;
  if (group == 0x41) node->pwm_mode[i] = value;
}

static void write_register(struct node_core *node, uint32_t address, uint32_t value) {
  const uint32_t group = address >> 8;
  const uint32_t i = (address & 0xFFU) / 4;
  if (i < NODE_CHANNELS) write_of_channel(node, group, i, value);
  switch (address) {
    case 0x0C00: load_watchdog(node, value); break;
    case 0x0D00: write_status(node, value); break;
    case 0x0E00:
      if (value >> 24 == FEED_MARK) feed(node);
      break;
    case 0x3200: node->stamp_divisor = value & 0xFFFFU; break;
    case 0x3400: node->filter = value; break;
    case 0x4200: node->pwm_rate = value & 0xFFFFU; break;
    case 0x4300: node->pdm_rate = value; break;
    case 0x4400: node->pwm_enable = value; break;
    default: break;
  }
}

/* The other spaces, by bytes. */

static uint8_t eeprom_byte(const struct node_identity *identity, uint32_t address) {
  if (address >= 2 && address < 8) return identity->mac[7 - address];
  if (address >= 0x10 && address < 0x20) return (uint8_t)identity->name[address - 0x10];
  return address >= 0x20 && address < 0x24 ? identity->address[0x23 - address] : 0;
}

static uint8_t board_byte(const struct node_identity *identity, uint32_t address) {
  if (address < 0x10) return (uint8_t)identity->name[address];
  return address == 0x10 ? 3 : address == 0x12 ? 15 : 0; /* versions of LBP16 and of the firmware */
}

static uint8_t timer_byte(const struct node_core *node, uint32_t address) {
  if (address < 2) return (uint8_t)(node->now_us >> 8 * address);
  return address < sizeof node->timers ? node->timers[address] : 0;
}

static uint8_t info_byte(const struct node_core *node, uint32_t space, uint32_t address) {
  static const char names[8][9] = {"HostMot2", "        ", "EtherEEP", "        ",
                                   "LBP16Tmr", "        ", "LBPCtlRg", "BrdInfo "};
  switch (address) {
    case 0: return (uint8_t)space;
    case 1: return 0x5A;
    case 2: return space == SPACE_HOSTMOT2 ? 4 : 2; /* bytes a unit */
    case 6: return (uint8_t)node->pointer[space];
    case 7: return (uint8_t)(node->pointer[space] >> 8);
    default: return address >= 8 && address < 16 ? (uint8_t)names[space][address - 8] : 0;
  }
}

static uint8_t read_byte(const struct node_core *node, uint32_t space, uint32_t address) {
  switch (space) {
    case SPACE_EEPROM: return eeprom_byte(&node->identity, address);
    case SPACE_TIMERS: return timer_byte(node, address);
    case SPACE_BOARD: return board_byte(&node->identity, address);
    default: /* SPACE_CONTROL */
      return address < sizeof node->control ? (uint8_t)(node->control[address / 2] >> 8 * (address % 2)) : 0;
  }
}

static void write_bytes(struct node_core *node, uint32_t space, uint32_t address, const uint8_t *data, uint32_t count) {
  for (; count > 0; --count, ++address, ++data) {
    if (space == SPACE_TIMERS && address >= 2 && address < sizeof node->timers) {
      node->timers[address] = *data;
      if (address >= WRITE_NUMBER) node->numbered = true;
    } else if (space == SPACE_CONTROL && address < 2) {
      node->control[0] = 0; /* a write clears the errors */
    } else {
      node->refused = CONTROL_WRITE;
    }
  }
}

/* Datagrams. */

struct command {
  bool write, info, increment, known;
  uint32_t space, unit, units, address;
  const uint8_t *data; /* of a write */
};

/* Takes the command at `*at` and moves on. False if the datagram breaks off in it. */
static bool take_command(const struct node_core *node, const uint8_t *bytes, size_t length, size_t *at,
                         struct command *command) {
  if (length - *at < 2) return false;
  const uint32_t word = word16(bytes + *at);
  const bool has_address = (word & 0x4000U) != 0;
  *at += 2;
  if (has_address && length - *at < 2) return false;
  command->write = (word & 0x8000U) != 0;
  command->info = (word & 0x2000U) != 0;
  command->increment = (word & 0x80U) != 0;
  command->space = word >> 10 & 7U;
  command->unit = 1U << (word >> 8 & 3U);
  command->units = word & 0x7FU;
  command->address = has_address ? word16(bytes + *at) : node->pointer[command->space];
  *at += has_address ? 2 : 0;
  command->data = bytes + *at;
  const size_t data_bytes = command->write ? (size_t)command->unit * command->units : 0;
  if (length - *at < data_bytes) return false;
  *at += data_bytes;
  const bool in_use = command->space != SPACE_CHIP && command->space != SPACE_FLASH && command->space != SPACE_UNUSED;
  const uint32_t unit = command->info || command->space != SPACE_HOSTMOT2 ? 2 : 4;
  const bool odd = command->space == SPACE_HOSTMOT2 && command->address % 4 != 0;
  command->known = in_use && command->unit == unit && !(command->write && (command->info || odd));
  return true;
}

static void obey_write(struct node_core *node, const struct command *command, uint32_t address, uint32_t unit) {
  const uint8_t *data = command->data + (size_t)unit * command->unit;
  if (command->space == SPACE_HOSTMOT2) {
    write_register(node, address, word32(data));
  } else {
    write_bytes(node, command->space, address, data, command->unit);
  }
}

static void obey_read(const struct node_core *node, const struct command *command, uint32_t address, uint8_t *answer) {
  if (command->known && !command->info && command->space == SPACE_HOSTMOT2) {
    const uint32_t word = read_register(node, address & 0xFFFCU);
    for (unsigned i = 0; i < 4; ++i) answer[i] = (uint8_t)(word >> 8 * i);
    return;
  }
  for (uint32_t i = 0; i < command->unit; ++i) {
    if (!command->known) {
      answer[i] = 0;
    } else {
      answer[i] = command->info ? info_byte(node, command->space, address + i) : read_byte(node, command->space, address + i);
    }
  }
}

static void obey(struct node_core *node, const struct command *command, uint8_t *answer) {
  uint32_t address = command->address;
  if (!command->known) {
    if (command->write) node->refused = CONTROL_MEMORY;
    count_error(node, CONTROL_MEMORY);
  }
  for (uint32_t unit = 0; unit < command->units; ++unit) {
    if (!command->write) {
      obey_read(node, command, address, answer + (size_t)unit * command->unit);
    } else if (command->known) {
      obey_write(node, command, address, unit);
    }
    if (command->increment) address = (address + command->unit) & 0xFFFFU;
  }
  if (!command->info) node->pointer[command->space] = (uint16_t)address;
}

/* Obeys until a command is refused, and returns the length of the answer. */
static size_t obey_all(struct node_core *node, const uint8_t *bytes, size_t length, uint8_t *answer) {
  size_t at = 0;
  size_t answered = 0;
  struct command command;
  while (at < length && node->refused == 0) {
    const bool whole = take_command(node, bytes, length, &at, &command);
    const size_t more = !whole || command.write ? 0 : (size_t)command.unit * command.units;
    if (!whole || answered + more > NODE_MOST_BYTES) {
      node->refused = CONTROL_PARSE;
    } else {
      obey(node, &command, answer + answered);
      answered += more;
    }
  }
  return answered;
}

/* True if outputs were permitted before a datagram whose write number, however it is written, is not one of the next. */
static bool is_stale(const struct node_core *before, const struct node_core *node) {
  const uint32_t step = word32(node->timers + WRITE_NUMBER) - word32(before->timers + WRITE_NUMBER);
  return node->numbered && permitted(before) && before->number_known && step - 1U >= MOST_AHEAD;
}

/* The owner is who numbers its datagrams. One without a number may then only make the outputs safer: it may not feed the
   watchdog, set a duty other than 0, or switch a pin on. A host that has sent no number since the activation has no owner's
   rights to defend: LinuxCNC before 2.8 sends none. */
static bool is_not_of_owner(const struct node_core *before, const struct node_core *node) {
  if (node->numbered || !before->number_known || !permitted(before) || !permitted(node)) return false;
  bool drives = node->feeds || (node_output(node) && !node_output(before));
  for (unsigned i = 0; i < NODE_CHANNELS; ++i) {
    drives |= node_duty(node, i) != 0 && node_duty(node, i) != node_duty(before, i);
    drives |= node_drives(node, i) && !node_drives(before, i);
  }
  return drives || node->pwm_rate != before->pwm_rate;
}

size_t node_datagram(struct node_core *node, uint32_t now_us, const uint8_t *datagram, size_t length, uint8_t *answer) {
  node_poll(node, now_us);
  ++node->control[CONTROL_RX];
  ++node->control[CONTROL_RX + 1];
  const struct node_core before = *node;
  const size_t answered = obey_all(node, datagram, length, answer);
  if (is_stale(&before, node) || is_not_of_owner(&before, node)) node->refused = CONTROL_WRITE;
  if (node->refused != 0) {
    const unsigned which = node->refused;
    *node = before; /* outputs follow the registers only after this function */
    count_error(node, which);
    return 0;
  }
  if (node->numbered) node->number_known = true;
  node->numbered = node->feeds = false;
  if (answered > 0) {
    ++node->control[CONTROL_TX];
    ++node->control[CONTROL_TX + 1];
  }
  return answered;
}
