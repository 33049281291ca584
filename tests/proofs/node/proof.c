/* What CBMC is asked of the node's core: an entry for each contract of contracts.h, and the world, which calls the node
   for ever. core.c is node_core.c with the ghosts (prove.py). */
#include "core.c"

static bool any_bool(void) {
  bool any;
  return any;
}
static uint32_t any_u32(void) {
  uint32_t any;
  return any;
}

#define ENTER(call)            \
  {                            \
    struct node_core *node;    \
    const struct command *command; \
    const uint8_t *bytes;      \
    uint8_t *answer;           \
    size_t length;             \
    ghost_feed = any_bool();   \
    ghost_open = any_bool();   \
    call;                      \
  }

void prove_write_register(void) ENTER(write_register(node, any_u32(), any_u32()))
void prove_write_bytes(void) ENTER(write_bytes(node, any_u32(), any_u32(), bytes, any_u32()))
void prove_read_register(void) ENTER(read_register(node, any_u32()))
void prove_obey_read(void) ENTER(obey_read(node, command, any_u32(), answer))
void prove_obey_write(void) ENTER(obey_write(node, command, any_u32(), any_u32()))
void prove_obey(void) ENTER(obey(node, command, answer))
void prove_obey_all(void) ENTER(obey_all(node, bytes, length, answer))
void prove_node_poll(void) ENTER(node_poll(node, any_u32()))
void prove_node_count(void) ENTER(node_count(node, any_u32(), (uint16_t)any_u32(), any_u32()))
void prove_node_datagram(void) ENTER(node_datagram(node, any_u32(), bytes, length, answer))
void prove_take_command(void) {
  const struct node_core *node;
  const uint8_t *bytes;
  size_t length, *at;
  struct command *command;
  take_command(node, bytes, length, at, command);
}

/* Any number of calls at any times by a clock of 64 bits, so that its lower 32 wrap; one at least every 2^31 us. `last` is
   that clock at the last feed or activation; `seen` what the node has noted of it, the same or an earlier one. `over`: 20 ms
   have passed since then without an activation; `fed`: a feed has come since they had passed. */
void prove_world(void) {
  struct node_core node;
  struct node_identity identity;
  uint8_t answer[NODE_MOST_BYTES], datagram[MOST_LENGTH];
  uint64_t now = 0, last = 0, seen = 0;
  bool ever = false, fed = false, over = true;
  node_init(&node, &identity);
  ghost_feed = ghost_open = false;
  while (any_bool())
    __CPROVER_assigns(node, now, last, seen, ever, fed, over, ghost_feed, ghost_open, __CPROVER_object_whole(answer),
                      __CPROVER_object_whole(datagram))
    __CPROVER_loop_invariant(BETWEEN(&node) && seen <= last && last <= now && now < 1ULL << 62 &&
                             (!over || node.latched) && (!node.armed || fed) &&
                             (!(node.armed || !node.latched) ||
                              (ever && node.fed_us == (uint32_t)seen &&
                               now - seen < (node.armed ? node.allowed_us : NODE_LONGEST_US))))
  {
    const uint32_t what = any_u32();
    const uint32_t step = any_u32();
    const size_t length = any_u32();
    __CPROVER_assume(step < 1U << 31 && now + step < 1ULL << 62 && length <= MOST_LENGTH);
    if (what == 0) {
      node_count(&node, any_u32() & 1, (uint16_t)any_u32(), any_u32());
      continue;
    }
    now += step;
    if (now - last >= NODE_LONGEST_US) {
      over = true;
      fed = false;
    }
    ghost_feed = ghost_open = false;
    if (what == 1) {
      node_poll(&node, (uint32_t)now);
    } else {
      node_datagram(&node, (uint32_t)now, datagram, length, answer);
    }
    if (ghost_feed || ghost_open) {
      last = now;
      ever = true;
      if (node.fed_us == (uint32_t)now) seen = now;
    }
    if (ghost_feed) fed = true;
    if (ghost_open) over = false;
    const bool on = node_duty(&node, 0) != 0 || node_duty(&node, 1) != 0 || node_output(&node) ||
                    node_drives(&node, 0) || node_drives(&node, 1);
    __CPROVER_assert(!on || (ever && now - last < NODE_LONGEST_US),
                     "CLAIM 20 ms after the last feed or activation every output is off");
    __CPROVER_assert(!on || !over, "CLAIM and stays off until an activation");
    __CPROVER_assert(!on || fed, "CLAIM and until a feed");
#ifdef COVER /* each must fail: the world has such a state */
    __CPROVER_assert(!on, "COVER an output is on");
    __CPROVER_assert(on || over || !ghost_feed, "COVER fed and activated, and all is off");
    __CPROVER_assert(!(over && ever && now > 1ULL << 33), "COVER over after the clock's wrap");
    __CPROVER_assert(!(on && now > 1ULL << 33), "COVER on after the clock's wrap");
#endif
  }
}
