/* fdlibm's logarithm (e_log.c, as FreeBSD and musl have kept it), which comes with this notice:

   ====================================================
   Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.

   Developed at SunSoft, a Sun Microsystems, Inc. business.
   Permission to use, copy, modify, and distribute this
   software is freely granted, provided that this notice
   is preserved.
   ==================================================== */

#include "logarithm.h"

#include <stdint.h>
#include <string.h>

static const double LN2_HI = 6.93147180369123816490e-01, /* 0x3FE62E42, 0xFEE00000 */
    LN2_LO = 1.90821492927058770002e-10,                 /* 0x3DEA39EF, 0x35793C76 */
    LG1 = 6.666666666666735130e-01,                      /* 0x3FE55555, 0x55555593 */
    LG2 = 3.999999999940941908e-01,                      /* 0x3FD99999, 0x9997FA04 */
    LG3 = 2.857142874366239149e-01,                      /* 0x3FD24924, 0x94229359 */
    LG4 = 2.222219843214978396e-01,                      /* 0x3FCC71C5, 0x1D8E78AF */
    LG5 = 1.818357216161805012e-01,                      /* 0x3FC74664, 0x96CB03DE */
    LG6 = 1.531383769920937332e-01,                      /* 0x3FC39A09, 0xD078C69F */
    LG7 = 1.479819860511658591e-01;                      /* 0x3FC2F112, 0xDF3E5244 */

double logarithm_of(double x)
{
    uint64_t bits;
    int k = 0;
    memcpy(&bits, &x, sizeof bits);
    if (bits >> 52 == 0x7ff) /* infinite, or no number */
        return x;
    if (bits >> 52 == 0) { /* subnormal: scale up */
        k = -54;
        x *= 0x1p54;
        memcpy(&bits, &x, sizeof bits);
    }
    /* x = 2^k * (1 + f) with sqrt(1/2) < 1 + f < sqrt(2) */
    const uint32_t high = (uint32_t)(bits >> 32) + (0x3ff00000 - 0x3fe6a09e);
    k += (int)(high >> 20) - 0x3ff;
    bits = (uint64_t)((high & 0x000fffff) + 0x3fe6a09e) << 32 | (bits & 0xffffffff);
    memcpy(&x, &bits, sizeof x);
    const double f = x - 1.0, half = 0.5 * f * f, s = f / (2.0 + f), z = s * s, w = z * z, dk = (double)k;
    const double t1 = w * (LG2 + w * (LG4 + w * LG6));
    const double t2 = z * (LG1 + w * (LG3 + w * (LG5 + w * LG7)));
    return s * (half + (t2 + t1)) + dk * LN2_LO - half + f + dk * LN2_HI;
}
