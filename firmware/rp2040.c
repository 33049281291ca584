/* The node on an RP2040 with a W5500 (W5500-EVB-Pico): clocks, pins, PIO counters, PWM, chip watchdog, and the loop.
   Source of the registers: Raspberry Pi's datasheet of the RP2040.

   Two layers of dying. The loop checks the node's watchdog and makes the PWM pins inputs if it bites. The chip's watchdog,
   fed by this loop alone, resets the chip 30 ms after the loop has stopped. At reset all pads are inputs with pull-downs,
   and the node begins latched. */

#include <stddef.h>
#include <stdint.h>

#include "node_core.h"
#include "w5500.h"

void *memset(void *to, int value, size_t count);
void *memcpy(void *restrict to, const void *restrict from, size_t count);

#ifndef NODE_NAME
#define NODE_NAME "abs-node"
#define NODE_IDROM_NAME "ABS-NODE"
#endif

#define REG(address) (*(volatile uint32_t *)(address))
#define CLEAR_ALIAS 0x3000U
#define SET_ALIAS 0x2000U

enum { PIN_LOWER_A = 2, PIN_UPPER_A = 4, PIN_DRIVE = 6, PIN_BRAKE = 8, PIN_OUTPUT = 10 };
enum { PIN_MISO = 16, PIN_SELECT = 17, PIN_CLOCK = 18, PIN_MOSI = 19, PIN_W5500_RESET = 20 };
enum { FUNCTION_SPI = 1, FUNCTION_PWM = 4, FUNCTION_SIO = 5, FUNCTION_PIO0 = 6 };
enum { PAD_INPUT_PULL_DOWN = 0x56, PAD_INPUT_PULL_UP = 0x5A };

#define RESETS 0x4000C000U
#define CLOCKS 0x40008000U
#define PSM_WDSEL 0x40010008U
#define XOSC 0x40024000U
#define PLL_SYS 0x40028000U
#define IO_CTRL(pin) REG(0x40014004U + 8U * (pin))
#define PAD(pin) REG(0x4001C004U + 4U * (pin))
#define SPI0 0x4003C000U
#define PWM_SLICE(pin) (0x40050000U + 0x14U * ((pin) / 2U % 8U))
#define TIMER_RAW_LOW REG(0x40054028U)
#define WATCHDOG 0x40058000U
#define PIO0 0x50200000U
#define SIO 0xD0000000U
#define SIO_OUT_SET REG(SIO + 0x14)
#define SIO_OUT_CLEAR REG(SIO + 0x18)
#define SIO_OE_SET REG(SIO + 0x24)
#define SIO_OE_CLEAR REG(SIO + 0x28)

#define CHIP_WATCHDOG_US 30000U
#define PWM_TOP 4095U

/* There is no library on the chip; the compiler calls these two. */
void *memset(void *to, int value, size_t count) {
  for (uint8_t *byte = to; count > 0; --count) *byte++ = (uint8_t)value;
  return to;
}

void *memcpy(void *restrict to, const void *restrict from, size_t count) {
  const uint8_t *source = from;
  for (uint8_t *byte = to; count > 0; --count) *byte++ = *source++;
  return to;
}

static void wait_for(uint32_t address, uint32_t bits) {
  while ((REG(address) & bits) != bits) {
  }
}

static void start_clocks(void) {
  /* Crystal of 12 MHz, PLL 12 MHz * 125 / 6 / 2 = 125 MHz. */
  REG(XOSC + 0x0C) = 47; /* 1 ms */
  REG(XOSC) = 0xFABAA0;
  wait_for(XOSC + 4, 0x80000000U);
  REG(CLOCKS + 0x30) = 2;
  wait_for(CLOCKS + 0x38, 4);
  REG(RESETS + CLEAR_ALIAS) = 1U << 12;
  wait_for(RESETS + 8, 1U << 12);
  REG(PLL_SYS + 0x08) = 125;
  REG(PLL_SYS + CLEAR_ALIAS + 4) = 0x21; /* power on, VCO on */
  wait_for(PLL_SYS, 0x80000000U);
  REG(PLL_SYS + 0x0C) = 6U << 16 | 2U << 12;
  REG(PLL_SYS + CLEAR_ALIAS + 4) = 0x08;
  REG(CLOCKS + 0x3C) = 0;
  REG(CLOCKS + 0x3C) = 1;
  wait_for(CLOCKS + 0x44, 2);
  REG(CLOCKS + 0x48) = 1U << 11;
}

static void start_chip_watchdog(void) {
  REG(PSM_WDSEL) = 0x0001FFFCU; /* a bite resets all but the oscillators */
  REG(WATCHDOG + 0x2C) = 1U << 9 | 12U;
  REG(WATCHDOG + 0x04) = 2U * CHIP_WATCHDOG_US; /* erratum E1: counts twice a us */
  REG(WATCHDOG) = 0x40000000U;
}

static void feed_chip_watchdog(void) { REG(WATCHDOG + 0x04) = 2U * CHIP_WATCHDOG_US; }

/* Quadrature by PIO: X holds the lines of the look before in its lowest bits, Y the count. A table of 16 jumps over
   (before, now) stands at address 0. */
#define P_JMP(to) ((uint16_t)(to))
#define P_JMP_Y_DEC(to) ((uint16_t)(0x0080U | (to)))
#define P_IN(source, bits) ((uint16_t)(0x4000U | (source) << 5 | (bits)))
#define P_MOV(to, invert, from) ((uint16_t)(0xA000U | (to) << 5 | (invert) << 3 | (from)))
enum { P_PINS = 0, P_X = 1, P_Y = 2, P_NULL = 3, P_PC = 5, P_ISR = 6 };
enum { UP = 16, DOWN = 20, TELL = 21, LOOK = 23, END = 27 };

static const uint16_t quadrature[END + 1] = {
    /* 00 -> */ P_JMP(TELL), P_JMP(UP), P_JMP(DOWN), P_JMP(TELL),
    /* 01 -> */ P_JMP(DOWN), P_JMP(TELL), P_JMP(TELL), P_JMP(UP),
    /* 10 -> */ P_JMP(UP), P_JMP(TELL), P_JMP(TELL), P_JMP(DOWN),
    /* 11 -> */ P_JMP(TELL), P_JMP(DOWN), P_JMP(UP), P_JMP(TELL),
    /* UP: Y + 1 = ~(~Y - 1) */ P_MOV(P_Y, 1, P_Y), P_JMP_Y_DEC(UP + 2), P_MOV(P_Y, 1, P_Y), P_JMP(TELL),
    /* DOWN */ P_JMP_Y_DEC(TELL),
    /* TELL */ P_MOV(P_ISR, 0, P_Y), 0x8000, /* push, not blocking */
    /* LOOK */ P_MOV(P_ISR, 0, P_NULL), P_IN(P_X, 2), P_IN(P_PINS, 2), P_MOV(P_X, 0, P_ISR), P_MOV(P_PC, 0, P_ISR)};

static void start_counter(unsigned machine, unsigned first_pin) {
  const uint32_t base = PIO0 + 0xC8 + 0x18 * machine;
  REG(base) = 1U << 16;                       /* every cycle */
  REG(base + 0x04) = (uint32_t)END << 12 | (uint32_t)LOOK << 7; /* wraps; the last jump never falls through */
  REG(base + 0x08) = 0;                       /* shifts left */
  REG(base + 0x14) = first_pin << 15;
  REG(base + 0x10) = P_MOV(P_X, 0, P_PINS);
  REG(base + 0x10) = P_MOV(P_Y, 0, P_NULL);
  REG(base + 0x10) = P_JMP(LOOK);
  for (unsigned pin = first_pin; pin < first_pin + 2; ++pin) {
    PAD(pin) = PAD_INPUT_PULL_UP;
    IO_CTRL(pin) = FUNCTION_PIO0;
  }
}

static void start_counters(void) {
  for (unsigned i = 0; i <= END; ++i) REG(PIO0 + 0x48 + 4 * i) = quadrature[i];
  start_counter(0, PIN_LOWER_A);
  start_counter(1, PIN_UPPER_A);
  REG(PIO0) = 3;
}

/* The queue fills with words of the time after the last look, so all are thrown away. The next one, at most 13 cycles
   later, is new. */
static uint16_t hardware_count(unsigned machine) {
  const uint32_t empty = 0x100U << machine;
  const uint32_t queue = PIO0 + 0x20 + 4 * machine;
  for (unsigned n = 0; n < 8 && (REG(PIO0 + 4) & empty) == 0; ++n) (void)REG(queue);
  for (unsigned n = 0; n < 100 && (REG(PIO0 + 4) & empty) != 0; ++n) {
  }
  return (uint16_t)REG(queue);
}

static void start_pins(void) {
  static const uint8_t outputs[] = {PIN_DRIVE, PIN_BRAKE, PIN_OUTPUT, PIN_SELECT, PIN_W5500_RESET};
  for (unsigned i = 0; i < sizeof outputs; ++i) {
    PAD(outputs[i]) = PAD_INPUT_PULL_DOWN;
    IO_CTRL(outputs[i]) = FUNCTION_SIO; /* an input until OE is set */
  }
  static const uint8_t spi[] = {PIN_MISO, PIN_CLOCK, PIN_MOSI};
  for (unsigned i = 0; i < sizeof spi; ++i) {
    PAD(spi[i]) = PAD_INPUT_PULL_DOWN;
    IO_CTRL(spi[i]) = FUNCTION_SPI;
  }
  SIO_OUT_SET = 1U << PIN_SELECT | 1U << PIN_W5500_RESET;
  SIO_OE_SET = 1U << PIN_SELECT | 1U << PIN_W5500_RESET;
  REG(SPI0 + 0x10) = 4; /* 31.25 MHz */
  REG(SPI0) = 7;        /* 8 bits, mode 0 */
  REG(SPI0 + 4) = 2;
}

void w5500_select(bool selected) {
  if (selected) {
    SIO_OUT_CLEAR = 1U << PIN_SELECT;
  } else {
    SIO_OUT_SET = 1U << PIN_SELECT;
  }
}

uint8_t w5500_exchange(uint8_t out) {
  REG(SPI0 + 8) = out;
  while ((REG(SPI0 + 0x0C) & 4) == 0) { /* the chip's watchdog ends a wait that hangs */
  }
  return (uint8_t)REG(SPI0 + 8);
}

static void apply_pwm(const struct node_core *node, unsigned channel, unsigned pin) {
  const uint32_t slice = PWM_SLICE(pin);
  if (!node_drives(node, channel)) {
    IO_CTRL(pin) = FUNCTION_SIO; /* OE is not set: an input, at once, in the middle of a period too */
    REG(slice + 0x0C) = 0;
    return;
  }
  REG(slice + 0x04) = node_pwm_divider(node);
  REG(slice + 0x0C) = node_duty(node, channel);
  IO_CTRL(pin) = FUNCTION_PWM;
}

static void apply_outputs(const struct node_core *node) {
  apply_pwm(node, 0, PIN_DRIVE);
  apply_pwm(node, 1, PIN_BRAKE);
  if (node_output(node)) {
    SIO_OUT_SET = 1U << PIN_OUTPUT;
    SIO_OE_SET = 1U << PIN_OUTPUT;
  } else {
    SIO_OE_CLEAR = 1U << PIN_OUTPUT;
  }
}

static struct node_core node;
static uint8_t received[NODE_MOST_BYTES];
static uint8_t answer[NODE_MOST_BYTES];

static void look(void) {
  for (unsigned i = 0; i < NODE_CHANNELS; ++i) node_count(&node, i, hardware_count(i), TIMER_RAW_LOW);
  node_poll(&node, TIMER_RAW_LOW);
  apply_outputs(&node);
  feed_chip_watchdog();
}

int main(void) {
  static const struct node_identity identity = {
      NODE_NAME, NODE_IDROM_NAME, {0x02, 0xAB, 0x50, 0x00, 0x00, 0x01}, {192, 168, 1, 121}};
  const uint32_t used = 1U << 5 | 1U << 8 | 1U << 10 | 1U << 14 | 1U << 16 | 1U << 21;
  start_chip_watchdog();
  start_clocks();
  REG(RESETS + CLEAR_ALIAS) = used;
  wait_for(RESETS + 8, used);
  start_pins();
  start_counters();
  for (unsigned pin = PIN_DRIVE; pin <= PIN_BRAKE; pin += 2) {
    REG(PWM_SLICE(pin) + 0x10) = PWM_TOP;
    REG(PWM_SLICE(pin)) = 1;
  }
  node_init(&node, &identity);
  bool online = false;
  while (true) {
    look();
    if (!online) {
      online = w5500_start(identity.mac, identity.address, NODE_PORT);
      continue;
    }
    struct w5500_peer peer;
    const size_t length = w5500_receive(received, sizeof received, &peer);
    if (length == 0) continue;
    look(); /* counts and time of the answer */
    const size_t size = node_datagram(&node, TIMER_RAW_LOW, received, length, answer);
    apply_outputs(&node);
    if (size > 0) (void)w5500_send(&peer, answer, size);
  }
}
