/* Loops without Python in them, for step_costs.py to time: a host's calls of an FMU, and the equations in one plain loop,
   as people write them. */

#include <math.h>
#include <stddef.h>

#include "fmi2FunctionTypes.h"
#include "trig.c"

/* n sub-steps of semi-implicit Euler with drag of constant area, from and to x, y, heading, vx, vy, yaw rate.
   k [kg/m], x_d [m], forces [N] and moment [N.m] of the actuators. */
void plain_loop(double mass, double inertia, double k, double x_d, double thrust, double side, double turn, double h,
                int n, double state[6])
{
    double x = state[0], y = state[1], heading = state[2], vx = state[3], vy = state[4], r = state[5];
    for (int i = 0; i < n; i++) {
        const double c = cos(heading), s = sin(heading);
        const double u = c * vx + s * vy, w = c * vy - s * vx + r * x_d;
        const double kq = k * sqrt(u * u + w * w), drag_y = -kq * w;
        const double force_x = thrust - kq * u, force_y = drag_y + side;
        vx += h * ((c * force_x - s * force_y) / mass);
        vy += h * ((s * force_x + c * force_y) / mass);
        r += h * ((x_d * drag_y + turn) / inertia);
        x += h * vx;
        y += h * vy;
        heading += h * r;
    }
    state[0] = x, state[1] = y, state[2] = heading, state[3] = vx, state[4] = vy, state[5] = r;
}

/* n sines with their cosines, each of an angle [rad] that waits for the ones before, as in a sub-step. */
double sine_loop(double angle, int n)
{
    struct trig_turn turn = {.quarters = 0.0};
    for (int i = 0; i < n; i++) {
        const struct trig_pair pair = trig_sine_cosine(angle, &turn);
        angle = pair.sine + pair.cosine;
    }
    return angle;
}

/* n square roots, each of a number that waits for the one before. */
double root_loop(double number, int n)
{
    for (int i = 0; i < n; i++)
        number = sqrt(number) + 1.0;
    return number;
}

/* n communication steps: set the inputs, step, get the outputs. `controls` has a row for each, `steps` its start and
   its size [s]. What it returns, and the next: the largest status. */
int step_loop(fmi2SetRealTYPE *set, fmi2DoStepTYPE *step, fmi2GetRealTYPE *get, fmi2Component craft,
              const unsigned *inputs, size_t input_count, const double *controls, const unsigned *outputs,
              size_t output_count, double *values, const double *steps, int n)
{
    int worst = fmi2OK;
    for (int i = 0; i < n; i++, steps += 2, controls += input_count) {
        const int status[] = {set(craft, inputs, input_count, controls), step(craft, steps[0], steps[1], fmi2True),
                              get(craft, outputs, output_count, values)};
        for (int k = 0; k < 3; k++)
            worst = status[k] > worst ? status[k] : worst;
    }
    return worst;
}

/* n evaluations in model exchange: set time and states, get the derivatives. */
int evaluation_loop(fmi2SetTimeTYPE *set_time, fmi2SetContinuousStatesTYPE *set_states,
                    fmi2GetDerivativesTYPE *get_derivatives, fmi2Component craft, double h, int n)
{
    double states[6] = {0.0, 0.0, 0.3, 0.1, 0.0, 0.01}, derivatives[6];
    int worst = fmi2OK;
    for (int i = 0; i < n; i++) {
        const int status[] = {set_time(craft, i * h), set_states(craft, states, 6),
                              get_derivatives(craft, derivatives, 6)};
        for (int k = 0; k < 3; k++)
            worst = status[k] > worst ? status[k] : worst;
        states[2] += h * derivatives[2];
    }
    return worst;
}
