/* The node without its chip: registers, LBP16 datagrams, watchdog, latch, counts. C99, no heap, no I/O; the caller brings
   time, hardware counts and datagrams, and takes duties and answers.

   A host sees a HostMot2 (docs/node.md) with watchdog, two ports of 17 I/O, two counters and two PWM generators. The node
   differs from one where that is safer:
     - A bite is latched. Until the host activates again, no pin is driven: a write of 0 to the status clears the latch
       only while both PWM values are 0, and if the watchdog has not been fed since the bite. A host that has fed it
       must first switch the watchdog off, or let it bite now.
     - The watchdog's time is at most NODE_LONGEST_US, and without an armed watchdog no pin is driven. A latch that was
       opened closes again if the watchdog is not armed within that time.
     - A datagram acts as a whole or, with no answer, not at all: if it breaks off, asks for too much, or a write in it is
       refused. While outputs are permitted, one whose write number is not among the 1,024 after the last is refused. If
       their host numbers its datagrams, one without a number is refused unless it makes the outputs safer.
     - A PWM output acts while it is high; the inversion, which the wiring of a 7I92 needs, is stored and does nothing. */
#ifndef NODE_CORE_H
#define NODE_CORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define NODE_PORT 27181
#define NODE_MOST_BYTES 1472 /* of a datagram, either way */
#define NODE_CHANNELS 2      /* counters, PWM generators, ports */
#define NODE_LONGEST_US 20000U
#define NODE_CLOCK_MHZ 100U /* ClockLow that the registers speak of; the chip's clock counts us */

struct node_identity {
  char name[17];       /* "abs-node"; "7I92" for tests with LinuxCNC; ends with 0 */
  char idrom_name[9];  /* 8 characters and 0 */
  uint8_t mac[6];
  uint8_t address[4];
};

struct node_core {
  struct node_identity identity;
  uint32_t now_us; /* of the last call; wraps */
  /* Ports: output, DDR, alternate source, open drain, inversion. */
  uint32_t port[5][NODE_CHANNELS];
  uint32_t pwm_value[NODE_CHANNELS], pwm_mode[NODE_CHANNELS];
  uint32_t pwm_rate, pdm_rate, pwm_enable;
  uint32_t counter_control[NODE_CHANNELS], stamp_divisor, filter;
  uint16_t hardware[NODE_CHANNELS]; /* last count of the hardware */
  uint32_t count[NODE_CHANNELS];    /* since the last clear, extended */
  uint32_t counted_us[NODE_CHANNELS];
  uint32_t watchdog_clocks, allowed_us, fed_us;
  bool armed, latched, fed_since_bite, number_known;
  bool numbered;        /* the datagram at hand has written to the write number */
  bool feeds;           /* and has loaded the watchdog */
  uint8_t refused;      /* the error count for the datagram at hand; 0: all of it acts */
  uint8_t timers[24];   /* space 4; the last 4 are the write number */
  uint16_t control[16]; /* space 6, by words */
  uint16_t pointer[8];
};

#ifdef __cplusplus
extern "C" {
#endif

/* All registers as after power-on: latched, nothing driven. */
void node_init(struct node_core *node, const struct node_identity *identity);
/* Takes the hardware counter of a channel, any 16 bits that wrap. At least every 32,767 counts. */
void node_count(struct node_core *node, unsigned channel, uint16_t hardware, uint32_t now_us);
/* Checks the watchdog. Call it in every loop. */
void node_poll(struct node_core *node, uint32_t now_us);
/* Obeys a datagram. Returns the length of the answer in `answer`, which has NODE_MOST_BYTES; 0: there is none. */
size_t node_datagram(struct node_core *node, uint32_t now_us, const uint8_t *datagram, size_t length, uint8_t *answer);

/* True while a PWM pin is driven; otherwise it is an input with a pull-down. */
bool node_drives(const struct node_core *node, unsigned channel);
/* Duty in 1/4096; 0 while the pin is not driven. */
uint32_t node_duty(const struct node_core *node, unsigned channel);
/* The plain output, I/O 0: true while it is driven and acts (its level on a 7I92 would be low). */
bool node_output(const struct node_core *node);
/* Divider of a 125 MHz clock, in 1/16, whose 4096 steps give the commanded PWM frequency; 16 to 4095. */
uint32_t node_pwm_divider(const struct node_core *node);

#ifdef __cplusplus
}
#endif

#endif
