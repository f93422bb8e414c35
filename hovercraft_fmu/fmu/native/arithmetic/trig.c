/* The rare cases of trig.h, where the notice stands: all this is fdlibm's. */

#include "trig.h"

#include <stdint.h>
#include <string.h>

static uint64_t bits_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static double from_bits(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static int exponent_of(double x)
{
    return (int)(bits_of(x) >> 52 & 0x7ff);
}

static const double PIO2_1 = 1.57079632673412561417e+00, /* 0x3FF921FB, 0x54400000: first 33 bits of pi/2 */
    PIO2_1T = 6.07710050650619224932e-11,                /* 0x3DD0B461, 0x1A626331: pi/2 - PIO2_1 */
    PIO2_2 = 6.07710050630396597660e-11,                 /* 0x3DD0B461, 0x1A600000: second 33 bits */
    PIO2_2T = 2.02226624879595063154e-21,                /* 0x3BA3198A, 0x2E037073 */
    PIO2_3 = 2.02226624871116645580e-21,                 /* 0x3BA3198A, 0x2E000000: third 33 bits */
    PIO2_3T = 8.47842766036889956997e-32;                /* 0x397B839A, 0x252049C1 */

void trig_turn_to(struct trig_turn *turn, double quarters)
{
    /* the high part is exact, as quarters has 20 bits; one round, good to 85 bits */
    *turn = (struct trig_turn){quarters, quarters * PIO2_1, quarters * PIO2_1T, (int)quarters & 3};
}

struct trig_pair trig_near_multiple(double angle)
{
    const double quarters = angle * TRIG_INVPIO2 + TRIG_TO_INTEGER - TRIG_TO_INTEGER;
    /* second round, good to 118 bits */
    const double first = angle - quarters * PIO2_1;
    double w = quarters * PIO2_2, r = first - w;
    w = quarters * PIO2_2T - ((first - r) - w);
    double y = r - w;
    if (exponent_of(angle) - exponent_of(y) > 49) { /* third round, good to 151 bits: covers all cases */
        const double second = r;
        w = quarters * PIO2_3;
        r = second - w;
        w = quarters * PIO2_3T - ((second - r) - w);
        y = r - w;
    }
    return trig_of_rest((int)quarters & 3, y, (r - y) - w);
}

/* 24 bits an element: the bits of 2/pi behind the binary point. */
static const int32_t TWO_OVER_PI[] = {
    0xA2F983, 0x6E4E44, 0x1529FC, 0x2757D1, 0xF534DD, 0xC0DB62,
    0x95993C, 0x439041, 0xFE5163, 0xABDEBB, 0xC561B7, 0x246E3A,
    0x424DD2, 0xE00649, 0x2EEA09, 0xD1921C, 0xFE1DEB, 0x1CB129,
    0xA73EE8, 0x8235F5, 0x2EBB44, 0x84E99C, 0x7026B4, 0x5F7E41,
    0x3991D6, 0x398353, 0x39F49C, 0x845F8B, 0xBDF928, 0x3B1FF8,
    0x97FFDE, 0x05980F, 0xEF2F11, 0x8B5A0A, 0x6D1F6D, 0x367ECF,
    0x27CB09, 0xB74F46, 0x3F669E, 0x5FEA2D, 0x7527BA, 0xC7EBE5,
    0xF17B3D, 0x0739F7, 0x8A5292, 0xEA6BFB, 0x5FB11F, 0x8D5D08,
    0x560330, 0x46FC7B, 0x6BABF0, 0xCFBC20, 0x9AF436, 0x1DA9E3,
    0x91615E, 0xE61B08, 0x659985, 0x5F14A0, 0x68408D, 0xFFD880,
    0x4D7327, 0x310606, 0x1556CA, 0x73A8C9, 0x60E27B, 0xC08C6B,
};
/* pi/2 in parts of 24 bits. */
static const double HALF_PI[] = {
    1.57079625129699707031e+00, /* 0x3FF921FB, 0x40000000 */
    7.54978941586159635335e-08, /* 0x3E74442D, 0x00000000 */
    5.39030252995776476554e-15, /* 0x3CF84698, 0x80000000 */
    3.28200341580791294123e-22, /* 0x3B78CC51, 0x60000000 */
    1.27065575308067607349e-29, /* 0x39F01B83, 0x80000000 */
};
enum { TERMS = 4, ROOM = 20 }; /* fdlibm's jk for 53 bits; its size of the working arrays */

/* x * 2^n, exact: fdlibm asks for |n| below 600 only. */
static double times_power_of_two(double x, int n)
{
    return x * from_bits((uint64_t)(0x3ff + n) << 52);
}

static double product(const double *x, const double *f, int jx, int i)
{
    double sum = 0.0;
    for (int j = 0; j <= jx; j++)
        sum += x[j] * f[jx + i - j];
    return sum;
}

/* q[0..jz] -> 24-bit integers iq[0..jz-1], last first; what is left over. */
static double distilled(const double *q, int32_t *iq, int jz)
{
    double z = q[jz];
    for (int i = 0, j = jz; j > 0; i++, j--) {
        const double high = (double)(int32_t)(0x1p-24 * z);
        iq[i] = (int32_t)(z - 0x1p24 * high);
        z = q[j - 1] + high;
    }
    return z;
}

/* 1 - q, where q is the fraction in iq[0..jz-1]: never 0, as no double is that close to a multiple of pi/4. */
static void complement(int32_t *iq, int jz, int q0)
{
    int carry = 0;
    for (int i = 0; i < jz; i++) {
        const int32_t j = iq[i];
        if (carry) {
            iq[i] = 0xffffff - j;
        } else if (j != 0) {
            carry = 1;
            iq[i] = 0x1000000 - j;
        }
    }
    if (q0 == 1)
        iq[jz - 1] &= 0x7fffff;
    else if (q0 == 2)
        iq[jz - 1] &= 0x3fffff;
}

/* The sum of iq[0..jz] * 2^(q0 - 24*(jz - i)) times pi/2, as y[0] + y[1]; negative where `negative`. */
static void times_half_pi(const int32_t *iq, int jz, int q0, int negative, double y[2])
{
    double q[ROOM], fq[ROOM] = {0.0}, power = times_power_of_two(1.0, q0), sum = 0.0;
    for (int i = jz; i >= 0; i--) {
        q[i] = power * (double)iq[i];
        power *= 0x1p-24;
    }
    for (int i = jz; i >= 0; i--) {
        double part = 0.0;
        for (int k = 0; k <= TERMS && k <= jz - i; k++)
            part += HALF_PI[k] * q[i + k];
        fq[jz - i] = part;
    }
    for (int i = jz; i >= 0; i--)
        sum += fq[i];
    y[0] = negative ? -sum : sum;
    sum = fq[0] - sum;
    for (int i = 1; i <= jz; i++)
        sum += fq[i];
    y[1] = negative ? -sum : sum;
}

/* fdlibm's __kernel_rem_pio2 for 53 bits: x[0..nx-1] are 24-bit parts of a positive number, x[0] times 2^e0. */
static int reduce_parts(const double *x, double y[2], int e0, int nx)
{
    const int jx = nx - 1, jv = e0 < 27 ? 0 : (e0 - 3) / 24;
    int q0 = e0 - 24 * (jv + 1), jz = TERMS, n, half;
    int32_t iq[ROOM];
    double f[ROOM], q[ROOM], z;
    for (int i = 0, j = jv - jx; i <= jx + TERMS; i++, j++)
        f[i] = j < 0 ? 0.0 : (double)TWO_OVER_PI[j];
    for (int i = 0; i <= TERMS; i++)
        q[i] = product(x, f, jx, i);
    for (;;) {
        int32_t any = 0;
        int more = 1;
        z = times_power_of_two(distilled(q, iq, jz), q0);
        z -= 8.0 * (double)(int64_t)(z * 0.125); /* trim off what is a multiple of 8 */
        n = (int)z;
        z -= (double)n;
        half = 0;
        if (q0 > 0) { /* iq[jz-1] holds a part of n */
            const int32_t i = iq[jz - 1] >> (24 - q0);
            n += i;
            iq[jz - 1] -= i << (24 - q0);
            half = iq[jz - 1] >> (23 - q0);
        } else if (q0 == 0) {
            half = iq[jz - 1] >> 23;
        } else if (z >= 0.5) {
            half = 2;
        }
        if (half > 0) { /* more than one half: take the rest to the next multiple */
            n += 1;
            complement(iq, jz, q0);
            if (half == 2)
                z = (1.0 - z) - times_power_of_two(1.0, q0);
        }
        if (z != 0.0)
            break;
        for (int i = jz - 1; i >= TERMS; i--)
            any |= iq[i];
        if (any)
            break;
        while (iq[TERMS - more] == 0) /* all bits cancelled: more terms are needed */
            more++;
        for (int i = jz + 1; i <= jz + more; i++) {
            f[jx + i] = (double)TWO_OVER_PI[jv + i];
            q[i] = product(x, f, jx, i);
        }
        jz += more;
    }
    if (z == 0.0) { /* chop off zero terms */
        do {
            jz--;
            q0 -= 24;
        } while (iq[jz] == 0);
    } else {
        z = times_power_of_two(z, -q0);
        if (z >= 0x1p24) {
            const double high = (double)(int32_t)(0x1p-24 * z);
            iq[jz] = (int32_t)(z - 0x1p24 * high);
            jz++;
            q0 += 24;
            iq[jz] = (int32_t)high;
        } else {
            iq[jz] = (int32_t)z;
        }
    }
    times_half_pi(iq, jz, q0, half, y);
    return n & 7;
}

struct trig_pair trig_large(double x)
{
    const uint64_t bits = bits_of(x);
    const int exponent = exponent_of(x);
    if (exponent == 0x7ff)
        return (struct trig_pair){x - x, x - x};
    double y[2], parts[3], z = from_bits((bits & UINT64_MAX >> 12) | (uint64_t)(0x3ff + 23) << 52);
    int i;
    for (i = 0; i < 2; i++) {
        parts[i] = (double)(int32_t)z;
        z = (z - parts[i]) * 0x1p24;
    }
    parts[2] = z;
    while (parts[i] == 0.0) /* the first is not */
        i--;
    const int n = reduce_parts(parts, y, exponent - (0x3ff + 23), i + 1);
    return bits >> 63 ? trig_of_rest(-n & 3, -y[0], -y[1]) : trig_of_rest(n & 3, y[0], y[1]);
}
