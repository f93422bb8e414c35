/* 8 threads with INSTANCES each, all alive at once in a thread, each with its own inputs: every one must end with
   the values that the same inputs give in a lone instance. Where the model has states, one in five is in model exchange,
   with a step of Euler's. */

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "calls.h"
#include "variables.h"

enum { THREADS = 8, KINDS = 50, STEPS = 3, MOST_STATES = 8 };

static double expected[KINDS][VARIABLE_COUNT];

static void demand(int good, const char *what)
{
    if (!good) {
        fprintf(stderr, "%s\n", what);
        exit(1);
    }
}

static int exchanges(int kind)
{
    return STATE_COUNT > 0 && kind % 5 == 4;
}

static void *made(int kind)
{
    double inputs[INPUT_COUNT];
    void *instance = call_instantiate(exchanges(kind) ? CALL_EXCHANGE : CALL_STEPS, VARIANT.guid, "");
    for (int i = 0; i < INPUT_COUNT; i++)
        inputs[i] = kind % (INPUT_COUNT + 1 - i) / 12.0; /* within all limits */
    demand(instance != NULL, "instantiate");
#ifdef INTEGRATOR_COUNT
    demand(call_choose(instance, V_INTEGRATOR, kind % 4 + 1) == CALL_OK, "choose");
#endif
    demand(call_start(instance) == CALL_OK, "initialization");
    demand(call_set(instance, INPUTS, INPUT_COUNT, inputs) == CALL_OK, "set");
    demand(!exchanges(kind) || call_go_continuous(instance) == CALL_OK, "continuous-time mode");
    return instance;
}

/* Every Real. */
static void finish(void *instance, double results[VARIABLE_COUNT])
{
    unsigned references[VARIABLE_COUNT];
    size_t n = 0;
    for (unsigned i = 0; i < VARIABLE_COUNT; i++)
        if (VARIABLES[i].kind == REAL)
            references[n++] = i;
    demand(call_get(instance, references, n, results) == CALL_OK, "get");
    call_free(instance);
}

static void exchange(void *instance, int k)
{
    double states[MOST_STATES], rates[MOST_STATES];
    demand(call_set_time(instance, k * 0.05) == CALL_OK && call_get_states(instance, states, STATE_COUNT) == CALL_OK &&
               call_get_rates(instance, rates, STATE_COUNT) == CALL_OK,
           "derivatives");
    for (int i = 0; i < STATE_COUNT; i++)
        states[i] += 0.05 * rates[i];
    demand(call_set_states(instance, states, STATE_COUNT) == CALL_OK, "states");
}

static void step(void *instance, int kind, int k)
{
    if (exchanges(kind))
        exchange(instance, k);
    else
        demand(call_step(instance, k * 0.05, 0.05) == CALL_OK, "step");
}

static void *drive(void *unused)
{
    static const size_t size = sizeof expected[0];
    void **instance = calloc(INSTANCES, sizeof *instance);
    double results[VARIABLE_COUNT] = {0.0};
    (void)unused;
    for (int i = 0; i < INSTANCES; i++)
        instance[i] = made(i % KINDS);
    for (int k = 0; k < STEPS; k++)
        for (int i = 0; i < INSTANCES; i++)
            step(instance[i], i % KINDS, k);
    for (int i = 0; i < INSTANCES; i++) {
        finish(instance[i], results);
        demand(memcmp(results, expected[i % KINDS], size) == 0, "an instance ended elsewhere");
    }
    free(instance);
    return NULL;
}

int main(void)
{
    pthread_t threads[THREADS];
    for (int kind = 0; kind < KINDS; kind++) {
        void *instance = made(kind);
        for (int k = 0; k < STEPS; k++)
            step(instance, kind, k);
        finish(instance, expected[kind]);
    }
    for (int i = 0; i < THREADS; i++)
        demand(pthread_create(&threads[i], NULL, drive, NULL) == 0, "pthread_create");
    for (int i = 0; i < THREADS; i++)
        demand(pthread_join(threads[i], NULL) == 0, "pthread_join");
    printf("%d\n", THREADS * INSTANCES);
    return 0;
}
