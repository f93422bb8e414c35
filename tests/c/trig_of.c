/* trig_sine_cosine for ctypes: once with no turn known, once with that of another angle. */

#include "trig.h"

void trig_alone(double angle, double *sine, double *cosine);
void trig_after(double before, double angle, double *sine, double *cosine);

void trig_alone(double angle, double *sine, double *cosine)
{
    struct trig_turn turn = {.quarters = 0.0};
    const struct trig_pair pair = trig_sine_cosine(angle, &turn);
    *sine = pair.sine;
    *cosine = pair.cosine;
}

void trig_after(double before, double angle, double *sine, double *cosine)
{
    struct trig_turn turn = {.quarters = 0.0};
    trig_sine_cosine(before, &turn);
    const struct trig_pair pair = trig_sine_cosine(angle, &turn);
    *sine = pair.sine;
    *cosine = pair.cosine;
}
