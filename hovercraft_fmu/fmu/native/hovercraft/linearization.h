/* The partial derivatives of the equations of motion, in closed form. */

#ifndef HOVERCRAFT_LINEARIZATION_H
#define HOVERCRAFT_LINEARIZATION_H

#include "hidden.h"
#include "kernel.h"

struct linearization; /* partials.h */

/* At a state and controls, these before saturation; without `parameters` only the first KNOWN_COUNT columns, and no
   projected area. The equations have kinks. There the slope is that of the inside for an input at its limit, and so 0
   over the limit; and the mean of both sides for what has an absolute value in it: the speed at rest, and, where the
   drag's area is directional, air that comes from right ahead or right abeam. Friction can only grow from none: its
   slope is that of the motion, or, at rest, of the one that begins. With friction a craft must slide to have slopes of
   its accelerations. */
HIDDEN void kernel_linearize(const struct state *state, const struct controls *controls, const struct craft *craft,
                             bool parameters, struct linearization *linearization);

#endif
