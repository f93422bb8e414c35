/* The physics: model/craft.py, dynamics.py, integrators.py, subcycling.py and error_estimate.py, function by function,
   in the same order of operations. Derivations stand there. SI units, world frame: x right, y down, heading from +x toward +y.

   It owns nothing and remembers nothing. Compile without contraction (-ffp-contract=off). Names that a linker sees
   have a prefix: glibc, for one, still has an `advance` of its own. */

#ifndef HOVERCRAFT_KERNEL_H
#define HOVERCRAFT_KERNEL_H

#include <stdbool.h>
#include <stdint.h>

#include "hidden.h"
#include "rounding.h"

enum drag_area { CONSTANT = 1, DIRECTIONAL };

/* Constants of one craft, in the order of craft.py; the caller has checked them. */
struct craft {
    double mass;                 /* kg */
    double inertia;              /* kg.m2 */
    double length;               /* m */
    double width;                /* m */
    double height;               /* m */
    double drag_coefficient;     /* 1 */
    double air_density;          /* kg/m3 */
    double drag_center_fraction; /* 1 */
    double steering_force;       /* N */
    double thrust_min;           /* N */
    double thrust_max;           /* N */
    int32_t drag_area;           /* enum drag_area */
    double skirt_friction;       /* 1 */
    double gravity;              /* m/s2 */
    double rotational_drag;      /* 1 */
};

/* What is worked out of the constants; the caller has checked that each is finite. Units and formulas: craft.py. */
struct derived {
    double projected_area, drag_factor, drag_factor_ahead, drag_factor_abeam, spin_drag_factor, friction_force;
    double drag_center, thruster_moment, drag_rate, spin_rate;
};

struct state {
    double x, y;     /* m */
    double heading;  /* rad, unwrapped */
    double vx, vy;   /* m/s */
    double yaw_rate; /* rad/s */
};

struct controls {
    double thrust;          /* N */
    double port, starboard; /* 1 */
    double wind_x, wind_y;  /* m/s: the velocity of the air */
    double external_force_x, external_force_y; /* N */
    double external_moment;                    /* N.m */
};

/* The controls over a communication step: `start + t*rate`, or what is answered when asked, then saturated. Else they
   hold, and the bits are those of the Python model, which knows neither. */
struct drive {
    struct controls start;
    struct controls rate; /* per s */
    bool varies;          /* some rate is not zero, or there is somebody to ask */
    struct controls (*ask)(void *asked, double time); /* s, after the start; NULL: nobody. A time may come again, or be
                                                         followed by an earlier one, as a step is tried again */
    void *asked;
    double later;         /* s: where in the communication step its time 0 is, for who is asked */
};

struct loads {
    double x, y;   /* N */
    double moment; /* N.m */
    double kq;     /* kg/s: k*q, the drag per air speed */
};

enum integrator { SEMI_IMPLICIT_EULER = 1, DRAG_IMPLICIT, RK4, ADAPTIVE, SPLITTING };

struct settings {
    double step_size; /* s */
    int32_t integrator;
    double tolerance; /* SI units */
};

/* Whether a companion is carried along. */
enum error_estimate { OFF = 1, ON };

struct companion {
    struct state state; /* NaN: it has left the range of numbers, or found no step for its tolerance; so it stays */
    double proposed;    /* s: the step that the adaptive method would take next */
    double way;         /* m, of the craft itself so far, from communication point to communication point */
    double fastest;     /* m/s: its largest slip speed at one of them, where it rubs */
};

/* How far a craft is off, by its companion. */
struct error {
    double position; /* m */
    double heading;  /* rad */
};

struct stretch {
    struct state state;
    int64_t substeps; /* of the adaptive method those that it tried and refused, too */
    double stability; /* 1: the largest of a sub-step, wherever the loads were worked out and at the end */
    double rotation; /* rad: the largest |yaw rate|*h, there too */
    double proposed; /* s: the step that the adaptive method would take next */
    double substep;  /* s: the sub-step that was taken, or the one that is too small */
};

/* Why a stretch was not made; its `state` then tells what came out, where something did. */
enum outcome { ADVANCED, TOO_MANY_SUBSTEPS, NOT_FINITE, STEP_TOO_SMALL };

/* m: the mean distance of the points of the skirt's rectangle from its centre, diagonal/6 + (along + across)/12. */
struct friction_radius {
    double radius, diagonal, along, across;
};

HIDDEN struct derived kernel_derived(const struct craft *craft);
HIDDEN struct friction_radius kernel_friction_radius(const struct craft *craft);

HIDDEN struct controls kernel_saturate(const struct controls *controls, const struct craft *craft);
HIDDEN struct controls kernel_controls_at(const struct drive *drive, double time);
/* Side force [N] of both bow thrusters, after saturation. */
HIDDEN double kernel_steering(const struct controls *controls, const struct craft *craft);
HIDDEN struct loads kernel_loads_on(const struct state *state, const struct controls *controls,
                                    const struct craft *craft);
/* Surge and sway [m/s]. */
HIDDEN void kernel_body_velocity(const struct state *state, double *surge, double *sway);

/* s: the whole number of sub-steps that a communication step means, or else the communication step itself. */
HIDDEN double kernel_meant_step(double time, double step, double start_time, double step_size);

/* The state one communication step [s], greater than 0, later. `proposed` [s] is what the last stretch of the adaptive
   method returned, 0 at the start. */
HIDDEN enum outcome kernel_advance(const struct state *state, const struct drive *drive, const struct craft *craft,
                                   double communication_step, const struct settings *settings, double proposed,
                                   struct stretch *stretch);
/* The place among the controls of the first one without limits that no step helps; their number: there is none. */
HIDDEN unsigned kernel_too_strong(const struct controls *controls, const struct craft *craft);
/* The companion over the same communication step, which the craft itself has made; and what the craft did in it. */
HIDDEN void kernel_accompany(struct companion *companion, const struct drive *drive, const struct craft *craft,
                             double communication_step, const struct settings *settings, const struct stretch *made);
HIDDEN void kernel_watch(struct companion *companion, const struct state *before, const struct state *after,
                         const struct craft *craft);
/* By now, for a method of that order. */
HIDDEN struct error kernel_estimated_error(const struct state *state, const struct companion *companion, int order);
/* Whether such an estimate [m] can be trusted no more, after so many sub-steps of a size [s]; 0 of the adaptive
   method. */
HIDDEN bool kernel_is_lost(double position, const struct state *state, const struct companion *companion,
                           const struct craft *craft, double substep, int32_t count);

#endif
