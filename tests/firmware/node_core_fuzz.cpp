// usage: node_core_fuzz COUNT. Random datagrams, most of them made of whole commands, at random times. Whatever
// arrives, the answer stays within its buffer and no output acts that the latch forbids.

#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "node_core.h"

namespace {

std::mt19937 any(39);

std::uint8_t byte() { return static_cast<std::uint8_t>(any()); }

/// Addresses at which something happens, more often than others.
std::uint32_t address() {
  static constexpr std::uint32_t known[] = {0x0C00, 0x0D00, 0x0E00, 0x1000, 0x1100, 0x1104, 0x1200, 0x1204,
                                            0x1300, 0x3000, 0x3100, 0x3200, 0x3300, 0x4000, 0x4004, 0x4100,
                                            0x4200, 0x0010, 0x0014, 0x0100, 0x0400, 0x0440, 0x0600, 0x0000};
  return any() % 8 == 0 ? any() & 0xFFFFU : known[any() % std::size(known)];
}

void add_command(std::vector<std::uint8_t>& datagram) {
  const bool write = any() % 2 == 0;
  const std::uint32_t space = any() % 3 == 0 ? any() % 8 : 0;
  const std::uint32_t log_unit = any() % 8 == 0 ? any() % 4 : space == 0 ? 2 : 1;
  const std::uint32_t units = any() % 16 == 0 ? any() % 128 : any() % 3;
  const bool with_address = any() % 8 != 0;
  const std::uint32_t word = (write ? 0x8000U : 0U) | (with_address ? 0x4000U : 0U) | (any() % 16 == 0 ? 0x2000U : 0U) |
                             space << 10U | log_unit << 8U | (any() % 2 == 0 ? 0x80U : 0U) | units;
  datagram.push_back(static_cast<std::uint8_t>(word));
  datagram.push_back(static_cast<std::uint8_t>(word >> 8U));
  if (with_address) {
    const std::uint32_t at = address();
    datagram.push_back(static_cast<std::uint8_t>(at));
    datagram.push_back(static_cast<std::uint8_t>(at >> 8U));
  }
  if (!write) return;
  for (std::uint32_t i = 0; i < units << log_unit; ++i) {
    datagram.push_back(any() % 4 == 0 ? byte() : static_cast<std::uint8_t>(any() % 3 == 0 ? 0x5A : any() % 4));
  }
}

/// What a driver sends: a bite, values 0, mode of 12 bits, PWM pins, watchdog of 5 ms, status 0, DDR, then a duty.
void add_activation(std::vector<std::uint8_t>& datagram) {
  static constexpr std::uint8_t bytes[] = {0x81, 0xC2, 0x00, 0x0C, 1,    0,    0,    0,              // watchdog
                                           0x82, 0xC2, 0x00, 0x40, 0,    0,    0,    0, 0, 0, 0, 0,  // values
                                           0x82, 0xC2, 0x00, 0x41, 3,    0,    0,    0, 3, 0, 0, 0,  // modes
                                           0x82, 0xC2, 0x00, 0x12, 2,    0,    0,    0, 2, 0, 0, 0,  // alternate source
                                           0x81, 0xC2, 0x00, 0x0C, 0x1F, 0xA1, 0x07, 0,              // watchdog
                                           0x81, 0xC2, 0x00, 0x0D, 0,    0,    0,    0,              // status
                                           0x82, 0xC2, 0x00, 0x11, 3,    0,    0,    0, 2, 0, 0, 0,  // DDR
                                           0x81, 0xC2, 0x00, 0x40, 0,    0,    0,    4};
  datagram.insert(datagram.end(), std::begin(bytes), std::end(bytes));
}

}  // namespace

int main(int argc, char** argv) {
  const long count = argc > 1 ? std::atol(argv[1]) : 1000;
  const node_identity identity{"abs-node", "ABS-NODE", {2, 0, 0, 0, 0, 1}, {10, 0, 0, 1}};
  node_core node;
  node_init(&node, &identity);
  std::uint32_t now_us = 0;
  long answered = 0;
  long driven = 0;
  for (long n = 0; n < count; ++n) {
    std::vector<std::uint8_t> datagram;
    if (any() % 16 == 0) {
      datagram.resize(any() % 64);
      for (std::uint8_t& b : datagram) b = byte();
    } else {
      if (any() % 64 == 0) add_activation(datagram);
      for (std::uint32_t commands = any() % 5; commands > 0; --commands) add_command(datagram);
      if (any() % 16 == 0 && !datagram.empty()) datagram.pop_back();
    }
    now_us += any() % (any() % 64 == 0 ? 30'000 : 200);
    node_count(&node, any() % 2, static_cast<std::uint16_t>(any()), now_us);
    // Of exactly the sizes that the sanitizer then guards.
    std::vector<std::uint8_t> answer(NODE_MOST_BYTES);
    const std::size_t length = node_datagram(&node, now_us, datagram.data(), datagram.size(), answer.data());
    answered += length > 0 ? 1 : 0;
    for (unsigned i = 0; i < NODE_CHANNELS; ++i) {
      driven += node_drives(&node, i) ? 1 : 0;
      const bool acts = node_duty(&node, i) > 0 || node_drives(&node, i) || node_output(&node);
      if (node_duty(&node, i) > 4095 || length > NODE_MOST_BYTES || (acts && (node.latched || !node.armed)) ||
          (node.latched && node.port[1][i] != 0) || node.allowed_us > NODE_LONGEST_US) {
        std::fprintf(stderr, "datagram %ld: duty %u, answer of %zu bytes, latched %d, DDR %x\n", n, node_duty(&node, i),
                     length, node.latched, node.port[1][i]);
        return 1;
      }
    }
  }
  std::printf("%ld datagrams, %ld answered, %ld times a pin was driven\n", count, answered, driven);
  return answered > count / 10 && driven > count / 1000 ? 0 : 1;  // else it has tried nothing
}
