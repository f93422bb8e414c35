#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <string.h>

#include "text.h"

static const char WARNING_CATEGORY[] = "logStatusWarning";
static const char ERROR_CATEGORY[] = "logStatusError";
static const char ALL_CATEGORIES[] = "logAll";

/* ---- what is said */

enum verdict instance_say(struct instance *instance, enum verdict verdict, const char *format, ...)
{
    char message[TEXT_SIZE];
    va_list values;
    va_start(values, format);
    text_format(message, format, values);
    va_end(values);
    if (verdict == WARNED ? instance->warnings : instance->errors)
        instance->tell(instance->sink, verdict, verdict == WARNED ? WARNING_CATEGORY : ERROR_CATEGORY, message);
    return verdict;
}

enum verdict instance_log(struct instance *instance, const char *call, bool on, size_t n,
                          const char *const *categories)
{
    bool warnings = n == 0, errors = n == 0;
    for (size_t i = 0; i < n; i++) {
        if (!categories || !categories[i])
            return instance_say(instance, REFUSED, "%s: no argument must be NULL", call);
        const bool all = strcmp(categories[i], ALL_CATEGORIES) == 0;
        const bool warning = strcmp(categories[i], WARNING_CATEGORY) == 0;
        const bool error = strcmp(categories[i], ERROR_CATEGORY) == 0;
        if (!all && !warning && !error)
            return instance_say(instance, REFUSED, "log category '%q': must be one of %s, %s, %s", categories[i],
                                WARNING_CATEGORY, ERROR_CATEGORY, ALL_CATEGORIES);
        warnings = warnings || all || warning;
        errors = errors || all || error;
    }
    instance->warnings = on ? warnings : instance->warnings && !warnings;
    instance->errors = on ? errors : instance->errors && !errors;
    return FINE;
}

enum verdict instance_require(struct instance *instance, const char *call, enum phase phase)
{
    if (instance->now.phase == phase)
        return FINE;
    return instance_say(instance, REFUSED, "%s in state '%s': must be called in state '%s'", call,
                        PHASE_NAMES[instance->now.phase], PHASE_NAMES[phase]);
}

enum verdict instance_require_either(struct instance *instance, const char *call, enum phase one, enum phase other)
{
    if (instance->now.phase == one || instance->now.phase == other)
        return FINE;
    return instance_say(instance, REFUSED, "%s in state '%s': must be called in state '%s' or '%s'", call,
                        PHASE_NAMES[instance->now.phase], PHASE_NAMES[one], PHASE_NAMES[other]);
}

enum verdict instance_require_use(struct instance *instance, const char *call, enum use use)
{
    if (instance->now.use == use)
        return FINE;
    return instance_say(instance, REFUSED, "%s: must be called of an instance for %s", call,
                        use == MODEL_EXCHANGE ? "model exchange" : "co-simulation");
}

enum verdict instance_no_such(struct instance *instance, const char *kind, unsigned reference)
{
    return instance_say(instance, REFUSED, "value reference %u: must be that of a variable of type %s",
                        (unsigned long long)reference, kind);
}

bool instance_has_started(const struct content *content)
{
    return content->phase != INSTANTIATED && content->phase != INITIALIZING;
}

/* ---- life cycle */

void instance_reset(struct instance *instance)
{
    const struct content empty = {
        .use = instance->now.use, .phase = INSTANTIATED, .stop_time = INFINITY, .motion_unread = true, .action_unread = true};
    instance->now = empty;
    instance->last_step = FINE;
    for (unsigned i = 0; i < VARIABLE_COUNT; i++) {
        if (VARIABLES[i].kind == REAL)
            instance->now.reals[i] = VARIABLES[i].start;
        else
            instance->now.integers[i] = (int32_t)VARIABLES[i].start;
    }
}

void instance_start(struct instance *instance, enum use use, teller *tell, void *sink, bool logging)
{
    instance->now.use = use;
    instance->tell = tell;
    instance->sink = sink;
    instance->warnings = logging;
    instance->errors = true;
    instance_reset(instance);
}

static enum verdict check_tolerance(struct instance *instance, double tolerance)
{
    if (0.0 < tolerance && tolerance < INFINITY)
        return FINE;
    return instance_say(instance, REFUSED, "tolerance = %r: must be a finite number greater than 0", tolerance);
}

enum verdict instance_set_up(struct instance *instance, const char *call, double start_time, bool tolerance_given,
                             double tolerance, double stop_time)
{
    if (instance_require(instance, call, INSTANTIATED) == REFUSED)
        return REFUSED;
    if (!isfinite(start_time))
        return instance_say(instance, REFUSED, "startTime = %r s: must be a finite number", start_time);
    if (tolerance_given && check_tolerance(instance, tolerance) == REFUSED)
        return REFUSED;
    if (!(stop_time >= start_time))
        return instance_say(instance, REFUSED, "stopTime = %r s: must not be before startTime = %r s", stop_time,
                            start_time);
    instance->now.time = start_time;
    instance->now.stop_time = stop_time;
    instance->now.hosts_tolerance = tolerance_given ? tolerance : 0.0;
    return FINE;
}

enum verdict instance_initialize(struct instance *instance, const char *call)
{
    if (instance_require(instance, call, INSTANTIATED) == REFUSED)
        return REFUSED;
    instance->now.phase = INITIALIZING;
    return FINE;
}

static enum verdict check_derived(struct instance *instance, const struct craft *craft)
{
    const struct derived derived = kernel_derived(craft);
    for (unsigned i = 0; i < sizeof DERIVED / sizeof *DERIVED; i++) {
        const struct derived_value *value = &DERIVED[i];
        const double found = *(const double *)(const void *)((const char *)&derived + value->offset);
        if (!isfinite(found))
            return instance_say(instance, REFUSED, "%s = %r %s: must be a finite number; it is made of %s", value->name,
                                found, value->unit, value->parts);
    }
    return FINE;
}

/* What an enumeration and the integer beside it say together. Refused: both are set, and differ. */
static enum verdict choose(struct instance *instance, unsigned enumeration, int32_t *item)
{
    const int32_t *integers = instance->now.integers;
    unsigned i = 0;
    while (CHOICES[i].enumeration != enumeration)
        i++;
    const unsigned beside = CHOICES[i].number;
    const int32_t said = integers[enumeration], number = integers[beside];
    if (number != 0 && number != said && said != (int32_t)VARIABLES[enumeration].start)
        return instance_say(instance, REFUSED, "%s = %i and %s = %i: must be the same where both are set",
                            VARIABLES[enumeration].name, (long long)said, VARIABLES[beside].name, (long long)number);
    *item = number != 0 ? number : said;
    return FINE;
}

/* The craft that the parameters make. */
static enum verdict make_craft(struct instance *instance, struct craft *craft)
{
    const struct content *now = &instance->now;
    for (unsigned i = 0; i < CRAFT_COUNT; i++) {
        const unsigned reference = CRAFT_FIELDS[i].reference;
        char *field = (char *)craft + CRAFT_FIELDS[i].offset;
        if (VARIABLES[reference].kind == REAL)
            *(double *)(void *)field = now->reals[reference];
        else if (choose(instance, reference, (int32_t *)(void *)field) == REFUSED)
            return REFUSED;
    }
    if (craft->thrust_max - craft->thrust_min < 0.0)
        return instance_say(instance, REFUSED, "thrust_min = %r N: must not be above thrust_max = %r N",
                            craft->thrust_min, craft->thrust_max);
    return check_derived(instance, craft);
}

static struct controls inputs_of(const double *reals)
{
    return (struct controls){reals[V_THRUST], reals[V_PORT_THRUSTER], reals[V_STARBOARD_THRUSTER], reals[V_WIND_X],
                             reals[V_WIND_Y]};
}

static void get_state(const double *reals, struct state *state)
{
    *state = (struct state){reals[V_POSE_X],     reals[V_POSE_Y],     reals[V_POSE_HEADING],
                            reals[V_VELOCITY_X], reals[V_VELOCITY_Y], reals[V_VELOCITY_YAW_RATE]};
}

static enum verdict take_up_start_values(struct instance *instance)
{
    struct content *now = &instance->now;
    struct craft craft;
    int32_t integrator;
    if (make_craft(instance, &craft) == REFUSED || choose(instance, V_INTEGRATOR, &integrator) == REFUSED)
        return REFUSED;
    now->craft = craft;
    now->settings = (struct settings){
        now->reals[V_STEP_SIZE],
        integrator,
        now->hosts_tolerance > 0.0 ? now->hosts_tolerance : now->reals[V_TOLERANCE],
    };
    now->controls = inputs_of(now->reals);
    get_state(now->reals, &now->state);
    now->reals[V_PROJECTED_AREA] = kernel_derived(&craft).projected_area;
    now->tuned = false;
    now->motion_unread = now->action_unread = true;
    return FINE;
}

enum verdict instance_go(struct instance *instance, const char *call)
{
    if (instance_require(instance, call, INITIALIZING) == REFUSED || take_up_start_values(instance) == REFUSED)
        return REFUSED;
    instance->now.phase = instance->now.use == MODEL_EXCHANGE ? EVENT_MODE : STEPPING;
    return FINE;
}

enum verdict instance_terminate(struct instance *instance, const char *call)
{
    if ((instance->now.use == MODEL_EXCHANGE ? instance_require_either(instance, call, EVENT_MODE, CONTINUOUS_TIME)
                                             : instance_require(instance, call, STEPPING)) == REFUSED)
        return REFUSED;
    instance->now.phase = TERMINATED;
    return FINE;
}

/* ---- the step */

static enum verdict check_step(struct instance *instance, double point, double step)
{
    const double time = instance->now.time, stop_time = instance->now.stop_time;
    if (!(0.0 < step && step < INFINITY))
        return instance_say(instance, REFUSED,
                            "communicationStepSize = %r s: must be a finite number greater than 0", step);
    if (point != time && !(fabs(point - time) <= SAME_TIME * larger(1.0, fabs(time))))
        return instance_say(instance, REFUSED,
                            "currentCommunicationPoint = %r s: must be where the last step ended, %r s", point, time);
    if (point + step - stop_time > SAME_TIME * larger(1.0, fabs(stop_time)))
        return instance_say(instance, REFUSED,
                            "communicationStepSize = %r s from %r s: must not lead past stopTime = %r s", step, point,
                            stop_time);
    return FINE;
}

/* Of what is not finite the velocities are told first: it is they that run away first. */
static enum verdict refuse_motion(struct instance *instance, const struct stretch *stretch)
{
    const struct state *s = &stretch->state;
    const double values[] = {s->vx, s->vy, s->yaw_rate, s->x, s->y, s->heading};
    static const unsigned references[] = {V_VELOCITY_X, V_VELOCITY_Y, V_VELOCITY_YAW_RATE,
                                          V_POSE_X,     V_POSE_Y,     V_POSE_HEADING};
    unsigned i = 0;
    while (i + 1 < STATE_COUNT && isfinite(values[i]))
        i++;
    return instance_say(instance, REFUSED,
                        "%s = %r after %r s: must stay a finite number; the step was refused and the state of %r s "
                        "stands; the motion is too fast for sub-steps of %r s: set a smaller step_size",
                        VARIABLES[references[i]].name, values[i], instance->now.time, instance->now.time,
                        stretch->substep);
}

static enum verdict refuse_step(struct instance *instance, enum outcome outcome, double step,
                                const struct stretch *stretch)
{
    const struct settings *settings = &instance->now.settings;
    if (outcome == TOO_MANY_SUBSTEPS)
        return instance_say(instance, REFUSED,
                            "communication step = %r s: must not need more than 10^9 sub-steps of step_size = %r s",
                            step, settings->step_size);
    if (outcome == STEP_TOO_SMALL)
        return instance_say(instance, REFUSED,
                            "step = %r s: must not fall below 1e-12 s to meet tolerance = %r; set a larger tolerance",
                            stretch->substep, settings->tolerance);
    return refuse_motion(instance, stretch);
}

/* What is watched over a step may overflow where the motion just does not; an infinite rotation leaves no finite
   stability number. */
static enum verdict check_watched(struct instance *instance, double stability, double rotation)
{
    const bool turns = !isfinite(rotation);
    const double time = instance->now.time;
    if (isfinite(stability))
        return FINE;
    return instance_say(instance, REFUSED,
                        "%s = %r after %r s: must stay a finite number; the step was refused and the state of %r s "
                        "stands; the motion is too fast for sub-steps of %r s: set a smaller step_size",
                        VARIABLES[turns ? V_ROTATION_PER_SUBSTEP : V_STABILITY_NUMBER].name,
                        turns ? rotation : stability, time, time, instance->now.settings.step_size);
}

/* Whether this warning was not yet given; then it is, now. */
static bool is_first(struct instance *instance, int bit)
{
    const bool first = !(instance->now.integers[V_WARNINGS] & bit);
    instance->now.integers[V_WARNINGS] |= bit;
    return first;
}

static bool is_held(double value, double limit)
{
    return fabs(value - limit) > HELD * larger(1.0, fabs(limit));
}

static const struct method *method_of(const struct instance *instance)
{
    return &METHODS[instance->now.settings.integrator - 1];
}

static enum verdict warn_of_the_step(struct instance *instance)
{
    const struct content *now = &instance->now;
    const struct method *method = method_of(instance);
    const double number = now->stability, rotation = now->rotation;
    enum verdict verdict = FINE;
    if (number > method->stability_limit && is_first(instance, STEP_UNSTABLE))
        verdict = instance_say(instance, WARNED,
                               "stability_number = %4: must not pass %r with %s; set a step_size below %3 s, or "
                               "another integrator (said once)",
                               number, method->stability_limit, method->name,
                               now->settings.step_size * method->stability_limit / number);
    if (rotation > method->rotation_limit && is_first(instance, STEP_TURNS))
        verdict = instance_say(instance, WARNED,
                               "rotation_per_substep = %4 rad: must not pass %r rad; set a step_size below %3 s, or "
                               "the integrator adaptive (said once)",
                               rotation, method->rotation_limit,
                               now->settings.step_size * method->rotation_limit / rotation);
    return verdict;
}

enum verdict instance_warn_of_held_inputs(struct instance *instance, const struct controls *controls)
{
    const struct controls limits = kernel_saturate(controls, &instance->now.craft);
    const double values[] = {controls->thrust, controls->port, controls->starboard};
    const double held[] = {limits.thrust, limits.port, limits.starboard};
    enum verdict verdict = FINE;
    for (unsigned i = 0; i < sizeof held / sizeof *held; i++)
        if (is_held(values[i], held[i]) && is_first(instance, INPUT_HELD))
            verdict = instance_say(instance, WARNED, "%s = %r: is outside its limits and is held at %r (said once)",
                                   VARIABLES[INPUTS[i]].name, values[i], held[i]);
    return verdict;
}

bool instance_has_to_warn(const struct instance *instance)
{
    const struct controls *controls = &instance->now.controls;
    const struct controls limits = kernel_saturate(controls, &instance->now.craft);
    return !(instance->now.integers[V_WARNINGS] & INPUT_HELD) &&
           (is_held(controls->thrust, limits.thrust) || is_held(controls->port, limits.port) ||
            is_held(controls->starboard, limits.starboard));
}

static enum verdict count_substeps(struct instance *instance, int64_t n)
{
    int32_t *count = &instance->now.integers[V_SUBSTEPS];
    if (n <= SUBSTEPS_MAX - (int64_t)*count) {
        *count += (int32_t)n;
        return FINE;
    }
    *count = SUBSTEPS_MAX;
    if (!is_first(instance, COUNTER_STOPPED))
        return FINE;
    return instance_say(instance, WARNED, "substeps = %i: %s (said once)", (long long)SUBSTEPS_MAX,
                        COUNTER_STOPPED_TEXT);
}

static enum verdict worse(enum verdict a, enum verdict b)
{
    return a > b ? a : b;
}

static bool is_finite_drive(const struct controls *c)
{
    return isfinite(c->thrust) && isfinite(c->port) && isfinite(c->starboard) && isfinite(c->wind_x) &&
           isfinite(c->wind_y);
}

/* The inputs over the step. Refused: a ramp that leaves the range of numbers. */
static enum verdict make_drive(struct instance *instance, double step, struct drive *drive, struct controls *end)
{
    const double *rates = instance->now.rates;
    *drive = (struct drive){inputs_of(instance->now.reals), {rates[0], rates[1], rates[2], rates[3], rates[4]}, false};
    for (unsigned i = 0; i < INPUT_COUNT; i++)
        drive->ramped = drive->ramped || rates[i] != 0.0;
    *end = kernel_controls_at(drive, step);
    if (is_finite_drive(end))
        return FINE;
    return instance_say(instance, REFUSED, "input derivatives over %r s: must lead to finite inputs", step);
}

static enum verdict take_step(struct instance *instance, double point, double step)
{
    struct content *now = &instance->now;
    struct drive drive;
    struct controls end;
    struct craft craft = now->craft;
    struct stretch stretch = {.substeps = 0};
    if (check_step(instance, point, step) == REFUSED)
        return REFUSED;
    if (now->tuned && make_craft(instance, &craft) == REFUSED)
        return REFUSED;
    if (make_drive(instance, step, &drive, &end) == REFUSED)
        return REFUSED;
    const enum outcome outcome =
        kernel_advance(&now->state, &drive, &craft, step, &now->settings, now->proposed, &stretch);
    if (outcome != ADVANCED)
        return refuse_step(instance, outcome, step, &stretch);
    const double stability = kernel_stability_number(stretch.drag_mass, stretch.rotation, &craft);
    if (check_watched(instance, stability, stretch.rotation) == REFUSED)
        return REFUSED;
    now->state = stretch.state;
    now->proposed = stretch.proposed;
    now->controls = end;
    now->craft = craft;
    now->tuned = false;
    now->time = point + step;
    now->motion_unread = now->action_unread = true;
    now->stability = larger(now->stability, stability);
    now->rotation = larger(now->rotation, stretch.rotation);
    now->reals[V_THRUST] = end.thrust; /* a ramp goes on from here */
    now->reals[V_PORT_THRUSTER] = end.port;
    now->reals[V_STARBOARD_THRUSTER] = end.starboard;
    now->reals[V_WIND_X] = end.wind_x;
    now->reals[V_WIND_Y] = end.wind_y;
    enum verdict verdict = count_substeps(instance, stretch.substeps);
    verdict = worse(verdict, warn_of_the_step(instance));
    verdict = worse(verdict, instance_warn_of_held_inputs(instance, &drive.start));
    return worse(verdict, instance_warn_of_held_inputs(instance, &end));
}

enum verdict instance_step(struct instance *instance, const char *call, double point, double step)
{
    if (instance_require(instance, call, STEPPING) == REFUSED)
        return REFUSED;
    return instance->last_step = take_step(instance, point, step);
}

/* ---- variables */

static enum verdict check_finite(struct instance *instance, const unsigned *references, unsigned n)
{
    for (unsigned i = 0; i < n; i++)
        if (!isfinite(instance->now.reals[references[i]]))
            return instance_say(instance, REFUSED, "%s = %r: must be a finite number; the motion is out of range",
                                VARIABLES[references[i]].name, instance->now.reals[references[i]]);
    return FINE;
}

enum verdict instance_take_up(struct instance *instance)
{
    struct content *now = &instance->now;
    struct craft craft = now->craft;
    if (now->use != MODEL_EXCHANGE)
        return FINE;
    if (now->tuned && make_craft(instance, &craft) == REFUSED)
        return REFUSED;
    now->craft = craft;
    now->tuned = false;
    now->controls = inputs_of(now->reals);
    return FINE;
}

/* Bring what is read of the motion up to the communication point. */
static enum verdict observe_motion(struct instance *instance)
{
    struct content *now = &instance->now;
    double *reals = now->reals;
    if (!now->motion_unread)
        return FINE;
    if ((instance_has_started(now) ? instance_take_up(instance) : take_up_start_values(instance)) == REFUSED)
        return REFUSED;
    const struct state *s = &now->state;
    kernel_body_velocity(s, &reals[V_BODY_SURGE], &reals[V_BODY_SWAY]);
    reals[V_SPEED] = sqrt(s->vx * s->vx + s->vy * s->vy);
    if (check_finite(instance, MOTION, sizeof MOTION / sizeof *MOTION) == REFUSED)
        return REFUSED;
    reals[V_POSE_X] = s->x;
    reals[V_POSE_Y] = s->y;
    reals[V_POSE_HEADING] = s->heading;
    reals[V_VELOCITY_X] = s->vx;
    reals[V_VELOCITY_Y] = s->vy;
    reals[V_VELOCITY_YAW_RATE] = s->yaw_rate;
    now->motion_unread = false;
    return FINE;
}

/* And of what acts on the craft, which most hosts never ask for. */
static enum verdict observe_action(struct instance *instance)
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
    if (check_finite(instance, ACTION, sizeof ACTION / sizeof *ACTION) == REFUSED)
        return REFUSED;
    now->action_unread = false;
    return FINE;
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
    for (unsigned i = 0; i < sizeof ACTION / sizeof *ACTION; i++)
        if (ACTION[i] == reference)
            return true;
    for (unsigned i = 0; i < sizeof WATCHED / sizeof *WATCHED; i++)
        if (WATCHED[i] == reference)
            return true;
    return false;
}

enum verdict instance_get_reals(struct instance *instance, const unsigned *references, size_t n, double *values)
{
    if (observe_motion(instance) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n; i++) {
        if (!is_real(references[i]))
            return instance_no_such(instance, "Real", references[i]);
        if (instance->now.action_unread && is_action(references[i]) && observe_action(instance) == REFUSED)
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
    case ANY:
        break;
    }
    return NULL;
}

static bool is_settable(const struct instance *instance, const struct variable *variable)
{
    return variable->settable >> instance->now.phase & 1u;
}

static enum verdict check_settable(struct instance *instance, const struct variable *variable, double value)
{
    if (is_settable(instance, variable))
        return FINE;
    return instance_say(instance, REFUSED, "%s = %r: must not be set in state '%s' (%s)", variable->name, value,
                        PHASE_NAMES[instance->now.phase], variable->role);
}

static enum verdict check_real(struct instance *instance, const struct variable *variable, double value)
{
    if (check_settable(instance, variable, value) == REFUSED)
        return REFUSED;
    if (!isfinite(value))
        return instance_say(instance, REFUSED, "%s = %r: must be a finite number", variable->name, value);
    if (variable == &VARIABLES[V_SKIRT_FRICTION] && value > 0.0 && instance->now.use == MODEL_EXCHANGE)
        return instance_say(instance, REFUSED,
                            "%s = %r: must be 0 in model exchange: a craft that friction stops, holds and lets go is "
                            "not smooth; use co-simulation",
                            variable->name, value);
    const char *why = broken_rule(variable->rule, value);
    if (why)
        return instance_say(instance, REFUSED, variable->rule == STEP_SIZE_RULE ? "%s = %r s: %s" : "%s = %r: %s",
                            variable->name, value, why);
    return FINE;
}

/* What is read belongs to the communication point: in step mode it changes with the next step, not now. */
static void after_set(struct instance *instance, bool parameter)
{
    instance->now.tuned = instance->now.tuned || parameter;
    if (instance->now.phase != STEPPING)
        instance->now.motion_unread = instance->now.action_unread = true;
}

/* Which input a reference is, or INPUT_COUNT. */
static unsigned input_of(unsigned reference)
{
    unsigned i = 0;
    while (i < INPUT_COUNT && INPUTS[i] != reference)
        i++;
    return i;
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
        const unsigned input = input_of(references[i]);
        instance->now.reals[references[i]] = values[i];
        if (input < INPUT_COUNT)
            instance->now.rates[input] = 0.0;
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
    return why ? instance_say(instance, REFUSED, "%s = %i: %s", variable->name, (long long)value, why) : FINE;
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

/* ---- derivatives */

static enum verdict check_order(struct instance *instance, unsigned reference, int order)
{
    if (order == 1)
        return FINE;
    return instance_say(instance, REFUSED, "order = %i of the derivative of %s: must be 1", (long long)order,
                        VARIABLES[reference].name);
}

enum verdict instance_set_rates(struct instance *instance, const unsigned *references, size_t n, const int *orders,
                                const double *values)
{
    for (size_t i = 0; i < n; i++) {
        if (input_of(references[i]) == INPUT_COUNT)
            return instance_say(instance, REFUSED, "value reference %u: must be that of an input to have a derivative",
                                (unsigned long long)references[i]);
        const struct variable *variable = &VARIABLES[references[i]];
        if (check_settable(instance, variable, values[i]) == REFUSED ||
            check_order(instance, references[i], orders[i]) == REFUSED)
            return REFUSED;
        if (!isfinite(values[i]))
            return instance_say(instance, REFUSED, "derivative of %s = %r: must be a finite number", variable->name,
                                values[i]);
    }
    for (size_t i = 0; i < n; i++)
        instance->now.rates[input_of(references[i])] = values[i];
    return FINE;
}

/* The derivative of an output at the communication point, after observe_motion and observe_action. */
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
        *rate = speed > 0.0 ? (vx / speed) * ax + (vy / speed) * ay : sqrt(ax * ax + ay * ay);
        return true;
    default:
        return false;
    }
}

enum verdict instance_get_rates(struct instance *instance, const unsigned *references, size_t n, const int *orders,
                                double *values)
{
    double rate;
    if (observe_motion(instance) == REFUSED || observe_action(instance) == REFUSED)
        return REFUSED;
    for (size_t i = 0; i < n; i++) {
        if (!output_rate(instance->now.reals, references[i], &rate))
            return instance_say(instance, REFUSED,
                                "value reference %u: must be that of an output to have a derivative",
                                (unsigned long long)references[i]);
        if (check_order(instance, references[i], orders[i]) == REFUSED)
            return REFUSED;
        if (!isfinite(rate))
            return instance_say(instance, REFUSED,
                                "derivative of %s = %r: must be a finite number; the motion is out of range",
                                VARIABLES[references[i]].name, rate);
    }
    for (size_t i = 0; i < n; i++)
        output_rate(instance->now.reals, references[i], &values[i]);
    return FINE;
}

/* ---- all of it */

enum verdict instance_restore(struct instance *instance, const struct content *content)
{
    const bool exchange = content->use == MODEL_EXCHANGE;
    if (exchange != (instance->now.use == MODEL_EXCHANGE))
        return instance_say(instance, REFUSED, "FMU state of an instance for %s: must be that of one for %s",
                            exchange ? "model exchange" : "co-simulation",
                            exchange ? "co-simulation" : "model exchange");
    instance->now = *content;
    instance->last_step = FINE;
    return FINE;
}
