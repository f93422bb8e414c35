#include "instance.h"

#include <math.h>

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

enum verdict instance_get_rates(struct instance *instance, const unsigned *references, size_t n, const int *orders,
                                double *values)
{
    double rate;
    if (instance_observe(instance) == REFUSED || instance_observe_on_demand(instance) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n; i++) {
        if (!model()->output_rate(instance->now.reals, references[i], &rate))
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
        model()->output_rate(instance->now.reals, references[i], &values[i]);
        if (orders[i] > 1)
            values[i] = 0.0;
    }
    return FINE;
}
