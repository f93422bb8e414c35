#include "instance.h"

#include <math.h>

/* Where a reference is in a list, or its length. */
static unsigned place_in(const unsigned *list, unsigned n, unsigned reference)
{
    unsigned i = 0;
    while (i < n && list[i] != reference)
        i++;
    return i;
}

/* The standard's knowns: in initialization mode the inputs, and every Real that is given exactly: states, parameters;
   later the inputs and the states. */
static bool is_known(enum phase phase, unsigned reference)
{
    if (phase == INITIALIZING)
        return reference < VARIABLE_COUNT && VARIABLES[reference].kind == REAL && VARIABLES[reference].start_given;
    return place_in(KNOWNS, KNOWN_COUNT, reference) < KNOWN_COUNT;
}

/* And its unknowns: in initialization mode those that are calculated then; later states and their derivatives, and what
   else is an output. */
static bool is_unknown(enum phase phase, unsigned reference)
{
    if (phase == INITIALIZING)
        return place_in(ROWS, ROW_COUNT, reference) < ROW_COUNT;
    return place_in(STATES, STATE_COUNT, reference) < STATE_COUNT ||
           place_in(DERIVATIVES, STATE_COUNT, reference) < STATE_COUNT ||
           place_in(MOTION, MOTION_COUNT, reference) < MOTION_COUNT;
}

static enum verdict refuse(struct instance *instance, const char *call, unsigned reference, const char *what,
                           const char *rule)
{
    if (reference < VARIABLE_COUNT)
        return instance_say(instance, REFUSED, "%s: %s %s: %s", call, what, VARIABLES[reference].name, rule);
    return instance_say(instance, REFUSED, "%s: %s with value reference %u: %s", call, what,
                        (unsigned long long)reference, rule);
}

static enum verdict check_references(struct instance *instance, const char *call, const unsigned *unknowns,
                                     size_t n_unknowns, const unsigned *knowns, size_t n_knowns)
{
    const enum phase phase = instance->now.phase;
    const bool initial = phase == INITIALIZING;
    for (size_t i = 0; i < n_unknowns; i++)
        if (!is_unknown(phase, unknowns[i]))
            return refuse(instance, call, unknowns[i], "unknown",
                          initial ? "must be one of the initial unknowns in initialization mode"
                                  : "must be an output or the derivative of a state after initialization mode");
    for (size_t k = 0; k < n_knowns; k++)
        if (!is_known(phase, knowns[k]))
            return refuse(instance, call, knowns[k], "known",
                          initial ? "must be a state, an input or a real parameter in initialization mode"
                                  : "must be a state or an input after initialization mode");
    return FINE;
}

/* Whether one of them is the derivative of a velocity. */
static bool is_accelerated(const unsigned *unknowns, size_t n_unknowns)
{
    for (size_t i = 0; i < n_unknowns; i++) {
        const unsigned row = place_in(ROWS, ROW_COUNT, unknowns[i]);
        if (row >= ACCELERATION_X && row <= ACCELERATION_YAW)
            return true;
    }
    return false;
}

static bool is_held(const struct content *content)
{
    const struct state *s = &content->state;
    return content->craft.skirt_friction != 0.0 && s->vx == 0.0 && s->vy == 0.0 && s->yaw_rate == 0.0;
}

double instance_partial(const struct linearization *linearization, unsigned unknown, unsigned known)
{
    const unsigned row = place_in(ROWS, ROW_COUNT, unknown);
    const unsigned column = place_in(KNOWNS, INITIAL_KNOWN_COUNT, known);
    if (row < ROW_COUNT && column < INITIAL_KNOWN_COUNT)
        return linearization->of[row][column];
    return unknown == known ? 1.0 : 0.0; /* of states, or velocities; nothing else follows a parameter of the steps */
}

enum verdict instance_linearize(struct instance *instance, const char *call, const unsigned *unknowns,
                                size_t n_unknowns, const unsigned *knowns, size_t n_knowns,
                                struct linearization *linearization)
{
    const struct content *now = &instance->now;
    if (now->phase == INSTANTIATED)
        return instance_require(instance, call, INITIALIZING);
    if (check_references(instance, call, unknowns, n_unknowns, knowns, n_knowns) == REFUSED ||
        instance_get_reals(instance, NULL, 0, NULL) == REFUSED) /* all is up to date after that */
        return REFUSED;
    if (is_held(now) && is_accelerated(unknowns, n_unknowns))
        return instance_say(instance, REFUSED, "%s: the craft is at rest on ground that rubs: it must slide to have "
                                               "partial derivatives", call);
    kernel_linearize(&now->state, &now->controls, &now->craft, now->phase == INITIALIZING, linearization);
    for (size_t i = 0; i < n_unknowns; i++)
        for (size_t k = 0; k < n_knowns; k++) {
            const double value = instance_partial(linearization, unknowns[i], knowns[k]);
            if (!isfinite(value))
                return instance_say(instance, REFUSED,
                                    "derivative of %s with respect to %s = %r: must be a finite number; the motion is "
                                    "out of range",
                                    VARIABLES[unknowns[i]].name, VARIABLES[knowns[k]].name, value);
        }
    return FINE;
}

static double product(const struct linearization *linearization, unsigned unknown, const unsigned *knowns,
                      size_t n_knowns, const double *seeds)
{
    double sum = 0.0;
    for (size_t k = 0; k < n_knowns; k++)
        sum += instance_partial(linearization, unknown, knowns[k]) * seeds[k];
    return sum;
}

enum verdict instance_directional_derivatives(struct instance *instance, const char *call, const unsigned *unknowns,
                                              size_t n_unknowns, const unsigned *knowns, size_t n_knowns,
                                              const double *seeds, double *values)
{
    struct linearization linearization;
    if (instance_linearize(instance, call, unknowns, n_unknowns, knowns, n_knowns, &linearization) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n_unknowns; i++) {
        const double value = product(&linearization, unknowns[i], knowns, n_knowns, seeds);
        if (!isfinite(value)) /* so are those with a seed that is none */
            return instance_say(instance, REFUSED, "directional derivative of %s = %r: must be a finite number",
                                VARIABLES[unknowns[i]].name, value);
    }
    for (size_t i = 0; i < n_unknowns; i++)
        values[i] = product(&linearization, unknowns[i], knowns, n_knowns, seeds);
    return FINE;
}
