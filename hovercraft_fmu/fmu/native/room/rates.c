#include "instance.h"

#include <math.h>

#include "root.h"

/* Derivatives of a higher order are there where they are 0. */
static enum verdict check_order(struct instance *instance, unsigned reference, int order, double value)
{
    if (order == 1 || (order > 1 && value == 0.0))
        return FINE;
    return instance_say(instance, REFUSED, "order = %i of the derivative of %s: must be 1", (long long)order,
                        VARIABLES[reference].name);
}

enum verdict instance_set_rates(struct instance *instance, const unsigned *references, size_t n, const int *orders,
                                const double *values)
{
    for (size_t i = 0; i < n; i++) {
        if (instance_place(INPUTS, INPUT_COUNT, references[i]) == INPUT_COUNT)
            return instance_say(instance, REFUSED, "value reference %u: must be that of an input to have a derivative",
                                (unsigned long long)references[i]);
        const struct variable *variable = &VARIABLES[references[i]];
        if (instance_check_settable(instance, variable, values[i]) == REFUSED ||
            check_order(instance, references[i], orders[i], values[i]) == REFUSED)
            return REFUSED;
        if (!isfinite(values[i]))
            return instance_say(instance, DISCARDED, "derivative of %s = %r: must be a finite number", variable->name,
                                values[i]);
    }
    for (size_t i = 0; i < n; i++) {
        const unsigned input = instance_place(INPUTS, INPUT_COUNT, references[i]);
        if (orders[i] == 1) {
            instance->now.rates[input] = values[i];
            instance->now.rated |= 1 << input;
        }
    }
    return FINE;
}

/* The derivative of an output at the communication point, after instance_observe_motion and instance_observe_action. */
static bool output_rate(const double *reals, unsigned reference, double *rate)
{
    const double vx = reals[V_VELOCITY_X], vy = reals[V_VELOCITY_Y], r = reals[V_VELOCITY_YAW_RATE];
    const double ax = reals[V_ACCELERATION_X], ay = reals[V_ACCELERATION_Y], speed = reals[V_SPEED];
    const struct state acceleration = {.heading = reals[V_POSE_HEADING], .vx = ax, .vy = ay};
    double forward, sideways;
    switch (reference) {
    case V_POSE_X:
        *rate = vx;
        return true;
    case V_POSE_Y:
        *rate = vy;
        return true;
    case V_POSE_HEADING:
        *rate = r;
        return true;
    case V_VELOCITY_X:
        *rate = ax;
        return true;
    case V_VELOCITY_Y:
        *rate = ay;
        return true;
    case V_VELOCITY_YAW_RATE:
        *rate = reals[V_ACCELERATION_YAW];
        return true;
    case V_BODY_SURGE: /* the body frame turns: d(u)/dt = a_x + r*v, d(v)/dt = a_y - r*u */
        kernel_body_velocity(&acceleration, &forward, &sideways);
        *rate = forward + r * reals[V_BODY_SWAY];
        return true;
    case V_BODY_SWAY:
        kernel_body_velocity(&acceleration, &forward, &sideways);
        *rate = sideways - r * reals[V_BODY_SURGE];
        return true;
    case V_SPEED: /* at rest it can only grow */
        *rate = speed > 0.0 ? (vx / speed) * ax + (vy / speed) * ay : square_root(ax * ax + ay * ay);
        return true;
    default:
        return false;
    }
}

enum verdict instance_get_rates(struct instance *instance, const unsigned *references, size_t n, const int *orders,
                                double *values)
{
    double rate;
    if (instance_observe_motion(instance) == REFUSED || instance_observe_action(instance) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n; i++) {
        if (!output_rate(instance->now.reals, references[i], &rate))
            return instance_say(instance, REFUSED,
                                "value reference %u: must be that of a continuous output to have a derivative",
                                (unsigned long long)references[i]);
        if (check_order(instance, references[i], orders[i], 0.0) == REFUSED)
            return REFUSED;
        if (!isfinite(rate))
            return instance_say(instance, DISCARDED,
                                "derivative of %s = %r: must be a finite number; the motion is out of range",
                                VARIABLES[references[i]].name, rate);
    }
    for (size_t i = 0; i < n; i++) {
        output_rate(instance->now.reals, references[i], &values[i]);
        if (orders[i] > 1)
            values[i] = 0.0;
    }
    return FINE;
}
