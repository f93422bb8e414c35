/* 8 threads with 1000 instances each, all alive at once in a thread, each with its own controls: every one must end
   where the same controls end in a lone instance. One in five is in model exchange, with a step of Euler's. */

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "variables.h"

enum { THREADS = 8, INSTANCES = 1000, KINDS = 50, STEPS = 3, RESULTS = 6 };

static double expected[KINDS][RESULTS];

static void demand(int good, const char *what)
{
    if (!good) {
        fprintf(stderr, "%s\n", what);
        exit(1);
    }
}

static int exchanges(int kind)
{
    return kind % 5 == 4;
}

static fmi2Component made(int kind)
{
    static const unsigned inputs[] = {V_THRUST, V_PORT_THRUSTER, V_STARBOARD_THRUSTER}, method = V_INTEGRATOR;
    const double controls[] = {kind % 11, kind % 7 / 7.0, kind % 5 / 5.0};
    const int number = kind % 4 + 1;
    const fmi2Type type = exchanges(kind) ? fmi2ModelExchange : fmi2CoSimulation;
    fmi2Component craft = fmi2Instantiate("craft", type, GUID, "", NULL, fmi2False, fmi2False);
    demand(craft != NULL, "fmi2Instantiate");
    demand(fmi2SetInteger(craft, &method, 1, &number) == fmi2OK, "fmi2SetInteger");
    demand(fmi2SetupExperiment(craft, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK, "fmi2SetupExperiment");
    demand(fmi2EnterInitializationMode(craft) == fmi2OK, "fmi2EnterInitializationMode");
    demand(fmi2ExitInitializationMode(craft) == fmi2OK, "fmi2ExitInitializationMode");
    demand(fmi2SetReal(craft, inputs, 3, controls) == fmi2OK, "fmi2SetReal");
    demand(!exchanges(kind) || fmi2EnterContinuousTimeMode(craft) == fmi2OK, "fmi2EnterContinuousTimeMode");
    return craft;
}

static void finish(fmi2Component craft, double results[RESULTS])
{
    static const unsigned outputs[] = {V_POSE_X,     V_POSE_Y,     V_POSE_HEADING,
                                       V_VELOCITY_X, V_VELOCITY_Y, V_VELOCITY_YAW_RATE};
    demand(fmi2GetReal(craft, outputs, RESULTS, results) == fmi2OK, "fmi2GetReal");
    fmi2FreeInstance(craft);
}

static void exchange(fmi2Component craft, int k)
{
    double states[RESULTS], rates[RESULTS];
    demand(fmi2SetTime(craft, k * 0.05) == fmi2OK && fmi2GetContinuousStates(craft, states, RESULTS) == fmi2OK &&
               fmi2GetDerivatives(craft, rates, RESULTS) == fmi2OK,
           "fmi2GetDerivatives");
    for (int i = 0; i < RESULTS; i++)
        states[i] += 0.05 * rates[i];
    demand(fmi2SetContinuousStates(craft, states, RESULTS) == fmi2OK, "fmi2SetContinuousStates");
}

static void step(fmi2Component craft, int kind, int k)
{
    if (exchanges(kind))
        exchange(craft, k);
    else
        demand(fmi2DoStep(craft, k * 0.05, 0.05, fmi2True) == fmi2OK, "fmi2DoStep");
}

static void *drive(void *unused)
{
    static const size_t size = sizeof expected[0];
    fmi2Component *craft = calloc(INSTANCES, sizeof *craft);
    double results[RESULTS];
    (void)unused;
    for (int i = 0; i < INSTANCES; i++)
        craft[i] = made(i % KINDS);
    for (int k = 0; k < STEPS; k++)
        for (int i = 0; i < INSTANCES; i++)
            step(craft[i], i % KINDS, k);
    for (int i = 0; i < INSTANCES; i++) {
        finish(craft[i], results);
        demand(memcmp(results, expected[i % KINDS], size) == 0, "an instance ended elsewhere");
    }
    free(craft);
    return NULL;
}

int main(void)
{
    pthread_t threads[THREADS];
    for (int kind = 0; kind < KINDS; kind++) {
        fmi2Component craft = made(kind);
        for (int k = 0; k < STEPS; k++)
            step(craft, kind, k);
        finish(craft, expected[kind]);
    }
    for (int i = 0; i < THREADS; i++)
        demand(pthread_create(&threads[i], NULL, drive, NULL) == 0, "pthread_create");
    for (int i = 0; i < THREADS; i++)
        demand(pthread_join(threads[i], NULL) == 0, "pthread_join");
    printf("%d\n", THREADS * INSTANCES);
    return 0;
}
