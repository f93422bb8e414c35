/* The tether as a model of the room: it samples its inputs at the start of a communication step. */

#include <math.h>
#include <string.h>

#include "cursor.h"
#include "instance.h"
#include "root.h"
#include "trig.h"

/* ---- the law */

/* With HOVERCRAFT_LIBM the platform's functions, which Python uses, too. */
static struct trig_pair sine_cosine(double angle)
{
#ifdef HOVERCRAFT_LIBM
    return (struct trig_pair){sin(angle), cos(angle)};
#else
    struct trig_turn turn = {.quarters = 0.0};
    return trig_sine_cosine(angle, &turn);
#endif
}

/* An end of the line, in the world frame; the arm is from the centre of gravity. */
struct line_end {
    double x, y, vx, vy, arm_x, arm_y;
};

static struct line_end end_of(const struct motion *craft, double x, double y)
{
    const struct trig_pair turned = sine_cosine(craft->heading);
    const double c = turned.cosine, s = turned.sine;
    const double arm_x = c * x - s * y, arm_y = s * x + c * y;
    return (struct line_end){
        .x = craft->x + arm_x,
        .y = craft->y + arm_y,
        .vx = craft->vx - craft->yaw_rate * arm_y,
        .vy = craft->vy + craft->yaw_rate * arm_x,
        .arm_x = arm_x,
        .arm_y = arm_y,
    };
}

static struct model pull(const struct motion *first, const struct motion *second, const struct line *line)
{
    const struct line_end near = end_of(first, line->first_x, line->first_y);
    const struct line_end far = end_of(second, line->second_x, line->second_y);
    const double dx = far.x - near.x, dy = far.y - near.y;
    struct model made = {.distance = square_root(dx * dx + dy * dy)};
    if (!(made.distance > line->slack_length))
        return made;
    const double along_x = dx / made.distance, along_y = dy / made.distance;
    const double speed = (far.vx - near.vx) * along_x + (far.vy - near.vy) * along_y;
    const double tension = line->stiffness * (made.distance - line->slack_length) + line->damping * speed;
    if (tension <= 0.0)
        return made;
    const double force_x = tension * along_x, force_y = tension * along_y;
    made.first = (struct load){force_x, force_y, near.arm_x * force_y - near.arm_y * force_x};
    made.second = (struct load){-force_x, -force_y, far.arm_y * force_x - far.arm_x * force_y};
    made.tension = tension;
    return made;
}

/* ---- behind the room */

static enum verdict sample(struct instance *instance)
{
    struct content *now = &instance->now;
    struct motion both[2];
    struct line line;
    double shown[SHOWN_COUNT];
    memcpy(both, now->inputs, sizeof both);
    instance_copy(&line, now->reals, LINE, LINE_COUNT);
    const struct model made = pull(&both[0], &both[1], &line);
    memcpy(shown, &made, sizeof shown);
    for (unsigned i = 0; i < SHOWN_COUNT; i++)
        if (!isfinite(shown[i]))
            return instance_say(instance, DISCARDED, "%s = %r: must be a finite number; the motion is out of range",
                                VARIABLES[SHOWN[i]].name, shown[i]);
    now->model = made;
    return FINE;
}

static enum verdict step_on(struct instance *instance, struct interval *interval)
{
    (void)interval;
    return sample(instance);
}

static enum verdict observe(struct instance *instance)
{
    instance_spread(instance->now.reals, &instance->now.model, SHOWN, SHOWN_COUNT);
    return FINE;
}

static void exchange_model(struct cursor *cursor, struct content *content)
{
    exchange_doubles(cursor, &content->model, sizeof content->model);
}

/* Whoever can work out a checksum may have written anything: outputs are finite numbers. */
static bool is_possible(const struct content *content)
{
    double shown[SHOWN_COUNT];
    memcpy(shown, &content->model, sizeof shown);
    for (unsigned i = 0; i < SHOWN_COUNT; i++)
        if (!isfinite(shown[i]))
            return false;
    return true;
}

const struct model_functions *model(void)
{
    static const struct model_functions functions = {
        .take_up = sample,
        .step = step_on,
        .observe = observe,
        .exchange = exchange_model,
        .is_possible = is_possible,
    };
    return &functions;
}
