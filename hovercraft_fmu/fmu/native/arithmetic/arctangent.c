/* fdlibm's arctangents (s_atan.c, e_atan2.c, as FreeBSD and musl have kept them), which come with this notice:

   ====================================================
   Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.

   Developed at SunSoft, a Sun Microsystems, Inc. business.
   Permission to use, copy, modify, and distribute this
   software is freely granted, provided that this notice
   is preserved.
   ==================================================== */

#include "arctangent.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

static const double ATAN_HIGH[] = {
    4.63647609000806093515e-01, /* atan(0.5) 0x3FDDAC67, 0x0561BB4F */
    7.85398163397448278999e-01, /* atan(1.0) 0x3FE921FB, 0x54442D18 */
    9.82793723247329054082e-01, /* atan(1.5) 0x3FEF730B, 0xD281F69B */
    1.57079632679489655800e+00, /* atan(inf) 0x3FF921FB, 0x54442D18 */
};
static const double ATAN_LOW[] = {
    2.26987774529616870924e-17, /* 0x3C7A2B7F, 0x222F65E2 */
    3.06161699786838301793e-17, /* 0x3C81A626, 0x33145C07 */
    1.39033110312309984516e-17, /* 0x3C700788, 0x7AF0CBBD */
    6.12323399573676603587e-17, /* 0x3C91A626, 0x33145C07 */
};
static const double ATAN_ODD[] = {
    3.33333333333329318027e-01,  /* 0x3FD55555, 0x5555550D */
    1.42857142725034663711e-01,  /* 0x3FC24924, 0x920083FF */
    9.09088713343650656196e-02,  /* 0x3FB745CD, 0xC54C206E */
    6.66107313738753120669e-02,  /* 0x3FB10D66, 0xA0D03D51 */
    4.97687799461593236017e-02,  /* 0x3FA97B4B, 0x24760DEB */
    1.62858201153657823623e-02,  /* 0x3F90AD3A, 0xE322DA11 */
};
static const double ATAN_EVEN[] = {
    -1.99999999998764832476e-01, /* 0xBFC99999, 0x9998EBC4 */
    -1.11111104054623557880e-01, /* 0xBFBC71C6, 0xFE231671 */
    -7.69187620504482999495e-02, /* 0xBFB3B0F2, 0xAF749A6D */
    -5.83357013379057348645e-02, /* 0xBFADDE2D, 0x52DEFD9A */
    -3.65315727442169155270e-02, /* 0xBFA2B444, 0x2C6A6C2F */
};
static const double PI_HIGH = 3.1415926535897931160E+00, PI_LOW = 1.2246467991473531772E-16;

/* Of a number from 0 to 2^64. */
static double arctangent_of(double x)
{
    int part = -1;
    if (x < 0.4375) {
        if (x < 0x1p-27)
            return x;
    } else if (x < 0.6875) {
        part = 0;
        x = (2.0 * x - 1.0) / (2.0 + x);
    } else if (x < 1.1875) {
        part = 1;
        x = (x - 1.0) / (x + 1.0);
    } else if (x < 2.4375) {
        part = 2;
        x = (x - 1.5) / (1.0 + 1.5 * x);
    } else {
        part = 3;
        x = -1.0 / x;
    }
    const double z = x * x, w = z * z;
    const double odd =
        z * (ATAN_ODD[0] +
             w * (ATAN_ODD[1] + w * (ATAN_ODD[2] + w * (ATAN_ODD[3] + w * (ATAN_ODD[4] + w * ATAN_ODD[5])))));
    const double even =
        w * (ATAN_EVEN[0] + w * (ATAN_EVEN[1] + w * (ATAN_EVEN[2] + w * (ATAN_EVEN[3] + w * ATAN_EVEN[4]))));
    if (part < 0)
        return x - x * (odd + even);
    return ATAN_HIGH[part] - ((x * (odd + even) - ATAN_LOW[part]) - x);
}

static bool is_negative(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits >> 63;
}

double angle_of(double y, double x)
{
    const double up = fabs(y), aside = fabs(x);
    double angle;
    if (isnan(x) || isnan(y))
        return x + y;
    if (isinf(up) && isinf(aside))
        angle = PI_HIGH / 4.0;
    else if (up == 0.0)
        angle = 0.0;
    else if (aside == 0.0 || up / aside > 0x1p64)
        return is_negative(y) ? -PI_HIGH / 2.0 : PI_HIGH / 2.0;
    else if (is_negative(x) && aside / up > 0x1p64)
        angle = 0.0;
    else
        angle = arctangent_of(up / aside);
    if (is_negative(x))
        angle = PI_HIGH - (angle - PI_LOW);
    return is_negative(y) ? -angle : angle;
}
