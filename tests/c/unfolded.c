/* The equations as people write them, with their divisions, in the precision of REAL: double, or __float128 with QUAD.

   Reads from stdin mass, inertia, k, x_d, steering force, half length, thrust limits (2), the state (6), the method (1
   Euler, 3 RK4); then a line for each communication step: sub-steps, h, the controls (5). Writes the state after each, as
   doubles and what is left of it beside them. */

#include <stdio.h>

#ifdef QUAD
#include <quadmath.h>
typedef __float128 real;
#define COS cosq
#define SIN sinq
#define SQRT sqrtq
#else
#include <math.h>
typedef double real;
#define COS cos
#define SIN sin
#define SQRT sqrt
#endif

enum { MASS, INERTIA, K, X_D, STEERING, HALF_LENGTH, THRUST_MIN, THRUST_MAX, CONSTANTS };
enum { X, Y, HEADING, VX, VY, YAW_RATE, STATES };

static double craft[CONSTANTS], controls[5];

static real clip(real value, real low, real high)
{
    return value < low ? low : value > high ? high : value;
}

/* The accelerations. */
static void accelerations(real heading, real vx, real vy, real yaw_rate, real a[3])
{
    const real commands = clip(controls[1], 0, 1) - clip(controls[2], 0, 1);
    const real side = craft[STEERING] * commands, turn = (real)craft[HALF_LENGTH] * craft[STEERING] * commands;
    const real c = COS(heading), s = SIN(heading);
    const real air_x = vx - controls[3], air_y = vy - controls[4];
    const real u = c * air_x + s * air_y, w = c * air_y - s * air_x + yaw_rate * craft[X_D];
    const real kq = craft[K] * SQRT(u * u + w * w), drag_y = -kq * w;
    const real force_x = clip(controls[0], craft[THRUST_MIN], craft[THRUST_MAX]) - kq * u, force_y = drag_y + side;
    a[0] = (c * force_x - s * force_y) / craft[MASS];
    a[1] = (s * force_x + c * force_y) / craft[MASS];
    a[2] = (craft[X_D] * drag_y + turn) / craft[INERTIA];
}

static void euler(real z[STATES], real h)
{
    real a[3];
    accelerations(z[HEADING], z[VX], z[VY], z[YAW_RATE], a);
    for (int i = 0; i < 3; i++)
        z[VX + i] = z[VX + i] + h * a[i];
    z[X] = z[X] + h * z[VX];
    z[Y] = z[Y] + h * z[VY];
    z[HEADING] = z[HEADING] + h * z[YAW_RATE];
}

static void rk4(real z[STATES], real h)
{
    const real half = (real)0.5 * h, sixth = h / 6, square = h * h / 6;
    const real heading = z[HEADING], vx = z[VX], vy = z[VY], r = z[YAW_RATE];
    real a1[3], a2[3], a3[3], a4[3];
    accelerations(heading, vx, vy, r, a1);
    const real r2 = r + half * a1[2];
    accelerations(heading + half * r, vx + half * a1[0], vy + half * a1[1], r2, a2);
    const real r3 = r + half * a2[2];
    accelerations(heading + half * r2, vx + half * a2[0], vy + half * a2[1], r3, a3);
    accelerations(heading + h * r3, vx + h * a3[0], vy + h * a3[1], r + h * a3[2], a4);
    const int pose[] = {X, Y, HEADING};
    for (int i = 0; i < 3; i++) {
        z[pose[i]] = z[pose[i]] + h * z[VX + i] + square * (a1[i] + a2[i] + a3[i]);
        z[VX + i] = z[VX + i] + sixth * (a1[i] + 2 * a2[i] + 2 * a3[i] + a4[i]);
    }
}

static int read(double *values, int n)
{
    int i = 0;
    while (i < n && scanf("%la", &values[i]) == 1)
        i++;
    return i == n;
}

int main(void)
{
    double start[STATES], step[2], method;
    real z[STATES];
    if (!read(craft, CONSTANTS) || !read(start, STATES) || !read(&method, 1))
        return 1;
    for (int i = 0; i < STATES; i++)
        z[i] = start[i];
    while (read(step, 2) && read(controls, 5)) {
        for (int n = (int)step[0]; n > 0; n--)
            (method == 1.0 ? euler : rk4)(z, step[1]);
        for (int i = 0; i < STATES; i++)
            printf("%a %a ", (double)z[i], (double)(z[i] - (double)z[i]));
        printf("\n");
    }
    return 0;
}
