#include "instance.h"
#include "rounding.h"

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
    const double rounding = time_rounding(largest, step, (time - start_time) / step);
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

bool instance_is_first(struct instance *instance, unsigned reference, int bit)
{
    const bool first = !(instance->now.integers[reference] & bit);
    instance->now.integers[reference] |= bit;
    return first;
}

bool instance_ask(struct instance *instance, struct interval *interval, double time)
{
    struct content *now = &instance->now;
    const struct services *services = &instance->services;
    time = time < interval->size ? time : interval->size; /* sub-steps add up to the step but for rounding */
    if (fabs(time - interval->asked) <= SAME_STAGE * time)
        return false;
    interval->asked = time;
    const bool is_within = time < interval->size && interval->point + time < interval->end;
    const volatile double at = is_within ? interval->point + time : interval->end; /* not in the host's environment */
    now->phase = INTERMEDIATE_UPDATE;
    const enum call call = instance->call;
    const bool inside = instance_go_out(instance);
    services->ask(services->sink, at);
    instance_come_back(instance, inside);
    now->phase = STEPPING;
    instance->call = call;
    return true;
}

enum verdict instance_check_asked(struct instance *instance, const struct interval *interval)
{
    if (instance->errors == interval->errors)
        return FINE;
    return instance_say(instance, REFUSED, "step from %r s: a call inside it was refused; the state of %r s stands",
                        interval->point, instance->now.time);
}

static enum verdict take_step(struct instance *instance, double point, double step)
{
    struct content *now = &instance->now;
    struct interval interval = {point, point + step, step, -INFINITY, instance->errors};
    if (check_step(instance, point, step) == REFUSED)
        return REFUSED;
    const enum verdict verdict = model()->step(instance, &interval);
    if (verdict == REFUSED)
        return REFUSED;
    now->time = interval.end;
    now->tuned = false;
    now->rated = 0; /* a ramp goes on from here */
    now->unread = now->unread_on_demand = true;
    return verdict;
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
    double inputs[INPUT_COUNT];
    memcpy(inputs, instance->now.inputs, sizeof inputs);
    enum verdict verdict = REFUSED;
    if (!instance->discarded || check_again(instance, point, step) != REFUSED)
        verdict = take_step(instance, point, step);
    if (verdict == REFUSED && instance->services.ask) { /* what was set inside it, too */
        memcpy(instance->now.inputs, inputs, sizeof inputs);
        instance_spread(instance->now.reals, inputs, INPUTS, INPUT_COUNT);
    }
    instance->last_step = verdict == REFUSED ? instance->refusal : verdict;
    instance->discarded = instance->last_step == DISCARDED ? instance_checksum(&instance->now, point, step) : 0;
    return verdict;
}
