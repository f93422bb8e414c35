#include "instance.h"

#include <math.h>
#include <string.h>

#include "root.h"

static enum verdict check_finite(struct instance *instance, const unsigned *references, unsigned n)
{
    for (unsigned i = 0; i < n; i++)
        if (!isfinite(instance->now.reals[references[i]]))
            return instance_say(instance, DISCARDED, "%s = %r: must be a finite number; the motion is out of range",
                                VARIABLES[references[i]].name, instance->now.reals[references[i]]);
    return FINE;
}

enum verdict instance_observe_motion(struct instance *instance)
{
    struct content *now = &instance->now;
    double *reals = now->reals;
    if (!now->motion_unread)
        return FINE;
    if (instance_take_up(instance) == REFUSED)
        return REFUSED;
    const struct state *s = &now->state;
    kernel_body_velocity(s, &reals[V_BODY_SURGE], &reals[V_BODY_SWAY]);
    reals[V_SPEED] = square_root(s->vx * s->vx + s->vy * s->vy);
    if (check_finite(instance, MOTION, MOTION_COUNT) == REFUSED)
        return REFUSED;
    instance_spread(reals, s, STATES, STATE_COUNT);
    const struct error error = instance_error(now);
    reals[V_ERROR_POSITION] = error.position;
    reals[V_ERROR_HEADING] = error.heading;
    now->motion_unread = false;
    return FINE;
}

enum verdict instance_observe_action(struct instance *instance)
{
    struct content *now = &instance->now;
    double *reals = now->reals;
    if (!now->action_unread)
        return FINE;
    const struct loads loads = kernel_loads_on(&now->state, &now->controls, &now->craft);
    reals[V_FORCE_X] = loads.x;
    reals[V_FORCE_Y] = loads.y;
    reals[V_MOMENT] = loads.moment;
    reals[V_ACCELERATION_X] = loads.x / now->craft.mass;
    reals[V_ACCELERATION_Y] = loads.y / now->craft.mass;
    reals[V_ACCELERATION_YAW] = loads.moment / now->craft.inertia;
    reals[V_APPLIED_THRUST] = kernel_saturate(&now->controls, &now->craft).thrust;
    reals[V_APPLIED_STEERING] = kernel_steering(&now->controls, &now->craft);
    reals[V_STABILITY_NUMBER] = now->stability;
    reals[V_ROTATION_PER_SUBSTEP] = now->rotation;
    if (check_finite(instance, ACTION, ACTION_COUNT) == REFUSED)
        return REFUSED;
    now->action_unread = false;
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

static bool is_integer(unsigned reference)
{
    return reference < VARIABLE_COUNT && VARIABLES[reference].kind != REAL;
}

/* Whether a variable is among ACTION or WATCHED. */
static bool is_action(unsigned reference)
{
    return instance_place(ACTION, ACTION_COUNT, reference) < ACTION_COUNT ||
           instance_place(WATCHED, WATCHED_COUNT, reference) < WATCHED_COUNT;
}

enum verdict instance_get_reals(struct instance *instance, const unsigned *references, size_t n, double *values)
{
    if (instance_observe_motion(instance) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n; i++) {
        if (!is_real(references[i]))
            return instance_no_such(instance, "Real", references[i]);
        if (instance->now.action_unread && is_action(references[i]) && instance_observe_action(instance) == REFUSED)
            return REFUSED;
    }
    for (size_t i = 0; i < n; i++)
        values[i] = instance->now.reals[references[i]];
    return FINE;
}

enum verdict instance_get_integers(struct instance *instance, const unsigned *references, size_t n, int *values)
{
    for (size_t i = 0; i < n; i++)
        if (!is_integer(references[i]))
            return instance_no_such(instance, "Integer or Enumeration", references[i]);
    for (size_t i = 0; i < n; i++)
        values[i] = instance->now.integers[references[i]];
    return FINE;
}

/* NULL where the value can be, else why not. */
static const char *broken_rule(enum rule rule, double value)
{
    switch (rule) {
    case POSITIVE:
        return value > 0.0 ? NULL : "must be greater than 0";
    case NOT_NEGATIVE:
        return value < 0.0 ? "must not be negative" : NULL;
    case FRACTION:
        return -0.5 <= value && value <= 0.5 ? NULL : "must be from -0.5 (stern) to 0.5 (bow)";
    case STEP_SIZE_RULE:
    case TOLERANCE_RULE:
        return value > 0.0 ? NULL : "must be a finite number greater than 0";
    case SHARE:
        return 0.0 <= value && value <= 1.0 ? NULL : "must be from 0 (off) to 1 (the whole moment)";
    case INTEGRATOR_RULE:
        return 1.0 <= value && value <= INTEGRATOR_COUNT ? NULL : "must be one of " INTEGRATOR_LIST;
    case DRAG_AREA_RULE:
        return 1.0 <= value && value <= DRAG_AREA_COUNT ? NULL : "must be one of " DRAG_AREA_LIST;
    case INTEGRATOR_NUMBER_RULE:
        return 0.0 <= value && value <= INTEGRATOR_COUNT ? NULL
                                                         : "must be 0 (as integrator says) or one of " INTEGRATOR_LIST;
    case DRAG_AREA_NUMBER_RULE:
        return 0.0 <= value && value <= DRAG_AREA_COUNT ? NULL
                                                        : "must be 0 (as drag_area says) or one of " DRAG_AREA_LIST;
    case ERROR_ESTIMATE_RULE:
        return 1.0 <= value && value <= ERROR_ESTIMATE_COUNT ? NULL : "must be one of " ERROR_ESTIMATE_LIST;
    case ERROR_ESTIMATE_NUMBER_RULE:
        return 0.0 <= value && value <= ERROR_ESTIMATE_COUNT
                   ? NULL
                   : "must be 0 (as error_estimate says) or one of " ERROR_ESTIMATE_LIST;
    case ANY:
        break;
    }
    return NULL;
}

/* A state is set in model exchange as SetContinuousStates does it: in FMI 3.0 in event mode too. */
static bool is_settable(const struct instance *instance, const struct variable *variable)
{
    const enum phase phase = instance->now.phase;
    const bool solved = phase == CONTINUOUS_TIME || (phase == EVENT_MODE && instance->services.fmi == 3);
    const unsigned reference = (unsigned)(variable - VARIABLES);
    return variable->settable >> phase & 1u ||
           (solved && instance_place(STATES, STATE_COUNT, reference) < STATE_COUNT);
}

enum verdict instance_check_settable(struct instance *instance, const struct variable *variable, double value)
{
    if (is_settable(instance, variable))
        return FINE;
    return instance_say(instance, REFUSED, "%s = %r: must not be set in state '%s' (%s)", variable->name, value,
                        PHASE_NAMES[instance->now.phase], variable->role);
}

static enum verdict check_real(struct instance *instance, const struct variable *variable, double value)
{
    if (instance_check_settable(instance, variable, value) == REFUSED)
        return REFUSED;
    if (!isfinite(value))
        return instance_say(instance, DISCARDED, "%s = %r: must be a finite number", variable->name, value);
    if (variable == &VARIABLES[V_SKIRT_FRICTION] && value > 0.0 && instance->now.use == MODEL_EXCHANGE)
        return instance_say(instance, DISCARDED,
                            "%s = %r: must be 0 in model exchange: a craft that friction stops, holds and lets go is "
                            "not smooth; use co-simulation",
                            variable->name, value);
    const char *why = broken_rule(variable->rule, value);
    if (why)
        return instance_say(instance, DISCARDED, variable->rule == STEP_SIZE_RULE ? "%s = %r s: %s" : "%s = %r: %s",
                            variable->name, value, why);
    return FINE;
}

/* What is read belongs to the communication point: in step mode it changes with the next step, not now. */
static void after_set(struct instance *instance, bool parameter)
{
    instance->now.tuned = instance->now.tuned || parameter;
    if (instance->now.phase != STEPPING && instance->now.phase != INTERMEDIATE_UPDATE)
        instance->now.motion_unread = instance->now.action_unread = true;
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
    memcpy((char *)&now->inputs + input * sizeof(double), &value, sizeof(double));
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
        const unsigned state = instance_place(STATES, STATE_COUNT, references[i]);
        instance->now.reals[references[i]] = values[i];
        if (input < INPUT_COUNT)
            set_input(&instance->now, input, values[i]);
        else if (state < STATE_COUNT)
            memcpy((char *)&instance->now.state + state * sizeof(double), &values[i], sizeof(double));
        else
            parameter = true;
    }
    if (n > 0)
        after_set(instance, parameter);
    return FINE;
}

/* What can be set are numbers of items of an enumeration, all of them small. */
static enum verdict check_integer(struct instance *instance, const struct variable *variable, int64_t value)
{
    if (!is_settable(instance, variable))
        return instance_say(instance, REFUSED, "%s = %i: must not be set in state '%s' (%s)", variable->name,
                            (long long)value, PHASE_NAMES[instance->now.phase], variable->role);
    const char *why = broken_rule(variable->rule, (double)value);
    const unsigned reference = (unsigned)(variable - VARIABLES);
    if ((reference == V_ERROR_ESTIMATE || reference == V_ERROR_ESTIMATE_NUMBER) && value == ON &&
        instance->now.use == MODEL_EXCHANGE)
        why = "must be off in model exchange: there the error is that of the importer's solver; use co-simulation";
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

enum verdict instance_set_integers(struct instance *instance, const unsigned *references, size_t n, const int *values)
{
    for (size_t i = 0; i < n; i++) {
        if (!is_integer(references[i]))
            return instance_no_such(instance, "Integer or Enumeration", references[i]);
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
    for (size_t i = 0; i < n; i++) {
        int value = 0;
        if (instance_get_integers(instance, &references[i], 1, &value) == REFUSED)
            return REFUSED;
        values[i] = value;
    }
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
        instance_set_integers(instance, &references[i], 1, &value);
    }
    return FINE;
}
