/* A state as bytes, the same on every platform: little-endian words behind a head, a checksum behind them.

     bytes 0-7     "HOVERFMU"
     bytes 8-11    version of this layout
     bytes 12-43   the build, hexadecimal
     then          the content, in the order of `exchange`: doubles 8 bytes, integers 4
     last 8        checksum of all before */

#include <string.h>

#include "checksum.h"
#include "cursor.h"
#include "instance.h"
#include "variant.h"

enum { VERSION = 7, MAGIC_SIZE = 8, BUILD_SIZE = 32, HEAD_SIZE = MAGIC_SIZE + 4 + BUILD_SIZE, SUM_SIZE = 8 };
static const char MAGIC[] = "HOVERFMU";

enum direction { MEASURE, WRITE, READ, SUM };

struct cursor {
    enum direction direction;
    unsigned char *to;         /* where to write */
    const unsigned char *from; /* where to read */
    size_t at, end;            /* behind `end` there is nothing to read: zeros */
    uint64_t sum; /* of what there is */
};

static void exchange_word(struct cursor *cursor, uint64_t *word, unsigned size)
{
    uint64_t read = 0;
    for (unsigned i = 0; i < size; i++) {
        if (cursor->direction == WRITE)
            cursor->to[cursor->at + i] = (unsigned char)(*word >> 8 * i);
        else if (cursor->direction == READ && cursor->at + i < cursor->end)
            read |= (uint64_t)cursor->from[cursor->at + i] << 8 * i;
    }
    if (cursor->direction == READ)
        *word = read;
    if (cursor->direction == SUM)
        cursor->sum = checksum(cursor->sum, word, size);
    cursor->at += size;
}

void exchange_double(struct cursor *cursor, double *value)
{
    uint64_t word;
    memcpy(&word, value, sizeof word);
    exchange_word(cursor, &word, 8);
    memcpy(value, &word, sizeof word);
}

void exchange_integer(struct cursor *cursor, int32_t *value)
{
    uint64_t word = (uint32_t)*value;
    exchange_word(cursor, &word, 4);
    const uint32_t low = (uint32_t)word;
    memcpy(value, &low, sizeof low);
}

void exchange_doubles(struct cursor *cursor, void *first, size_t bytes)
{
    for (size_t i = 0; i < bytes / sizeof(double); i++)
        exchange_double(cursor, (double *)first + i);
}

static bool is_state(unsigned reference)
{
    return is_among(STATES, STATE_COUNT, reference);
}

/* Before the start the state is what the host has set. */
static void exchange_state(struct cursor *cursor, struct content *c)
{
    if (!instance_has_started(c))
        instance_copy(states_of(c), c->reals, STATES, STATE_COUNT);
    exchange_doubles(cursor, states_of(c), STATE_COUNT * sizeof(double));
    instance_spread(c->reals, states_of(c), STATES, STATE_COUNT);
}

/* All of the content that cannot be worked out from the rest; the same for writing and reading. */
static void exchange(struct cursor *cursor, struct content *c)
{
    int32_t use = (int32_t)c->use, phase = (int32_t)c->phase, tuned = c->tuned;
    for (unsigned i = 0; i < VARIABLE_COUNT; i++)
        if (VARIABLES[i].kind != REAL)
            exchange_integer(cursor, &c->integers[i]);
    exchange_integer(cursor, &use);
    exchange_integer(cursor, &phase);
    exchange_integer(cursor, &tuned);
    exchange_integer(cursor, &c->rated);
    exchange_double(cursor, &c->time);
    exchange_double(cursor, &c->completed);
    exchange_double(cursor, &c->start_time);
    exchange_double(cursor, &c->stop_time);
    for (unsigned i = 0; i < VARIABLE_COUNT; i++)
        if (VARIABLES[i].start_given && VARIABLES[i].kind == REAL && !is_state(i))
            exchange_double(cursor, &c->reals[i]);
    exchange_doubles(cursor, c->inputs, sizeof c->inputs);
    exchange_doubles(cursor, c->rates, sizeof c->rates);
    exchange_double(cursor, &c->hosts_tolerance);
    exchange_state(cursor, c);
    model()->exchange(cursor, c);
    c->use = use == MODEL_EXCHANGE ? MODEL_EXCHANGE : CO_SIMULATION;
    c->phase = phase >= 0 && phase < PHASE_COUNT ? (enum phase)phase : PHASE_COUNT;
    c->tuned = tuned != 0;
}

/* Windows has frames of a page where there is no C runtime: one copy to a function. */
_Static_assert(sizeof(struct content) < 3900, "a copy of the content fits into a frame");

static NEVER_INLINE size_t serialized_size(const struct content *content)
{
    struct content copy = *content;
    struct cursor cursor = {.direction = MEASURE, .at = HEAD_SIZE};
    exchange(&cursor, &copy);
    return cursor.at + SUM_SIZE;
}

uint64_t instance_checksum(const struct content *content, double point, double step)
{
    struct content copy = *content;
    struct cursor cursor = {.direction = SUM, .sum = CHECKSUM_OF_NOTHING};
    exchange(&cursor, &copy);
    exchange_double(&cursor, &point);
    exchange_double(&cursor, &step);
    return cursor.sum;
}

enum verdict instance_serialize(struct instance *instance, const struct content *content, unsigned char *bytes,
                                size_t size)
{
    struct content copy = *content;
    struct cursor cursor = {.direction = WRITE, .to = bytes, .at = MAGIC_SIZE};
    int32_t version = VERSION;
    const size_t needed = serialized_size(content);
    if (size < needed)
        return instance_say(instance, REFUSED, "%s: size = %u: must be %u bytes",
                            call_name(instance, SERIALIZE_FMU_STATE), (unsigned long long)size,
                            (unsigned long long)needed);
    memcpy(bytes, MAGIC, MAGIC_SIZE);
    exchange_integer(&cursor, &version);
    memcpy(bytes + cursor.at, variant()->build, BUILD_SIZE);
    cursor.at = HEAD_SIZE;
    exchange(&cursor, &copy);
    uint64_t sum = checksum(CHECKSUM_OF_NOTHING, bytes, cursor.at);
    exchange_word(&cursor, &sum, SUM_SIZE);
    return FINE;
}

static bool is_complete(const unsigned char *bytes, size_t size)
{
    struct cursor cursor = {.direction = READ, .from = bytes, .at = size - SUM_SIZE, .end = size};
    uint64_t sum;
    if (size < HEAD_SIZE + SUM_SIZE || memcmp(bytes, MAGIC, MAGIC_SIZE) != 0)
        return false;
    exchange_word(&cursor, &sum, SUM_SIZE);
    return sum == checksum(CHECKSUM_OF_NOTHING, bytes, size - SUM_SIZE);
}

static bool is_of_this_build(const unsigned char *bytes)
{
    struct cursor cursor = {.direction = READ, .from = bytes, .at = MAGIC_SIZE, .end = HEAD_SIZE};
    int32_t version = 0;
    exchange_integer(&cursor, &version);
    return version == VERSION && memcmp(bytes + cursor.at, variant()->build, BUILD_SIZE) == 0;
}

static bool is_phase_of_use(const struct content *c)
{
    if (c->phase == EVENT_MODE || c->phase == CONTINUOUS_TIME)
        return c->use == MODEL_EXCHANGE;
    return c->phase < STEPPING || c->phase == TERMINATED || (c->phase == STEPPING && c->use == CO_SIMULATION);
}

/* The words are right; whoever can work out a checksum may still have written anything. */
static bool is_whole(const struct content *c)
{
    if (!is_phase_of_use(c))
        return false;
    for (unsigned i = 0; i < VARIABLE_COUNT; i++) {
        const double value = VARIABLES[i].kind == REAL ? c->reals[i] : c->integers[i];
        if (VARIABLES[i].start_given && instance_why_not(c, &VARIABLES[i], value))
            return false;
    }
    return model()->is_possible(c);
}

static enum verdict deserialize(struct instance *instance, const unsigned char *bytes, size_t size,
                                struct content *content)
{
    struct cursor cursor = {.direction = READ, .from = bytes, .at = HEAD_SIZE, .end = size - SUM_SIZE};
    char build[BUILD_SIZE + 1] = "";
    if (!is_complete(bytes, size))
        return instance_say(instance, REFUSED, "serialized FMU state of %u bytes: must be complete and unchanged",
                            (unsigned long long)size);
    memcpy(build, bytes + MAGIC_SIZE + 4, BUILD_SIZE);
    if (!is_of_this_build(bytes))
        return instance_say(instance, REFUSED, "FMU state of build %q: must be a state of this build, %q", build,
                            variant()->build);
    *content = instance->now; /* what is not among the bytes is worked out again */
    exchange(&cursor, content);
    content->unread = content->unread_on_demand = true;
    if (cursor.at != cursor.end || !is_whole(content))
        return instance_say(instance, REFUSED, "serialized FMU state of %u bytes: must be one that this FMU wrote",
                            (unsigned long long)size);
    return FINE;
}

enum verdict instance_deserialize(struct instance *instance, const unsigned char *bytes, size_t size, void **state)
{
    struct content content;
    void *made = NULL; /* whatever *state was: it may never have been set */
    if (deserialize(instance, bytes, size, &content) == REFUSED ||
        instance_keep(instance, DESERIALIZE_FMU_STATE, &content, &made) == REFUSED)
        return REFUSED;
    *state = made;
    return FINE;
}

enum verdict instance_serialized_size(const struct content *content, size_t *size)
{
    *size = serialized_size(content);
    return FINE;
}
