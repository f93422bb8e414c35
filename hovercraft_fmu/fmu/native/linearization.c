#include "linearization.h"

#include <math.h>

#include "trig.h"

/* What all columns share; the names are those of the loads in kernel.c. */
struct point {
    const struct craft *craft;
    const struct state *state;
    struct derived derived;
    double c, s;                    /* of the heading */
    double u, v, w;                 /* m/s: through the air, body frame; w at the centre of drag */
    double kq, kq_u, kq_w;          /* kg/s, kg/m: k*q, and its slopes over u and w */
    double x, y;                    /* N: the force without friction, world frame */
    double thrust, port, starboard; /* 1: slopes of the saturation */
    double grip, radius;            /* kg/s, m: of friction */
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
    const double q = sqrt(p->u * p->u + p->w * p->w);
    if (p->craft->drag_area == DIRECTIONAL) {
        p->kq = ahead * fabs(p->u) + abeam * fabs(p->w);
        p->kq_u = ahead * sign(p->u);
        p->kq_w = abeam * sign(p->w);
    } else if (q > 0.0) { /* else all of it is 0: q*u is flat there */
        p->kq = k * q;
        p->kq_u = k * (p->u / q);
        p->kq_w = k * (p->w / q);
    }
}

static void friction_at(struct point *p)
{
    const struct state *state = p->state;
    p->radius = kernel_friction_radius(p->craft);
    const double turning = p->radius * state->yaw_rate;
    const double slip = sqrt(state->vx * state->vx + state->vy * state->vy + turning * turning);
    p->grip = p->derived.friction_force / slip;
    p->slip_x = state->vx / slip;
    p->slip_y = state->vy / slip;
    p->slip_r = turning / slip;
}

static struct point point_at(const struct state *state, const struct controls *controls, const struct craft *craft)
{
    struct point p = {.craft = craft, .state = state, .derived = kernel_derived(craft)};
    struct trig_turn turn = {.quarters = 0.0};
    const struct trig_pair turned = trig_sine_cosine(state->heading, &turn);
    const double air_x = state->vx - controls->wind_x, air_y = state->vy - controls->wind_y;
    p.c = turned.cosine;
    p.s = turned.sine;
    p.u = p.c * air_x + p.s * air_y;
    p.v = p.c * air_y - p.s * air_x;
    p.w = p.v + state->yaw_rate * p.derived.drag_center;
    drag_at(&p);
    const double force_x = kernel_saturate(controls, craft).thrust - p.kq * p.u;
    const double force_y = kernel_steering(controls, craft) - p.kq * p.w;
    p.x = p.c * force_x - p.s * force_y;
    p.y = p.s * force_x + p.c * force_y;
    p.thrust = slope(controls->thrust, craft->thrust_min, craft->thrust_max);
    p.port = slope(controls->port, 0.0, 1.0);
    p.starboard = slope(controls->starboard, 0.0, 1.0);
    if (craft->skirt_friction != 0.0)
        friction_at(&p);
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
    const double turning = p->radius * d->yaw_rate;
    const double along = p->slip_x * d->vx + p->slip_y * d->vy + p->slip_r * turning;
    return (struct loads){
        .x = p->c * force_x - p->s * force_y - d->heading * p->y - p->grip * (d->vx - p->slip_x * along),
        .y = p->s * force_x + p->c * force_y + d->heading * p->x - p->grip * (d->vy - p->slip_y * along),
        .moment = x_d * drag_y + p->derived.thruster_moment * steering - spin * d->yaw_rate -
                  p->grip * p->radius * (turning - p->slip_r * along),
    };
}

static void motion_at(const struct point *p, double motion[ROW_COUNT][KNOWN_COUNT])
{
    const struct state *state = p->state;
    const double speed = sqrt(state->vx * state->vx + state->vy * state->vy);
    const double surge = p->c * state->vx + p->s * state->vy, sway = p->c * state->vy - p->s * state->vx;
    const double rows[ROW_COUNT][KNOWN_COUNT] = {
        {0.0, 0.0, sway, p->c, p->s},
        {0.0, 0.0, -surge, -p->s, p->c},
        {0.0, 0.0, 0.0, speed > 0.0 ? state->vx / speed : 0.0, speed > 0.0 ? state->vy / speed : 0.0},
    };
    for (int row = 0; row < ROW_COUNT; row++)
        for (int known = 0; known < KNOWN_COUNT; known++)
            motion[row][known] = rows[row][known];
}

void kernel_linearize(const struct state *state, const struct controls *controls, const struct craft *craft,
                      struct linearization *linearization)
{
    const struct point p = point_at(state, controls, craft);
    motion_at(&p, linearization->motion);
    for (int known = 0; known < KNOWN_COUNT; known++) {
        double d[KNOWN_COUNT] = {0.0};
        d[known] = 1.0;
        const struct state d_state = {d[0], d[1], d[2], d[3], d[4], d[5]};
        const struct controls d_controls = {d[6], d[7], d[8], d[9], d[10]};
        const struct loads loads = change(&p, &d_state, &d_controls);
        linearization->acceleration[0][known] = loads.x / craft->mass;
        linearization->acceleration[1][known] = loads.y / craft->mass;
        linearization->acceleration[2][known] = loads.moment / craft->inertia;
    }
}
