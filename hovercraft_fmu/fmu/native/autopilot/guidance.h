/* The control law: autopilot/guidance.py, function by function, in the same order of operations. Derivations stand
   there. SI units; world frame: x right, y down, heading from +x toward +y.

   It owns nothing and remembers nothing. Compile without contraction (-ffp-contract=off). */

#ifndef HOVERCRAFT_GUIDANCE_H
#define HOVERCRAFT_GUIDANCE_H

#include <stdint.h>

#include "hidden.h"

/* What the autopilot is told, in the order of guidance.py; the caller has checked it. */
struct orders {
    double acceptance_radius; /* m */
    double cruise_speed;      /* m/s */
    double lookahead;         /* m; 0, here and below: follows from the craft */
    double velocity_gain;     /* kg/s */
    double integral_time;     /* s */
    double heading_gain;      /* 1/rad */
    double yaw_rate_gain;     /* s/rad */
    double thrust_max;        /* N */
    double thrust_min;        /* N */
    double turn_rate;         /* rad/s */
    double mass;              /* kg */
    double inertia;           /* kg.m2 */
    double length;            /* m */
    double steering_force;    /* N */
    int32_t turn_back;        /* 0, 1 */
    int32_t keep_station;     /* 0, 1 */
};

struct waypoint {
    double x, y; /* m */
};

/* The autopilot's inputs. */
struct motion {
    double x, y;     /* m */
    double heading;  /* rad, unwrapped */
    double vx, vy;   /* m/s */
    double yaw_rate; /* rad/s */
};

/* What the autopilot remembers; meanings: guidance.py. */
struct pilot {
    struct waypoint origin; /* m */
    double heading;         /* rad */
    double x, y;            /* m */
    double vx, vy;          /* m/s */
    double push_x, push_y;  /* N */
    double swept;           /* rad */
    double saturated;       /* 1 */
    double driven;          /* 1 */
    int32_t passed;
    int32_t missed;
    int32_t braking;        /* 0, 1 */
    int32_t status;
};

struct course {
    const struct waypoint *points;
    int32_t count; /* at least 1 */
};

struct commands {
    double thrust;          /* N */
    double port, starboard; /* 1 */
};

struct sight {
    double cross_track, distance; /* m */
};

HIDDEN struct pilot guidance_beginning(const struct motion *motion);
/* rad/s, of the heading's loop; 0: nothing to steer with. */
HIDDEN double guidance_frequency(const struct orders *orders);
/* One sample of the law, which then holds for `duration` [s]. */
HIDDEN void guidance_steer(struct pilot *pilot, const struct motion *motion, const struct course *course,
                           const struct orders *orders, double duration, struct commands *commands,
                           struct sight *sight);
/* 1: round the active waypoint. */
HIDDEN double guidance_turns(const struct pilot *pilot);

#endif
