/* The angle of a vector with the same bits on every platform. */

#ifndef HOVERCRAFT_ARCTANGENT_H
#define HOVERCRAFT_ARCTANGENT_H

#include "hidden.h"

/* rad, from -pi to pi: as C's atan2. */
HIDDEN double angle_of(double y, double x);

#endif
