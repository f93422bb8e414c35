#include "variant.h"

#include <string.h>

#include "checksum.h"

_Static_assert(sizeof VARIANT == 16 + 8 + 3 * 40 + 8 * VARIABLE_COUNT + 8, "no gaps: it is written as bytes");

const struct variant *variant(void)
{
    const struct variant *volatile place = &VARIANT;
    return place;
}

static uint64_t with_word(uint64_t sum, uint64_t word)
{
    unsigned char bytes[8];
    for (unsigned i = 0; i < 8; i++)
        bytes[i] = (unsigned char)(word >> 8 * i);
    return checksum(sum, bytes, sizeof bytes);
}

/* Of all before the checksum. */
static uint64_t checksum_of(const struct variant *v)
{
    uint64_t sum = checksum(CHECKSUM_OF_NOTHING, v->mark, sizeof v->mark);
    sum = with_word(sum, v->size);
    sum = checksum(sum, v->code, sizeof v->code);
    sum = checksum(sum, v->build, sizeof v->build);
    sum = checksum(sum, v->guid, sizeof v->guid);
    for (unsigned i = 0; i < VARIABLE_COUNT; i++) {
        uint64_t word;
        memcpy(&word, &v->starts[i], sizeof word);
        sum = with_word(sum, word);
    }
    return sum;
}

static bool is_whole_block(const struct variant *v)
{
    return v->size == sizeof *v && v->checksum == checksum_of(v) && !v->code[sizeof v->code - 1] &&
           !v->build[sizeof v->build - 1] && !v->guid[sizeof v->guid - 1];
}

enum verdict variant_check(struct instance *instance)
{
    const struct variant *v = variant();
    if (!is_whole_block(v))
        return instance_say(instance, REFUSED, "start values in the library: must be complete and unchanged");
    if (strcmp(v->code, CODE) != 0)
        return instance_say(instance, REFUSED, "start values in the library of code %q: must be of its code, %s",
                            v->code, CODE);
    for (unsigned i = 0; i < VARIABLE_COUNT; i++)
        if (VARIABLES[i].start_given && instance_check_start(instance, i, v->starts[i]) == REFUSED)
            return REFUSED;
    return FINE;
}
