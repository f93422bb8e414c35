/* Many craft at once, each with constants, controls and a state of its own, and with the bits that the FMU gives it. */

#ifndef HOVERCRAFT_FLEET_H
#define HOVERCRAFT_FLEET_H

#include <stdint.h>

enum { FLEET_STATES = 6, FLEET_CONTROLS = 8, FLEET_CONSTANTS = 15 };

/* One quantity: of craft i it is values[i * stride]; stride 0 where all have the same. */
struct column {
    const double *values;
    int64_t stride;
};

struct fleet {
    int64_t count;
    struct column states[FLEET_STATES];       /* in the order of struct state */
    struct column controls[FLEET_CONTROLS];   /* in the order of struct controls */
    struct column slopes[FLEET_CONTROLS];     /* per s, of the controls */
    struct column constants[FLEET_CONSTANTS]; /* in the order of struct craft; checked, and what is derived of them, too */
};

struct way {
    struct column communication_step; /* s */
    struct column step_size;          /* s */
    struct column tolerance;
    struct column proposed;           /* s, by the last call with the adaptive method; else 0 */
    int32_t integrator;
};

/* An element for each craft. Of one that is refused the state is as it was, and drag mass and rotation are 0. */
struct reached {
    double *states[FLEET_STATES];
    int64_t *substeps;
    double *stability; /* 1 */
    double *rotation;  /* rad */
    double *proposed;  /* s */
    int32_t *why;      /* enum refusal */
    int32_t *part;     /* of the state, that is not finite; else 0 */
    double *value;     /* of that part; of a step that is too small, the step [s] */
    double *substep;   /* s */
};

/* The first three as `enum outcome` has them. */
enum refusal { MOVED, TOO_MANY, RUNAWAY, TOO_SMALL, NOT_A_STEP, NOT_A_NUMBER };

#if defined(_WIN32)
#define FLEET_EXPORT __declspec(dllexport)
#else
#define FLEET_EXPORT __attribute__((visibility("default")))
#endif

/* How many craft were refused; -1 where a pointer is missing, or the method is none. A step of 0 changes no bit. */
FLEET_EXPORT int64_t fleet_advance(const struct fleet *fleet, const struct way *way, const struct reached *reached);
/* Number k in struct derived of craft i goes to derived[k * count + i]. */
FLEET_EXPORT int32_t fleet_derived(const struct fleet *fleet, double *derived);
/* Surge, sway [m/s]; force x, y [N], moment [N.m], k*q [kg/s]; no slopes. */
FLEET_EXPORT int32_t fleet_observe(const struct fleet *fleet, double *const motion[2], double *const loads[4]);

#endif
