#include "instance.h"

#include <stdarg.h>
#include <string.h>

#include "text.h"

static const char *const CATEGORIES[] = {
    [WARNED] = "logStatusWarning",
    [DISCARDED] = "logStatusDiscard",
    [REFUSED] = "logStatusError",
};
static const char ALL_CATEGORIES[] = "logAll";

enum verdict instance_say(struct instance *instance, enum verdict verdict, const char *format, ...)
{
    char message[TEXT_SIZE];
    va_list values;
    if (verdict == DISCARDED && !can_be_discarded(instance))
        verdict = REFUSED;
    if (verdict == REFUSED) {
        instance->errors++;
        instance->failed = true;
    }
    va_start(values, format);
    text_format(message, format, values);
    va_end(values);
    const struct services *services = &instance->services;
    const bool inside = instance_go_out(instance);
    instance->telling = true;
    if (instance->logged >> verdict & 1)
        services->tell(services->sink, verdict, CATEGORIES[verdict], message);
    instance->telling = false;
    instance_come_back(instance, inside);
    if (verdict == WARNED)
        return WARNED;
    instance->refusal = verdict;
    return REFUSED;
}

enum verdict instance_log(struct instance *instance, bool on, size_t n, const char *const *categories)
{
    unsigned named = n == 0 ? ~0u : 0;
    for (size_t i = 0; i < n; i++) {
        if (!permitted(instance, SET_DEBUG_LOGGING, categories[i] != NULL))
            return REFUSED;
        unsigned found = strcmp(categories[i], ALL_CATEGORIES) == 0 ? ~0u : 0;
        for (unsigned verdict = WARNED; verdict <= REFUSED; verdict++)
            if (strcmp(categories[i], CATEGORIES[verdict]) == 0)
                found = 1u << verdict;
        if (!found)
            return instance_say(instance, REFUSED, "log category '%q': must be one of %s, %s, %s, %s", categories[i],
                                CATEGORIES[WARNED], CATEGORIES[DISCARDED], CATEGORIES[REFUSED], ALL_CATEGORIES);
        named |= found;
    }
    if (!on)
        instance->logged &= ~named;
    else if (instance->services.fmi == 3) /* "only" in FMI 2.0, these too in FMI 3.0 */
        instance->logged |= named;
    else
        instance->logged = named;
    return FINE;
}
