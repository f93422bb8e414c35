#include "instance.h"

#include <math.h>
#include <string.h>

static const double SAME_STAGE = 1e-12; /* relative: times as near as that differ by rounding alone */

/* s: from a time to the next double that is larger in size. */
static double spacing_at(double time)
{
    const double size = fabs(time);
    double next;
    uint64_t bits;
    memcpy(&bits, &size, sizeof bits);
    bits++;
    memcpy(&next, &bits, sizeof next);
    return next - size;
}

static enum verdict check_step(struct instance *instance, double point, double step)
{
    const double time = instance->now.time, stop_time = instance->now.stop_time;
    const double start_time = instance->now.start_time, end = point + step;
    const double largest = larger(larger(fabs(time), fabs(end)), fabs(start_time));
    if (!(0.0 < step && step < INFINITY))
        return instance_say(instance, REFUSED,
                            "communicationStepSize = %r s: must be a finite number greater than 0", step);
    const double rounding = kernel_rounding(largest, step, (time - start_time) / step);
    if (!(fabs(point - time) <= rounding))
        return instance_say(instance, REFUSED,
                            "currentCommunicationPoint = %r s: must be where the last step ended, %r s", point, time);
    const double spacing = spacing_at(fabs(end) < fabs(point) ? end : point);
    if (step < spacing)
        return instance_say(instance, REFUSED,
                            "communicationStepSize = %r s: must not be less than what a double can tell at %r s, %r s",
                            step, point, spacing);
    if (end - stop_time > rounding)
        return instance_say(instance, REFUSED,
                            "communicationStepSize = %r s from %r s: must not lead past stopTime = %r s", step, point,
                            stop_time);
    return FINE;
}

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

static enum verdict refuse_step(struct instance *instance, enum outcome outcome, double step,
                                const struct stretch *stretch)
{
    const struct settings *settings = &instance->now.settings;
    if (outcome == TOO_MANY_SUBSTEPS)
        return instance_say(instance, DISCARDED,
                            "communication step = %r s: must not need more than 10^9 sub-steps of step_size = %r s",
                            step, settings->step_size);
    if (outcome == STEP_TOO_SMALL)
        return instance_say(instance, DISCARDED,
                            "step = %r s: must not fall below 1e-12 s to meet tolerance = %r; set a larger tolerance",
                            stretch->substep, settings->tolerance);
    return refuse_motion(instance, stretch);
}

/* What is watched over a step may overflow where the motion just does not. */
static enum verdict check_watched(struct instance *instance, double stability, double rotation)
{
    const bool turns = !isfinite(rotation);
    const double time = instance->now.time;
    if (isfinite(stability) && !turns)
        return FINE;
    return instance_say(instance, DISCARDED,
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

static const struct method *method_of(const struct content *content)
{
    return &METHODS[content->settings.integrator - 1];
}

struct error instance_error(const struct content *content)
{
    if (!content->estimates)
        return (struct error){0.0, 0.0};
    const struct method *method = method_of(content);
    return kernel_estimated_error(&content->state, &content->companion,
                                  content->craft.skirt_friction != 0.0 ? method->rubbing_order : method->order);
}

static enum verdict warn_of_the_step(struct instance *instance)
{
    const struct content *now = &instance->now;
    const struct method *method = method_of(now);
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

static enum verdict warn_of_the_error(struct instance *instance, double step)
{
    const struct content *now = &instance->now;
    const double substep = step < now->settings.step_size ? step : now->settings.step_size;
    const double position = instance_error(now).position;
    const bool cut = now->settings.integrator != ADAPTIVE;
    if (!kernel_is_lost(position, &now->state, &now->companion, &now->craft, cut ? substep : 0.0,
                        now->integers[V_SUBSTEPS]) ||
        !is_first(instance, ERROR_LOST))
        return FINE;
    return instance_say(instance, WARNED,
                        "error.position = %4 m after a way of %4 m: cannot be trusted; set a smaller %s (said once)",
                        position, now->companion.way, cut ? "step_size" : "tolerance");
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
        if (is_held(values[i], held[i]))
            return (struct held){i, values[i], held[i]};
    return (struct held){.input = INPUT_COUNT};
}

enum verdict instance_warn_of_held_inputs(struct instance *instance, const struct controls *controls)
{
    const struct held held = held_input(controls, &instance->now.craft);
    if (held.input == INPUT_COUNT || !is_first(instance, INPUT_HELD))
        return FINE;
    return instance_say(instance, WARNED, "%s = %r: is outside its limits and is held at %r (said once)",
                        VARIABLES[INPUTS[held.input]].name, held.value, held.limit);
}

bool instance_has_to_warn(const struct instance *instance)
{
    return !(instance->now.integers[V_WARNINGS] & INPUT_HELD) &&
           held_input(&instance->now.controls, &instance->now.craft).input < INPUT_COUNT;
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

/* A step in which the host is asked for inputs. */
struct inquiry {
    struct instance *instance;
    const struct craft *craft;
    double point, end;     /* s: as the host has them */
    double step;           /* s: as it is made */
    double last;           /* s, after the point: when it was asked */
    struct controls start; /* or what was outside its limits later */
};

/* The inputs at a time: the host's, or as they were where it sets nothing. Equal times are asked for once: the end of a
   sub-step is the start of the next. */
static struct controls inputs_at(void *asked, double time)
{
    struct inquiry *inquiry = asked;
    struct instance *instance = inquiry->instance;
    struct content *now = &instance->now;
    const struct services *services = &instance->services;
    time = time < inquiry->step ? time : inquiry->step; /* sub-steps add up to the step but for rounding */
    if (fabs(time - inquiry->last) <= SAME_STAGE * time)
        return now->inputs;
    inquiry->last = time;
    const bool is_within = time < inquiry->step && inquiry->point + time < inquiry->end;
    const volatile double at = is_within ? inquiry->point + time : inquiry->end; /* not in the host's environment */
    now->phase = INTERMEDIATE_UPDATE;
    const enum call call = instance->call;
    const bool inside = instance_go_out(instance);
    services->ask(services->sink, at);
    instance_come_back(instance, inside);
    now->phase = STEPPING;
    instance->call = call;
    if (held_input(&now->inputs, inquiry->craft).input < INPUT_COUNT)
        inquiry->start = now->inputs;
    return now->inputs;
}

/* The inputs over the step. Refused: a ramp that leaves the range of numbers. */
static enum verdict make_drive(struct inquiry *inquiry, struct drive *drive, struct controls *end)
{
    struct instance *instance = inquiry->instance;
    const double *rates = instance->now.rates, step = inquiry->step;
    double ends[INPUT_COUNT];
    bool finite = true;
    *drive = (struct drive){.start = instance->now.inputs};
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

static enum verdict take_step(struct instance *instance, double point, double step)
{
    struct content *now = &instance->now;
    struct drive drive;
    struct controls end;
    struct craft craft = now->craft;
    struct stretch stretch = {.substeps = 0};
    struct companion companion;
    const double end_time = point + step;
    struct inquiry inquiry = {instance, &craft, point, end_time, step, -INFINITY, now->inputs};
    const unsigned errors = instance->errors;
    if (check_step(instance, point, step) == REFUSED)
        return REFUSED;
    inquiry.step = step = kernel_meant_step(point, step, now->start_time, now->settings.step_size);
    if (now->tuned && instance_make_craft(instance, &craft) == REFUSED)
        return REFUSED;
    if (make_drive(&inquiry, &drive, &end) == REFUSED)
        return REFUSED;
    if (instance->services.ask) {
        drive.varies = true;
        drive.ask = inputs_at;
        drive.asked = &inquiry;
        inquiry.start = drive.start = inputs_at(&inquiry, 0.0);
    }
    const enum outcome outcome =
        kernel_advance(&now->state, &drive, &craft, step, &now->settings, now->proposed, &stretch);
    if (outcome != ADVANCED)
        return refuse_step(instance, outcome, step, &stretch);
    if (now->estimates) {
        companion = now->companion;
        kernel_accompany(&companion, &drive, &craft, step, &now->settings, &stretch);
        kernel_watch(&companion, &now->state, &stretch.state, &craft);
    }
    if (instance->services.ask)
        end = inputs_at(&inquiry, step);
    if (instance->errors != errors)
        return instance_say(instance, REFUSED,
                            "step from %r s: a call inside it was refused; the state of %r s stands", point, now->time);
    if (check_watched(instance, stretch.stability, stretch.rotation) == REFUSED)
        return REFUSED;
    if (now->estimates)
        now->companion = companion;
    now->state = stretch.state;
    now->proposed = stretch.proposed;
    now->controls = end;
    now->craft = craft;
    now->tuned = false;
    now->time = end_time;
    now->motion_unread = now->action_unread = true;
    now->stability = larger(now->stability, stretch.stability);
    now->rotation = larger(now->rotation, stretch.rotation);
    now->inputs = end; /* a ramp goes on from here */
    now->rated = 0;
    enum verdict verdict = count_substeps(instance, stretch.substeps);
    verdict = worse(verdict, warn_of_the_step(instance));
    if (now->estimates)
        verdict = worse(verdict, warn_of_the_error(instance, step));
    verdict = worse(verdict, instance_warn_of_held_inputs(instance, &inquiry.start));
    return worse(verdict, instance_warn_of_held_inputs(instance, &end));
}

/* Tried again as it was a step would be discarded for ever, and there are masters that never stop trying. Where the
   host is asked for inputs, they may be other ones. */
static enum verdict check_again(struct instance *instance, double point, double step)
{
    if (instance->services.ask || instance_checksum(&instance->now, point, step) != instance->discarded)
        return FINE;
    return instance_say(instance, REFUSED,
                        "communication step of %r s from %r s: was discarded; it must be tried with a shorter step, other "
                        "inputs or parameters, or another state",
                        step, point);
}

enum verdict instance_step(struct instance *instance, double point, double step)
{
    const struct controls inputs = instance->now.inputs;
    enum verdict verdict = REFUSED;
    if (!instance->discarded || check_again(instance, point, step) != REFUSED)
        verdict = take_step(instance, point, step);
    if (verdict == REFUSED && instance->services.ask) { /* what was set inside it, too */
        instance->now.inputs = inputs;
        instance_spread(instance->now.reals, &inputs, INPUTS, INPUT_COUNT);
    }
    instance->last_step = verdict == REFUSED ? instance->refusal : verdict;
    instance->discarded = instance->last_step == DISCARDED ? instance_checksum(&instance->now, point, step) : 0;
    return verdict;
}
