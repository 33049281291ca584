/* Contracts of firmware/node_core.c for CBMC (goto-instrument --dfcc). prove.py includes this file into a copy of the
   core, behind its last type, and puts ghosts.h and the loops' contracts there. */

#define OLD(x) __CPROVER_old(x)
#define ENTRY(x) __CPROVER_loop_entry(x)
#define SAME(x) (x)
#define FRESH(p, n) __CPROVER_is_fresh(p, n)
#define MOST_LENGTH 65535U

/* What holds between calls, and within a datagram. */
#define DDR(n, i) ((n)->port[PORT_DDR][i])
#define DRAIN(n, i) ((n)->port[PORT_OPEN_DRAIN][i])
#define NO_PIN(n) (DDR(n, 0) == 0 && DDR(n, 1) == 0 && DRAIN(n, 0) == 0 && DRAIN(n, 1) == 0)
#define HOLDS(n)                                                                                                   \
  ((n)->allowed_us <= NODE_LONGEST_US && (n)->stamp_divisor <= 0xFFFFU && (n)->pwm_rate <= 0xFFFFU &&              \
   DDR(n, 0) <= PIN_MASK && DDR(n, 1) <= PIN_MASK && (!(n)->latched || NO_PIN(n)) &&                               \
   (!(n)->armed || (n)->allowed_us >= 1) && (n)->refused <= CONTROL_WRITE)
#define BETWEEN(n) (HOLDS(n) && (n)->refused == 0 && !(n)->numbered && !(n)->feeds)
#define NOTED(n) (!ghost_feed || ((n)->feeds && (n)->fed_us == (n)->now_us))
/* The write number of then or now. */
#define BYTE_OF(n, T, i) ((uint32_t)T((n)->timers[WRITE_NUMBER + i]) << 8 * i)
#define NUMBER_OF(n, T) (BYTE_OF(n, T, 0) | BYTE_OF(n, T, 1) | BYTE_OF(n, T, 2) | BYTE_OF(n, T, 3))
#define NUMBER(n) NUMBER_OF(n, SAME)
#define NUMBER_KEPT(n, T) ((!T((n)->numbered) || (n)->numbered) && ((n)->numbered || NUMBER(n) == NUMBER_OF(n, T)))
/* From a state of then to one of now: what a feed and an activation alone can change. */
#define STEP(n, T)                                                                                                 \
  (((n)->fed_us == T((n)->fed_us) || ((ghost_feed || ghost_open) && (n)->fed_us == (n)->now_us)) &&                \
   ((n)->latched || !T((n)->latched) || (ghost_open && (n)->fed_us == (n)->now_us)) &&                             \
   (!(n)->armed || ghost_feed || (T((n)->armed) && (n)->allowed_us == T((n)->allowed_us))) &&                      \
   (!T(ghost_feed) || ghost_feed) && (!T(ghost_open) || ghost_open))
#define REGISTERS(n)                                                                                               \
  (n)->port, (n)->pwm_value, (n)->pwm_mode, (n)->pwm_rate, (n)->pdm_rate, (n)->pwm_enable, (n)->counter_control,   \
    (n)->stamp_divisor, (n)->filter, (n)->count, (n)->watchdog_clocks, (n)->allowed_us, (n)->fed_us, (n)->armed,   \
    (n)->latched, (n)->fed_since_bite, (n)->number_known, (n)->feeds, (n)->refused, ghost_feed, ghost_open
/* The watchdog's time, or without an armed watchdog that of an opened latch, is over. */
#define LATE(n, now)                                                                                               \
  ((OLD((n)->armed) || !OLD((n)->latched)) &&                                                                      \
   (uint32_t)((now) - OLD((n)->fed_us)) >= (OLD((n)->armed) ? OLD((n)->allowed_us) : NODE_LONGEST_US))
#define WAS_PERMITTED(n, now) (OLD((n)->armed) && !OLD((n)->latched) && !LATE(n, now))

static void write_register(struct node_core *node, uint32_t address, uint32_t value)
__CPROVER_requires(FRESH(node, sizeof *node) && HOLDS(node) && address <= 0xFFFFU && NOTED(node))
__CPROVER_assigns(REGISTERS(node))
__CPROVER_ensures(HOLDS(node) && STEP(node, OLD) && NOTED(node))
/* The latch opens only for a host that has not fed since the bite, and while both values are 0. */
__CPROVER_ensures(!OLD(node->latched) || node->latched ||
                  (address == 0x0D00 && value == 0 && !OLD(node->fed_since_bite) && OLD(node->pwm_value[0]) == 0 &&
                   OLD(node->pwm_value[1]) == 0));

static void write_bytes(struct node_core *node, uint32_t space, uint32_t address, const uint8_t *data, uint32_t count)
__CPROVER_requires(count <= 8 && space < 8 && address <= 0xFFFFU && FRESH(node, sizeof *node) && FRESH(data, count) &&
                   HOLDS(node))
__CPROVER_assigns(node->timers, node->control[0], node->refused, node->numbered)
__CPROVER_ensures(node->refused <= CONTROL_WRITE && NUMBER_KEPT(node, OLD));

/* Commands. */
#define UNIT_OF(c) ((c)->info || (c)->space != SPACE_HOSTMOT2 ? 2 : 4)
#define IN_USE(c) ((c)->space != SPACE_CHIP && (c)->space != SPACE_FLASH && (c)->space != SPACE_UNUSED)
#define ODD(c) ((c)->space == SPACE_HOSTMOT2 && (c)->address % 4 != 0)
#define SIZES(c)                                                                                                   \
  ((c)->space < 8 && ((c)->unit == 1 || (c)->unit == 2 || (c)->unit == 4 || (c)->unit == 8) && (c)->units <= 127 && \
   (c)->address <= 0xFFFFU &&                                                                                      \
   (c)->known == (IN_USE(c) && (c)->unit == UNIT_OF(c) && !((c)->write && ((c)->info || ODD(c)))))
#define BYTES(c) ((size_t)(c)->unit * (c)->units)

static uint32_t read_register(const struct node_core *node, uint32_t address)
__CPROVER_requires(FRESH(node, sizeof *node) && HOLDS(node) && address <= 0xFFFFU)
__CPROVER_assigns();

static void obey_read(const struct node_core *node, const struct command *command, uint32_t address, uint8_t *answer)
__CPROVER_requires(FRESH(node, sizeof *node) && FRESH(command, sizeof *command) && SIZES(command) && HOLDS(node) &&
                   address <= 0xFFFFU && FRESH(answer, command->unit))
__CPROVER_assigns(__CPROVER_object_upto(answer, command->unit));

static void obey_write(struct node_core *node, const struct command *command, uint32_t address, uint32_t unit)
__CPROVER_requires(FRESH(node, sizeof *node) && FRESH(command, sizeof *command) && SIZES(command) && HOLDS(node) &&
                   address <= 0xFFFFU && command->known && command->write && unit < command->units &&
                   FRESH(command->data, BYTES(command)) && NOTED(node))
__CPROVER_assigns(REGISTERS(node), node->timers, node->control[0], node->numbered)
__CPROVER_ensures(HOLDS(node) && STEP(node, OLD) && NOTED(node) && NUMBER_KEPT(node, OLD));

static void obey(struct node_core *node, const struct command *command, uint8_t *answer)
__CPROVER_requires(FRESH(node, sizeof *node) && FRESH(command, sizeof *command) && SIZES(command) && HOLDS(node) &&
                   (command->write ==> FRESH(command->data, BYTES(command))) &&
                   (!command->write ==> FRESH(answer, BYTES(command))) && NOTED(node))
__CPROVER_assigns(REGISTERS(node), node->timers, node->control, node->pointer, node->numbered;
                  !command->write: __CPROVER_object_upto(answer, BYTES(command)))
__CPROVER_ensures(HOLDS(node) && STEP(node, OLD) && NOTED(node) && NUMBER_KEPT(node, OLD));

#define LOOP_OBEY                                                                                                  \
  __CPROVER_assigns(unit, address, REGISTERS(node), node->timers, node->control[0], node->numbered;                \
                    !command->write: __CPROVER_object_upto(answer, BYTES(command)))                                \
  __CPROVER_loop_invariant(unit <= command->units && address <= 0xFFFFU && HOLDS(node) && STEP(node, ENTRY) &&     \
                           NOTED(node) && NUMBER_KEPT(node, ENTRY))                                                \
  __CPROVER_decreases(command->units - unit)

static bool take_command(const struct node_core *node, const uint8_t *bytes, size_t length, size_t *at,
                         struct command *command)
__CPROVER_requires(length <= MOST_LENGTH && FRESH(node, sizeof *node) && FRESH(bytes, length) &&
                   FRESH(at, sizeof *at) && FRESH(command, sizeof *command) && *at < length)
__CPROVER_assigns(*at, *command)
__CPROVER_ensures(*at >= OLD(*at) && *at <= length)
/* A whole command lies in the datagram, with its data. */
__CPROVER_ensures(__CPROVER_return_value ==>
                  (*at > OLD(*at) && SIZES(command) &&
                   (command->write ==> (__CPROVER_pointer_in_range_dfcc(bytes, command->data, bytes + length) &&
                                        __CPROVER_POINTER_OFFSET(command->data) + BYTES(command) ==
                                            __CPROVER_POINTER_OFFSET(bytes) + *at))));

static size_t obey_all(struct node_core *node, const uint8_t *bytes, size_t length, uint8_t *answer)
__CPROVER_requires(length <= MOST_LENGTH && FRESH(node, sizeof *node) && FRESH(bytes, length) &&
                   FRESH(answer, NODE_MOST_BYTES) && BETWEEN(node) && !ghost_feed && !ghost_open)
__CPROVER_assigns(REGISTERS(node), node->timers, node->control, node->pointer, node->numbered,
                  __CPROVER_object_upto(answer, NODE_MOST_BYTES))
__CPROVER_ensures(__CPROVER_return_value <= NODE_MOST_BYTES && HOLDS(node) && STEP(node, OLD) && NOTED(node) &&
                  NUMBER_KEPT(node, OLD));

#define LOOP_ALL                                                                                                   \
  __CPROVER_assigns(at, answered, command, REGISTERS(node), node->timers, node->control, node->pointer,            \
                    node->numbered, __CPROVER_object_upto(answer, NODE_MOST_BYTES))                                \
  __CPROVER_loop_invariant(at <= length && answered <= NODE_MOST_BYTES && HOLDS(node) && STEP(node, ENTRY) &&      \
                           NOTED(node) && NUMBER_KEPT(node, ENTRY))                                                \
  __CPROVER_decreases(length - at + (node->refused == 0 ? 1U : 0U))

void node_poll(struct node_core *node, uint32_t now_us)
__CPROVER_requires(FRESH(node, sizeof *node) && BETWEEN(node))
__CPROVER_assigns(node->now_us, node->armed, node->latched, node->fed_since_bite, node->port, node->pwm_value)
__CPROVER_ensures(BETWEEN(node) && node->now_us == now_us)
__CPROVER_ensures(!node->latched == !(OLD(node->latched) || LATE(node, now_us)))
__CPROVER_ensures(!node->armed == !(OLD(node->armed) && !LATE(node, now_us)));

void node_count(struct node_core *node, unsigned channel, uint16_t hardware, uint32_t now_us)
__CPROVER_requires(FRESH(node, sizeof *node) && channel < NODE_CHANNELS)
__CPROVER_assigns(node->hardware, node->count, node->counted_us);

size_t node_datagram(struct node_core *node, uint32_t now_us, const uint8_t *datagram, size_t length, uint8_t *answer)
__CPROVER_requires(length <= MOST_LENGTH && FRESH(node, sizeof *node) && FRESH(datagram, length) &&
                   FRESH(answer, NODE_MOST_BYTES) && BETWEEN(node) && !ghost_feed && !ghost_open)
__CPROVER_assigns(*node, ghost_feed, ghost_open, __CPROVER_object_upto(answer, NODE_MOST_BYTES))
__CPROVER_ensures(__CPROVER_return_value <= NODE_MOST_BYTES && BETWEEN(node) && node->now_us == now_us)
__CPROVER_ensures(ghost_feed ? node->fed_us == now_us
                             : node->fed_us == OLD(node->fed_us) || (ghost_open && node->fed_us == now_us))
__CPROVER_ensures(!node->armed || ghost_feed ||
                  (OLD(node->armed) && !LATE(node, now_us) && node->allowed_us == OLD(node->allowed_us)))
__CPROVER_ensures(node->latched || (ghost_open && node->fed_us == now_us) ||
                  (!OLD(node->latched) && !LATE(node, now_us)))
/* While outputs are permitted, the write number stays or goes on by 1 to 1,024. */
__CPROVER_ensures(!(WAS_PERMITTED(node, now_us) && OLD(node->number_known)) ||
                  NUMBER(node) - NUMBER_OF(node, OLD) <= MOST_AHEAD)
/* The owner: who feeds a permitted node that knows its host's number brings one of the next. */
__CPROVER_ensures(!(WAS_PERMITTED(node, now_us) && OLD(node->number_known) && ghost_feed && node->armed &&
                    !node->latched) ||
                  NUMBER(node) - NUMBER_OF(node, OLD) - 1U < MOST_AHEAD);
