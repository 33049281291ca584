/* A feed is an accepted write of the watchdog's time, or of the mark to its reload register; an activation is an accepted
   write of 0 to the status. These notes know them by address and value alone, whatever the node makes of them. */
bool ghost_feed, ghost_open; /* in the datagram at hand */

static void ghost_write(uint32_t address, uint32_t value) {
  if (address == 0x0C00 || (address == 0x0E00 && value >> 24 == 0x5A)) ghost_feed = true;
  if (address == 0x0D00 && value == 0) ghost_open = true;
}
static void ghost_refused(void) { ghost_feed = ghost_open = false; }
