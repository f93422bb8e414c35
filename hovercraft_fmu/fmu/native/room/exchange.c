#include "instance.h"
#include "rounding.h"

#include <math.h>

/* ---- phases */

enum verdict instance_enter_event_mode(struct instance *instance)
{
    instance->now.phase = EVENT_MODE;
    return FINE;
}

/* Parameters that contradict one another are refused here at the latest. */
enum verdict instance_enter_continuous_time(struct instance *instance)
{
    if (instance_take_up(instance) == REFUSED)
        return REFUSED;
    instance->now.phase = CONTINUOUS_TIME;
    return FINE;
}

enum verdict instance_update_discrete_states(struct instance *instance)
{
    if (instance_take_up(instance) == REFUSED)
        return REFUSED;
    return model()->warn(instance);
}

/* A solver may look ahead of the stop time, and comes back from there; a step that it has completed stands. */
enum verdict instance_complete_integrator_step(struct instance *instance, bool *event_needed)
{
    const double time = instance->now.time, stop_time = instance->now.stop_time;
    const double start_time = instance->now.start_time, step = time - instance->now.completed;
    const double largest = larger(fabs(time), fabs(start_time));
    if (step > 0.0 && time - stop_time > time_rounding(largest, step, (time - start_time) / step))
        return instance_say(instance, REFUSED, "%s at %r s: must not lead past stopTime = %r s",
                            call_name(instance, COMPLETE_INTEGRATOR_STEP), time, stop_time);
    if (instance_take_up(instance) == REFUSED)
        return REFUSED;
    instance->now.completed = time;
    *event_needed = model()->has_to_warn(instance);
    return FINE;
}

/* ---- time, states, derivatives */

enum verdict instance_set_time(struct instance *instance, double time)
{
    const double start_time = instance->now.start_time;
    if (!isfinite(time))
        return instance_say(instance, REFUSED, "time = %r s: must be a finite number", time);
    if (start_time - time > time_rounding(fabs(start_time), INFINITY, 0.0))
        return instance_say(instance, REFUSED, "time = %r s: must not be before startTime = %r s", time, start_time);
    instance->now.time = time;
    return FINE;
}

static enum verdict check_number(struct instance *instance, enum call call, size_t n)
{
    if (n == STATE_COUNT)
        return FINE;
    return instance_say(instance, REFUSED, "%s: %u values: must be %u, one for each state", call_name(instance, call),
                        (unsigned long long)n, (unsigned long long)STATE_COUNT);
}

enum verdict instance_set_states(struct instance *instance, const double *values, size_t n)
{
    struct content *now = &instance->now;
    if (check_number(instance, SET_STATES, n) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n; i++)
        if (!isfinite(values[i]))
            return instance_say(instance, DISCARDED, "%s = %r: must be a finite number", VARIABLES[STATES[i]].name,
                                values[i]);
    for (size_t i = 0; i < n; i++)
        states_of(now)[i] = values[i];
    now->unread = now->unread_on_demand = true;
    return FINE;
}

enum verdict instance_get_states(struct instance *instance, double *values, size_t n)
{
    if (check_number(instance, GET_STATES, n) == REFUSED)
        return REFUSED;
    return instance_get_reals(instance, STATES, n, values);
}

enum verdict instance_get_derivatives(struct instance *instance, double *values, size_t n)
{
    if (check_number(instance, GET_DERIVATIVES, n) == REFUSED)
        return REFUSED;
    return instance_get_reals(instance, DERIVATIVES, n, values);
}

enum verdict instance_get_nominals(struct instance *instance, double *values, size_t n)
{
    if (check_number(instance, GET_NOMINALS, n) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n; i++)
        values[i] = NOMINALS[i];
    return FINE;
}

enum verdict instance_get_event_indicators(struct instance *instance, size_t n)
{
    if (n == 0)
        return FINE;
    return instance_say(instance, REFUSED, "%s: %u values: must be 0; there are no event indicators",
                        call_name(instance, GET_EVENT_INDICATORS), (unsigned long long)n);
}
