#include "linearization.h"

#include <math.h>
#include <string.h>

#include "partials.h"
#include "root.h"
#include "trig.h"

/* Below each number of the craft is differentiated by hand. */
_Static_assert(CRAFT_REAL_COUNT == 14, "change_of_derived and change_of_craft follow every number of struct craft");

/* What all columns share; the names are those of the loads in kernel.c. */
struct point {
    const struct craft *craft;
    const struct state *state;
    const struct controls *controls;
    struct derived derived;
    double c, s;                    /* of the heading */
    double u, v, w, q;              /* m/s: through the air, body frame; w and q at the centre of drag */
    double kq, kq_u, kq_w;          /* kg/s, kg/m: k*q, and its slopes over u and w */
    double drag_y;                  /* N: body frame */
    double x, y;                    /* N: the force without friction and loads from outside, world frame */
    double thrust, port, starboard; /* 1: slopes of the saturation */
    struct friction_radius skirt;   /* m */
    double grip;                    /* kg/s: of friction */
    double slip_x, slip_y, slip_r;  /* 1: the direction of the slip */
};

static double sign(double value)
{
    return value > 0.0 ? 1.0 : value < 0.0 ? -1.0 : 0.0;
}

/* Of a value that is held from low to high. */
static double slope(double value, double low, double high)
{
    return low < high && low <= value && value <= high ? 1.0 : 0.0;
}

static void drag_at(struct point *p)
{
    const double k = p->derived.drag_factor, ahead = p->derived.drag_factor_ahead, abeam = p->derived.drag_factor_abeam;
    p->q = square_root(p->u * p->u + p->w * p->w);
    if (p->craft->drag_area == DIRECTIONAL) {
        p->kq = ahead * fabs(p->u) + abeam * fabs(p->w);
        p->kq_u = ahead * sign(p->u);
        p->kq_w = abeam * sign(p->w);
    } else if (p->q > 0.0) { /* else all of it is 0: q*u is flat there */
        p->kq = k * p->q;
        p->kq_u = k * (p->u / p->q);
        p->kq_w = k * (p->w / p->q);
    }
}

/* The slip [m/s] of a motion over the ground, or of the one that an acceleration begins; its direction is kept. */
static double slip_at(struct point *p, double x, double y, double turning)
{
    const double slip = square_root(x * x + y * y + turning * turning);
    p->slip_x = slip > 0.0 ? x / slip : 0.0;
    p->slip_y = slip > 0.0 ? y / slip : 0.0;
    p->slip_r = slip > 0.0 ? turning / slip : 0.0;
    return slip;
}

static double skirt_at(struct point *p)
{
    p->skirt = kernel_friction_radius(p->craft);
    return slip_at(p, p->state->vx, p->state->vy, p->skirt.radius * p->state->yaw_rate);
}

static struct point point_at(const struct state *state, const struct controls *controls, const struct craft *craft)
{
    struct point p = {.craft = craft, .state = state, .controls = controls, .derived = kernel_derived(craft)};
    struct trig_turn turn = {.quarters = 0.0};
    const struct trig_pair turned = trig_sine_cosine(state->heading, &turn);
    const double air_x = state->vx - controls->wind_x, air_y = state->vy - controls->wind_y;
    p.c = turned.cosine;
    p.s = turned.sine;
    p.u = p.c * air_x + p.s * air_y;
    p.v = p.c * air_y - p.s * air_x;
    p.w = p.v + state->yaw_rate * p.derived.drag_center;
    drag_at(&p);
    p.drag_y = -p.kq * p.w;
    const double force_x = kernel_saturate(controls, craft).thrust - p.kq * p.u;
    const double force_y = p.drag_y + kernel_steering(controls, craft);
    p.x = p.c * force_x - p.s * force_y;
    p.y = p.s * force_x + p.c * force_y;
    p.thrust = slope(controls->thrust, craft->thrust_min, craft->thrust_max);
    p.port = slope(controls->port, 0.0, 1.0);
    p.starboard = slope(controls->starboard, 0.0, 1.0);
    if (craft->skirt_friction != 0.0)
        p.grip = p.derived.friction_force / skirt_at(&p);
    return p;
}

/* The change of the loads with a small change of state and controls: the loads of kernel.c, differentiated line by
   line. */
static struct loads change(const struct point *p, const struct state *d, const struct controls *dc)
{
    const double x_d = p->derived.drag_center, air_x = d->vx - dc->wind_x, air_y = d->vy - dc->wind_y;
    const double u = p->c * air_x + p->s * air_y + d->heading * p->v;
    const double w = p->c * air_y - p->s * air_x - d->heading * p->u + d->yaw_rate * x_d;
    const double kq = p->kq_u * u + p->kq_w * w;
    const double steering = p->port * dc->port - p->starboard * dc->starboard;
    const double drag_y = -(kq * p->w + p->kq * w);
    const double force_x = p->thrust * dc->thrust - (kq * p->u + p->kq * u);
    const double force_y = drag_y + p->craft->steering_force * steering;
    const double spin = 2.0 * p->derived.spin_drag_factor * fabs(p->state->yaw_rate);
    const double turning = p->skirt.radius * d->yaw_rate;
    const double along = p->slip_x * d->vx + p->slip_y * d->vy + p->slip_r * turning;
    return (struct loads){
        .x = p->c * force_x - p->s * force_y - d->heading * p->y + dc->external_force_x -
             p->grip * (d->vx - p->slip_x * along),
        .y = p->s * force_x + p->c * force_y + d->heading * p->x + dc->external_force_y -
             p->grip * (d->vy - p->slip_y * along),
        .moment = x_d * drag_y + p->derived.thruster_moment * steering + dc->external_moment - spin * d->yaw_rate -
                  p->grip * p->skirt.radius * (turning - p->slip_r * along),
    };
}

/* The change of what is worked out of the craft with a small change of it. */
static struct derived change_of_derived(const struct craft *craft, const struct craft *d)
{
    const double length = craft->length, width = craft->width, height = craft->height, share = craft->rotational_drag;
    const double mean = (length + width) / 2.0, square = length * length;
    const double pressure = 0.5 * craft->air_density * craft->drag_coefficient; /* of the air, over q*q */
    const double d_pressure =
        0.5 * (d->air_density * craft->drag_coefficient + craft->air_density * d->drag_coefficient);
    const double d_area = (d->length + d->width) / 2.0 * height + mean * d->height;
    const double spin = height * (square * square) / 32.0;
    const double d_spin = (d->height * length + 4.0 * height * d->length) * (length * square) / 32.0;
    return (struct derived){
        .projected_area = d_area,
        .drag_factor = d_pressure * (mean * height) + pressure * d_area,
        .drag_factor_ahead = d_pressure * (width * height) + pressure * (d->width * height + width * d->height),
        .drag_factor_abeam = d_pressure * (length * height) + pressure * (d->length * height + length * d->height),
        .spin_drag_factor =
            d->rotational_drag * (pressure * spin) + share * (d_pressure * spin + pressure * d_spin),
        .friction_force = (d->skirt_friction * craft->mass + craft->skirt_friction * d->mass) * craft->gravity +
                          craft->skirt_friction * craft->mass * d->gravity,
        .drag_center = d->drag_center_fraction * length + craft->drag_center_fraction * d->length,
        .thruster_moment = 0.5 * (d->length * craft->steering_force + length * d->steering_force),
    };
}

/* And of the loads: `held` are the controls after saturation, `dd` is that change. */
static struct loads change_of_craft(const struct point *p, const struct controls *held, const struct craft *d,
                                    const struct derived *dd)
{
    const struct craft *craft = p->craft;
    const struct friction_radius *skirt = &p->skirt;
    const double r = p->state->yaw_rate, steering = held->port - held->starboard;
    const double w = r * dd->drag_center;
    const double k_q = craft->drag_area == DIRECTIONAL
                           ? dd->drag_factor_ahead * fabs(p->u) + dd->drag_factor_abeam * fabs(p->w)
                           : dd->drag_factor * p->q;
    const double kq = k_q + p->kq_w * w;
    const double low = p->controls->thrust < craft->thrust_min ? d->thrust_min : 0.0;
    const double high = p->controls->thrust > craft->thrust_max ? d->thrust_max : 0.0;
    const double drag_y = -(kq * p->w + p->kq * w);
    const double force_x = low + high - kq * p->u;
    const double force_y = drag_y + d->steering_force * steering;
    const double radius = ((skirt->diagonal + 2.0 * skirt->along - skirt->across) * (d->length / craft->length) +
                           (skirt->diagonal + 2.0 * skirt->across - skirt->along) * (d->width / craft->width)) / 12.0;
    const double turning = radius * r;
    const double rubbed = dd->friction_force - p->grip * (p->slip_r * turning);
    return (struct loads){
        .x = p->c * force_x - p->s * force_y - rubbed * p->slip_x,
        .y = p->s * force_x + p->c * force_y - rubbed * p->slip_y,
        .moment = p->derived.drag_center * drag_y + dd->drag_center * p->drag_y + dd->thruster_moment * steering -
                  dd->spin_drag_factor * r * fabs(r) - skirt->radius * (rubbed * p->slip_r + p->grip * turning) -
                  radius * (p->derived.friction_force * p->slip_r),
    };
}

static void parameters_at(struct point p, struct linearization *linearization)
{
    const struct craft *craft = p.craft;
    const struct controls held = kernel_saturate(p.controls, craft);
    const struct loads loads = kernel_loads_on(p.state, p.controls, craft);
    const double x = loads.x / craft->mass, y = loads.y / craft->mass, yaw = loads.moment / craft->inertia;
    if (craft->skirt_friction == 0.0 && skirt_at(&p) == 0.0)
        slip_at(&p, x, y, p.skirt.radius * yaw);
    for (int known = KNOWN_COUNT; known < INITIAL_KNOWN_COUNT; known++) {
        struct craft d_craft = {0};
        *(double *)(void *)((char *)&d_craft + CRAFT_REALS[known - KNOWN_COUNT]) = 1.0;
        const struct derived derived = change_of_derived(craft, &d_craft);
        const struct loads d_loads = change_of_craft(&p, &held, &d_craft, &derived);
        linearization->of[ROW_ACCELERATION_X][known] = (d_loads.x - d_craft.mass * x) / craft->mass;
        linearization->of[ROW_ACCELERATION_Y][known] = (d_loads.y - d_craft.mass * y) / craft->mass;
        linearization->of[ROW_ACCELERATION_YAW][known] = (d_loads.moment - d_craft.inertia * yaw) / craft->inertia;
        linearization->of[ROW_PROJECTED_AREA][known] = derived.projected_area;
    }
}

static void motion_at(const struct point *p, struct linearization *linearization)
{
    const struct state *state = p->state;
    const double speed = square_root(state->vx * state->vx + state->vy * state->vy);
    const double surge = p->c * state->vx + p->s * state->vy, sway = p->c * state->vy - p->s * state->vx;
    double (*of)[INITIAL_KNOWN_COUNT] = linearization->of;
    of[ROW_BODY_SURGE][KNOWN_POSE_HEADING] = sway;
    of[ROW_BODY_SURGE][KNOWN_VELOCITY_X] = p->c;
    of[ROW_BODY_SURGE][KNOWN_VELOCITY_Y] = p->s;
    of[ROW_BODY_SWAY][KNOWN_POSE_HEADING] = -surge;
    of[ROW_BODY_SWAY][KNOWN_VELOCITY_X] = -p->s;
    of[ROW_BODY_SWAY][KNOWN_VELOCITY_Y] = p->c;
    of[ROW_SPEED][KNOWN_VELOCITY_X] = speed > 0.0 ? state->vx / speed : 0.0;
    of[ROW_SPEED][KNOWN_VELOCITY_Y] = speed > 0.0 ? state->vy / speed : 0.0;
}

static void accelerations_at(const struct point *p, struct linearization *linearization)
{
    for (int known = 0; known < KNOWN_COUNT; known++) {
        double d[KNOWN_COUNT] = {0.0};
        struct state d_state;
        struct controls d_controls;
        d[known] = 1.0;
        memcpy(&d_state, d, sizeof d_state);
        memcpy(&d_controls, d + STATE_COUNT, sizeof d_controls);
        const struct loads loads = change(p, &d_state, &d_controls);
        linearization->of[ROW_ACCELERATION_X][known] = loads.x / p->craft->mass;
        linearization->of[ROW_ACCELERATION_Y][known] = loads.y / p->craft->mass;
        linearization->of[ROW_ACCELERATION_YAW][known] = loads.moment / p->craft->inertia;
    }
}

void kernel_linearize(const struct state *state, const struct controls *controls, const struct craft *craft,
                      bool parameters, struct linearization *linearization)
{
    const struct point p = point_at(state, controls, craft);
    *linearization = (struct linearization){{{0.0}}};
    motion_at(&p, linearization);
    accelerations_at(&p, linearization);
    if (parameters)
        parameters_at(p, linearization);
}
