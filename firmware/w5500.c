/* W5500: a frame on SPI is an address of 16 bits, a control byte (block | write | length by the select line) and data.
   Source: WIZnet's datasheet of the W5500. */

#include "w5500.h"

enum { COMMON = 0, SOCKET = 1, TX_BUFFER = 2, RX_BUFFER = 3 }; /* blocks of socket 0 */
enum { MODE = 0x00, GATEWAY = 0x01, SUBNET = 0x05, MAC = 0x09, ADDRESS = 0x0F, VERSION = 0x39 };
enum {
  S_MODE = 0x00,
  S_COMMAND = 0x01,
  S_INTERRUPT = 0x02,
  S_STATUS = 0x03,
  S_PORT = 0x04,
  S_DESTINATION = 0x0C,
  S_TX_WRITE = 0x24,
  S_RX_RECEIVED = 0x26,
  S_RX_READ = 0x28
};
enum { OPEN = 0x01, SEND = 0x20, RECEIVE = 0x40 };
enum { UDP = 0x02, STATUS_UDP = 0x22, SENT = 0x10, TIMED_OUT = 0x08, OUR_VERSION = 0x04 };
#define HEADER 8U /* before each datagram in the receive buffer: address, port, length */
#define MOST_POLLS 1000U

static bool sending;

static void begin(unsigned block, uint16_t address, bool write) {
  w5500_select(true);
  (void)w5500_exchange((uint8_t)(address >> 8));
  (void)w5500_exchange((uint8_t)address);
  (void)w5500_exchange((uint8_t)(block << 3 | (write ? 4U : 0U)));
}

static void put(unsigned block, uint16_t address, const uint8_t *data, size_t length) {
  begin(block, address, true);
  while (length-- > 0) (void)w5500_exchange(*data++);
  w5500_select(false);
}

static void get(unsigned block, uint16_t address, uint8_t *data, size_t length) {
  begin(block, address, false);
  while (length-- > 0) *data++ = w5500_exchange(0);
  w5500_select(false);
}

static void put8(unsigned block, uint16_t address, uint8_t value) { put(block, address, &value, 1); }

static uint8_t get8(unsigned block, uint16_t address) {
  uint8_t value = 0;
  get(block, address, &value, 1);
  return value;
}

static void put16(uint16_t address, uint16_t value) {
  const uint8_t bytes[2] = {(uint8_t)(value >> 8), (uint8_t)value};
  put(SOCKET, address, bytes, sizeof bytes);
}

static uint16_t get16(uint16_t address) {
  uint8_t bytes[2];
  get(SOCKET, address, bytes, sizeof bytes);
  return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

/* Bytes that wait. A datagram may come between the two bytes of the register: only two looks that agree count. */
static uint16_t bytes_waiting(void) {
  const uint16_t first = get16(S_RX_RECEIVED);
  return first != 0 && get16(S_RX_RECEIVED) == first ? first : 0;
}

/* A command is taken when the register reads 0 again, within some us. */
static void command(uint8_t what) {
  put8(SOCKET, S_COMMAND, what);
  for (unsigned n = 0; n < MOST_POLLS && get8(SOCKET, S_COMMAND) != 0; ++n) {
  }
}

bool w5500_start(const uint8_t mac[6], const uint8_t address[4], uint16_t port) {
  static const uint8_t subnet[4] = {255, 255, 255, 0};
  static const uint8_t none[4] = {0, 0, 0, 0};
  sending = false;
  put8(COMMON, MODE, 0x80); /* reset */
  for (unsigned n = 0; n < MOST_POLLS && (get8(COMMON, MODE) & 0x80) != 0; ++n) {
  }
  if (get8(COMMON, VERSION) != OUR_VERSION) return false;
  put(COMMON, GATEWAY, none, sizeof none);
  put(COMMON, SUBNET, subnet, sizeof subnet);
  put(COMMON, MAC, mac, 6);
  put(COMMON, ADDRESS, address, 4);
  put8(SOCKET, S_MODE, UDP);
  put16(S_PORT, port);
  command(OPEN);
  return get8(SOCKET, S_STATUS) == STATUS_UDP;
}

size_t w5500_receive(uint8_t *data, size_t most, struct w5500_peer *from) {
  uint8_t header[HEADER];
  const uint16_t waiting = bytes_waiting();
  if (waiting < HEADER) return 0;
  const uint16_t at = get16(S_RX_READ);
  get(RX_BUFFER, at, header, sizeof header);
  size_t length = (size_t)(header[6] << 8 | header[7]);
  /* A length that cannot be has lost the place: all that waits is dropped. */
  if (length + HEADER > waiting) length = waiting - HEADER;
  for (unsigned i = 0; i < 4; ++i) from->address[i] = header[i];
  for (unsigned i = 0; i < 2; ++i) from->port[i] = header[4 + i];
  if (length <= most) get(RX_BUFFER, (uint16_t)(at + HEADER), data, length);
  put16(S_RX_READ, (uint16_t)(at + HEADER + length));
  command(RECEIVE);
  return length <= most ? length : 0;
}

bool w5500_send(const struct w5500_peer *to, const uint8_t *data, size_t length) {
  if (sending) {
    if ((get8(SOCKET, S_INTERRUPT) & (SENT | TIMED_OUT)) == 0) return false;
    put8(SOCKET, S_INTERRUPT, SENT | TIMED_OUT);
  }
  const uint16_t at = get16(S_TX_WRITE);
  put(SOCKET, S_DESTINATION, to->address, sizeof to->address + sizeof to->port);
  put(TX_BUFFER, at, data, length);
  put16(S_TX_WRITE, (uint16_t)(at + length));
  command(SEND);
  sending = true;
  return true;
}
