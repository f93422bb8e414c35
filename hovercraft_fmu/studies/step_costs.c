/* What an FMU costs a host in C: a line "name value" for each measure, medians of interleaved samples.

   native_costs LIBRARY GUID RESOURCES [substeps]
   With `substeps` also ns an evaluation in model exchange, and ns a sub-step of each method, beside others with this
   platform's libm at -O3: a plain loop of semi-implicit Euler and one of Dormand-Prince, as people write them, which
   must end where the kernel does but for roundings, and kernel.c (compiled into this program with HOVERCRAFT_LIBM). */

#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "costs.h"
#include "fmi2FunctionTypes.h"
#include "kernel.h"
#include "variables.h"

enum { SAMPLES = 21, MOST_CASES = 16, SUBSTEPS = 20000, ALIVE = 2000 };
static const double STEP_SIZE = 0.001;  /* s */
static const double TOLERANCE = 1e-12;  /* SI units, of the adaptive method: thousands of its own steps in that time */

struct functions {
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2SetRealTYPE *set;
    fmi2GetRealTYPE *get;
    fmi2SetIntegerTYPE *choose;
    fmi2GetIntegerTYPE *count;
    fmi2DoStepTYPE *step;
    fmi2ResetTYPE *reset;
    fmi2FreeInstanceTYPE *release;
};

struct exchange_functions {
    fmi2EnterContinuousTimeModeTYPE *enter;
    fmi2SetTimeTYPE *set_time;
    fmi2SetContinuousStatesTYPE *set_states;
    fmi2GetDerivativesTYPE *get_derivatives;
};

struct host {
    struct functions f;
    struct exchange_functions exchange;
    const char *guid, *resources;
    fmi2Component craft;
    double time; /* s, where the last step ended */
};

struct outcome_of_case {
    char name[64];
    double samples[SAMPLES];
};

static long resident(void)
{
    long size, pages = -1;
    FILE *file = fopen("/proc/self/statm", "r");
    demand(file && fscanf(file, "%ld %ld", &size, &pages) == 2, "statm");
    fclose(file);
    return pages * sysconf(_SC_PAGESIZE);
}

static void *found(void *library, const char *name)
{
    void *function = dlsym(library, name);
    demand(function != NULL, name);
    return function;
}

static void load(struct host *host, const char *path, bool exchanges)
{
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    demand(library != NULL, "dlopen");
    host->f = (struct functions){
        (fmi2InstantiateTYPE *)found(library, "fmi2Instantiate"),
        (fmi2SetupExperimentTYPE *)found(library, "fmi2SetupExperiment"),
        (fmi2EnterInitializationModeTYPE *)found(library, "fmi2EnterInitializationMode"),
        (fmi2ExitInitializationModeTYPE *)found(library, "fmi2ExitInitializationMode"),
        (fmi2SetRealTYPE *)found(library, "fmi2SetReal"),
        (fmi2GetRealTYPE *)found(library, "fmi2GetReal"),
        (fmi2SetIntegerTYPE *)found(library, "fmi2SetInteger"),
        (fmi2GetIntegerTYPE *)found(library, "fmi2GetInteger"),
        (fmi2DoStepTYPE *)found(library, "fmi2DoStep"),
        (fmi2ResetTYPE *)found(library, "fmi2Reset"),
        (fmi2FreeInstanceTYPE *)found(library, "fmi2FreeInstance"),
    };
    if (exchanges)
        host->exchange = (struct exchange_functions){
            (fmi2EnterContinuousTimeModeTYPE *)found(library, "fmi2EnterContinuousTimeMode"),
            (fmi2SetTimeTYPE *)found(library, "fmi2SetTime"),
            (fmi2SetContinuousStatesTYPE *)found(library, "fmi2SetContinuousStates"),
            (fmi2GetDerivativesTYPE *)found(library, "fmi2GetDerivatives"),
        };
}

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    (void)environment, (void)instance, (void)category;
    if (status > fmi2Warning)
        fprintf(stderr, "%s\n", message);
}

static fmi2Component made(const struct host *host, fmi2Type type)
{
    static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    fmi2Component craft = host->f.instantiate("craft", type, host->guid, host->resources, &callbacks, fmi2False,
                                              fmi2False);
    demand(craft != NULL, "fmi2Instantiate");
    return craft;
}

static void start(struct host *host, int method, double tolerance)
{
    static const unsigned reference = V_INTEGRATOR, of_tolerance = V_TOLERANCE;
    const struct functions *f = &host->f;
    demand(f->reset(host->craft) == fmi2OK && f->choose(host->craft, &reference, 1, &method) == fmi2OK &&
               f->set(host->craft, &of_tolerance, 1, &tolerance) == fmi2OK &&
               f->setup(host->craft, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK &&
               f->enter(host->craft) == fmi2OK && f->leave(host->craft) == fmi2OK,
           "initialization");
    host->time = 0.0;
}

/* us a communication step: set, step, get. */
static double time_of_calls(struct host *host, double size, int steps)
{
    static const unsigned inputs[] = {V_THRUST, V_PORT_THRUSTER, V_STARBOARD_THRUSTER};
    static const unsigned outputs[] = {V_POSE_X,     V_POSE_Y,            V_POSE_HEADING, V_VELOCITY_X, V_VELOCITY_Y,
                                       V_VELOCITY_YAW_RATE, V_BODY_SURGE, V_BODY_SWAY,    V_SPEED};
    const double controls[] = {5.0, 0.5, 0.2};
    double values[9];
    start(host, SEMI_IMPLICIT_EULER, 1e-6);
    const double begun = now();
    for (int i = 0; i < steps; i++) {
        demand(host->f.set(host->craft, inputs, 3, controls) == fmi2OK &&
                   host->f.step(host->craft, host->time, size, fmi2True) <= fmi2Warning &&
                   host->f.get(host->craft, outputs, 9, values) == fmi2OK,
               "a communication step");
        host->time += size;
    }
    return (now() - begun) / steps * 1e6;
}

/* ns a sub-step, inside one communication step; the adaptive method cuts it as it likes. */
static double time_of_substeps(struct host *host, int method)
{
    static const unsigned inputs[] = {V_THRUST, V_PORT_THRUSTER, V_STARBOARD_THRUSTER}, substeps = V_SUBSTEPS;
    const double controls[] = {5.0, 0.5, 0.2};
    int taken = 0;
    start(host, method, TOLERANCE);
    demand(host->f.set(host->craft, inputs, 3, controls) == fmi2OK, "fmi2SetReal");
    const double begun = now();
    demand(host->f.step(host->craft, 0.0, SUBSTEPS * STEP_SIZE, fmi2True) <= fmi2Warning, "fmi2DoStep");
    const double spent = now() - begun;
    demand(host->f.count(host->craft, &substeps, 1, &taken) == fmi2OK && taken > 0, "fmi2GetInteger");
    return spent / taken * 1e9;
}

/* ns an evaluation in model exchange: time, states, derivatives, as a solver asks for them. */
static double time_of_evaluations(const struct host *host)
{
    const struct functions *f = &host->f;
    const struct exchange_functions *x = &host->exchange;
    double states[STATE_COUNT] = {0.0, 0.0, 0.3, 0.1, 0.0, 0.01}, derivatives[STATE_COUNT];
    fmi2Component craft = made(host, fmi2ModelExchange);
    demand(f->setup(craft, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK && f->enter(craft) == fmi2OK &&
               f->leave(craft) == fmi2OK && x->enter(craft) == fmi2OK,
           "initialization for model exchange");
    const double begun = now();
    for (int i = 0; i < SUBSTEPS; i++) {
        demand(x->set_time(craft, i * STEP_SIZE) == fmi2OK && x->set_states(craft, states, STATE_COUNT) == fmi2OK &&
                   x->get_derivatives(craft, derivatives, STATE_COUNT) == fmi2OK,
               "an evaluation");
        states[2] += STEP_SIZE * derivatives[2];
    }
    const double spent = now() - begun;
    f->release(craft);
    return spent / SUBSTEPS * 1e9;
}

/* What it is measured against, from rest: the kernel with libm, and plain loops that must end there, too. */
static double time_of_kernel_with_libm(int method, struct stretch *stretch)
{
    const struct craft craft = {100.0, 500.0, 20.0, 10.0, 5.0, 1.25, 1.225, -0.25, 3.0, 0.0, 10.0, CONSTANT, 0.0, 9.80665, 0.0};
    const struct drive drive = {.start = {5.0, 0.5, 0.2}};
    const struct settings settings = {STEP_SIZE, method, TOLERANCE};
    const struct state rest = {.x = 0.0};
    const double begun = now();
    demand(kernel_advance(&rest, &drive, &craft, SUBSTEPS * STEP_SIZE, &settings, 0.0, stretch) == ADVANCED, "kernel");
    return (now() - begun) / (double)stretch->substeps * 1e9;
}

static const double MASS = 100.0, INERTIA = 500.0, K = 0.5 * 1.225 * 75.0 * 1.25, X_D = -5.0;
static const double THRUST = 5.0, SIDE = 3.0 * (0.5 - 0.2), TURN = 30.0 * (0.5 - 0.2);

static double time_of_plain_euler(struct stretch *end)
{
    const double h = STEP_SIZE;
    double x = 0.0, y = 0.0, heading = 0.0, vx = 0.0, vy = 0.0, yaw_rate = 0.0;
    const double begun = now();
    for (int i = 0; i < SUBSTEPS; i++) {
        const double c = cos(heading), s = sin(heading);
        const double u = c * vx + s * vy, w = c * vy - s * vx + yaw_rate * X_D;
        const double kq = K * sqrt(u * u + w * w), drag_y = -kq * w;
        const double force_x = THRUST - kq * u, force_y = drag_y + SIDE;
        vx += h * ((c * force_x - s * force_y) / MASS);
        vy += h * ((s * force_x + c * force_y) / MASS);
        yaw_rate += h * ((X_D * drag_y + TURN) / INERTIA);
        x += h * vx;
        y += h * vy;
        heading += h * yaw_rate;
    }
    *end = (struct stretch){.state = {x, y, heading, vx, vy, yaw_rate}, .substeps = SUBSTEPS};
    return (now() - begun) / SUBSTEPS * 1e9;
}

static void rates_of(const double y[6], double rates[6])
{
    const double c = cos(y[2]), s = sin(y[2]);
    const double u = c * y[3] + s * y[4], w = c * y[4] - s * y[3] + y[5] * X_D;
    const double kq = K * sqrt(u * u + w * w), drag_y = -kq * w;
    const double force_x = THRUST - kq * u, force_y = drag_y + SIDE;
    rates[0] = y[3];
    rates[1] = y[4];
    rates[2] = y[5];
    rates[3] = (c * force_x - s * force_y) / MASS;
    rates[4] = (s * force_x + c * force_y) / MASS;
    rates[5] = (X_D * drag_y + TURN) / INERTIA;
}

/* A step of Dormand and Prince from y, whose rates are in k[0], to `new`, whose rates are in k[6]; the error. */
static double plain_step(const double y[6], double h, double k[7][6], double new[6])
{
    double error = 0.0;
    for (int i = 0; i < 6; i++)
        new[i] = y[i] + h * (1.0 / 5 * k[0][i]);
    rates_of(new, k[1]);
    for (int i = 0; i < 6; i++)
        new[i] = y[i] + h * (3.0 / 40 * k[0][i] + 9.0 / 40 * k[1][i]);
    rates_of(new, k[2]);
    for (int i = 0; i < 6; i++)
        new[i] = y[i] + h * (44.0 / 45 * k[0][i] + -56.0 / 15 * k[1][i] + 32.0 / 9 * k[2][i]);
    rates_of(new, k[3]);
    for (int i = 0; i < 6; i++)
        new[i] = y[i] + h * (19372.0 / 6561 * k[0][i] + -25360.0 / 2187 * k[1][i] + 64448.0 / 6561 * k[2][i] +
                             -212.0 / 729 * k[3][i]);
    rates_of(new, k[4]);
    for (int i = 0; i < 6; i++)
        new[i] = y[i] + h * (9017.0 / 3168 * k[0][i] + -355.0 / 33 * k[1][i] + 46732.0 / 5247 * k[2][i] +
                             49.0 / 176 * k[3][i] + -5103.0 / 18656 * k[4][i]);
    rates_of(new, k[5]);
    for (int i = 0; i < 6; i++)
        new[i] = y[i] + h * (35.0 / 384 * k[0][i] + 500.0 / 1113 * k[2][i] + 125.0 / 192 * k[3][i] +
                             -2187.0 / 6784 * k[4][i] + 11.0 / 84 * k[5][i]);
    rates_of(new, k[6]);
    for (int i = 0; i < 6; i++)
        error = larger(error, fabs(h * (71.0 / 57600 * k[0][i] + -71.0 / 16695 * k[2][i] + 71.0 / 1920 * k[3][i] +
                                        -17253.0 / 339200 * k[4][i] + 22.0 / 525 * k[5][i] + -1.0 / 40 * k[6][i])));
    return error;
}

static double time_of_plain_dormand_prince(struct stretch *end)
{
    const double duration = SUBSTEPS * STEP_SIZE;
    double y[6] = {0.0}, new[6], k[7][6], time = 0.0, proposed = STEP_SIZE;
    int64_t taken = 0;
    const double begun = now();
    rates_of(y, k[0]);
    while (time < duration) {
        const double left = duration - time, h = proposed < left ? proposed : left;
        const bool last = h >= left;
        const double error = plain_step(y, h, k, new);
        const double factor = 0.9 * sqrt(sqrt(TOLERANCE / error));
        if (!(error <= TOLERANCE)) {
            proposed = h * larger(0.2, factor);
            continue;
        }
        time = last ? duration : time + h;
        memcpy(y, new, sizeof y);
        memcpy(k[0], k[6], sizeof k[0]);
        taken++;
        proposed = h * (factor < 5.0 ? factor : 5.0);
    }
    *end = (struct stretch){.state = {y[0], y[1], y[2], y[3], y[4], y[5]}, .substeps = taken};
    return (now() - begun) / (double)taken * 1e9;
}

static bool is_close(double a, double b)
{
    return fabs(a - b) <= 1e-11 * larger(1.0, fabs(b));
}

static void demand_close(const struct stretch *plain, const struct stretch *kernel)
{
    const struct state *a = &plain->state, *b = &kernel->state;
    demand(plain->substeps == kernel->substeps && is_close(a->x, b->x) && is_close(a->y, b->y) &&
               is_close(a->heading, b->heading) && is_close(a->vx, b->vx) && is_close(a->vy, b->vy) &&
               is_close(a->yaw_rate, b->yaw_rate),
           "a plain loop that ends where the kernel does");
}

static int compared(const void *a, const void *b)
{
    const double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

static double median(double *samples)
{
    qsort(samples, SAMPLES, sizeof *samples, compared);
    return samples[SAMPLES / 2];
}

static void measure(struct host *host, bool with_substeps)
{
    static struct outcome_of_case cases[MOST_CASES];
    static const double sizes[] = {0.01, 0.1, 1.0};
    static const int steps[] = {100, 20, 4};
    struct stretch with_libm[ADAPTIVE + 1], plain;
    int n = 0;
    for (int k = 0; k < SAMPLES; k++) {
        n = 0;
        for (int i = 0; i < 3; i++, n++) {
            snprintf(cases[n].name, sizeof cases[n].name, "calls_%g", sizes[i]);
            cases[n].samples[k] = time_of_calls(host, sizes[i], steps[i]);
        }
        for (int method = 1; with_substeps && method <= ADAPTIVE; method++, n += 2) {
            snprintf(cases[n].name, sizeof cases[n].name, "substep_%s", METHODS[method - 1].name);
            cases[n].samples[k] = time_of_substeps(host, method);
            snprintf(cases[n + 1].name, sizeof cases[n].name, "libm_%s", METHODS[method - 1].name);
            cases[n + 1].samples[k] = time_of_kernel_with_libm(method, &with_libm[method]);
        }
        if (with_substeps) {
            strcpy(cases[n].name, "evaluation");
            cases[n++].samples[k] = time_of_evaluations(host);
            strcpy(cases[n].name, "plain_semi_implicit_euler");
            cases[n++].samples[k] = time_of_plain_euler(&plain);
            demand_close(&plain, &with_libm[SEMI_IMPLICIT_EULER]);
            strcpy(cases[n].name, "plain_adaptive");
            cases[n++].samples[k] = time_of_plain_dormand_prince(&plain);
            demand_close(&plain, &with_libm[ADAPTIVE]);
        }
    }
    for (int i = 0; i < n; i++)
        printf("%s %.9g\n", cases[i].name, median(cases[i].samples));
}

/* us to instantiate and free, bytes an instance. */
static void measure_instances(const struct host *host)
{
    static fmi2Component alive[ALIVE];
    double samples[SAMPLES];
    for (int k = 0; k < SAMPLES; k++) {
        const double begun = now();
        host->f.release(made(host, fmi2CoSimulation));
        samples[k] = (now() - begun) * 1e6;
    }
    const long before = resident();
    for (int i = 0; i < ALIVE; i++)
        alive[i] = made(host, fmi2CoSimulation);
    printf("memory %.9g\n", (double)(resident() - before) / ALIVE);
    for (int i = 0; i < ALIVE; i++)
        host->f.release(alive[i]);
    printf("instantiate %.9g\n", median(samples));
}

int main(int argc, char **argv)
{
    struct host host = {.guid = argc > 2 ? argv[2] : "", .resources = argc > 3 ? argv[3] : ""};
    if (argc < 4)
        return 1;
    const double begun = now();
    load(&host, argv[1], argc > 4);
    host.craft = made(&host, fmi2CoSimulation);
    printf("load %.9g\n", (now() - begun) * 1e6);
    measure(&host, argc > 4);
    host.f.release(host.craft);
    measure_instances(&host);
    return 0;
}
