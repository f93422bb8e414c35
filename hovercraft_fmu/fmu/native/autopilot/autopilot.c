/* The autopilot as a model of the room: it samples its inputs at the start of a communication step. */

#include <math.h>
#include <string.h>

#include "cursor.h"
#include "guidance.h"
#include "instance.h"

/* ---- parameters */

/* Refused: orders that contradict one another. */
static enum verdict take_orders(struct instance *instance, struct model *m)
{
    const struct content *now = &instance->now;
    m->count = now->integers[V_WAYPOINT_COUNT];
    instance_copy(m->points, now->reals, COURSE, 2 * COURSE_MAX);
    for (unsigned i = 0; i < ORDER_COUNT; i++) {
        const unsigned reference = ORDER_FIELDS[i].reference;
        char *field = (char *)&m->orders + ORDER_FIELDS[i].offset;
        if (VARIABLES[reference].kind == REAL)
            *(double *)(void *)field = now->reals[reference];
        else
            *(int32_t *)(void *)field = now->integers[reference];
    }
    const double frequency = guidance_frequency(&m->orders);
    if (frequency < INFINITY)
        return FINE;
    return instance_say(instance, DISCARDED,
                        "frequency = %r rad/s of the heading's loop: must be a finite number; it is made of inertia, "
                        "length, steering_force",
                        frequency);
}

/* ---- the law */

static enum verdict check_shown(struct instance *instance, const struct model *m)
{
    const double turns = guidance_turns(&m->pilot);
    const double shown[SHOWN_COUNT] = {m->commands.thrust,   m->commands.port,  m->commands.starboard,
                                       m->sight.cross_track, m->sight.distance, turns};
    for (unsigned i = 0; i < SHOWN_COUNT; i++)
        if (!isfinite(shown[i]))
            return instance_say(instance, DISCARDED, "%s = %r: must be a finite number; the motion is out of range",
                                VARIABLES[SHOWN[i]].name, shown[i]);
    return FINE;
}

static struct motion motion_of(const struct content *content)
{
    struct motion motion;
    memcpy(&motion, content->inputs, sizeof motion);
    return motion;
}

static enum verdict sample(struct instance *instance, struct model *m, double duration)
{
    const struct motion motion = motion_of(&instance->now);
    const struct course course = {m->points, m->count};
    guidance_steer(&m->pilot, &motion, &course, &m->orders, duration, &m->commands, &m->sight);
    return check_shown(instance, m);
}

static enum verdict take_up(struct instance *instance)
{
    const struct motion motion = motion_of(&instance->now);
    struct model m = {.pilot = guidance_beginning(&motion)};
    if (take_orders(instance, &m) == REFUSED || sample(instance, &m, 0.0) == REFUSED)
        return REFUSED;
    instance->now.model = m;
    return FINE;
}

static enum verdict step_on(struct instance *instance, struct interval *interval)
{
    struct content *now = &instance->now;
    struct model m = now->model;
    const int32_t before = m.pilot.status;
    enum verdict verdict = FINE;
    if (now->tuned && take_orders(instance, &m) == REFUSED)
        return REFUSED;
    if (sample(instance, &m, interval->size) == REFUSED)
        return REFUSED;
    now->model = m;
    for (unsigned i = 0; i < STATUS_COUNT; i++)
        if (m.pilot.status & ~before & 1 << i)
            verdict = instance_say(instance, WARNED, "status %i: %s (said once)", (long long)(1 << i), STATUS[i]);
    return verdict;
}

static enum verdict observe(struct instance *instance)
{
    const struct model *m = &instance->now.model;
    double *reals = instance->now.reals;
    int32_t *integers = instance->now.integers;
    reals[V_THRUST] = m->commands.thrust;
    reals[V_PORT_THRUSTER] = m->commands.port;
    reals[V_STARBOARD_THRUSTER] = m->commands.starboard;
    reals[V_CROSS_TRACK_ERROR] = m->sight.cross_track;
    reals[V_DISTANCE] = m->sight.distance;
    reals[V_TURNS] = guidance_turns(&m->pilot);
    integers[V_WAYPOINT] = m->pilot.passed + 1 < m->count ? m->pilot.passed + 1 : m->count;
    integers[V_STATUS] = m->pilot.status;
    integers[V_MISSED] = m->pilot.missed;
    integers[V_ARRIVED] = m->pilot.passed >= m->count;
    return FINE;
}

/* ---- FMU state */

static void exchange_model(struct cursor *cursor, struct content *content)
{
    struct model *m = &content->model;
    exchange_doubles(cursor, &m->pilot, offsetof(struct pilot, passed));
    exchange_integer(cursor, &m->pilot.passed);
    exchange_integer(cursor, &m->pilot.missed);
    exchange_integer(cursor, &m->pilot.braking);
    exchange_integer(cursor, &m->pilot.status);
    exchange_doubles(cursor, m->points, sizeof m->points);
    exchange_integer(cursor, &m->count);
    exchange_doubles(cursor, &m->orders, offsetof(struct orders, turn_back));
    exchange_integer(cursor, &m->orders.turn_back);
    exchange_integer(cursor, &m->orders.keep_station);
    exchange_doubles(cursor, &m->commands, sizeof m->commands);
    exchange_doubles(cursor, &m->sight, sizeof m->sight);
}

/* The number of waypoints may have become smaller than that of those that were passed. */
static bool is_possible(const struct content *content)
{
    const struct model *m = &content->model;
    return !instance_has_started(content) ||
           (m->count >= 1 && m->count <= COURSE_MAX && m->pilot.passed >= 0 && m->pilot.passed <= COURSE_MAX &&
            m->pilot.missed >= 0 && m->pilot.missed <= m->pilot.passed);
}

const struct model_functions *model(void)
{
    static const struct model_functions functions = {
        .take_up = take_up,
        .step = step_on,
        .observe = observe,
        .exchange = exchange_model,
        .is_possible = is_possible,
        .discrete_is_worked_out = true,
    };
    return &functions;
}
