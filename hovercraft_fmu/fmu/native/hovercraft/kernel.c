#include "kernel.h"

#include <math.h>
#include <string.h>

#include "logarithm.h"
#include "root.h"
#include "trig.h"

static const double MIN_STEP = 1e-12;     /* s: below it the adaptive method gives up */
static const double MAX_SUBSTEPS = 1e9;   /* of one communication step */
static const double MAX_TURN = 1.0;       /* rad, in a step of the adaptive method */
static const double MAX_GROWTH = 5.0;     /* of such a step over the one before */
static const double NEAR_REST = 4.0;      /* sub-steps in which friction could stop the craft */
static const double MOST = 1e100;         /* h times a rate of drag is taken as no more by splitting */
static const double LEAST_SLIP = 1e-150;  /* m/s: so that at rest nothing is divided by zero */
static const double LARGEST = 1e300;      /* m, rad: the estimate of an error where there is none */
static const double TIGHTER = 32.0;       /* the adaptive companion's tolerance is smaller by this */
static const double NOT_SMALL = 0.25;     /* of the way: an error above it is lost */
static const int FEW = 20;                /* sub-steps: before so many even a small error is not small beside the way */
static const double TO_INTEGER = 0x1p+52; /* adding and subtracting it rounds what is smaller, ties to even */

/* Steps of the adaptive method in one communication step, taken or tried. (A test has not the time for so many.) */
#ifndef HOVERCRAFT_MAX_TRIED
#define HOVERCRAFT_MAX_TRIED 100000000
#endif

/* With HOVERCRAFT_LIBM the platform's functions, which Python uses, too. */
#ifdef HOVERCRAFT_LIBM

static ALWAYS_INLINE struct trig_pair sine_cosine(double angle, struct trig_turn *turn)
{
    (void)turn;
    return (struct trig_pair){sin(angle), cos(angle)};
}

static double natural_logarithm(double x)
{
    return log(x);
}

#else

static ALWAYS_INLINE struct trig_pair sine_cosine(double angle, struct trig_turn *turn)
{
    return trig_sine_cosine(angle, turn);
}

static double natural_logarithm(double x)
{
    return logarithm_of(x);
}

#endif

/* ---- craft.py */

static double projected_area(const struct craft *craft)
{
    return (craft->length + craft->width) / 2.0 * craft->height;
}

static double drag_factor(const struct craft *craft)
{
    return 0.5 * craft->air_density * projected_area(craft) * craft->drag_coefficient;
}

static double drag_factor_ahead(const struct craft *craft)
{
    return 0.5 * craft->air_density * (craft->width * craft->height) * craft->drag_coefficient;
}

static double drag_factor_abeam(const struct craft *craft)
{
    return 0.5 * craft->air_density * (craft->length * craft->height) * craft->drag_coefficient;
}

static double spin_drag_factor(const struct craft *craft)
{
    const double square = craft->length * craft->length;
    const double whole = craft->air_density * craft->drag_coefficient * craft->height * (square * square) / 64.0;
    return craft->rotational_drag * whole;
}

static double friction_force(const struct craft *craft)
{
    return craft->skirt_friction * craft->mass * craft->gravity;
}

static bool has_plain_drag(const struct craft *craft)
{
    return craft->drag_area == CONSTANT && craft->rotational_drag == 0.0;
}

static bool rubs(const struct craft *craft)
{
    return craft->skirt_friction != 0.0;
}

static double drag_center(const struct craft *craft)
{
    return craft->drag_center_fraction * craft->length;
}

static double thruster_moment(const struct craft *craft)
{
    return 0.5 * craft->length * craft->steering_force;
}

static double drag_rate(const struct craft *craft)
{
    const double x_d = drag_center(craft);
    return 2.0 * (1.0 / craft->mass + x_d * x_d / craft->inertia);
}

static double spin_rate(const struct craft *craft)
{
    return 2.0 * spin_drag_factor(craft) / craft->inertia;
}

struct derived kernel_derived(const struct craft *craft)
{
    return (struct derived){
        .projected_area = projected_area(craft),
        .drag_factor = drag_factor(craft),
        .drag_factor_ahead = drag_factor_ahead(craft),
        .drag_factor_abeam = drag_factor_abeam(craft),
        .spin_drag_factor = spin_drag_factor(craft),
        .friction_force = friction_force(craft),
        .drag_center = drag_center(craft),
        .thruster_moment = thruster_moment(craft),
        .drag_rate = drag_rate(craft),
        .spin_rate = spin_rate(craft),
    };
}

/* ---- dynamics.py */

static double clip(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

struct controls kernel_saturate(const struct controls *controls, const struct craft *craft)
{
    struct controls held = *controls;
    held.thrust = clip(controls->thrust, craft->thrust_min, craft->thrust_max);
    held.port = clip(controls->port, 0.0, 1.0);
    held.starboard = clip(controls->starboard, 0.0, 1.0);
    return held;
}

double kernel_steering(const struct controls *controls, const struct craft *craft)
{
    const struct controls held = kernel_saturate(controls, craft);
    return craft->steering_force * (held.port - held.starboard);
}

/* But for the loads from outside. */
static ALWAYS_INLINE struct controls ramp_at(const struct drive *drive, double time)
{
    return (struct controls){
        .thrust = drive->start.thrust + time * drive->rate.thrust,
        .port = drive->start.port + time * drive->rate.port,
        .starboard = drive->start.starboard + time * drive->rate.starboard,
        .wind_x = drive->start.wind_x + time * drive->rate.wind_x,
        .wind_y = drive->start.wind_y + time * drive->rate.wind_y,
    };
}

struct controls kernel_controls_at(const struct drive *drive, double time)
{
    if (!drive->varies)
        return drive->start;
    if (drive->ask)
        return drive->ask(drive->asked, drive->later + time);
    struct controls controls = ramp_at(drive, time);
    controls.external_force_x = drive->start.external_force_x + time * drive->rate.external_force_x;
    controls.external_force_y = drive->start.external_force_y + time * drive->rate.external_force_y;
    controls.external_moment = drive->start.external_moment + time * drive->rate.external_moment;
    return controls;
}

/* Whether the air moves, now or later in the step, or could. */
static bool is_windy(const struct drive *drive)
{
    const struct controls *start = &drive->start, *rate = &drive->rate;
    return drive->ask || start->wind_x != 0.0 || start->wind_y != 0.0 || rate->wind_x != 0.0 || rate->wind_y != 0.0;
}

static bool has_external_load(const struct controls *controls)
{
    return controls->external_force_x != 0.0 || controls->external_force_y != 0.0 || controls->external_moment != 0.0;
}

/* Whether there are loads from outside, now or later in the step, or could be. */
static bool is_pushed(const struct drive *drive)
{
    return drive->ask || has_external_load(&drive->start) || has_external_load(&drive->rate);
}

enum drag_kind { WITHOUT_DRAG, PLAIN_DRAG, ANY_DRAG };
/* What else there is: a sum of these. */
enum beside { FRICTION = 1, OUTSIDE = 2 };

/* All that the loads need and that does not change from sub-step to sub-step; `steer` renews the controls' part. Forces
   are times `per_mass`, moments times `per_inertia`: so no division, and no constant factor, stands in a loop. */
struct load_function {
    enum drag_kind kind;
    unsigned beside; /* enum beside: loads in the world frame */
    bool directional;
    double per_mass, per_inertia;
    double k;                  /* kg/m; with the directional area 1, as q then has the two factors in it */
    double ahead, abeam, x_d;  /* kg/m, kg/m, m */
    double drag, turning_drag; /* k, and k*x_d */
    double spin;               /* of the rotational drag */
    double drag_rate, spin_rate; /* 1/kg, 1: of the stability number, see integrators.py */
    double grip, turning_grip; /* of friction: its force, and force*radius */
    double radius;             /* m: of friction */
    double thrust, side, turn;
    double wind_x, wind_y;     /* m/s */
    double external_x, external_y, external_moment;
    double begun;              /* s: where in the communication step its time 0 is */
    const struct craft *craft;
    const struct drive *drive;
    struct trig_turn last; /* of the heading */
};

static ALWAYS_INLINE void steer(struct load_function *f, const struct controls *controls, bool pushed)
{
    const struct craft *craft = f->craft;
    const double command = clip(controls->port, 0.0, 1.0) - clip(controls->starboard, 0.0, 1.0);
    f->thrust = clip(controls->thrust, craft->thrust_min, craft->thrust_max) * f->per_mass;
    f->side = craft->steering_force * command * f->per_mass;
    f->turn = thruster_moment(craft) * command * f->per_inertia;
    f->wind_x = controls->wind_x;
    f->wind_y = controls->wind_y;
    if (pushed) {
        f->external_x = controls->external_force_x * f->per_mass;
        f->external_y = controls->external_force_y * f->per_mass;
        f->external_moment = controls->external_moment * f->per_inertia;
    }
}

static NEVER_INLINE void steer_now(struct load_function *f, double time)
{
    if (f->beside & OUTSIDE) { /* as where somebody is asked */
        const struct controls controls = kernel_controls_at(f->drive, time);
        steer(f, &controls, true);
    } else {
        const struct controls controls = ramp_at(f->drive, time);
        steer(f, &controls, false);
    }
}

/* The controls at a time [s] after the start. */
static ALWAYS_INLINE void steer_at(struct load_function *f, double time)
{
    if (f->drive->varies)
        steer_now(f, f->begun + time);
}

struct friction_radius kernel_friction_radius(const struct craft *craft)
{
    const double length = craft->length, width = craft->width;
    const double d = square_root(length * length + width * width);
    const double along = length * length / width * natural_logarithm((width + d) / length);
    const double across = width * width / length * natural_logarithm((length + d) / width);
    return (struct friction_radius){d / 6.0 + (along + across) / 12.0, d, along, across};
}

/* The loads on the craft, but for the friction of its skirt: 1 and 1 for forces and moment; 1/m and 1/I for the
   accelerations; h/m and h/I for what they add to the velocities in the time h. */
static struct load_function load_function(const struct drive *drive, const struct craft *craft, double per_mass,
                                          double per_inertia)
{
    struct load_function f = {.per_mass = per_mass, .per_inertia = per_inertia, .craft = craft, .drive = drive};
    f.k = drag_factor(craft);
    f.x_d = drag_center(craft);
    f.drag_rate = drag_rate(craft);
    f.spin_rate = spin_rate(craft);
    f.beside = is_pushed(drive) ? OUTSIDE : 0;
    const bool plain = has_plain_drag(craft) && !is_windy(drive) && !f.beside;
    f.kind = f.k == 0.0 ? WITHOUT_DRAG : plain ? PLAIN_DRAG : ANY_DRAG;
    if (f.kind == ANY_DRAG) {
        f.ahead = drag_factor_ahead(craft);
        f.abeam = drag_factor_abeam(craft);
        f.spin = spin_drag_factor(craft) * per_inertia;
        f.directional = craft->drag_area == DIRECTIONAL;
        if (f.directional)
            f.k = 1.0;
    }
    f.drag = f.k * per_mass;
    f.turning_drag = f.k * f.x_d * per_inertia;
    steer(&f, &drive->start, f.beside & OUTSIDE);
    return f;
}

/* All loads on a craft that slides. */
static struct load_function sliding_load_function(const struct drive *drive, const struct craft *craft,
                                                  double per_mass, double per_inertia)
{
    struct load_function f = load_function(drive, craft, per_mass, per_inertia);
    f.beside |= FRICTION;
    f.radius = kernel_friction_radius(craft).radius;
    f.grip = friction_force(craft) * per_mass;
    f.turning_grip = friction_force(craft) * f.radius * per_inertia;
    return f;
}

/* Velocity of the centre of drag through the air, body frame, and its size; see `k` above. */
struct air {
    double u, w; /* m/s */
    double q;    /* m/s */
};

/* m/s: q, of (u, w). */
static ALWAYS_INLINE double air_speed(const struct load_function *f, enum drag_kind kind, double u, double w)
{
    return kind == ANY_DRAG && f->directional ? f->ahead * fabs(u) + f->abeam * fabs(w)
                                              : square_root(u * u + w * w);
}

static ALWAYS_INLINE struct air air_at(const struct load_function *f, enum drag_kind kind, double c, double s,
                                       double vx, double vy, double yaw_rate)
{
    struct air air;
    if (kind == WITHOUT_DRAG)
        return (struct air){0.0, 0.0, 0.0};
    if (kind == ANY_DRAG) {
        vx = vx - f->wind_x;
        vy = vy - f->wind_y;
    }
    air.u = c * vx + s * vy;
    air.w = c * vy - s * vx + yaw_rate * f->x_d;
    air.q = air_speed(f, kind, air.u, air.w);
    return air;
}

static double slip_speed(double vx, double vy, double turning)
{
    return square_root(vx * vx + vy * vy + turning * turning);
}

/* For a kind, and what is beside, that the compiler may know. */
static ALWAYS_INLINE struct loads loads_as(struct load_function *f, enum drag_kind kind, unsigned beside,
                                           double heading, double vx, double vy, double yaw_rate)
{
    const struct trig_pair turned = sine_cosine(heading, &f->last);
    const double c = turned.cosine, s = turned.sine;
    struct loads loads;
    if (kind == WITHOUT_DRAG) {
        loads = (struct loads){c * f->thrust - s * f->side, s * f->thrust + c * f->side, f->turn, 0.0};
    } else {
        const struct air air = air_at(f, kind, c, s, vx, vy, yaw_rate);
        const double force_x = f->thrust - f->drag * air.u * air.q;
        const double force_y = f->side - f->drag * air.w * air.q;
        double moment = f->turn - f->turning_drag * air.w * air.q;
        if (kind == ANY_DRAG)
            moment = moment - f->spin * yaw_rate * fabs(yaw_rate);
        loads = (struct loads){c * force_x - s * force_y, s * force_x + c * force_y, moment, f->k * air.q};
    }
    if (!beside)
        return loads;
    if (beside != FRICTION) { /* OUTSIDE is in it; asked so, a sub-step has fewer instructions */
        loads.x = loads.x + f->external_x;
        loads.y = loads.y + f->external_y;
        loads.moment = loads.moment + f->external_moment;
    }
    if (beside != OUTSIDE) { /* FRICTION is in it */
        const double turning = f->radius * yaw_rate;
        const double slowness = 1.0 / larger(slip_speed(vx, vy, turning), LEAST_SLIP);
        loads.x = loads.x - f->grip * slowness * vx;
        loads.y = loads.y - f->grip * slowness * vy;
        loads.moment = loads.moment - f->turning_grip * slowness * turning;
    }
    return loads;
}

static struct loads loads_at(struct load_function *f, double heading, double vx, double vy, double yaw_rate)
{
    return loads_as(f, f->kind, f->beside, heading, vx, vy, yaw_rate);
}

/* How much of v, and of rho*r, friction can take away in a time [m/s]. */
struct friction {
    bool rubs;
    double a, b, radius;
};

enum { NEWTON = 30 };

static struct friction friction_function(const struct craft *craft, double h)
{
    struct friction friction = {.rubs = rubs(craft)};
    if (friction.rubs) {
        const double radius = kernel_friction_radius(craft).radius, force = friction_force(craft);
        friction.radius = radius;
        friction.a = h * (force / craft->mass);
        friction.b = h * (force * radius * radius / craft->inertia);
    }
    return friction;
}

/* What friction makes of velocities that were reached without it: an implicit step. */
static void rub(const struct friction *friction, double *vx, double *vy, double *yaw_rate)
{
    const double a = friction->a, b = friction->b, turning = friction->radius * *yaw_rate;
    const double straight = *vx * *vx + *vy * *vy, turned = turning * turning;
    if (straight * (b * b) + turned * (a * a) <= (a * a) * (b * b)) { /* it holds */
        *vx = *vy = *yaw_rate = 0.0;
        return;
    }
    double q = larger(square_root(straight + turned) - larger(a, b), 0.0);
    for (int i = 0; i < NEWTON; i++) {
        const double of_v = q + a, of_r = q + b;
        const double part_v = straight / (of_v * of_v), part_r = turned / (of_r * of_r);
        const double size = part_v + part_r;
        const double new = q + size * (square_root(size) - 1.0) / (part_v / of_v + part_r / of_r);
        if (!(new > q))
            break;
        q = new;
    }
    const double of_v = q / (q + a), of_r = q / (q + b);
    *vx = *vx * of_v;
    *vy = *vy * of_v;
    *yaw_rate = *yaw_rate * of_r;
}

/* What friction leaves of a push on a craft at rest: its implicit step from rest, over any time, gives the rate. */
static struct loads loads_at_rest(struct load_function *f, double heading)
{
    const struct craft *craft = f->craft;
    const struct friction friction = friction_function(craft, 1.0);
    const struct loads push = loads_at(f, heading, 0.0, 0.0, 0.0);
    double ax = push.x / craft->mass, ay = push.y / craft->mass, turning = push.moment / craft->inertia;
    rub(&friction, &ax, &ay, &turning);
    return (struct loads){craft->mass * ax, craft->mass * ay, craft->inertia * turning, push.kq};
}

struct loads kernel_loads_on(const struct state *state, const struct controls *controls, const struct craft *craft)
{
    const struct drive drive = {.start = *controls};
    struct load_function f =
        rubs(craft) ? sliding_load_function(&drive, craft, 1.0, 1.0) : load_function(&drive, craft, 1.0, 1.0);
    if (rubs(craft) && state->vx == 0.0 && state->vy == 0.0 && state->yaw_rate == 0.0) {
        f.beside &= OUTSIDE;
        return loads_at_rest(&f, state->heading);
    }
    return loads_at(&f, state->heading, state->vx, state->vy, state->yaw_rate);
}

void kernel_body_velocity(const struct state *state, double *surge, double *sway)
{
    struct trig_turn turn = {.quarters = 0.0};
    const struct trig_pair turned = sine_cosine(state->heading, &turn);
    const double c = turned.cosine, s = turned.sine;
    *surge = c * state->vx + s * state->vy;
    *sway = c * state->vy - s * state->vx;
}

/* ---- integrators.py */

enum { PIECE = 1 << 16 }; /* sub-steps after which it is seen whether the motion is still finite */

/* What is watched over a stretch. */
struct watch {
    double most;        /* 1/s: the fastest drag; of plain drag the largest k*q [kg/s], which is times one constant */
    double left, right; /* rad/s: the least and the largest yaw rate */
};

/* 1/s: no linearized drag is faster; see integrators.py. */
static inline double fastest_rate(const struct load_function *f, double kq, double yaw_rate)
{
    return kq * f->drag_rate + fabs(yaw_rate) * f->spin_rate;
}

static ALWAYS_INLINE void watch_loads(struct watch *watch, const struct load_function *f, enum drag_kind kind,
                                      double kq, double yaw_rate)
{
    watch->most = larger(watch->most, kind == PLAIN_DRAG ? kq : fastest_rate(f, kq, yaw_rate));
}

static inline void watch_yaw_rate(struct watch *watch, double yaw_rate)
{
    watch->left = smaller(watch->left, yaw_rate);
    watch->right = larger(watch->right, yaw_rate);
}

static struct stretch watched_stretch(const struct load_function *f, const struct state *s, int64_t n, double h,
                                      const struct watch *watch)
{
    return (struct stretch){
        .state = *s,
        .substeps = n,
        .stability = h * (f->kind == PLAIN_DRAG ? watch->most * f->drag_rate : watch->most),
        .rotation = h * larger(watch->right, -watch->left),
        .substep = h,
    };
}

/* And at its end. */
static struct stretch stretch_of(struct load_function *f, const struct state *s, int64_t n, double h,
                                 struct watch *watch)
{
    watch_loads(watch, f, f->kind, loads_at(f, s->heading, s->vx, s->vy, s->yaw_rate).kq, s->yaw_rate);
    return watched_stretch(f, s, n, h, watch);
}

static bool is_finite(const struct state *s)
{
    return isfinite(s->x) && isfinite(s->y) && isfinite(s->heading) && isfinite(s->vx) && isfinite(s->vy) &&
           isfinite(s->yaw_rate);
}

/* Sub-steps are made in pieces: of a motion that has left the range of numbers nothing more is worked out. */
static ALWAYS_INLINE int64_t end_of_piece(int64_t begun, int64_t n)
{
    return n - begun > PIECE ? begun + PIECE : n;
}

static ALWAYS_INLINE struct stretch euler_as(enum drag_kind kind, unsigned beside, const struct state *state,
                                             struct load_function *f, double h, int64_t n)
{
    const struct friction friction = friction_function(f->craft, h);
    struct state s = *state;
    struct watch watch = {0.0, s.yaw_rate, s.yaw_rate};
    int64_t i = 0;
    do
        for (const int64_t end = end_of_piece(i, n); i < end; i++) {
            steer_at(f, (double)i * h);
            const struct loads push = loads_as(f, kind, beside, s.heading, s.vx, s.vy, s.yaw_rate);
            watch_loads(&watch, f, kind, push.kq, s.yaw_rate);
            s.vx = s.vx + push.x;
            s.vy = s.vy + push.y;
            s.yaw_rate = s.yaw_rate + push.moment;
            if (friction.rubs)
                rub(&friction, &s.vx, &s.vy, &s.yaw_rate);
            s.x = s.x + h * s.vx;
            s.y = s.y + h * s.vy;
            s.heading = s.heading + h * s.yaw_rate;
            watch_yaw_rate(&watch, s.yaw_rate);
        }
    while (i < n && is_finite(&s));
    return stretch_of(f, &s, n, h, &watch);
}

/* Of loads in the time h. The compiler makes a loop of its own for the default's drag: what a scene does not ask for
   costs nothing. */
static struct stretch semi_implicit_euler(const struct state *state, struct load_function *f, double h, int64_t n)
{
    if (f->kind == PLAIN_DRAG)
        return euler_as(PLAIN_DRAG, 0, state, f, h, n);
    return euler_as(f->kind == WITHOUT_DRAG ? WITHOUT_DRAG : ANY_DRAG, f->beside & OUTSIDE, state, f, h, n);
}

/* Ahead, abeam and turning, at a heading: the craft's own push, and what comes from outside. */
struct push {
    double ahead, abeam, turn;
};

static ALWAYS_INLINE struct push push_at(const struct load_function *f, unsigned beside, double c, double s)
{
    struct push push = {f->thrust, f->side, f->turn};
    if (beside & OUTSIDE) {
        push.ahead = push.ahead + (c * f->external_x + s * f->external_y);
        push.abeam = push.abeam + (c * f->external_y - s * f->external_x);
        push.turn = push.turn + f->external_moment;
    }
    return push;
}

static struct stretch drag_implicit(const struct state *state, struct load_function *f, double h, int64_t n)
{
    const double mass = f->craft->mass, inertia = f->craft->inertia, x_d = f->x_d;
    const double spin = spin_drag_factor(f->craft), arm = mass * x_d * x_d, square = x_d * x_d;
    const bool in_wind = is_windy(f->drive), spins = f->craft->rotational_drag != 0.0;
    const bool scene = in_wind || spins || f->beside;
    const struct friction friction = friction_function(f->craft, h);
    double damped = inertia;
    struct state z = *state;
    struct watch watch = {0.0, z.yaw_rate, z.yaw_rate};
    int64_t i = 0;
    do
        for (const int64_t end = end_of_piece(i, n); i < end; i++) {
            steer_at(f, (double)i * h);
            const struct trig_pair turned = sine_cosine(z.heading, &f->last);
            const double c = turned.cosine, s = turned.sine;
            const double kq = f->k * air_at(f, f->kind, c, s, z.vx, z.vy, z.yaw_rate).q;
            const double g = h * kq;
            watch_loads(&watch, f, f->kind, kq, z.yaw_rate);
            struct push push = push_at(f, 0, c, s);
            if (scene) {
                if (in_wind) {
                    z.vx = z.vx - f->wind_x;
                    z.vy = z.vy - f->wind_y;
                }
                if (spins)
                    damped = inertia + h * spin * fabs(z.yaw_rate);
                push = push_at(f, f->beside, c, s);
            }
            const double v = c * z.vy - s * z.vx;
            const double b = inertia * z.yaw_rate + h * push.turn;
            const double e = x_d * (mass * v + h * push.abeam) - b;
            const double determinant = mass * damped + g * (damped + arm);
            const double kept = mass / (mass + g);
            const double surge = h * push.ahead / (mass + g);
            const double sway =
                ((damped + g * square) * (h * push.abeam) + g * x_d * (x_d * (g * kept) * v - b)) / determinant;
            z.yaw_rate = (mass * b - g * e) / determinant;
            z.vx = kept * z.vx + (c * surge - s * sway);
            z.vy = kept * z.vy + (s * surge + c * sway);
            if (in_wind) {
                z.vx = z.vx + f->wind_x;
                z.vy = z.vy + f->wind_y;
            }
            if (friction.rubs)
                rub(&friction, &z.vx, &z.vy, &z.yaw_rate);
            z.x = z.x + h * z.vx;
            z.y = z.y + h * z.vy;
            z.heading = z.heading + h * z.yaw_rate;
            watch_yaw_rate(&watch, z.yaw_rate);
        }
    while (i < n && is_finite(&z));
    return stretch_of(f, &z, n, h, &watch);
}

/* Of accelerations. */
static ALWAYS_INLINE struct stretch rk4_as(enum drag_kind kind, unsigned beside, const struct state *state,
                                           struct load_function *f, double h, int64_t n)
{
    const double half = 0.5 * h, sixth = h / 6.0, square = h * h / 6.0;
    struct state s = *state;
    struct watch watch = {0.0, s.yaw_rate, s.yaw_rate};
    int64_t i = 0;
    do
        for (const int64_t end = end_of_piece(i, n); i < end; i++) {
            const double t = (double)i * h;
            steer_at(f, t);
            const struct loads a1 = loads_as(f, kind, beside, s.heading, s.vx, s.vy, s.yaw_rate);
            const double r2 = s.yaw_rate + half * a1.moment;
            steer_at(f, t + half);
            const struct loads a2 = loads_as(f, kind, beside, s.heading + half * s.yaw_rate, s.vx + half * a1.x,
                                                     s.vy + half * a1.y, r2);
            const double r3 = s.yaw_rate + half * a2.moment;
            const struct loads a3 =
                loads_as(f, kind, beside, s.heading + half * r2, s.vx + half * a2.x, s.vy + half * a2.y, r3);
            const double r4 = s.yaw_rate + h * a3.moment;
            steer_at(f, t + h);
            const struct loads a4 = loads_as(f, kind, beside, s.heading + h * r3, s.vx + h * a3.x,
                                                     s.vy + h * a3.y, r4);
            watch_loads(&watch, f, kind, a1.kq, s.yaw_rate);
            watch_loads(&watch, f, kind, a2.kq, r2);
            watch_loads(&watch, f, kind, a3.kq, r3);
            watch_loads(&watch, f, kind, a4.kq, r4);
            s.x = s.x + h * s.vx + square * (a1.x + a2.x + a3.x);
            s.y = s.y + h * s.vy + square * (a1.y + a2.y + a3.y);
            s.heading = s.heading + h * s.yaw_rate + square * (a1.moment + a2.moment + a3.moment);
            s.vx = s.vx + sixth * (a1.x + 2.0 * a2.x + 2.0 * a3.x + a4.x);
            s.vy = s.vy + sixth * (a1.y + 2.0 * a2.y + 2.0 * a3.y + a4.y);
            s.yaw_rate = s.yaw_rate + sixth * (a1.moment + 2.0 * a2.moment + 2.0 * a3.moment + a4.moment);
            watch_yaw_rate(&watch, r2);
            watch_yaw_rate(&watch, r3);
            watch_yaw_rate(&watch, r4);
            watch_yaw_rate(&watch, s.yaw_rate);
        }
    while (i < n && is_finite(&s));
    return stretch_of(f, &s, n, h, &watch);
}

static struct stretch smooth_rk4(const struct state *state, struct load_function *f, double h, int64_t n)
{
    return f->kind == PLAIN_DRAG && !f->beside ? rk4_as(PLAIN_DRAG, 0, state, f, h, n)
                                               : rk4_as(f->kind, f->beside, state, f, h, n);
}

/* While it slides, friction is a load like others. Near rest it is not: an implicit step of Euler's. */
static struct stretch rk4_with_friction(const struct state *state, const struct drive *drive,
                                        const struct craft *craft, double h, int64_t n)
{
    struct load_function free = load_function(drive, craft, h / craft->mass, h / craft->inertia);
    struct load_function sliding = sliding_load_function(drive, craft, 1.0 / craft->mass, 1.0 / craft->inertia);
    const struct friction friction = friction_function(craft, h);
    const double near = NEAR_REST * larger(friction.a, friction.b);
    struct stretch whole = {.state = *state, .substeps = n, .substep = h};
    int64_t i = 0;
    do
        for (const int64_t end = end_of_piece(i, n); i < end; i++) {
            const struct state *s = &whole.state;
            const bool at_rest = slip_speed(s->vx, s->vy, friction.radius * s->yaw_rate) < near;
            free.begun = sliding.begun = (double)i * h;
            const struct stretch one = at_rest ? semi_implicit_euler(s, &free, h, 1) : smooth_rk4(s, &sliding, h, 1);
            whole.state = one.state;
            whole.stability = larger(whole.stability, one.stability);
            whole.rotation = larger(whole.rotation, one.rotation);
        }
    while (i < n && is_finite(&whole.state));
    return whole;
}

static ALWAYS_INLINE struct stretch rk4(const struct state *state, const struct drive *drive,
                                        const struct craft *craft, double h, int64_t n)
{
    if (rubs(craft))
        return rk4_with_friction(state, drive, craft, h, n);
    struct load_function f = load_function(drive, craft, 1.0 / craft->mass, 1.0 / craft->inertia);
    return smooth_rk4(state, &f, h, n);
}

/* The constants of splitting. */
struct relaxation {
    double push;            /* m/s: of the drag point, abeam */
    double ahead, abeam;    /* s/kg: h times the rate that a drag has for each */
    double of_sway, of_yaw; /* 1, 1/m: what they have of a loss of the drag point's, abeam */
};

static ALWAYS_INLINE double at_most(double z)
{
    return z < MOST ? z : MOST;
}

static ALWAYS_INLINE double gained(double y, double push, double rate)
{
    const double z = at_most(rate), g = 1.0 + 0.5 * z;
    return (push - z * y) * (g / (1.0 + z * g));
}

/* What friction leaves of the motion in the middle of a sub-step, from a state and its velocity through the air. */
static struct air rubbed_half(const struct load_function *f, const struct relaxation *r, const struct push *push,
                              const struct friction *friction, double c, double s, const struct state *z,
                              const struct air *air, const struct air *half)
{
    const double lost = air->w + 0.5 * r->push - half->w;
    const double surge = half->u + (c * f->wind_x + s * f->wind_y);
    const double sway = c * z->vy - s * z->vx + (0.5 * push->abeam - lost * r->of_sway);
    const double yaw = z->yaw_rate + (0.5 * push->turn - lost * r->of_yaw);
    double surge_left = surge, sway_left = sway, yaw_left = yaw;
    rub(friction, &surge_left, &sway_left, &yaw_left);
    return (struct air){
        .u = half->u + (surge_left - surge),
        .w = half->w + (sway_left - sway + (yaw_left - yaw) * f->x_d),
    };
}

/* Of loads in the time h. */
static ALWAYS_INLINE struct stretch splitting_as(enum drag_kind kind, unsigned beside, const struct state *state,
                                                 struct load_function *f, double h, int64_t n)
{
    const double half = 0.5 * h, lever = 0.5 * f->drag_rate;
    const bool spins = f->craft->rotational_drag != 0.0;
    const double slowing = half * spin_drag_factor(f->craft) / f->craft->inertia;
    const struct friction friction = friction_function(f->craft, h), of_half = friction_function(f->craft, half);
    struct relaxation r = {
        .ahead = f->per_mass,
        .abeam = h * lever,
        .of_sway = 1.0 / (f->craft->mass * lever),
        .of_yaw = f->x_d / f->craft->inertia / lever,
    };
    struct state z = *state;
    struct watch watch = {0.0, z.yaw_rate, z.yaw_rate};
    int64_t i = 0;
    do
        for (const int64_t end = end_of_piece(i, n); i < end; i++) {
            steer_at(f, (double)i * h + half);
            z.x = z.x + half * z.vx;
            z.y = z.y + half * z.vy;
            z.heading = z.heading + half * z.yaw_rate;
            const struct trig_pair turned = sine_cosine(z.heading, &f->last);
            const double c = turned.cosine, s = turned.sine, begun = fabs(z.yaw_rate);
            const struct push push = push_at(f, beside, c, s);
            r.push = push.abeam + f->x_d * push.turn;
            if (spins)
                z.yaw_rate = z.yaw_rate / (1.0 + slowing * fabs(z.yaw_rate));
            const struct air air = air_at(f, kind, c, s, z.vx, z.vy, z.yaw_rate);
            const double kq = kind == WITHOUT_DRAG ? 0.0 : f->k * air.q;
            struct air middle = {
                .u = (air.u + 0.5 * push.ahead) / (1.0 + at_most(0.5 * (kq * r.ahead))),
                .w = (air.w + 0.5 * r.push) / (1.0 + at_most(0.5 * (kq * r.abeam))),
            };
            if (friction.rubs)
                middle = rubbed_half(f, &r, &push, &of_half, c, s, &z, &air, &middle);
            const double then = kind == WITHOUT_DRAG ? 0.0 : f->k * air_speed(f, kind, middle.u, middle.w);
            double surge = push.ahead, sway = push.abeam, yaw = push.turn;
            if (then != 0.0) {
                const double lost = r.push - gained(air.w, r.push, then * r.abeam);
                surge = gained(air.u, push.ahead, then * r.ahead);
                sway = push.abeam - lost * r.of_sway;
                yaw = push.turn - lost * r.of_yaw;
            }
            z.vx = z.vx + (c * surge - s * sway);
            z.vy = z.vy + (s * surge + c * sway);
            z.yaw_rate = z.yaw_rate + yaw;
            const double driven = fabs(z.yaw_rate);
            if (spins)
                z.yaw_rate = z.yaw_rate / (1.0 + slowing * driven);
            if (friction.rubs)
                rub(&friction, &z.vx, &z.vy, &z.yaw_rate);
            z.x = z.x + half * z.vx;
            z.y = z.y + half * z.vy;
            z.heading = z.heading + half * z.yaw_rate;
            watch_loads(&watch, f, kind, then > kq ? then : kq, larger(begun, driven));
            watch_yaw_rate(&watch, z.yaw_rate);
        }
    while (i < n && is_finite(&z));
    return watched_stretch(f, &z, n, h, &watch);
}

static struct stretch splitting(const struct state *state, struct load_function *f, double h, int64_t n)
{
    return f->kind == PLAIN_DRAG ? splitting_as(PLAIN_DRAG, 0, state, f, h, n)
                                 : splitting_as(f->kind, f->beside, state, f, h, n);
}

enum { STAGES = 7 };
/* Of the state, in its order. */
enum { X, Y, HEADING, VX, VY, YAW_RATE, COMPONENTS };
_Static_assert(sizeof(struct state) == COMPONENTS * sizeof(double), "a component for each part of the state");
/* Dormand, Prince (1980): the pair 5(4); row i leads to stage i + 1. */
static const double WEIGHTS[STAGES - 1][STAGES - 1] = {
    {1.0 / 5},
    {3.0 / 40, 9.0 / 40},
    {44.0 / 45, -56.0 / 15, 32.0 / 9},
    {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
    {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
    {35.0 / 384, 0.0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84},
};
/* Where in the step a stage lies. */
static const double NODES[] = {1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1.0, 1.0};
/* Fifth order minus fourth order. */
static const double ERROR[] = {71.0 / 57600,       0.0,        -71.0 / 16695, 71.0 / 1920,
                               -17253.0 / 339200, 22.0 / 525, -1.0 / 40};

static void components_of(const struct state *s, double y[COMPONENTS])
{
    y[X] = s->x;
    y[Y] = s->y;
    y[HEADING] = s->heading;
    y[VX] = s->vx;
    y[VY] = s->vy;
    y[YAW_RATE] = s->yaw_rate;
}

static struct state state_of(const double y[COMPONENTS])
{
    return (struct state){
        .x = y[X], .y = y[Y], .heading = y[HEADING], .vx = y[VX], .vy = y[VY], .yaw_rate = y[YAW_RATE]};
}

/* The derivative of the state, and k*q there. */
struct rates {
    double of[COMPONENTS];
    double kq;
};

static struct rates rates_at(struct load_function *f, const double y[COMPONENTS])
{
    const struct loads a = loads_at(f, y[HEADING], y[VX], y[VY], y[YAW_RATE]);
    return (struct rates){
        .of = {[X] = y[VX], [Y] = y[VY], [HEADING] = y[YAW_RATE], [VX] = a.x, [VY] = a.y, [YAW_RATE] = a.moment},
        .kq = a.kq,
    };
}

static double combined(const double *weights, int n, const struct rates *stages, int i)
{
    double total = weights[0] * stages[0].of[i];
    for (int k = 1; k < n; k++)
        total += weights[k] * stages[k].of[i];
    return total;
}

/* One step from `time`: the new state, the rates there in stages[6], and the largest component of the error. */
static double dormand_prince(struct load_function *f, double time, const double y[COMPONENTS], double h,
                             struct rates stages[STAGES], double new[COMPONENTS])
{
    double error = 0.0, sum = 0.0;
    for (int row = 0; row < STAGES - 1; row++) {
        for (int i = 0; i < COMPONENTS; i++)
            new[i] = y[i] + h * combined(WEIGHTS[row], row + 1, stages, i);
        steer_at(f, time + NODES[row] * h);
        stages[row + 1] = rates_at(f, new);
    }
    for (int i = 0; i < COMPONENTS; i++) {
        const double part = fabs(h * combined(ERROR, STAGES, stages, i));
        error = i ? larger(error, part) : part;
        sum += new[i];
    }
    return isfinite(sum) ? error : INFINITY;
}

/* Whether the craft slides, and then the longest step [s]; without friction, any. */
static bool can_slide(const struct load_function *f, const double y[COMPONENTS], const struct rates *rates,
                      const struct friction *friction, double tolerance, double *longest)
{
    *longest = INFINITY;
    if (!friction->rubs)
        return true;
    const double turning = f->radius * y[YAW_RATE], speed = slip_speed(y[VX], y[VY], turning);
    if (!(speed > tolerance))
        return false;
    const double gain =
        (y[VX] * rates->of[VX] + y[VY] * rates->of[VY] + f->radius * turning * rates->of[YAW_RATE]) / speed;
    *longest = speed / larger(larger(friction->a, friction->b), NEAR_REST * -gain);
    return *longest > MIN_STEP;
}

/* An implicit step of Euler's; its error is at most all that it changes of the velocity, and h times that. */
static double near_rest(struct load_function *f, double time, const double y[COMPONENTS], double h,
                        struct rates *rates, double new[COMPONENTS])
{
    const struct state before = state_of(y);
    struct load_function free = load_function(f->drive, f->craft, h / f->craft->mass, h / f->craft->inertia);
    free.begun = time;
    const struct state after = semi_implicit_euler(&before, &free, h, 1).state;
    const double change = larger(larger(fabs(after.vx - y[VX]), fabs(after.vy - y[VY])),
                                 fabs(after.yaw_rate - y[YAW_RATE]));
    components_of(&after, new);
    steer_at(f, time + h);
    *rates = rates_at(f, new);
    const double error = change * larger(1.0, h);
    return isfinite(error) && is_finite(&after) ? error : INFINITY;
}

/* s: where in the communication step the next ramp of an input meets a limit, or its end. */
static double next_bend(const struct drive *drive, const struct craft *craft, double time, double end)
{
    const double starts[] = {drive->start.thrust, drive->start.port, drive->start.starboard};
    const double rates[] = {drive->rate.thrust, drive->rate.port, drive->rate.starboard};
    const double limits[][2] = {{craft->thrust_min, craft->thrust_max}, {0.0, 1.0}, {0.0, 1.0}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; rates[i] != 0.0 && k < 2; k++) {
            const double met = (limits[i][k] - starts[i]) / rates[i];
            end = time < met && met < end ? met : end;
        }
    return end;
}

static enum outcome adaptive(const struct state *state, const struct drive *drive, const struct craft *craft,
                             double duration, double tolerance, double proposed, struct stretch *stretch)
{
    const double per_mass = 1.0 / craft->mass, per_inertia = 1.0 / craft->inertia;
    struct load_function f = rubs(craft) ? sliding_load_function(drive, craft, per_mass, per_inertia)
                                         : load_function(drive, craft, per_mass, per_inertia);
    const struct friction friction = friction_function(craft, 1.0);
    double y[COMPONENTS];
    double time = 0.0, most = 0.0, fastest = 0.0;
    double growth = MAX_GROWTH;
    int64_t tried = 0;
    struct rates stages[STAGES];
    components_of(state, y);
    stages[0] = rates_at(&f, y);
    while (time < duration) {
        const double end = next_bend(drive, craft, time, duration);
        double new[COMPONENTS], longest, h = smaller(end - time, proposed);
        const bool slides = can_slide(&f, y, &stages[0], &friction, tolerance, &longest);
        if (slides)
            h = smaller(h, longest);
        if (h * fabs(y[YAW_RATE]) > 0.9 * MAX_TURN)
            h = 0.9 * MAX_TURN / fabs(y[YAW_RATE]);
        const bool last = h >= end - time;
        if (!last && h < larger(MIN_STEP, UNIT * time)) {
            stretch->substep = h;
            return STEP_TOO_SMALL;
        }
        if (++tried > HOVERCRAFT_MAX_TRIED)
            return TOO_MANY_SUBSTEPS;
        const double error = slides ? dormand_prince(&f, time, y, h, stages, new)
                                    : near_rest(&f, time, y, h, &stages[STAGES - 1], new);
        const double turn = fabs(new[HEADING] - y[HEADING]);
        if (!(error <= tolerance && turn <= MAX_TURN)) {
            if (error <= tolerance)
                proposed = h * larger(0.2, 0.9 * MAX_TURN / turn);
            else
                proposed =
                    error < INFINITY ? h * larger(0.2, 0.9 * square_root(square_root(tolerance / error))) : 0.2 * h;
            growth = 1.0;
            if (proposed < MIN_STEP) {
                stretch->substep = proposed;
                return STEP_TOO_SMALL;
            }
            continue;
        }
        most = larger(most, h * fastest_rate(&f, stages[0].kq, y[YAW_RATE]));
        fastest = larger(fastest, h * fabs(y[YAW_RATE]));
        time = last ? end : time + h;
        for (int i = 0; i < COMPONENTS; i++)
            y[i] = new[i];
        stages[0] = stages[STAGES - 1];
        most = larger(most, h * fastest_rate(&f, stages[0].kq, y[YAW_RATE]));
        fastest = larger(fastest, h * fabs(y[YAW_RATE]));
        if (!last) /* a step cut short by the end, or a bend, says nothing against the one proposed */
            proposed = h * smaller(growth, error > 0.0 ? 0.9 * square_root(square_root(tolerance / error)) : growth);
        growth = MAX_GROWTH;
    }
    *stretch = (struct stretch){
        .state = state_of(y),
        .substeps = tried,
        .stability = most,
        .rotation = fastest,
        .proposed = proposed,
    };
    return ADVANCED;
}

/* ---- subcycling.py */

/* To the nearest, of what is below 2^51. */
static double whole_number(double ratio)
{
    return larger(1.0, ratio + TO_INTEGER - TO_INTEGER);
}

double kernel_meant_step(double time, double step, double start_time, double step_size)
{
    const double ratio = step / step_size;
    if (!(ratio <= MAX_SUBSTEPS + 1.0))
        return step;
    const double whole = whole_number(ratio) * step_size;
    const double largest = larger(larger(fabs(time), fabs(time + step)), fabs(start_time));
    return fabs(whole - step) <= time_rounding(largest, step, 0.0) ? whole : step;
}

/* Number and size [s] of the sub-steps of a communication step; false where they are too many. */
static bool substeps(double communication_step, double step_size, int64_t *n, double *h)
{
    const double ratio = communication_step / step_size;
    if (!(ratio <= MAX_SUBSTEPS + 1.0))
        return false;
    double whole = whole_number(ratio);
    const double rounding = time_rounding(communication_step, communication_step, 0.0);
    if (fabs(whole * step_size - communication_step) <= rounding) {
        *h = step_size;
    } else {
        whole = (double)(int64_t)ratio + 1.0; /* of a whole ratio the product is the step, but for rounding */
        *h = communication_step / whole;
    }
    *n = (int64_t)whole;
    return whole <= MAX_SUBSTEPS;
}

/* Of a fixed step. */
static enum outcome checked(struct stretch *stretch)
{
    if (isinf(stretch->state.heading)) /* its sine is no number; in Python it raises, and nothing is left */
        stretch->state = (struct state){NAN, NAN, NAN, NAN, NAN, NAN};
    return is_finite(&stretch->state) ? ADVANCED : NOT_FINITE;
}

/* By a method of fixed steps; in line, as a copy of what is reached would cost more than the branch. */
static ALWAYS_INLINE enum outcome fixed(const struct state *state, const struct drive *drive,
                                        const struct craft *craft, int32_t integrator, double h, int64_t n,
                                        struct stretch *stretch)
{
    if (integrator == RK4) {
        *stretch = rk4(state, drive, craft, h, n);
    } else if (integrator == DRAG_IMPLICIT) {
        struct load_function f = load_function(drive, craft, 1.0, 1.0);
        *stretch = drag_implicit(state, &f, h, n);
    } else {
        struct load_function f = load_function(drive, craft, h / craft->mass, h / craft->inertia);
        *stretch = integrator == SPLITTING ? splitting(state, &f, h, n) : semi_implicit_euler(state, &f, h, n);
    }
    return checked(stretch);
}

enum outcome kernel_advance(const struct state *state, const struct drive *drive, const struct craft *craft,
                     double communication_step, const struct settings *settings, double proposed,
                     struct stretch *stretch)
{
    int64_t n;
    double h;
    if (settings->integrator == ADAPTIVE)
        return adaptive(state, drive, craft, communication_step, settings->tolerance,
                        proposed != 0.0 ? proposed : settings->step_size, stretch);
    if (!substeps(communication_step, settings->step_size, &n, &h))
        return TOO_MANY_SUBSTEPS;
    return fixed(state, drive, craft, settings->integrator, h, n, stretch);
}

enum { CONTROLS = sizeof(struct controls) / sizeof(double) };

unsigned kernel_too_strong(const struct controls *controls, const struct craft *craft)
{
    const double k = drag_factor(craft) > 0.0 ? drag_factor(craft) : 1.0, rate = MIN_STEP * drag_rate(craft) * k;
    const struct controls reached = {
        .wind_x = fabs(controls->wind_x),
        .wind_y = fabs(controls->wind_y),
        .external_force_x = square_root(fabs(controls->external_force_x) / k),
        .external_force_y = square_root(fabs(controls->external_force_y) / k),
        .external_moment = square_root(fabs(controls->external_moment) / craft->length / k),
    };
    double speeds[CONTROLS]; /* m/s: of the air */
    unsigned i = 0;
    memcpy(speeds, &reached, sizeof speeds);
    while (i < CONTROLS && !(rate * speeds[i] > 1.0))
        i++;
    return i;
}

/* ---- error_estimate.py */

static const struct state LOST = {NAN, NAN, NAN, NAN, NAN, NAN};

/* Where the steps of the adaptive method are as long as the communication step, those of the companion are half. */
static enum outcome in_two_halves(const struct companion *companion, const struct drive *drive,
                                  const struct craft *craft, double communication_step,
                                  const struct settings *settings, struct stretch *stretch)
{
    const double half = 0.5 * communication_step;
    struct drive second = *drive;
    *stretch = (struct stretch){.state = companion->state, .proposed = companion->proposed};
    for (int i = 0; i < 2; i++) {
        const struct state state = stretch->state;
        if (i > 0) {
            second.start = kernel_controls_at(drive, half);
            second.later = half;
        }
        const double start = stretch->proposed != 0.0 ? stretch->proposed : settings->step_size;
        const enum outcome outcome =
            adaptive(&state, i > 0 ? &second : drive, craft, half, settings->tolerance / TIGHTER, start, stretch);
        if (outcome != ADVANCED)
            return outcome;
    }
    return ADVANCED;
}

void kernel_accompany(struct companion *companion, const struct drive *drive, const struct craft *craft,
                      double communication_step, const struct settings *settings, const struct stretch *made)
{
    struct stretch stretch;
    if (isnan(companion->state.x))
        return;
    const enum outcome outcome =
        settings->integrator == ADAPTIVE
            ? in_two_halves(companion, drive, craft, communication_step, settings, &stretch)
            : fixed(&companion->state, drive, craft, settings->integrator, 0.5 * made->substep, 2 * made->substeps,
                    &stretch);
    const bool made_it = outcome == ADVANCED;
    companion->state = made_it ? stretch.state : LOST;
    companion->proposed = made_it ? stretch.proposed : 0.0;
}

static double slip_of(const struct state *state, const struct craft *craft)
{
    return slip_speed(state->vx, state->vy, kernel_friction_radius(craft).radius * state->yaw_rate);
}

void kernel_watch(struct companion *companion, const struct state *before, const struct state *after,
                  const struct craft *craft)
{
    const double dx = after->x - before->x, dy = after->y - before->y;
    companion->way = companion->way + square_root(dx * dx + dy * dy);
    if (rubs(craft)) {
        const double fastest = companion->fastest > 0.0 ? companion->fastest : slip_of(before, craft);
        companion->fastest = larger(fastest, slip_of(after, craft));
    }
}

/* What the difference between the two is to be multiplied by. */
static double error_factor(int order)
{
    const double gain = (double)(1 << order);
    return gain / (gain - 1.0);
}

struct error kernel_estimated_error(const struct state *state, const struct companion *companion, int order)
{
    const struct state *other = &companion->state;
    const double factor = error_factor(order);
    const double dx = other->x - state->x, dy = other->y - state->y;
    const double position = factor * square_root(dx * dx + dy * dy);
    const double heading = factor * fabs(other->heading - state->heading);
    return (struct error){position <= LARGEST ? position : LARGEST, heading <= LARGEST ? heading : LARGEST};
}

bool kernel_is_lost(double position, const struct state *state, const struct companion *companion,
                    const struct craft *craft, double substep, int32_t count)
{
    if (position >= LARGEST || (count >= FEW && position > NOT_SMALL * companion->way))
        return true;
    if (!rubs(craft))
        return false;
    const struct friction friction = friction_function(craft, substep);
    const double gain = larger(friction.a, friction.b);
    if (!(companion->fastest < FEW * gain))
        return false;
    const double slip = slip_of(state, craft);
    return slip < NEAR_REST * gain && slip < companion->fastest;
}
