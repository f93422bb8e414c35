/* 8 threads with 1000 instances each, all alive at once in a thread, each with its own controls: every one must end
   where the same controls end in a lone instance. One in five is in model exchange, with a step of Euler's. */

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "calls.h"
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

static void *made(int kind)
{
    static const unsigned inputs[] = {V_THRUST, V_PORT_THRUSTER, V_STARBOARD_THRUSTER};
    const double controls[] = {kind % 11, kind % 7 / 7.0, kind % 5 / 5.0};
    void *craft = call_instantiate(exchanges(kind) ? CALL_EXCHANGE : CALL_STEPS, VARIANT.guid, "");
    demand(craft != NULL, "instantiate");
    demand(call_choose(craft, V_INTEGRATOR, kind % 4 + 1) == CALL_OK, "choose");
    demand(call_start(craft) == CALL_OK, "initialization");
    demand(call_set(craft, inputs, 3, controls) == CALL_OK, "set");
    demand(!exchanges(kind) || call_go_continuous(craft) == CALL_OK, "continuous-time mode");
    return craft;
}

static void finish(void *craft, double results[RESULTS])
{
    static const unsigned outputs[] = {V_POSE_X,     V_POSE_Y,     V_POSE_HEADING,
                                       V_VELOCITY_X, V_VELOCITY_Y, V_VELOCITY_YAW_RATE};
    demand(call_get(craft, outputs, RESULTS, results) == CALL_OK, "get");
    call_free(craft);
}

static void exchange(void *craft, int k)
{
    double states[RESULTS], rates[RESULTS];
    demand(call_set_time(craft, k * 0.05) == CALL_OK && call_get_states(craft, states, RESULTS) == CALL_OK &&
               call_get_rates(craft, rates, RESULTS) == CALL_OK,
           "derivatives");
    for (int i = 0; i < RESULTS; i++)
        states[i] += 0.05 * rates[i];
    demand(call_set_states(craft, states, RESULTS) == CALL_OK, "states");
}

static void step(void *craft, int kind, int k)
{
    if (exchanges(kind))
        exchange(craft, k);
    else
        demand(call_step(craft, k * 0.05, 0.05) == CALL_OK, "step");
}

static void *drive(void *unused)
{
    static const size_t size = sizeof expected[0];
    void **craft = calloc(INSTANCES, sizeof *craft);
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
        void *craft = made(kind);
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
