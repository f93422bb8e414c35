/* The partial derivatives of the equations of motion, in closed form. */

#ifndef HOVERCRAFT_LINEARIZATION_H
#define HOVERCRAFT_LINEARIZATION_H

#include "kernel.h"

/* What the derivatives are taken with respect to: the parts of struct state, then those of struct controls. */
enum { KNOWN_COUNT = 11, ROW_COUNT = 3 };

struct linearization {
    double motion[ROW_COUNT][KNOWN_COUNT];       /* of surge, sway, speed */
    double acceleration[ROW_COUNT][KNOWN_COUNT]; /* of x, y, yaw */
};

/* At a state and controls, these before saturation. The equations have kinks. There the slope is that of the inside for
   an input at its limit, and the mean of both sides for what has an absolute value in it: the speed at rest, and, where
   the drag's area is directional, air that comes from right ahead or right abeam. A craft with friction must slide. */
void kernel_linearize(const struct state *state, const struct controls *controls, const struct craft *craft,
                      struct linearization *linearization);

#endif
