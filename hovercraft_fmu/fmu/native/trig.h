/* Sine and cosine with the same bits on every platform. */

#ifndef HOVERCRAFT_TRIG_H
#define HOVERCRAFT_TRIG_H

/* Both for one angle [rad] of any size, each within one unit in the last place; NaN for an infinite angle. */
void trig_sine_cosine(double angle, double *sine, double *cosine);

#endif
