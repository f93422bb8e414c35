/* The hovercraft as a model of the room: parameters to a craft, a communication step, what is read, what is warned of. */

#include <math.h>
#include <string.h>

#include "cursor.h"
#include "instance.h"
#include "kernel.h"
#include "linearization.h"
#include "partials.h"
#include "root.h"
#include "rounding.h"

static struct controls inputs_of(const struct content *content)
{
    struct controls inputs;
    memcpy(&inputs, content->inputs, sizeof inputs);
    return inputs;
}

/* ---- parameters */

static enum verdict check_derived(struct instance *instance, const struct craft *craft)
{
    const struct derived derived = kernel_derived(craft);
    for (unsigned i = 0; i < sizeof DERIVED / sizeof *DERIVED; i++) {
        const struct derived_value *value = &DERIVED[i];
        const double found = *(const double *)(const void *)((const char *)&derived + value->offset);
        if (!isfinite(found))
            return instance_say(instance, DISCARDED, "%s = %r %s: must be a finite number; it is made of %s", value->name,
                                found, value->unit, value->parts);
    }
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
        else if (instance_choose(instance, reference, (int32_t *)(void *)field) == REFUSED)
            return REFUSED;
    }
    if (craft->thrust_max - craft->thrust_min < 0.0)
        return instance_say(instance, DISCARDED, "thrust_min = %r N: must not be above thrust_max = %r N",
                            craft->thrust_min, craft->thrust_max);
    return check_derived(instance, craft);
}

static enum verdict take_up(struct instance *instance)
{
    struct content *now = &instance->now;
    struct model *m = &now->model;
    struct craft craft;
    int32_t integrator, error_estimate;
    if (make_craft(instance, &craft) == REFUSED || instance_choose(instance, V_INTEGRATOR, &integrator) == REFUSED ||
        instance_choose(instance, V_ERROR_ESTIMATE, &error_estimate) == REFUSED)
        return REFUSED;
    m->craft = craft;
    m->settings = (struct settings){
        .step_size = now->reals[V_STEP_SIZE],
        .integrator = integrator,
        .tolerance = now->hosts_tolerance > 0.0 ? now->hosts_tolerance : now->reals[V_TOLERANCE],
    };
    m->controls = inputs_of(now);
    m->estimates = error_estimate == ON;
    m->companion = (struct companion){.state = m->state};
    now->reals[V_PROJECTED_AREA] = kernel_derived(&craft).projected_area;
    return FINE;
}

static enum verdict follow(struct instance *instance)
{
    struct content *now = &instance->now;
    struct craft craft = now->model.craft;
    if (now->tuned && make_craft(instance, &craft) == REFUSED)
        return REFUSED;
    now->model.craft = craft;
    now->model.controls = inputs_of(now);
    return FINE;
}

static const char *why_not(const struct content *content, unsigned reference, double value)
{
    if (content->use != MODEL_EXCHANGE)
        return NULL;
    if (reference == V_SKIRT_FRICTION && value > 0.0)
        return "must be 0 in model exchange: a craft that friction stops, holds and lets go is not smooth; use "
               "co-simulation";
    if ((reference == V_ERROR_ESTIMATE || reference == V_ERROR_ESTIMATE_NUMBER) && value == ON)
        return "must be off in model exchange: there the error is that of the importer's solver; use co-simulation";
    return NULL;
}

/* ---- what is read */

static const struct method *method_of(const struct model *m)
{
    return &METHODS[m->settings.integrator - 1];
}

/* By its companion, at the communication point; 0 where it has none. */
static struct error error_of(const struct model *m)
{
    if (!m->estimates)
        return (struct error){0.0, 0.0};
    const struct method *method = method_of(m);
    return kernel_estimated_error(&m->state, &m->companion,
                                  m->craft.skirt_friction != 0.0 ? method->rubbing_order : method->order);
}

static enum verdict observe(struct instance *instance)
{
    const struct model *m = &instance->now.model;
    double *reals = instance->now.reals;
    const struct state *s = &m->state;
    kernel_body_velocity(s, &reals[V_BODY_SURGE], &reals[V_BODY_SWAY]);
    reals[V_SPEED] = square_root(s->vx * s->vx + s->vy * s->vy);
    if (instance_check_finite(instance, MOTION, MOTION_COUNT) == REFUSED)
        return REFUSED;
    const struct error error = error_of(m);
    reals[V_ERROR_POSITION] = error.position;
    reals[V_ERROR_HEADING] = error.heading;
    return FINE;
}

static enum verdict observe_on_demand(struct instance *instance)
{
    const struct model *m = &instance->now.model;
    double *reals = instance->now.reals;
    const struct loads loads = kernel_loads_on(&m->state, &m->controls, &m->craft);
    reals[V_FORCE_X] = loads.x;
    reals[V_FORCE_Y] = loads.y;
    reals[V_MOMENT] = loads.moment;
    reals[V_ACCELERATION_X] = loads.x / m->craft.mass;
    reals[V_ACCELERATION_Y] = loads.y / m->craft.mass;
    reals[V_ACCELERATION_YAW] = loads.moment / m->craft.inertia;
    reals[V_APPLIED_THRUST] = kernel_saturate(&m->controls, &m->craft).thrust;
    reals[V_APPLIED_STEERING] = kernel_steering(&m->controls, &m->craft);
    reals[V_STABILITY_NUMBER] = m->stability;
    reals[V_ROTATION_PER_SUBSTEP] = m->rotation;
    return instance_check_finite(instance, ACTION, ACTION_COUNT);
}

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

/* ---- why a step is refused */

/* Of what is not finite the velocities are told first: it is they that run away first. */
static enum verdict refuse_motion(struct instance *instance, const struct stretch *stretch)
{
    double parts[STATE_COUNT];
    unsigned n = 0, i = STATE_COUNT / 2;
    memcpy(parts, &stretch->state, sizeof parts);
    while (n + 1 < STATE_COUNT && isfinite(parts[i]))
        i = (++n + STATE_COUNT / 2) % STATE_COUNT;
    return instance_say(instance, DISCARDED,
                        "%s = %r after %r s: must stay a finite number; the step was refused and the state of %r s "
                        "stands; the motion is too fast for sub-steps of %r s: set a smaller step_size",
                        VARIABLES[STATES[i]].name, parts[i], instance->now.time, instance->now.time,
                        stretch->substep);
}

/* An input that no step helps. */
static enum verdict refuse_input(struct instance *instance, const struct controls *controls, unsigned i)
{
    double values[INPUT_COUNT];
    memcpy(values, controls, sizeof values);
    return instance_say(instance, DISCARDED,
                        "%s = %r: must not drive the craft so fast that even sub-steps of 1e-12 s are too long; the "
                        "step was refused and the state of %r s stands",
                        VARIABLES[INPUTS[i]].name, values[i], instance->now.time);
}

static enum verdict refuse_step(struct instance *instance, enum outcome outcome, double step,
                                const struct stretch *stretch, const struct controls *controls,
                                const struct craft *craft)
{
    const struct settings *settings = &instance->now.model.settings;
    const unsigned input = kernel_too_strong(controls, craft);
    if (outcome == TOO_MANY_SUBSTEPS && settings->integrator == ADAPTIVE)
        return instance_say(instance, DISCARDED,
                            "communication step = %r s: must not need more than 10^8 sub-steps to meet tolerance = %r; "
                            "set a larger tolerance, or take a shorter step",
                            step, settings->tolerance);
    if (outcome == TOO_MANY_SUBSTEPS)
        return instance_say(instance, DISCARDED,
                            "communication step = %r s: must not need more than 10^9 sub-steps of step_size = %r s",
                            step, settings->step_size);
    if (input < INPUT_COUNT)
        return refuse_input(instance, controls, input);
    if (outcome == STEP_TOO_SMALL)
        return instance_say(instance, DISCARDED,
                            "step = %r s: must not fall below 1e-12 s, nor below what a double can tell at its time, to meet "
                            "tolerance = %r; set a larger tolerance",
                            stretch->substep, settings->tolerance);
    return refuse_motion(instance, stretch);
}

/* What is watched over a step may overflow where the motion just does not. */
static enum verdict check_watched(struct instance *instance, const struct stretch *stretch,
                                  const struct controls *controls, const struct craft *craft)
{
    const double stability = stretch->stability, rotation = stretch->rotation, time = instance->now.time;
    const bool turns = !isfinite(rotation);
    if (isfinite(stability) && !turns)
        return FINE;
    const unsigned input = kernel_too_strong(controls, craft);
    if (input < INPUT_COUNT)
        return refuse_input(instance, controls, input);
    return instance_say(instance, DISCARDED,
                        "%s = %r after %r s: must stay a finite number; the step was refused and the state of %r s "
                        "stands; the motion is too fast for sub-steps of %r s: set a smaller step_size",
                        VARIABLES[turns ? V_ROTATION_PER_SUBSTEP : V_STABILITY_NUMBER].name,
                        turns ? rotation : stability, time, time, instance->now.model.settings.step_size);
}

/* ---- warnings */

static bool is_first(struct instance *instance, int bit)
{
    return instance_is_first(instance, V_WARNINGS, bit);
}

static enum verdict warn_of_the_step(struct instance *instance)
{
    const struct model *m = &instance->now.model;
    const struct method *method = method_of(m);
    const double number = m->stability, rotation = m->rotation;
    enum verdict verdict = FINE;
    if (number > method->stability_limit && is_first(instance, STEP_UNSTABLE))
        verdict = instance_say(instance, WARNED,
                               "stability_number = %4: must not pass %r with %s; set a step_size below %3 s, or "
                               "another integrator (said once)",
                               number, method->stability_limit, method->name,
                               m->settings.step_size * method->stability_limit / number);
    if (rotation > method->rotation_limit && is_first(instance, STEP_TURNS))
        verdict = instance_say(instance, WARNED,
                               "rotation_per_substep = %4 rad: must not pass %r rad; set a step_size below %3 s, or "
                               "the integrator adaptive (said once)",
                               rotation, method->rotation_limit,
                               m->settings.step_size * method->rotation_limit / rotation);
    return verdict;
}

static enum verdict warn_of_the_error(struct instance *instance, double step)
{
    const struct content *now = &instance->now;
    const struct model *m = &now->model;
    const double substep = step < m->settings.step_size ? step : m->settings.step_size;
    const double position = error_of(m).position;
    const bool cut = m->settings.integrator != ADAPTIVE;
    if (!kernel_is_lost(position, &m->state, &m->companion, &m->craft, cut ? substep : 0.0,
                        now->integers[V_SUBSTEPS]) ||
        !is_first(instance, ERROR_LOST))
        return FINE;
    return instance_say(instance, WARNED,
                        "error.position = %4 m after a way of %4 m: cannot be trusted; set a smaller %s (said once)",
                        position, m->companion.way, cut ? "step_size" : "tolerance");
}

/* An input that is outside its limits, and where it is held. */
struct held {
    unsigned input; /* INPUT_COUNT: none */
    double value, limit;
};

static struct held held_input(const struct controls *controls, const struct craft *craft)
{
    const struct controls limits = kernel_saturate(controls, craft);
    double values[INPUT_COUNT], held[INPUT_COUNT];
    memcpy(values, controls, sizeof values);
    memcpy(held, &limits, sizeof held);
    for (unsigned i = 0; i < INPUT_COUNT; i++)
        if (fabs(values[i] - held[i]) > HELD * larger(1.0, fabs(held[i])))
            return (struct held){i, values[i], held[i]};
    return (struct held){.input = INPUT_COUNT};
}

static enum verdict warn_of_held_inputs(struct instance *instance, const struct controls *controls)
{
    const struct held held = held_input(controls, &instance->now.model.craft);
    if (held.input == INPUT_COUNT || !is_first(instance, INPUT_HELD))
        return FINE;
    return instance_say(instance, WARNED, "%s = %r: is outside its limits and is held at %r (said once)",
                        VARIABLES[INPUTS[held.input]].name, held.value, held.limit);
}

static enum verdict warn(struct instance *instance)
{
    return warn_of_held_inputs(instance, &instance->now.model.controls);
}

static bool has_to_warn(const struct instance *instance)
{
    const struct content *now = &instance->now;
    return !(now->integers[V_WARNINGS] & INPUT_HELD) &&
           held_input(&now->model.controls, &now->model.craft).input < INPUT_COUNT;
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

/* ---- the step */

/* A step in which the host is asked for inputs. */
struct inquiry {
    struct instance *instance;
    struct interval *interval;
    const struct craft *craft;
    struct controls start; /* or what was outside its limits later */
};

/* The inputs at a time: the host's, or as they were where it sets nothing. */
static struct controls inputs_at(void *asked, double time)
{
    struct inquiry *inquiry = asked;
    const bool is_new = instance_ask(inquiry->instance, inquiry->interval, time);
    const struct controls inputs = inputs_of(&inquiry->instance->now);
    if (is_new && held_input(&inputs, inquiry->craft).input < INPUT_COUNT)
        inquiry->start = inputs;
    return inputs;
}

/* The inputs over the step. Refused: a ramp that leaves the range of numbers. */
static enum verdict make_drive(struct instance *instance, double step, struct drive *drive, struct controls *end)
{
    const double *rates = instance->now.rates;
    double ends[INPUT_COUNT];
    bool finite = true;
    *drive = (struct drive){.start = inputs_of(&instance->now)};
    memcpy(&drive->rate, rates, sizeof drive->rate);
    for (unsigned i = 0; i < INPUT_COUNT; i++)
        drive->varies = drive->varies || rates[i] != 0.0;
    *end = kernel_controls_at(drive, step);
    memcpy(ends, end, sizeof ends);
    for (unsigned i = 0; i < INPUT_COUNT; i++)
        finite = finite && isfinite(ends[i]);
    if (finite)
        return FINE;
    return instance_say(instance, DISCARDED, "input derivatives over %r s: must lead to finite inputs", step);
}

static enum verdict step_on(struct instance *instance, struct interval *interval)
{
    struct content *now = &instance->now;
    struct model *m = &now->model;
    struct drive drive;
    struct controls end;
    struct craft craft = m->craft;
    struct stretch stretch = {.substeps = 0};
    struct companion companion;
    const double step = kernel_meant_step(interval->point, interval->size, now->start_time, m->settings.step_size);
    struct inquiry inquiry = {instance, interval, &craft, inputs_of(now)};
    interval->size = step;
    if (now->tuned && make_craft(instance, &craft) == REFUSED)
        return REFUSED;
    if (make_drive(instance, step, &drive, &end) == REFUSED)
        return REFUSED;
    if (instance->services.ask) {
        drive.varies = true;
        drive.ask = inputs_at;
        drive.asked = &inquiry;
        inquiry.start = drive.start = inputs_at(&inquiry, 0.0);
    }
    const enum outcome outcome = kernel_advance(&m->state, &drive, &craft, step, &m->settings, m->proposed, &stretch);
    if (outcome != ADVANCED) {
        end = instance->services.ask ? inputs_of(now) : end;
        return refuse_step(instance, outcome, step, &stretch, &end, &craft);
    }
    if (m->estimates) {
        companion = m->companion;
        kernel_accompany(&companion, &drive, &craft, step, &m->settings, &stretch);
        kernel_watch(&companion, &m->state, &stretch.state, &craft);
    }
    if (instance->services.ask)
        end = inputs_at(&inquiry, step);
    if (instance_check_asked(instance, interval) == REFUSED ||
        check_watched(instance, &stretch, &end, &craft) == REFUSED)
        return REFUSED;
    if (m->estimates)
        m->companion = companion;
    m->state = stretch.state;
    m->proposed = stretch.proposed;
    m->controls = end;
    m->craft = craft;
    m->stability = larger(m->stability, stretch.stability);
    m->rotation = larger(m->rotation, stretch.rotation);
    memcpy(now->inputs, &end, sizeof now->inputs);
    enum verdict verdict = count_substeps(instance, stretch.substeps);
    verdict = worse(verdict, warn_of_the_step(instance));
    if (m->estimates)
        verdict = worse(verdict, warn_of_the_error(instance, step));
    verdict = worse(verdict, warn_of_held_inputs(instance, &inquiry.start));
    return worse(verdict, warn_of_held_inputs(instance, &end));
}

/* ---- partial derivatives */

/* Nothing follows a parameter of the steps at once, and there are two; all else that is given is a known of ROWS. */
_Static_assert(GIVEN_REAL_COUNT == INITIAL_KNOWN_COUNT + 2, "a parameter is a number of the craft, or of the steps");

/* Whether one of them is the derivative of a velocity. */
static bool is_accelerated(const unsigned *unknowns, size_t n_unknowns)
{
    for (size_t i = 0; i < n_unknowns; i++) {
        const unsigned row = instance_place(ROWS, ROW_COUNT, unknowns[i]);
        if (row >= ROW_ACCELERATION_X && row <= ROW_ACCELERATION_YAW)
            return true;
    }
    return false;
}

static bool is_stuck(const struct state *s, const struct craft *craft)
{
    return craft->skirt_friction != 0.0 && s->vx == 0.0 && s->vy == 0.0 && s->yaw_rate == 0.0;
}

/* In step mode a controller asks at a point what an input would do from there. */
static enum verdict linearize(struct instance *instance, enum call call, const unsigned *unknowns, size_t n_unknowns,
                              bool parameters, struct linearization *linearization)
{
    const struct content *now = &instance->now;
    const struct model *m = &now->model;
    const bool to_come = now->phase == STEPPING;
    const struct controls controls = to_come ? inputs_of(now) : m->controls;
    struct craft craft = m->craft;
    if (to_come && now->tuned && make_craft(instance, &craft) == REFUSED)
        return REFUSED;
    if (is_stuck(&m->state, &craft) && is_accelerated(unknowns, n_unknowns))
        return instance_say(instance, DISCARDED, "%s: the craft is at rest on ground that rubs: it must slide to have "
                                               "partial derivatives", call_name(instance, call));
    kernel_linearize(&m->state, &controls, &craft, parameters, linearization);
    return FINE;
}

/* ---- FMU state */

static void exchange_craft(struct cursor *cursor, struct craft *craft)
{
    for (unsigned i = 0; i < CRAFT_COUNT; i++) {
        char *field = (char *)craft + CRAFT_FIELDS[i].offset;
        if (VARIABLES[CRAFT_FIELDS[i].reference].kind == REAL)
            exchange_double(cursor, (double *)(void *)field);
        else
            exchange_integer(cursor, (int32_t *)(void *)field);
    }
}

static void exchange_model(struct cursor *cursor, struct content *content)
{
    struct model *m = &content->model;
    int32_t estimates = m->estimates;
    exchange_integer(cursor, &m->settings.integrator);
    exchange_double(cursor, &m->settings.step_size);
    exchange_double(cursor, &m->settings.tolerance);
    exchange_doubles(cursor, &m->controls, sizeof m->controls);
    exchange_craft(cursor, &m->craft);
    exchange_double(cursor, &m->proposed);
    exchange_double(cursor, &m->stability);
    exchange_double(cursor, &m->rotation);
    exchange_integer(cursor, &estimates);
    m->estimates = estimates != 0;
    if (m->estimates) {
        exchange_doubles(cursor, &m->companion.state, sizeof m->companion.state);
        exchange_double(cursor, &m->companion.proposed);
        exchange_double(cursor, &m->companion.way);
        exchange_double(cursor, &m->companion.fastest);
    }
    content->reals[V_PROJECTED_AREA] = kernel_derived(&m->craft).projected_area;
}

static bool is_possible(const struct content *content)
{
    const struct model *m = &content->model;
    if (content->integers[V_SUBSTEPS] < 0)
        return false;
    if (instance_has_started(content) && !(m->settings.integrator >= 1 && m->settings.integrator <= INTEGRATOR_COUNT &&
                                           m->settings.step_size > 0.0))
        return false;
    return content->use == CO_SIMULATION || (m->craft.skirt_friction == 0.0 && !m->estimates);
}

const struct model_functions *model(void)
{
    static const struct model_functions functions = {
        .take_up = take_up,
        .step = step_on,
        .observe = observe,
        .observe_on_demand = observe_on_demand,
        .why_not = why_not,
        .exchange = exchange_model,
        .is_possible = is_possible,
        .output_rate = output_rate,
        .follow = follow,
        .has_to_warn = has_to_warn,
        .warn = warn,
        .directional = instance_directional_derivatives,
        .adjoint = instance_adjoint_derivatives,
        .linearize = linearize,
        .asks = true,
        .takes_rates = true,
    };
    return &functions;
}
