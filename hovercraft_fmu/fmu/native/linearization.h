/* The partial derivatives of the equations of motion, in closed form. */

#ifndef HOVERCRAFT_LINEARIZATION_H
#define HOVERCRAFT_LINEARIZATION_H

#include "kernel.h"

/* What the derivatives are taken with respect to: the parts of struct state, then those of struct controls, and, at the
   start, the numbers of struct craft. */
enum { KNOWN_COUNT = 11, INITIAL_KNOWN_COUNT = 25 };
/* What they are taken of. */
enum row { SURGE, SWAY, SPEED, ACCELERATION_X, ACCELERATION_Y, ACCELERATION_YAW, PROJECTED_AREA, ROW_COUNT };

struct linearization {
    double of[ROW_COUNT][INITIAL_KNOWN_COUNT];
};

/* At a state and controls, these before saturation; without `parameters` only the first KNOWN_COUNT columns, and no
   projected area. The equations have kinks. There the slope is that of the inside for an input at its limit, and so 0
   over the limit; and the mean of both sides for what has an absolute value in it: the speed at rest, and, where the
   drag's area is directional, air that comes from right ahead or right abeam. Friction can only grow from none: its
   slope is that of the motion, or, at rest, of the one that begins. With friction a craft must slide to have slopes of
   its accelerations. */
void kernel_linearize(const struct state *state, const struct controls *controls, const struct craft *craft,
                      bool parameters, struct linearization *linearization);

#endif
