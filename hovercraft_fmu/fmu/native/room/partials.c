#include "partials.h"

#include <math.h>

/* The standard's knowns: in initialization mode the inputs, and every Real that is given exactly: states, parameters;
   later the inputs and the states, and in FMI 3.0, where they can be set, the tunable parameters. */
static bool is_known(const struct instance *instance, unsigned reference)
{
    const enum phase phase = instance->now.phase;
    if (phase == INITIALIZING)
        return reference < VARIABLE_COUNT && VARIABLES[reference].kind == REAL && VARIABLES[reference].start_given;
    const unsigned place = instance_place(KNOWNS, INITIAL_KNOWN_COUNT, reference);
    if (place == INITIAL_KNOWN_COUNT)
        return false;
    return place < KNOWN_COUNT || (instance->services.fmi == 3 && VARIABLES[reference].settable >> phase & 1u);
}

/* What follows nothing at once: every derivative of it is 0. */
static bool is_flat(unsigned reference)
{
    return instance_place(FLAT, FLAT_COUNT, reference) < FLAT_COUNT;
}

/* And its unknowns: in initialization mode those that are calculated then; later states and their derivatives, and what
   else is an output. */
static bool is_unknown(enum phase phase, unsigned reference)
{
    if (phase == INITIALIZING)
        return instance_place(ROWS, ROW_COUNT, reference) < ROW_COUNT || is_flat(reference);
    return instance_place(STATES, STATE_COUNT, reference) < STATE_COUNT ||
           instance_place(DERIVATIVES, STATE_COUNT, reference) < STATE_COUNT ||
           instance_place(OUTPUTS, OUTPUT_COUNT, reference) < OUTPUT_COUNT || is_flat(reference);
}

static enum verdict refuse_reference(struct instance *instance, enum call call, unsigned reference, const char *what,
                           const char *rule)
{
    if (reference < VARIABLE_COUNT)
        return instance_say(instance, REFUSED, "%s: %s %s: %s", call_name(instance, call), what,
                            VARIABLES[reference].name, rule);
    return instance_say(instance, REFUSED, "%s: %s with value reference %u: %s", call_name(instance, call), what,
                        (unsigned long long)reference, rule);
}

static enum verdict check_references(struct instance *instance, enum call call, const unsigned *unknowns,
                                     size_t n_unknowns, const unsigned *knowns, size_t n_knowns)
{
    const enum phase phase = instance->now.phase;
    const bool initial = phase == INITIALIZING;
    for (size_t i = 0; i < n_unknowns; i++)
        if (!is_unknown(phase, unknowns[i]))
            return refuse_reference(instance, call, unknowns[i], "unknown",
                          initial ? "must be one of the initial unknowns in initialization mode"
                                  : "must be an output or the derivative of a state after initialization mode");
    for (size_t k = 0; k < n_knowns; k++)
        if (!is_known(instance, knowns[k]))
            return refuse_reference(instance, call, knowns[k], "known",
                          initial ? "must be a state, an input or a real parameter in initialization mode"
                                  : "must be a state or an input after initialization mode");
    return FINE;
}

/* d(unknown)/d(known), of references that were not refused. */
static double partial(const struct linearization *linearization, unsigned unknown, unsigned known)
{
    const unsigned row = instance_place(ROWS, ROW_COUNT, unknown);
    const unsigned column = instance_place(KNOWNS, INITIAL_KNOWN_COUNT, known);
    if (row < ROW_COUNT && column < INITIAL_KNOWN_COUNT)
        return linearization->of[row][column];
    return unknown == known ? 1.0 : 0.0; /* of states, or velocities */
}

static enum verdict linearized(struct instance *instance, enum call call, const unsigned *unknowns, size_t n_unknowns,
                            const unsigned *knowns, size_t n_knowns, struct linearization *linearization)
{
    if (check_references(instance, call, unknowns, n_unknowns, knowns, n_knowns) == REFUSED ||
        instance_get_reals(instance, NULL, 0, NULL) == REFUSED) /* all is up to date after that */
        return REFUSED;
    bool parameters = instance->now.phase == INITIALIZING;
    for (size_t k = 0; k < n_knowns; k++)
        parameters = parameters || instance_place(KNOWNS, KNOWN_COUNT, knowns[k]) == KNOWN_COUNT;
    if (model()->linearize(instance, call, unknowns, n_unknowns, parameters, linearization) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n_unknowns; i++)
        for (size_t k = 0; k < n_knowns; k++) {
            const double value = partial(linearization, unknowns[i], knowns[k]);
            if (!isfinite(value))
                return instance_say(instance, DISCARDED,
                                    "derivative of %s with respect to %s = %r: must be a finite number; the motion is "
                                    "out of range",
                                    VARIABLES[unknowns[i]].name, VARIABLES[knowns[k]].name, value);
        }
    return FINE;
}

/* The sum over the knowns of seeds[k] * d(unknown)/d(known k). */
static double directional(const struct linearization *linearization, unsigned unknown, const unsigned *knowns,
                      size_t n_knowns, const double *seeds)
{
    double sum = 0.0;
    for (size_t k = 0; k < n_knowns; k++)
        sum += partial(linearization, unknown, knowns[k]) * seeds[k];
    return sum;
}

enum verdict instance_directional_derivatives(struct instance *instance, const unsigned *unknowns,
                                              size_t n_unknowns, const unsigned *knowns, size_t n_knowns,
                                              const double *seeds, double *values)
{
    struct linearization linearization;
    if (linearized(instance, DIRECTIONAL_DERIVATIVE, unknowns, n_unknowns, knowns, n_knowns, &linearization) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n_unknowns; i++) {
        const double value = directional(&linearization, unknowns[i], knowns, n_knowns, seeds);
        if (!isfinite(value)) /* so are those with a seed that is none */
            return instance_say(instance, DISCARDED, "directional derivative of %s = %r: must be a finite number",
                                VARIABLES[unknowns[i]].name, value);
    }
    for (size_t i = 0; i < n_unknowns; i++)
        values[i] = directional(&linearization, unknowns[i], knowns, n_knowns, seeds);
    return FINE;
}

/* The sum over the unknowns of seeds[i] * d(unknown i)/d(known). */
static double adjoint(const struct linearization *linearization, const unsigned *unknowns, size_t n_unknowns,
                      unsigned known, const double *seeds)
{
    double sum = 0.0;
    for (size_t i = 0; i < n_unknowns; i++)
        sum += seeds[i] * partial(linearization, unknowns[i], known);
    return sum;
}

enum verdict instance_adjoint_derivatives(struct instance *instance, const unsigned *unknowns, size_t n_unknowns,
                                          const unsigned *knowns, size_t n_knowns, const double *seeds, double *values)
{
    struct linearization linearization;
    if (linearized(instance, ADJOINT_DERIVATIVE, unknowns, n_unknowns, knowns, n_knowns, &linearization) == REFUSED)
        return REFUSED;
    for (size_t k = 0; k < n_knowns; k++) {
        const double value = adjoint(&linearization, unknowns, n_unknowns, knowns[k], seeds);
        if (!isfinite(value)) /* so are those with a seed that is none */
            return instance_say(instance, DISCARDED, "adjoint derivative of %s = %r: must be a finite number",
                                VARIABLES[knowns[k]].name, value);
    }
    for (size_t k = 0; k < n_knowns; k++)
        values[k] = adjoint(&linearization, unknowns, n_unknowns, knowns[k], seeds);
    return FINE;
}
