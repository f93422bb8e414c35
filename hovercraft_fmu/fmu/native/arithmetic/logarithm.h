/* The natural logarithm with the same bits on every platform. */

#ifndef HOVERCRAFT_LOGARITHM_H
#define HOVERCRAFT_LOGARITHM_H

#include "hidden.h"

/* Of a number greater than 0, within one unit in the last place. */
HIDDEN double logarithm_of(double x);

#endif
