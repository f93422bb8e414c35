/* The square root, rounded correctly, without libm: `sqrt` is a call in most compilers, if only to set errno. */

#ifndef HOVERCRAFT_ROOT_H
#define HOVERCRAFT_ROOT_H

#if !defined(HOVERCRAFT_ROOT_IN_C) && (defined(__SSE2__) || defined(_M_X64))

#include <emmintrin.h>

static inline double square_root(double x)
{
    const __m128d both = _mm_set_sd(x);
    return _mm_cvtsd_f64(_mm_sqrt_sd(both, both));
}

#elif !defined(HOVERCRAFT_ROOT_IN_C) && (defined(__aarch64__) || defined(_M_ARM64))

#include <arm_neon.h>

static inline double square_root(double x)
{
    return vget_lane_f64(vsqrt_f64(vdup_n_f64(x)), 0);
}

#elif !defined(HOVERCRAFT_ROOT_IN_C) && defined(__wasm__) && defined(__clang__) && __clang_major__ >= 18

static inline double square_root(double x)
{
    return __builtin_elementwise_sqrt(x);
}

#else

#include <stdint.h>
#include <string.h>

/* Bit by bit, as by hand: of m*2^e with an even e it is the root of m, with one bit more than a double has, which
   rounds it. That root is never half way between two doubles: the square of an odd number is odd. */
static inline double square_root(double x)
{
    uint64_t bits, m, root = 0, rest = 0;
    memcpy(&bits, &x, sizeof bits);
    int e = (int)(bits >> 52);
    if (bits << 1 == 0 || e == 0x7ff || bits << 1 > UINT64_C(0x7ff) << 53) /* zeros, infinity and no number */
        return x;
    if (bits >> 63)
        return (x - x) / (x - x);
    m = bits & UINT64_MAX >> 12;
    if (e > 0)
        m |= UINT64_C(1) << 52;
    else
        for (e = 1; !(m >> 52); e--)
            m <<= 1;
    e -= 0x3ff + 52;
    if (e % 2 != 0) {
        m <<= 1;
        e--;
    }
    for (int i = 26; i >= -27; i--) {
        const uint64_t trial = root << 2 | 1;
        rest = rest << 2 | (i >= 0 ? m >> 2 * i & 3 : 0);
        root <<= 1;
        if (rest >= trial) {
            rest -= trial;
            root |= 1;
        }
    }
    bits = ((uint64_t)(e / 2 - 26 + 0x3ff + 52 - 1) << 52) + ((root + 1) >> 1);
    memcpy(&x, &bits, sizeof x);
    return x;
}

#endif

#endif
