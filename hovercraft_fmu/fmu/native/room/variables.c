#include "instance.h"

#include <math.h>
#include <string.h>

enum verdict instance_check_finite(struct instance *instance, const unsigned *references, unsigned n)
{
    for (unsigned i = 0; i < n; i++)
        if (!isfinite(instance->now.reals[references[i]]))
            return instance_say(instance, DISCARDED, "%s = %r: must be a finite number; the motion is out of range",
                                VARIABLES[references[i]].name, instance->now.reals[references[i]]);
    return FINE;
}

enum verdict instance_observe(struct instance *instance)
{
    struct content *now = &instance->now;
    if (!now->unread)
        return FINE;
    if (instance_take_up(instance) == REFUSED || model()->observe(instance) == REFUSED)
        return REFUSED;
    instance_spread(now->reals, states_of(now), STATES, STATE_COUNT);
    now->unread = false;
    return FINE;
}

enum verdict instance_observe_on_demand(struct instance *instance)
{
    struct content *now = &instance->now;
    if (!now->unread_on_demand)
        return FINE;
    if (model()->observe_on_demand(instance) == REFUSED)
        return REFUSED;
    now->unread_on_demand = false;
    return FINE;
}

enum verdict instance_no_such(struct instance *instance, const char *kind, unsigned reference)
{
    return instance_say(instance, REFUSED, "value reference %u: must be that of a variable of type %s",
                        (unsigned long long)reference, kind);
}

enum verdict instance_none_of(struct instance *instance, const char *name, const char *kind,
                              const unsigned *references, size_t n)
{
    if (!permitted_always(instance, name, n == 0 || references))
        return REFUSED;
    return n == 0 ? FINE : instance_no_such(instance, kind, references[0]);
}

static bool is_real(unsigned reference)
{
    return reference < VARIABLE_COUNT && VARIABLES[reference].kind == REAL;
}

/* Whether it is of that kind; to get and to set an Enumeration is an Integer, too. */
static bool is_of(enum kind kind, unsigned reference)
{
    if (reference >= VARIABLE_COUNT)
        return false;
    const enum kind own = VARIABLES[reference].kind;
    return own == kind || (kind == INTEGER && own == ENUMERATION);
}

static enum verdict no_such_integer(struct instance *instance, enum kind kind, unsigned reference)
{
    return instance_no_such(instance, kind == BOOLEAN ? "Boolean" : "Integer or Enumeration", reference);
}

enum verdict instance_get_reals(struct instance *instance, const unsigned *references, size_t n, double *values)
{
    if (instance_observe(instance) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n; i++) {
        if (!is_real(references[i]))
            return instance_no_such(instance, "Real", references[i]);
        if (instance->now.unread_on_demand && VARIABLES[references[i]].on_demand &&
            instance_observe_on_demand(instance) == REFUSED)
            return REFUSED;
    }
    for (size_t i = 0; i < n; i++)
        values[i] = instance->now.reals[references[i]];
    return FINE;
}

enum verdict instance_get_integers(struct instance *instance, enum kind kind, const unsigned *references, size_t n,
                                   int *values)
{
    if (model()->discrete_is_worked_out && instance_observe(instance) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n; i++)
        if (!is_of(kind, references[i]))
            return no_such_integer(instance, kind, references[i]);
    for (size_t i = 0; i < n; i++)
        values[i] = instance->now.integers[references[i]];
    return FINE;
}

/* NULL where the value can be, else why not. */
static const char *broken_rule(const struct rule *rule, double value)
{
    const bool is_inside = (rule->open ? rule->low < value : rule->low <= value) && value <= rule->high;
    return is_inside ? NULL : rule->why;
}

/* A state is set in model exchange as SetContinuousStates does it: in FMI 3.0 in event mode too. */
static bool is_settable(const struct instance *instance, const struct variable *variable)
{
    const enum phase phase = instance->now.phase;
    const bool solved = phase == CONTINUOUS_TIME || (phase == EVENT_MODE && instance->services.fmi == 3);
    const unsigned reference = (unsigned)(variable - VARIABLES);
    return variable->settable >> phase & 1u ||
           (solved && is_among(STATES, STATE_COUNT, reference));
}

enum verdict instance_check_settable(struct instance *instance, const struct variable *variable, double value)
{
    if (is_settable(instance, variable))
        return FINE;
    return instance_say(instance, REFUSED, "%s = %r: must not be set in state '%s' (%s)", variable->name, value,
                        PHASE_NAMES[instance->now.phase], variable->role);
}

const char *instance_why_not(const struct content *content, const struct variable *variable, double value)
{
    const unsigned reference = (unsigned)(variable - VARIABLES);
    const char *why = model()->why_not ? model()->why_not(content, reference, value) : NULL;
    return why ? why : broken_rule(&variable->rule, value);
}

static enum verdict check_real(struct instance *instance, const struct variable *variable, double value)
{
    if (instance_check_settable(instance, variable, value) == REFUSED)
        return REFUSED;
    if (!isfinite(value))
        return instance_say(instance, DISCARDED, "%s = %r: must be a finite number", variable->name, value);
    const char *why = instance_why_not(&instance->now, variable, value);
    if (why)
        return instance_say(instance, DISCARDED, "%s = %r%s: %s", variable->name, value, variable->rule.unit, why);
    return FINE;
}

/* What is read belongs to the communication point: in step mode it changes with the next step, not now. */
static void after_set(struct instance *instance, bool parameter)
{
    instance->now.tuned = instance->now.tuned || parameter;
    if (instance->now.phase != STEPPING && instance->now.phase != INTERMEDIATE_UPDATE)
        instance->now.unread = instance->now.unread_on_demand = true;
}

unsigned instance_place(const unsigned *references, unsigned n, unsigned reference)
{
    unsigned i = 0;
    while (i < n && references[i] != reference)
        i++;
    return i;
}

/* A ramp of before ends; one that was set at this communication point stays, so that the order does not matter. */
static void set_input(struct content *now, unsigned input, double value)
{
    now->inputs[input] = value;
    if (!(now->rated >> input & 1))
        now->rates[input] = 0.0;
}

enum verdict instance_set_reals(struct instance *instance, const unsigned *references, size_t n, const double *values)
{
    bool parameter = false;
    for (size_t i = 0; i < n; i++) { /* all are checked before one is set */
        if (!is_real(references[i]))
            return instance_no_such(instance, "Real", references[i]);
        if (check_real(instance, &VARIABLES[references[i]], values[i]) == REFUSED)
            return REFUSED;
    }
    for (size_t i = 0; i < n; i++) {
        const unsigned input = instance_place(INPUTS, INPUT_COUNT, references[i]);
        instance->now.reals[references[i]] = values[i];
        if (input < INPUT_COUNT)
            set_input(&instance->now, input, values[i]);
        else if (is_among(STATES, STATE_COUNT, references[i]))
            states_of(&instance->now)[instance_place(STATES, STATE_COUNT, references[i])] = values[i];
        else
            parameter = true;
    }
    if (n > 0)
        after_set(instance, parameter);
    return FINE;
}

/* What can be set are small numbers. */
static enum verdict check_integer(struct instance *instance, const struct variable *variable, int64_t value)
{
    if (variable->kind == BOOLEAN) /* no model has one that can be set */
        return instance_say(instance, REFUSED, "%s = %s: must not be set in state '%s' (%s)", variable->name,
                            value ? "True" : "False", PHASE_NAMES[instance->now.phase], variable->role);
    if (!is_settable(instance, variable))
        return instance_say(instance, REFUSED, "%s = %i: must not be set in state '%s' (%s)", variable->name,
                            (long long)value, PHASE_NAMES[instance->now.phase], variable->role);
    const char *why = instance_why_not(&instance->now, variable, (double)value);
    return why ? instance_say(instance, DISCARDED, "%s = %i: %s", variable->name, (long long)value, why) : FINE;
}

enum verdict instance_check_start(struct instance *instance, unsigned reference, double value)
{
    const struct variable *variable = &VARIABLES[reference];
    if (variable->kind == REAL)
        return check_real(instance, variable, value);
    if (!(fabs(value) <= INT32_MAX) || value != (double)(int32_t)value)
        return instance_say(instance, REFUSED, "%s = %r: must be a whole number", variable->name, value);
    return check_integer(instance, variable, (int32_t)value);
}

enum verdict instance_set_integers(struct instance *instance, enum kind kind, const unsigned *references, size_t n,
                                   const int *values)
{
    for (size_t i = 0; i < n; i++) {
        if (!is_of(kind, references[i]))
            return no_such_integer(instance, kind, references[i]);
        if (check_integer(instance, &VARIABLES[references[i]], values[i]) == REFUSED)
            return REFUSED;
    }
    for (size_t i = 0; i < n; i++)
        instance->now.integers[references[i]] = values[i];
    if (n > 0)
        after_set(instance, true);
    return FINE;
}

enum verdict instance_get_enumerations(struct instance *instance, const unsigned *references, size_t n,
                                       int64_t *values)
{
    for (size_t i = 0; i < n; i++)
        values[i] = instance->now.integers[references[i]]; /* no model works one out */
    return FINE;
}

enum verdict instance_set_enumerations(struct instance *instance, const unsigned *references, size_t n,
                                       const int64_t *values)
{
    for (size_t i = 0; i < n; i++)
        if (check_integer(instance, &VARIABLES[references[i]], values[i]) == REFUSED)
            return REFUSED;
    for (size_t i = 0; i < n; i++) {
        const int value = (int)values[i];
        instance_set_integers(instance, ENUMERATION, &references[i], 1, &value);
    }
    return FINE;
}

enum verdict instance_get_booleans(struct instance *instance, const unsigned *references, size_t n, bool *values)
{
    for (size_t i = 0; i < n; i++) {
        int value = 0;
        if (instance_get_integers(instance, BOOLEAN, &references[i], 1, &value) == REFUSED)
            return REFUSED;
        values[i] = value != 0;
    }
    return FINE;
}

enum verdict instance_set_booleans(struct instance *instance, const unsigned *references, size_t n, const bool *values)
{
    return n == 0 ? FINE : check_integer(instance, &VARIABLES[references[0]], values[0]); /* which refuses it */
}
