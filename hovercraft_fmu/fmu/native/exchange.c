#include "instance.h"

#include <math.h>

/* ---- phases */

enum verdict instance_enter_event_mode(struct instance *instance, const char *call)
{
    if (instance_require_either(instance, call, EVENT_MODE, CONTINUOUS_TIME) == REFUSED)
        return REFUSED;
    instance->now.phase = EVENT_MODE;
    return FINE;
}

/* Parameters that contradict one another are refused here at the latest. */
enum verdict instance_enter_continuous_time(struct instance *instance, const char *call)
{
    if (instance_require(instance, call, EVENT_MODE) == REFUSED || instance_take_up(instance) == REFUSED)
        return REFUSED;
    instance->now.phase = CONTINUOUS_TIME;
    return FINE;
}

enum verdict instance_new_discrete_states(struct instance *instance, const char *call)
{
    if (instance_require(instance, call, EVENT_MODE) == REFUSED || instance_take_up(instance) == REFUSED)
        return REFUSED;
    return instance_warn_of_held_inputs(instance, &instance->now.controls);
}

/* A solver may look ahead of the stop time, and comes back from there; a step that it has completed stands. */
enum verdict instance_completed_integrator_step(struct instance *instance, const char *call, bool *event_needed)
{
    const double time = instance->now.time, stop_time = instance->now.stop_time;
    if (instance_require(instance, call, CONTINUOUS_TIME) == REFUSED)
        return REFUSED;
    if (time - stop_time > SAME_TIME * larger(1.0, fabs(stop_time)))
        return instance_say(instance, REFUSED, "%s at %r s: must not lead past stopTime = %r s", call, time, stop_time);
    if (instance_take_up(instance) == REFUSED)
        return REFUSED;
    *event_needed = instance_has_to_warn(instance);
    return FINE;
}

/* ---- time, states, derivatives */

enum verdict instance_set_time(struct instance *instance, const char *call, double time)
{
    if (instance_require_either(instance, call, EVENT_MODE, CONTINUOUS_TIME) == REFUSED)
        return REFUSED;
    if (!isfinite(time))
        return instance_say(instance, REFUSED, "time = %r s: must be a finite number", time);
    instance->now.time = time;
    return FINE;
}

static enum verdict check_array(struct instance *instance, const char *call, const double *values, size_t n)
{
    if (!values)
        return instance_say(instance, REFUSED, "%s: no argument must be NULL", call);
    if (n == STATE_COUNT)
        return FINE;
    return instance_say(instance, REFUSED, "%s: %u values: must be %u, one for each state", call,
                        (unsigned long long)n, (unsigned long long)STATE_COUNT);
}

enum verdict instance_set_states(struct instance *instance, const char *call, const double *values, size_t n)
{
    struct content *now = &instance->now;
    if (check_array(instance, call, values, n) == REFUSED ||
        instance_require(instance, call, CONTINUOUS_TIME) == REFUSED)
        return REFUSED;
    for (unsigned i = 0; i < STATE_COUNT; i++)
        if (!isfinite(values[i]))
            return instance_say(instance, REFUSED, "%s = %r: must be a finite number", VARIABLES[STATES[i]].name,
                                values[i]);
    now->state = (struct state){values[0], values[1], values[2], values[3], values[4], values[5]};
    now->motion_unread = now->action_unread = true;
    return FINE;
}

/* Of an instance for model exchange that is past 'instantiated'. */
static enum verdict get(struct instance *instance, const char *call, const unsigned *references, double *values,
                        size_t n)
{
    if (check_array(instance, call, values, n) == REFUSED ||
        instance_require_use(instance, call, MODEL_EXCHANGE) == REFUSED)
        return REFUSED;
    if (instance->now.phase == INSTANTIATED)
        return instance_require(instance, call, INITIALIZING);
    return instance_get_reals(instance, references, n, values);
}

enum verdict instance_get_states(struct instance *instance, const char *call, double *values, size_t n)
{
    return get(instance, call, STATES, values, n);
}

enum verdict instance_get_derivatives(struct instance *instance, const char *call, double *values, size_t n)
{
    return get(instance, call, DERIVATIVES, values, n);
}

enum verdict instance_get_nominals(struct instance *instance, const char *call, double *values, size_t n)
{
    if (check_array(instance, call, values, n) == REFUSED ||
        instance_require_use(instance, call, MODEL_EXCHANGE) == REFUSED)
        return REFUSED;
    for (unsigned i = 0; i < STATE_COUNT; i++)
        values[i] = NOMINALS[i];
    return FINE;
}
