/* A state as bytes, the same on every platform: little-endian words behind a head, a checksum behind them.

     bytes 0-7     "HOVERFMU"
     bytes 8-11    version of this layout
     bytes 12-43   the build, hexadecimal
     then          the content, in the order of `exchange`: doubles 8 bytes, integers 4
     last 8        checksum of all before */

#include <string.h>

#include "checksum.h"
#include "instance.h"
#include "variant.h"

enum { VERSION = 6, MAGIC_SIZE = 8, BUILD_SIZE = 32, HEAD_SIZE = MAGIC_SIZE + 4 + BUILD_SIZE, SUM_SIZE = 8 };
static const char MAGIC[] = "HOVERFMU";

enum direction { MEASURE, WRITE, READ, SUM };

struct cursor {
    enum direction direction;
    unsigned char *to;         /* where to write */
    const unsigned char *from; /* where to read */
    size_t at;
    uint64_t sum; /* of what there is */
};

static void exchange_word(struct cursor *cursor, uint64_t *word, unsigned size)
{
    uint64_t read = 0;
    for (unsigned i = 0; i < size; i++) {
        if (cursor->direction == WRITE)
            cursor->to[cursor->at + i] = (unsigned char)(*word >> 8 * i);
        else if (cursor->direction == READ)
            read |= (uint64_t)cursor->from[cursor->at + i] << 8 * i;
    }
    if (cursor->direction == READ)
        *word = read;
    if (cursor->direction == SUM)
        cursor->sum = checksum(cursor->sum, word, size);
    cursor->at += size;
}

static void exchange_double(struct cursor *cursor, double *value)
{
    uint64_t word;
    memcpy(&word, value, sizeof word);
    exchange_word(cursor, &word, 8);
    memcpy(value, &word, sizeof word);
}

static void exchange_integer(struct cursor *cursor, int32_t *value)
{
    uint64_t word = (uint32_t)*value;
    exchange_word(cursor, &word, 4);
    const uint32_t low = (uint32_t)word;
    memcpy(value, &low, sizeof low);
}

static void exchange_doubles(struct cursor *cursor, void *first, size_t bytes)
{
    for (size_t i = 0; i < bytes / sizeof(double); i++)
        exchange_double(cursor, (double *)first + i);
}

static bool is_state(unsigned reference)
{
    return instance_place(STATES, STATE_COUNT, reference) < STATE_COUNT;
}

/* Before the start the state is what the host has set. */
static void exchange_state(struct cursor *cursor, struct content *c)
{
    if (!instance_has_started(c))
        instance_copy(&c->state, c->reals, STATES, STATE_COUNT);
    exchange_doubles(cursor, &c->state, sizeof c->state);
    instance_spread(c->reals, &c->state, STATES, STATE_COUNT);
}

static void exchange_craft(struct cursor *cursor, struct craft *craft)
{
    for (unsigned i = 0; i < CRAFT_COUNT; i++) {
        char *field = (char *)craft + CRAFT_FIELDS[i].offset;
        if (VARIABLES[CRAFT_FIELDS[i].reference].kind == REAL)
            exchange_double(cursor, (double *)(void *)field);
        else
            exchange_integer(cursor, (int32_t *)(void *)field);
    }
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
    exchange_integer(cursor, &c->settings.integrator);
    exchange_double(cursor, &c->settings.step_size);
    exchange_double(cursor, &c->settings.tolerance);
    exchange_double(cursor, &c->time);
    exchange_double(cursor, &c->completed);
    exchange_double(cursor, &c->start_time);
    exchange_double(cursor, &c->stop_time);
    for (unsigned i = 0; i < VARIABLE_COUNT; i++)
        if (VARIABLES[i].start_given && VARIABLES[i].kind == REAL && !is_state(i))
            exchange_double(cursor, &c->reals[i]);
    exchange_doubles(cursor, &c->inputs, sizeof c->inputs);
    exchange_doubles(cursor, c->rates, sizeof c->rates);
    exchange_double(cursor, &c->hosts_tolerance);
    exchange_state(cursor, c);
    exchange_doubles(cursor, &c->controls, sizeof c->controls);
    exchange_craft(cursor, &c->craft);
    exchange_double(cursor, &c->proposed);
    exchange_double(cursor, &c->stability);
    exchange_double(cursor, &c->rotation);
    if (c->estimates) { /* that is known by the size */
        exchange_doubles(cursor, &c->companion.state, sizeof c->companion.state);
        exchange_double(cursor, &c->companion.proposed);
        exchange_double(cursor, &c->companion.way);
        exchange_double(cursor, &c->companion.fastest);
    }
    c->use = use == MODEL_EXCHANGE ? MODEL_EXCHANGE : CO_SIMULATION;
    c->phase = phase >= 0 && phase < PHASE_COUNT ? (enum phase)phase : PHASE_COUNT;
    c->tuned = tuned != 0;
}

static size_t serialized_size(bool estimates)
{
    struct content content = {.phase = INSTANTIATED, .estimates = estimates};
    struct cursor cursor = {.direction = MEASURE, .at = HEAD_SIZE};
    exchange(&cursor, &content);
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
    const size_t needed = serialized_size(content->estimates);
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
    struct cursor cursor = {.direction = READ, .from = bytes, .at = size - SUM_SIZE};
    uint64_t sum;
    if (size < HEAD_SIZE + SUM_SIZE || memcmp(bytes, MAGIC, MAGIC_SIZE) != 0)
        return false;
    exchange_word(&cursor, &sum, SUM_SIZE);
    return sum == checksum(CHECKSUM_OF_NOTHING, bytes, size - SUM_SIZE);
}

static bool is_of_this_build(const unsigned char *bytes, size_t size)
{
    struct cursor cursor = {.direction = READ, .from = bytes, .at = MAGIC_SIZE};
    int32_t version = 0;
    exchange_integer(&cursor, &version);
    return version == VERSION && (size == serialized_size(false) || size == serialized_size(true)) &&
           memcmp(bytes + cursor.at, variant()->build, BUILD_SIZE) == 0;
}

static bool is_phase_of_use(const struct content *c)
{
    if (c->phase == EVENT_MODE || c->phase == CONTINUOUS_TIME)
        return c->use == MODEL_EXCHANGE;
    return c->phase < STEPPING || c->phase == TERMINATED || (c->phase == STEPPING && c->use == CO_SIMULATION);
}

/* The words are right; whoever can work out a checksum may still have written anything. */
static bool is_possible(const struct content *c)
{
    const int32_t most = INTEGRATOR_COUNT;
    const bool started = instance_has_started(c);
    const int32_t kept = c->integers[V_INTEGRATOR], used = c->settings.integrator;
    const int32_t number = c->integers[V_INTEGRATOR_NUMBER];
    return is_phase_of_use(c) && kept >= 1 && kept <= most && number >= 0 && number <= most &&
           (!started || (used >= 1 && used <= most)) && c->reals[V_STEP_SIZE] > 0.0 &&
           (!started || c->settings.step_size > 0.0) && c->integers[V_SUBSTEPS] >= 0 &&
           (c->use == CO_SIMULATION ||
            (c->reals[V_SKIRT_FRICTION] == 0.0 && c->craft.skirt_friction == 0.0 && !c->estimates &&
             c->integers[V_ERROR_ESTIMATE] != ON && c->integers[V_ERROR_ESTIMATE_NUMBER] != ON));
}

static enum verdict deserialize(struct instance *instance, const unsigned char *bytes, size_t size,
                                struct content *content)
{
    struct cursor cursor = {.direction = READ, .from = bytes, .at = HEAD_SIZE};
    char build[BUILD_SIZE + 1] = "";
    if (!is_complete(bytes, size))
        return instance_say(instance, REFUSED, "serialized FMU state of %u bytes: must be complete and unchanged",
                            (unsigned long long)size);
    memcpy(build, bytes + MAGIC_SIZE + 4, BUILD_SIZE);
    if (!is_of_this_build(bytes, size))
        return instance_say(instance, REFUSED, "FMU state of build %q: must be a state of this build, %q", build,
                            variant()->build);
    *content = instance->now; /* what is not among the bytes is worked out again */
    content->estimates = size == serialized_size(true);
    exchange(&cursor, content);
    content->reals[V_PROJECTED_AREA] = kernel_derived(&content->craft).projected_area;
    content->motion_unread = content->action_unread = true;
    if (!is_possible(content))
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
    *size = serialized_size(content->estimates);
    return FINE;
}
