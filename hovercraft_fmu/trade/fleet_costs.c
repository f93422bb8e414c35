/* Would one instance that steps a fleet be cheaper than as many instances? A line "name value" for each measure, ns a
   craft and sub-step, the best of interleaved samples; compiled together with the sources of the FMI 3.0 FMU (-DFMI=3).

   The fleet is as cheap as it can be made: arrays of LANES craft, which the compiler works on several at a time, with
   no more around a communication step than it needs: inputs in, checked and held, what is watched, results checked,
   outputs out. It knows semi-implicit Euler and plain drag alone, and must come to the bits of the instances. */

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "calls.h"
#include "costs.h"
#include "kernel.h"
#include "trig.h"
#include "variables.h"

enum { FLEET = 1000, LANES = 8, GROUPS = FLEET / LANES, SAMPLES = 21, OUTPUT_COUNT = 9 };
static const double STEP_SIZE = 0.001; /* s */
static const unsigned OUTPUTS[OUTPUT_COUNT] = {V_POSE_X,     V_POSE_Y,     V_POSE_HEADING,
                                               V_VELOCITY_X, V_VELOCITY_Y, V_VELOCITY_YAW_RATE,
                                               V_BODY_SURGE, V_BODY_SWAY,  V_SPEED};

struct lanes {
    double x[LANES], y[LANES], heading[LANES], vx[LANES], vy[LANES], yaw_rate[LANES];
    double thrust[LANES], side[LANES], turn[LANES];         /* N, N, N.m */
    double k[LANES], x_d[LANES], mass[LANES], inertia[LANES];
    double most[LANES], left[LANES], right[LANES];          /* what is watched, as in kernel.c */
    double stability[LANES], rotation[LANES];               /* 1, rad: the largest so far */
};

/* trig.h without its rare cases, and without a branch: for headings below 2^20 quarter turns, not next to one. */
static inline void sine_cosine(double angle, double *sine, double *cosine)
{
    const double S1 = -1.66666666666666324348e-01, S2 = 8.33333333332248946124e-03, S3 = -1.98412698298579493134e-04,
                 S4 = 2.75573137070700676789e-06, S5 = -2.50507602534068634195e-08, S6 = 1.58969099521155010221e-10;
    const double C1 = 4.16666666666666019037e-02, C2 = -1.38888888888741095749e-03, C3 = 2.48015872894767294178e-05,
                 C4 = -2.75573143513906633035e-07, C5 = 2.08757232129817482790e-09, C6 = -1.13596475577881948265e-11;
    const double quarters = angle * TRIG_INVPIO2 + TRIG_TO_INTEGER - TRIG_TO_INTEGER;
    const double high = quarters * 1.57079632673412561417e+00, low = quarters * 6.07710050650619224932e-11;
    const double r = angle - high, y = r - low, tail = (r - y) - low;
    const double z = y * y, w = z * z, ww = w * w;
    const double odd = (S1 + z * S2) + w * (S3 + z * S4) + ww * (S5 + z * S6);
    const double s = y + (z * y * odd + (tail - z * (0.5 * tail)));
    const double even = w * (C1 + z * C2) + ww * ((C3 + z * C4) + w * (C5 + z * C6));
    const double half = 0.5 * z, one = 1.0 - half;
    const double c = one + ((((1.0 - one) - half) - y * tail) + even);
    const double n = quarters - 4.0 * (quarters * 0.25 + TRIG_TO_INTEGER - TRIG_TO_INTEGER); /* -2 ... 2 */
    const double a = fabs(n) == 1.0 ? c : s, b = fabs(n) == 1.0 ? s : c;
    *sine = n == -1.0 || fabs(n) == 2.0 ? -a : a;
    *cosine = n == 1.0 || fabs(n) == 2.0 ? -b : b;
}

static void substeps(struct lanes *restrict f, int n)
{
    const double h = STEP_SIZE;
    for (int i = 0; i < n; i++) {
        for (int l = 0; l < LANES; l++) {
            double s, c;
            sine_cosine(f->heading[l], &s, &c);
            const double u = c * f->vx[l] + s * f->vy[l];
            const double w = c * f->vy[l] - s * f->vx[l] + f->yaw_rate[l] * f->x_d[l];
            const double kq = f->k[l] * sqrt(u * u + w * w), drag_y = -kq * w;
            const double force_x = f->thrust[l] - kq * u, force_y = drag_y + f->side[l];
            const double moment = f->x_d[l] * drag_y + f->turn[l];
            f->vx[l] = f->vx[l] + h * ((c * force_x - s * force_y) / f->mass[l]);
            f->vy[l] = f->vy[l] + h * ((s * force_x + c * force_y) / f->mass[l]);
            f->yaw_rate[l] = f->yaw_rate[l] + h * (moment / f->inertia[l]);
            f->x[l] = f->x[l] + h * f->vx[l];
            f->y[l] = f->y[l] + h * f->vy[l];
            f->heading[l] = f->heading[l] + h * f->yaw_rate[l];
            f->most[l] = larger(f->most[l], kq);
            f->left[l] = f->yaw_rate[l] < f->left[l] ? f->yaw_rate[l] : f->left[l];
            f->right[l] = larger(f->right[l], f->yaw_rate[l]);
        }
    }
}

/* The inputs of a group: finite, held at their limits. */
static bool take_up(struct lanes *restrict f, const double *restrict thrust, const double *restrict port,
                    const double *restrict starboard, const struct craft *craft, double thruster_moment)
{
    double all = 0.0;
    for (int l = 0; l < LANES; l++) {
        const double p = port[l] < 0.0 ? 0.0 : port[l] > 1.0 ? 1.0 : port[l];
        const double s = starboard[l] < 0.0 ? 0.0 : starboard[l] > 1.0 ? 1.0 : starboard[l];
        all += 0.0 * thrust[l] + 0.0 * port[l] + 0.0 * starboard[l];
        f->thrust[l] = thrust[l] < craft->thrust_min ? craft->thrust_min
                       : thrust[l] > craft->thrust_max ? craft->thrust_max : thrust[l];
        f->side[l] = craft->steering_force * (p - s);
        f->turn[l] = thruster_moment * (p - s);
        f->most[l] = 0.0;
        f->left[l] = f->right[l] = f->yaw_rate[l];
    }
    return all == 0.0;
}

/* What is watched, and all that is an output; whether it is finite. */
static bool give_back(struct lanes *restrict f, double drag_rate, double (*restrict outputs)[FLEET])
{
    double all = 0.0;
    for (int l = 0; l < LANES; l++) {
        double s, c;
        sine_cosine(f->heading[l], &s, &c);
        f->stability[l] = larger(f->stability[l], STEP_SIZE * f->most[l] * drag_rate);
        f->rotation[l] = larger(f->rotation[l], STEP_SIZE * larger(f->right[l], -f->left[l]));
        outputs[0][l] = f->x[l];
        outputs[1][l] = f->y[l];
        outputs[2][l] = f->heading[l];
        outputs[3][l] = f->vx[l];
        outputs[4][l] = f->vy[l];
        outputs[5][l] = f->yaw_rate[l];
        outputs[6][l] = c * f->vx[l] + s * f->vy[l];
        outputs[7][l] = c * f->vy[l] - s * f->vx[l];
        outputs[8][l] = sqrt(f->vx[l] * f->vx[l] + f->vy[l] * f->vy[l]);
        all += 0.0 * f->x[l] + 0.0 * f->y[l] + 0.0 * f->heading[l] + 0.0 * outputs[8][l] + 0.0 * f->stability[l];
    }
    return all == 0.0;
}

static double controls[3][FLEET], outputs[OUTPUT_COUNT][FLEET], results[FLEET][OUTPUT_COUNT];
static struct lanes fleet[GROUPS];
static void *craft[FLEET];

static double time_of_fleet(const struct craft *kind, int n)
{
    const struct derived derived = kernel_derived(kind);
    bool good = true;
    const double begun = now();
    for (int g = 0; g < GROUPS; g++) {
        const int first = g * LANES;
        good = good && take_up(&fleet[g], &controls[0][first], &controls[1][first], &controls[2][first], kind,
                               derived.thruster_moment);
        substeps(&fleet[g], n);
        good = good && give_back(&fleet[g], derived.drag_rate, (double(*)[FLEET]) & outputs[0][first]);
    }
    const double spent = now() - begun;
    demand(good, "the fleet");
    return spent / FLEET / n * 1e9;
}

static double time_of_instances(double time, int n)
{
    static const unsigned inputs[] = {V_THRUST, V_PORT_THRUSTER, V_STARBOARD_THRUSTER};
    bool good = true;
    const double begun = now();
    for (int i = 0; i < FLEET; i++) {
        const double values[] = {controls[0][i], controls[1][i], controls[2][i]};
        good = good && call_set(craft[i], inputs, 3, values) == CALL_OK &&
               call_step(craft[i], time, n * STEP_SIZE) <= CALL_WARNED &&
               call_get(craft[i], OUTPUTS, OUTPUT_COUNT, results[i]) == CALL_OK;
    }
    const double spent = now() - begun;
    demand(good, "the instances");
    return spent / FLEET / n * 1e9;
}

static void demand_same(void)
{
    for (int i = 0; i < FLEET; i++)
        for (int k = 0; k < OUTPUT_COUNT; k++)
            demand(memcmp(&outputs[k][i], &results[i][k], sizeof(double)) == 0,
                   "a fleet that ends where the instances do");
}

static void start(const struct craft *kind)
{
    const struct derived derived = kernel_derived(kind);
    for (int i = 0; i < FLEET; i++) {
        struct lanes *f = &fleet[i / LANES];
        f->k[i % LANES] = derived.drag_factor;
        f->x_d[i % LANES] = derived.drag_center;
        f->mass[i % LANES] = kind->mass;
        f->inertia[i % LANES] = kind->inertia;
        controls[0][i] = i % 11;
        controls[1][i] = i % 7 / 7.0;
        controls[2][i] = i % 5 / 5.0;
        craft[i] = call_instantiate(CALL_STEPS, GUID, "");
        demand(craft[i] && call_start(craft[i]) == CALL_OK, "initialization");
    }
}

static double best(const double *samples)
{
    double least = samples[0];
    for (int k = 1; k < SAMPLES; k++)
        least = samples[k] < least ? samples[k] : least;
    return least;
}

int main(void)
{
    static const struct craft kind = {100.0, 500.0, 20.0, 10.0, 5.0, 1.25, 1.225, -0.25, 3.0,
                                      0.0,   10.0,  CONSTANT, 0.0, 9.80665, 0.0};
    static const int numbers[] = {1, 10, 100};
    enum { CASES = sizeof numbers / sizeof *numbers };
    static double of_fleet[CASES][SAMPLES], of_instances[CASES][SAMPLES];
    double time = 0.0;
    start(&kind);
    for (int k = 0; k < SAMPLES; k++)
        for (int i = 0; i < CASES; i++) {
            of_instances[i][k] = time_of_instances(time, numbers[i]);
            of_fleet[i][k] = time_of_fleet(&kind, numbers[i]);
            time += numbers[i] * STEP_SIZE;
            demand_same();
        }
    for (int i = 0; i < CASES; i++)
        printf("instances_%d %.9g\nfleet_%d %.9g\n", numbers[i], best(of_instances[i]), numbers[i], best(of_fleet[i]));
    return 0;
}
