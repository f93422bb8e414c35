/* Any bytes as a sequence of FMI calls with any arguments, on a few instances: libFuzzer calls LLVMFuzzerTestOneInput.
   What differs in the standards is in fuzz_fmi2.h and, with -DFMI=3, in fuzz_fmi3.h; in models, in fuzz_MODEL.h.

   Beside what the sanitizers see it demands that only the statuses of the standard that this FMU has come back, that a
   refused call changes nothing, and that what is read is finite.

   The host of a sequence may be a hostile one: it has no memory now and then, and is told so (linked with
   -Wl,--wrap=calloc); it rounds otherwise, which changes no bit, and is left to it; its logger calls back, which is
   refused, and frees, which does nothing; with CALM in the environment it never is. With -DALONE it has a main of its
   own: so many sequences of random bytes. */

#include <fenv.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "calls.h"
#include "checksum.h"
#include "variables.h"

enum { INSTANCES = 2, SLOTS = 4, MOST = 5, BLOB = 4096, CALLS = 28 };

struct bytes {
    const uint8_t *at;
    size_t left;
};

struct world {
    void *craft[INSTANCES];
    int listens[INSTANCES]; /* to errors, for sure */
    void *saved[SLOTS];
    char blob[BLOB];
    size_t blob_size;
    int forged; /* a state with a right checksum and any content was made: then numbers need not be finite */
};

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
void *__real_calloc(size_t count, size_t size);
void *__wrap_calloc(size_t count, size_t size);

/* What the host of a sequence is like. */
struct host_kind {
    int rounding;     /* one of fenv.h's */
    int calls_back;   /* its logger does */
    unsigned without; /* bit n: of 16 allocations the n-th fails */
    int compared;     /* the sequence is made again, by one who rounds otherwise */
};

/* And what it does at the moment. */
static struct {
    struct host_kind is;
    void *craft;           /* whose call is made; NULL: nobody's, or of one that is not yet the host's */
    struct bytes *bytes;   /* inside a step and in the logger: what it does there */
    int is_making_a_call;
    int is_told;           /* its logger is at work */
    unsigned allocations;
    unsigned failed;       /* of them */
    unsigned told_of_none; /* that there is no memory */
    uint64_t hash;         /* of all that comes of the calls, where it is compared */
} host;

static void demand(int good, const char *what)
{
    if (!good) {
        fprintf(stderr, "fuzz: %s\n", what);
        abort();
    }
}

void *__wrap_calloc(size_t count, size_t size)
{
    if (host.is_making_a_call && host.is.without >> host.allocations++ % 16 & 1) {
        host.failed++;
        return NULL;
    }
    return __real_calloc(count, size);
}

static unsigned a_byte(struct bytes *bytes);

/* From inside the logger. */
static void call_back(void *craft, unsigned how)
{
    static const unsigned reference = 0;
    void *state = NULL;
    double value = 1.0;
    const int statuses[] = {call_get(craft, &reference, 1, &value), call_set(craft, &reference, 1, &value),
                            call_step(craft, 0.0, 0.01),            call_save(craft, &state),
                            call_reset(craft),                      call_go(craft),
                            call_set_time(craft, 1.0),              call_get(craft, NULL, 1, NULL)};
    for (size_t i = 0; i < sizeof statuses / sizeof *statuses; i++)
        demand(statuses[i] == CALL_REFUSED && !state && value == 1.0, "a call from inside the logger was taken");
    if (how & 1)
        call_free(craft);
}

static void heard(int status, const char *message)
{
    demand(!host.is_told, "the logger was called from inside the logger");
    demand(fegetround() == host.is.rounding, "the logger has another rounding");
    host.is_told = 1;
    host.told_of_none += strstr(message, "no memory") != NULL;
    host.hash = checksum(host.hash, message, strlen(message));
    if (host.is.calls_back && host.craft)
        call_back(host.craft, a_byte(host.bytes));
    host.is_told = 0;
    demand(status >= CALL_WARNED && status <= CALL_REFUSED, "a message of another status");
    demand(strlen(message) > 0 && !strchr(message, '%'), "a message that is empty, or a format");
}

static void take(struct bytes *bytes, void *into, size_t size)
{
    const size_t n = size < bytes->left ? size : bytes->left;
    memset(into, 0, size);
    if (n > 0)
        memcpy(into, bytes->at, n);
    bytes->at += n;
    bytes->left -= n;
}

static unsigned a_byte(struct bytes *bytes)
{
    uint8_t value;
    take(bytes, &value, 1);
    return value;
}

static double a_double(struct bytes *bytes)
{
    static const double usual[] = {0.0,  -0.0, 1.0,   -1.0, 5.0,  10.0,     0.1,       0.001,     1e-9,   0.5,
                                   -0.5, 1e6,  -1e12, 1e30, 1e300, INFINITY, -INFINITY, NAN, 5e-324, 1.7e308};
    const unsigned kind = a_byte(bytes);
    double value;
    if (kind < 160)
        return usual[kind % (sizeof usual / sizeof *usual)];
    if (kind < 220)
        return ((int)a_byte(bytes) - 64) / 16.0; /* in integers: rounded down, 64.0 - 64.0 is -0.0 */
    take(bytes, &value, sizeof value);
    return value;
}

static unsigned a_reference(struct bytes *bytes)
{
    const unsigned kind = a_byte(bytes);
    unsigned value;
    if (kind < 250)
        return kind % (VARIABLE_COUNT + 2);
    take(bytes, &value, sizeof value);
    return value;
}

static int an_integer(struct bytes *bytes)
{
    const unsigned kind = a_byte(bytes);
    int value;
    if (kind < 230)
        return (int)(kind % 7);
    take(bytes, &value, sizeof value);
    return value;
}

static double real_of(void *craft, unsigned reference)
{
    double value = NAN;
    return call_get(craft, &reference, 1, &value) == CALL_OK ? value : NAN;
}

static inline int integer_of(void *craft, unsigned reference);

#include FUZZED /* what is the model's: fuzz_MODEL.h */

#if FMI == 3
#include "fuzz_fmi3.h"
#else
#include "fuzz_fmi2.h"
#endif

enum { SUMMED = sizeof VARIANT - sizeof VARIANT.checksum }; /* fuzz.py makes it one that can be written */

/* Now and then the library has other start values, or other bytes among them; half of these with the right checksum. */
static void spoil_variant(struct bytes *bytes)
{
    const unsigned how = a_byte(bytes);
    if (how < 192)
        return;
    if (how & 1)
        VARIANT.starts[a_reference(bytes) % VARIABLE_COUNT] = a_double(bytes);
    for (unsigned i = 0; i < how / 2 % 4; i++) {
        const size_t at = (a_byte(bytes) << 8 | a_byte(bytes)) % sizeof VARIANT;
        ((char *)&VARIANT)[at] = (char)a_byte(bytes);
    }
    if (how & 8)
        VARIANT.checksum = checksum(CHECKSUM_OF_NOTHING, &VARIANT, SUMMED);
}

/* Half of them are past their start already; in continuous-time mode, where they are for that. Of the others half are
   in initialization mode. Start values of one's own may contradict one another: that is said when it starts. */
static void *started(struct bytes *bytes, const struct variant *ours, int *listens)
{
    const unsigned failed = host.failed, told = host.told_of_none;
    void *craft = made(bytes, listens);
    demand(host.failed == failed || (!craft && host.told_of_none == told + (*listens != 0)),
           "there was no memory for an instance");
    const unsigned how = craft ? a_byte(bytes) : 0;
    host.craft = craft;
    demand(!craft || VARIANT.checksum == checksum(CHECKSUM_OF_NOTHING, &VARIANT, SUMMED),
           "damaged start values were taken");
    if (how & 3)
        demand(enter(craft) == CALL_OK, "to initialization mode");
    if (how & 1) {
        demand(call_go(craft) == CALL_OK || memcmp(ours, &VARIANT, sizeof VARIANT) != 0, "initialization");
        call_go_continuous(craft);
    }
    return craft;
}

/* A step that does not take long. */
static int step(void *craft, struct bytes *bytes)
{
    const double size = a_double(bytes);
    const double point = a_byte(bytes) < 240 ? time_of(craft) : a_double(bytes);
    return limited_step(craft, point, size);
}

static int reals(void *craft, struct bytes *bytes, const struct world *world)
{
    const unsigned how = a_byte(bytes);
    const size_t n = how % MOST;
    unsigned references[MOST];
    double values[MOST] = {0};
    for (size_t i = 0; i < n; i++) {
        references[i] = a_reference(bytes);
        values[i] = a_double(bytes);
    }
    if (how & 128)
        return call_set(craft, how == 255 ? NULL : references, n, values);
    const int status = call_get(craft, references, n, how == 127 ? NULL : values);
    for (size_t i = 0; i < n && status == CALL_OK; i++)
        demand(world->forged || isfinite(values[i]), "a number is not finite");
    return status;
}

/* The calls of model exchange, on whatever the instance is for. */
static int exchange(void *craft, struct bytes *bytes, const struct world *world)
{
    const unsigned how = a_byte(bytes), call = how % 16;
    const size_t n = how < 240 ? STATE_COUNT : how % 16;
    double values[16] = {0};
    int status;
    switch (call) {
    case 0:
    case 1:
        return call_go_to_events(craft);
    case 2:
    case 3:
        return call_go_continuous(craft);
    case 4:
        return new_discrete_states(craft, how == 244);
    case 5:
        return completed_step(craft, how & 1, how == 245);
    case 6:
        return call_set_time(craft, a_double(bytes));
    case 7:
        return call_get_nominals(craft, values, n);
    case 8:
        return call_get_indicators(craft, values, how == 248);
    case 9:
    case 10:
    case 11:
        for (int i = 0; i < STATE_COUNT; i++)
            values[i] = a_double(bytes);
        return call_set_states(craft, how == 249 ? NULL : values, n);
    default:
        status = call < 14 ? call_get_rates(craft, how == 252 ? NULL : values, n)
                           : call_get_states(craft, how == 254 ? NULL : values, n);
        for (size_t i = 0; i < n && status == CALL_OK; i++)
            demand(world->forged || isfinite(values[i]), "a state or its derivative is not finite");
        return status;
    }
}

/* Some bytes of the blob are other ones; now and then with the right checksum. */
static void spoil(struct world *world, struct bytes *bytes)
{
    const unsigned how = a_byte(bytes);
    if (world->blob_size <= 8 || how < 128)
        return;
    for (unsigned i = 0; i < how % 8; i++) {
        const size_t at = (a_byte(bytes) << 8 | a_byte(bytes)) % world->blob_size;
        world->blob[at] = (char)a_byte(bytes);
    }
    if (how >= 200) {
        const uint64_t sum = checksum(CHECKSUM_OF_NOTHING, world->blob, world->blob_size - 8);
        memcpy(world->blob + world->blob_size - 8, &sum, 8);
        world->forged = 1;
    }
    if (how == 199)
        world->blob_size -= 1 + how % 7;
}

static int states(void *craft, struct bytes *bytes, struct world *world)
{
    const unsigned how = a_byte(bytes);
    void **slot = &world->saved[how / 8 % SLOTS], *restored = NULL;
    switch (how % 8) {
    case 0:
    case 1:
        return call_save(craft, how == 249 ? NULL : slot);
    case 2:
    case 3:
        return *slot || how > 200 ? call_restore(craft, *slot) : CALL_OK;
    case 4:
        return call_forget(craft, how == 252 ? NULL : slot);
    case 5:
        if (!*slot || call_size(craft, *slot, &world->blob_size) != CALL_OK)
            return CALL_OK;
        demand(world->blob_size <= BLOB, "the size of a state");
        return call_serialize(craft, *slot, world->blob, how > 240 ? 5 : world->blob_size);
    case 6:
        spoil(world, bytes);
        return CALL_OK;
    default: {
        const int status = call_deserialize(craft, world->blob, world->blob_size, &restored);
        demand((status == CALL_OK) == (restored != NULL), "a refused blob made a state");
        call_forget(craft, slot);
        *slot = restored;
        return status;
    }
    }
}

static int called(struct bytes *bytes, struct world *world, void **craft)
{
    double values[3];
    switch (a_byte(bytes) % CALLS) {
    case 0:
        values[0] = a_double(bytes), values[1] = a_double(bytes), values[2] = a_double(bytes);
        return set_up(*craft, a_byte(bytes) & 1, values[0], values[1], a_byte(bytes) < 64, values[2]);
    case 1:
    case 2:
        return enter(*craft);
    case 3:
    case 4:
        return call_go(*craft);
    case 5:
        return a_byte(bytes) < 64 ? call_terminate(*craft) : CALL_OK;
    case 6:
        return a_byte(bytes) < 64 ? call_reset(*craft) : CALL_OK;
    case 7:
        call_free(*craft);
        *craft = NULL;
        return CALL_OK;
    case 8:
        world->listens[craft - world->craft] = 0;
        return logging(*craft, bytes);
    case 9:
        return others(*craft, bytes);
    case 10:
        return statuses(*craft, bytes);
    case 11:
        return a_byte(bytes) < 32 ? cancel(*craft) : partial_derivatives(*craft, bytes, world);
    case 12:
    case 13:
        return integers(*craft, bytes);
    case 14:
    case 15:
        return derivatives(*craft, bytes, world);
    case 16:
    case 17:
    case 18:
        return states(*craft, bytes, world);
    case 19:
    case 20:
    case 21:
        return reals(*craft, bytes, world);
    case 22:
    case 23:
    case 24:
    case 25:
        return exchange(*craft, bytes, world);
    default:
        return step(*craft, bytes);
    }
}

/* All that an instance is, as bytes; what is worked out when it is read has been. */
static size_t whole(void *craft, char into[BLOB])
{
    void *state = NULL;
    size_t size = 0;
    host.is_making_a_call = 0;
    real_of(craft, WORKED_OUT);
    demand(call_save(craft, &state) == CALL_OK && call_size(craft, state, &size) == CALL_OK &&
               size <= BLOB && call_serialize(craft, state, into, size) == CALL_OK,
           "a state must always be there");
    call_forget(craft, &state);
    if (host.is.compared)
        host.hash = checksum(host.hash, into, size);
    host.is_making_a_call = 1;
    return size;
}

static void one_call(struct bytes *bytes, struct world *world, void **craft)
{
    char before[BLOB], after[BLOB];
    host.craft = *craft;
    const size_t n = whole(*craft, before);
    const unsigned failed = host.failed, told = host.told_of_none;
    const unsigned listens = world->listens[craft - world->craft] != 0;
    const int status = called(bytes, world, craft);
    demand(status >= CALL_OK && status <= CALL_REFUSED, "a status that never comes");
    demand(host.failed == failed || (status == CALL_REFUSED && host.told_of_none >= told + listens),
           "there was no memory for a call");
    demand(fegetround() == host.is.rounding, "the host has another rounding");
    if (status >= CALL_DISCARDED)
        demand(whole(*craft, after) == n && memcmp(before, after, n) == 0, "a refused call changed something");
}

/* Returns the hash of all that came of it. */
static uint64_t sequence(struct bytes bytes, struct host_kind kind)
{
    struct world world = {.blob_size = 0};
    const struct variant ours = VARIANT;
    memset(&host, 0, sizeof host);
    host.is = kind, host.bytes = &bytes;
    call_tell = heard;
    spoil_variant(&bytes);
    fesetround(kind.rounding);
    host.is_making_a_call = 1;
    while (bytes.left > 0) {
        const unsigned i = a_byte(&bytes) % INSTANCES;
        host.craft = NULL;
        if (world.craft[i] || (world.craft[i] = started(&bytes, &ours, &world.listens[i])))
            one_call(&bytes, &world, &world.craft[i]);
    }
    host.is_making_a_call = 0;
    fesetround(FE_TONEAREST);
    for (int i = 0; i < SLOTS; i++)
        free(world.saved[i]); /* the hosts' own memory, with or without callbacks */
    for (int i = 0; i < INSTANCES; i++)
        call_free(world.craft[i]);
    VARIANT = ours;
    return host.hash;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const int roundings[] = {FE_TONEAREST, FE_DOWNWARD, FE_UPWARD, FE_TOWARDZERO};
    struct bytes bytes = {data, size};
    const unsigned how = getenv("CALM") ? 0 : a_byte(&bytes);
    const int rounding = roundings[how % 16 < 12 ? 0 : how % 4];
    struct host_kind kind = {.rounding = FE_TONEAREST, .calls_back = how & 16, .compared = rounding != FE_TONEAREST};
    if (how & 32)
        kind.without = a_byte(&bytes) << 8 | a_byte(&bytes);
    const uint64_t hash = sequence(bytes, kind);
    kind.rounding = rounding;
    demand(!kind.compared || sequence(bytes, kind) == hash, "the host's rounding changed a bit");
    return 0;
}

#ifdef ALONE

int main(int argc, char **argv)
{
    static uint8_t data[400];
    uint64_t dice = 88172645463325252u;
    for (int left = argc > 1 ? atoi(argv[1]) : 1; left > 0; left--) {
        for (size_t i = 0; i < sizeof data; i++) {
            dice ^= dice << 13, dice ^= dice >> 7, dice ^= dice << 17;
            data[i] = (uint8_t)(dice >> 32);
        }
        LLVMFuzzerTestOneInput(data, sizeof data);
    }
    return 0;
}

#endif
