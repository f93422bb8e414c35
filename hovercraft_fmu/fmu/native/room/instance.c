#include "instance.h"

#include <math.h>
#include <string.h>

#include "variant.h"

bool instance_has_started(const struct content *content)
{
    return content->phase != INSTANTIATED && content->phase != INITIALIZING;
}

enum verdict instance_reset(struct instance *instance)
{
    const struct content empty = {
        .use = instance->now.use,
        .phase = INSTANTIATED,
        .stop_time = INFINITY,
        .unread = true,
        .unread_on_demand = true,
    };
    instance->now = empty;
    instance->last_step = FINE;
    instance->failed = false;
    instance->discarded = 0;
    for (unsigned i = 0; i < VARIABLE_COUNT; i++) {
        if (!VARIABLES[i].start_given)
            continue;
        if (VARIABLES[i].kind == REAL)
            instance->now.reals[i] = variant()->starts[i];
        else
            instance->now.integers[i] = (int32_t)variant()->starts[i];
    }
    instance_copy(instance->now.inputs, instance->now.reals, INPUTS, INPUT_COUNT);
    instance_copy(states_of(&instance->now), instance->now.reals, STATES, STATE_COUNT);
    return FINE;
}

enum verdict instance_start(struct instance *instance, enum use use, const struct services *services, bool logging)
{
    instance->now.use = use;
    instance->services = *services;
    instance->logged = logging ? ~0u : 1u << DISCARDED | 1u << REFUSED;
    instance->call = NO_CALL;
    instance->refusal = REFUSED;
    return variant_check(instance) == REFUSED ? REFUSED : instance_reset(instance);
}

static enum verdict check_tolerance(struct instance *instance, double tolerance)
{
    if (0.0 < tolerance && tolerance < INFINITY)
        return FINE;
    return instance_say(instance, REFUSED, "tolerance = %r: must be a finite number greater than 0", tolerance);
}

enum verdict instance_set_up(struct instance *instance, double start_time, bool tolerance_given, double tolerance,
                             double stop_time)
{
    if (!isfinite(start_time))
        return instance_say(instance, REFUSED, "startTime = %r s: must be a finite number", start_time);
    if (tolerance_given && check_tolerance(instance, tolerance) == REFUSED)
        return REFUSED;
    if (!(stop_time >= start_time))
        return instance_say(instance, REFUSED, "stopTime = %r s: must not be before startTime = %r s", stop_time,
                            start_time);
    instance->now.time = instance->now.completed = instance->now.start_time = start_time;
    instance->now.stop_time = stop_time;
    instance->now.hosts_tolerance = tolerance_given ? tolerance : 0.0;
    return FINE;
}

enum verdict instance_initialize(struct instance *instance)
{
    instance->now.phase = INITIALIZING;
    return FINE;
}

void instance_copy(void *into, const double *reals, const unsigned *references, unsigned n)
{
    for (unsigned i = 0; i < n; i++)
        memcpy((char *)into + i * sizeof(double), &reals[references[i]], sizeof(double));
}

void instance_spread(double *reals, const void *from, const unsigned *references, unsigned n)
{
    for (unsigned i = 0; i < n; i++)
        memcpy(&reals[references[i]], (const char *)from + i * sizeof(double), sizeof(double));
}

enum verdict instance_choose(struct instance *instance, unsigned enumeration, int32_t *item)
{
    const int32_t *integers = instance->now.integers;
    unsigned i = 0;
    while (CHOICES[i].enumeration != enumeration)
        i++;
    const unsigned beside = CHOICES[i].number;
    const int32_t said = integers[enumeration], number = integers[beside];
    if (number != 0 && number != said && said != (int32_t)variant()->starts[enumeration])
        return instance_say(instance, DISCARDED, "%s = %i and %s = %i: must be the same where both are set",
                            VARIABLES[enumeration].name, (long long)said, VARIABLES[beside].name, (long long)number);
    *item = number != 0 ? number : said;
    return FINE;
}

static enum verdict take_up_start_values(struct instance *instance)
{
    struct content *now = &instance->now;
    if (model()->take_up(instance) == REFUSED)
        return REFUSED;
    now->tuned = false;
    now->unread = now->unread_on_demand = true;
    return FINE;
}

enum verdict instance_take_up(struct instance *instance)
{
    struct content *now = &instance->now;
    if (!instance_has_started(now))
        return take_up_start_values(instance);
    if (now->use != MODEL_EXCHANGE)
        return FINE;
    if (model()->follow(instance) == REFUSED)
        return REFUSED;
    now->tuned = false;
    return FINE;
}

enum verdict instance_go(struct instance *instance)
{
    if (take_up_start_values(instance) == REFUSED)
        return REFUSED;
    instance->now.phase = instance->now.use == MODEL_EXCHANGE ? EVENT_MODE : STEPPING;
    return FINE;
}

enum verdict instance_terminate(struct instance *instance)
{
    instance->now.phase = TERMINATED;
    return FINE;
}

enum verdict instance_restore(struct instance *instance, const struct content *content)
{
    const bool exchange = content->use == MODEL_EXCHANGE;
    if (exchange != (instance->now.use == MODEL_EXCHANGE))
        return instance_say(instance, REFUSED, "FMU state of an instance for %s: must be that of one for %s",
                            exchange ? "model exchange" : "co-simulation",
                            exchange ? "co-simulation" : "model exchange");
    instance->now = *content;
    instance->last_step = FINE;
    instance->failed = false;
    return FINE;
}

enum verdict instance_keep(struct instance *instance, enum call call, const struct content *content, void **state)
{
    const struct services *services = &instance->services;
    const bool inside = instance_go_out(instance);
    if (!*state)
        *state = services->allocate(services->sink, sizeof *content);
    instance_come_back(instance, inside);
    if (!*state)
        return instance_say(instance, REFUSED, "%s: no memory", call_name(instance, call));
    *(struct content *)*state = *content;
    return FINE;
}

enum verdict instance_save(struct instance *instance, void **state)
{
    return instance_keep(instance, GET_FMU_STATE, &instance->now, state);
}

enum verdict instance_forget(struct instance *instance, void **state)
{
    const bool inside = instance_go_out(instance);
    if (state && *state) {
        instance->services.release(instance->services.sink, *state);
        *state = NULL;
    }
    instance_come_back(instance, inside);
    return FINE;
}
