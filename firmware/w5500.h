/* UDP through a WIZnet W5500 on SPI: one socket, no waiting. */
#ifndef W5500_H
#define W5500_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct w5500_peer {
  uint8_t address[4];
  uint8_t port[2]; /* big-endian, as on the wire */
};

/* What the chip's own file provides: the select line, and one byte out and in. */
void w5500_select(bool selected);
uint8_t w5500_exchange(uint8_t out);

/* Sets addresses and opens the UDP socket at `port`. False if no W5500 answers. */
bool w5500_start(const uint8_t mac[6], const uint8_t address[4], uint16_t port);
/* Takes the next datagram. Returns its length; 0: there is none. One longer than `most` is dropped. */
size_t w5500_receive(uint8_t *data, size_t most, struct w5500_peer *from);
/* Sends a datagram. False if the one before is still under way: then this one is lost. */
bool w5500_send(const struct w5500_peer *to, const uint8_t *data, size_t length);

#endif
