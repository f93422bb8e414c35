/* The tether behind the room (model.h): tether/line.py, function by function, in the same order of operations. */

#ifndef HOVERCRAFT_TETHER_H
#define HOVERCRAFT_TETHER_H

/* As in the table. */
struct motion {
    double x, y;     /* m */
    double heading;  /* rad */
    double vx, vy;   /* m/s */
    double yaw_rate; /* rad/s */
};

struct line {
    double stiffness;          /* N/m */
    double damping;            /* N.s/m */
    double slack_length;       /* m */
    double first_x, first_y;   /* m, body frame of the first craft */
    double second_x, second_y; /* m, of the second */
};

struct load {
    double x, y;   /* N, world frame */
    double moment; /* N.m */
};

struct model { /* what was sampled last: read until the next step */
    struct load first, second;
    double tension;  /* N */
    double distance; /* m */
};

#endif
