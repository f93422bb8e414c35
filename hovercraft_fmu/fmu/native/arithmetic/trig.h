/* Sine and cosine with the same bits on every platform: fdlibm's polynomials and its reduction of the argument, both
   functions at once, so that one reduction does.

   Angles that follow one another mostly lie in the same quarter turn. So the multiple of pi/2 that is taken away is
   kept from one angle to the next, and only checked: the check is not in the chain of dependent operations that a
   sub-step is, and neither are the tails. The result depends on the angle alone.

   The constants, the reduction and the bounds are fdlibm's (k_sin.c, k_cos.c, e_rem_pio2.c, k_rem_pio2.c, as FreeBSD
   and musl keep them); the polynomials are summed in another order, pairs first. They come with this notice:

   ====================================================
   Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.

   Developed at SunSoft, a Sun Microsystems, Inc. business.
   Permission to use, copy, modify, and distribute this
   software is freely granted, provided that this notice
   is preserved.
   ====================================================
   The reduction of medium arguments: optimized by Bruce D. Evans.

   Compile without contraction (-ffp-contract=off): a fused multiply-add has other bits. */

#ifndef HOVERCRAFT_TRIG_H
#define HOVERCRAFT_TRIG_H

#include <math.h>

#include "hidden.h"

struct trig_pair {
    double sine, cosine;
};

/* Quarter turns and what they are in rad, high + low; all zeros at first. */
struct trig_turn {
    double quarters;
    double high, low;
    int n; /* quarters modulo 4 */
};

/* Not in line, for what is rare: another quarter turn; an angle very close to a multiple of pi/2; one that is large,
   infinite or no number. */
HIDDEN void trig_turn_to(struct trig_turn *turn, double quarters);
HIDDEN struct trig_pair trig_near_multiple(double angle);
HIDDEN struct trig_pair trig_large(double angle);

static const double TRIG_QUARTER = 0x1.921fb54442d18p-1;    /* pi/4 */
static const double TRIG_LARGE = 0x1.921fbp+20;            /* 2^20*pi/2, above it all bits of 2/pi count */
static const double TRIG_TO_INTEGER = 0x1.8p52;            /* adding and subtracting it rounds to an integer */
static const double TRIG_INVPIO2 = 6.36619772367581382433e-01; /* 0x3FE45F30, 0x6DC9C883: 53 bits of 2/pi */

static const double TRIG_S1 = -1.66666666666666324348e-01, /* 0xBFC55555, 0x55555549 */
    TRIG_S2 = 8.33333333332248946124e-03,                  /* 0x3F811111, 0x1110F8A6 */
    TRIG_S3 = -1.98412698298579493134e-04,                 /* 0xBF2A01A0, 0x19C161D5 */
    TRIG_S4 = 2.75573137070700676789e-06,                  /* 0x3EC71DE3, 0x57B1FE7D */
    TRIG_S5 = -2.50507602534068634195e-08,                 /* 0xBE5AE5E6, 0x8A2B9CEB */
    TRIG_S6 = 1.58969099521155010221e-10,                  /* 0x3DE5D93A, 0x5ACFD57C */
    TRIG_C1 = 4.16666666666666019037e-02,                  /* 0x3FA55555, 0x5555554C */
    TRIG_C2 = -1.38888888888741095749e-03,                 /* 0xBF56C16C, 0x16C15177 */
    TRIG_C3 = 2.48015872894767294178e-05,                  /* 0x3EFA01A0, 0x19CB1590 */
    TRIG_C4 = -2.75573143513906633035e-07,                 /* 0xBE927E4F, 0x809C52AD */
    TRIG_C5 = 2.08757232129817482790e-09,                  /* 0x3E21EE9E, 0xBDB4B1C4 */
    TRIG_C6 = -1.13596475577881948265e-11;                 /* 0xBDA8FAE9, 0xBE8838D4 */

/* Sine and cosine of y + tail, where y is in [-pi/4, pi/4]; `real` is double, or some of them side by side. */
#define TRIG_POLYNOMIALS(real, y, tail, sine, cosine)                                                                  \
    do {                                                                                                               \
        const real z = y * y, w = z * z, ww = w * w;                                                                   \
        const real odd = (TRIG_S1 + z * TRIG_S2) + w * (TRIG_S3 + z * TRIG_S4) + ww * (TRIG_S5 + z * TRIG_S6);         \
        const real even = w * (TRIG_C1 + z * TRIG_C2) + ww * ((TRIG_C3 + z * TRIG_C4) + w * (TRIG_C5 + z * TRIG_C6));  \
        const real half = 0.5 * z, one = 1.0 - half;                                                                   \
        sine = y + (z * y * odd + (tail - z * (0.5 * tail)));                                                          \
        cosine = one + ((((1.0 - one) - half) - y * tail) + even);                                                     \
    } while (0)

/* Of n quarter turns and y + tail. */
static ALWAYS_INLINE struct trig_pair trig_of_rest(int n, double y, double tail)
{
    double s, c;
    TRIG_POLYNOMIALS(double, y, tail, s, c);
    if (n == 0)
        return (struct trig_pair){s, c};
    if (n == 1)
        return (struct trig_pair){c, -s};
    return n == 2 ? (struct trig_pair){-s, -c} : (struct trig_pair){-c, s};
}

/* Of an angle [rad] of any size, each within one unit in the last place; NaN for an infinite one. */
static ALWAYS_INLINE struct trig_pair trig_sine_cosine(double angle, struct trig_turn *turn)
{
    const double size = fabs(angle);
    double y = angle, tail = 0.0;
    int n = 0;
    if (!(size <= TRIG_QUARTER)) {
        if (!(size < TRIG_LARGE))
            return trig_large(angle);
        const double quarters = angle * TRIG_INVPIO2 + TRIG_TO_INTEGER - TRIG_TO_INTEGER;
        if (quarters != turn->quarters)
            trig_turn_to(turn, quarters);
        const double r = angle - turn->high;
        y = r - turn->low;
        if (fabs(y) < 0x1p-16 * size)
            return trig_near_multiple(angle);
        tail = (r - y) - turn->low;
        n = turn->n;
    }
    return trig_of_rest(n, y, tail);
}

#endif
