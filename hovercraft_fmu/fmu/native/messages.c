#include "instance.h"

#include <stdarg.h>
#include <string.h>

#include "text.h"

static const char WARNING_CATEGORY[] = "logStatusWarning";
static const char ERROR_CATEGORY[] = "logStatusError";
static const char ALL_CATEGORIES[] = "logAll";

enum verdict instance_say(struct instance *instance, enum verdict verdict, const char *format, ...)
{
    char message[TEXT_SIZE];
    va_list values;
    instance->refusals += verdict == REFUSED;
    va_start(values, format);
    text_format(message, format, values);
    va_end(values);
    const struct services *services = &instance->services;
    const bool inside = instance_go_out(instance);
    if (verdict == WARNED ? instance->warnings : instance->errors)
        services->tell(services->sink, verdict, verdict == WARNED ? WARNING_CATEGORY : ERROR_CATEGORY, message);
    instance_come_back(instance, inside);
    return verdict;
}

enum verdict instance_log(struct instance *instance, bool on, size_t n, const char *const *categories)
{
    bool warnings = n == 0, errors = n == 0;
    for (size_t i = 0; i < n; i++) {
        if (!permitted(instance, SET_DEBUG_LOGGING, categories[i] != NULL))
            return REFUSED;
        const bool all = strcmp(categories[i], ALL_CATEGORIES) == 0;
        const bool warning = strcmp(categories[i], WARNING_CATEGORY) == 0;
        const bool error = strcmp(categories[i], ERROR_CATEGORY) == 0;
        if (!all && !warning && !error)
            return instance_say(instance, REFUSED, "log category '%q': must be one of %s, %s, %s", categories[i],
                                WARNING_CATEGORY, ERROR_CATEGORY, ALL_CATEGORIES);
        warnings = warnings || all || warning;
        errors = errors || all || error;
    }
    const bool kept = !on || instance->services.fmi == 3; /* FMI 2.0: "only", FMI 3.0: these too */
    instance->warnings = on ? warnings || (kept && instance->warnings) : instance->warnings && !warnings;
    instance->errors = on ? errors || (kept && instance->errors) : instance->errors && !errors;
    return FINE;
}
