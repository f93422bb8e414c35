/* The host's floating-point environment: whatever it is, every call gives the same bits, and leaves it as it was, flags
   included. Prints how many environments were tried, and how many calls were made in each. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "calls.h"
#include "checksum.h"
#include "variables.h"

#if defined(__SSE2__)

#include <xmmintrin.h>

enum { DEFAULT = 0x1f80 };
/* Traps on for what is invalid, a division by zero, an overflow; rounded down, up, to zero; what is tiny flushed, in
   what comes out and in what goes in; a flag of the host's that is to stay. */
static const unsigned HOSTS[] = {DEFAULT,  0x1f80 & ~0x680, 0x3f80, 0x5f80, 0x7f80, 0x9f80, 0x1fc0, 0x9fc0,
                                 0xffc0 & ~0x680, 0x1f80 | 0x21};

static unsigned environment(void)
{
    return _mm_getcsr();
}

static void set_environment(unsigned value)
{
    _mm_setcsr(value);
}

#else

enum { DEFAULT = 0 };
static const unsigned HOSTS[] = {DEFAULT, 1u << 22, 2u << 22, 3u << 22, 1u << 24};

static unsigned environment(void)
{
    unsigned long long value;
    __asm__ volatile("mrs %0, fpcr" : "=r"(value) : : "memory");
    return (unsigned)value;
}

static void set_environment(unsigned value)
{
    __asm__ volatile("msr fpcr, %0" : : "r"((unsigned long long)value) : "memory");
}

#endif

enum { STEPS = 12, TERMS = 5, METHOD_COUNT = sizeof METHODS / sizeof *METHODS };

static unsigned host;
static unsigned calls;
static uint64_t hash;

static void demand(int good, const char *what)
{
    if (!good) {
        set_environment(DEFAULT);
        fprintf(stderr, "environment %#x: %s\n", host, what);
        exit(1);
    }
}

static void add(const void *bytes, size_t n)
{
    hash = checksum(hash, bytes, n);
}

static int left(int status, const char *call)
{
    const unsigned found = environment();
    set_environment(DEFAULT);
    demand(found == host, call);
    add(&status, sizeof status);
    calls++;
    return status;
}

/* A call in the host's environment; the program's own arithmetic is done in the usual one. */
#define IN_HOST(call) (set_environment(host), left((call), #call))

static void told(int status, const char *message)
{
    demand(environment() == host, "a message is told in the host's environment");
    add(&status, sizeof status);
    add(message, strlen(message));
}

static int derive(void *craft, const unsigned *unknowns, size_t n, const unsigned *known, double *values)
{
    static const double seed = 1.0;
#if FMI == 3
    return fmi3GetDirectionalDerivative(craft, unknowns, n, known, 1, &seed, 1, values, n);
#else
    return fmi2GetDirectionalDerivative(craft, unknowns, n, known, 1, &seed, values);
#endif
}

static void read(void *craft)
{
    unsigned references[VARIABLE_COUNT];
    double values[VARIABLE_COUNT] = {0.0};
    size_t n = 0;
    for (unsigned i = 0; i < VARIABLE_COUNT; i++)
        if (VARIABLES[i].kind == REAL)
            references[n++] = i;
    IN_HOST(call_get(craft, references, n, values));
    add(values, sizeof values);
    for (unsigned k = 0; k < STATE_COUNT + INPUT_COUNT; k++) {
        double slopes[STATE_COUNT] = {0.0};
        IN_HOST(derive(craft, DERIVATIVES, STATE_COUNT, &KNOWNS[k], slopes));
        add(slopes, sizeof slopes);
    }
}

#if FMI == 3

static void *asking;

/* Sets the thrust, in the host's environment, into which it was called. */
static void answer(fmi3InstanceEnvironment craft, double time, bool set, bool get, bool finished, bool early,
                   bool *return_early, double *when)
{
    static const unsigned thrust = V_THRUST;
    (void)craft, (void)set, (void)get, (void)finished, (void)early, (void)return_early, (void)when;
    demand(environment() == host, "inputs are asked for in the host's environment");
    set_environment(DEFAULT);
    const double value = 5.0 + time;
    IN_HOST(call_set(asking, &thrust, 1, &value));
    add(&time, sizeof time);
    set_environment(host);
}

static void *instantiate(enum call_use use)
{
    if (use == CALL_STEPS)
        return asking = fmi3InstantiateCoSimulation("craft", VARIANT.guid, "", false, true, false, false, NULL, 0, NULL,
                                                    call_log, answer);
    return call_instantiate(use, VARIANT.guid, "");
}

#else

static void *instantiate(enum call_use use)
{
    return call_instantiate(use, VARIANT.guid, "");
}

#endif

/* What is refused, each with its message. */
static void refuse(void *craft)
{
    static const unsigned thrust = V_THRUST, mass = V_MASS;
    double zero = 0.0;
    const double none = zero / zero, infinite = 1.0 / zero, negative = -1.0;
    IN_HOST(call_set(craft, &thrust, 1, &none));
    IN_HOST(call_set(craft, &thrust, 1, &infinite));
    IN_HOST(call_set(craft, &mass, 1, &negative));
    IN_HOST(call_step(craft, 0.0, none));
    IN_HOST(call_step(craft, infinite, 1.0));
}

static void save_and_restore(void *craft)
{
    static unsigned char bytes[4000];
    void *state = NULL, *again = NULL;
    size_t size = 0;
    IN_HOST(call_save(craft, &state));
    IN_HOST(call_size(craft, state, &size));
    demand(size <= sizeof bytes, "size");
    IN_HOST(call_serialize(craft, state, bytes, size));
    add(bytes + 44, size - 44);
    IN_HOST(call_deserialize(craft, bytes, size, &again));
    IN_HOST(call_restore(craft, again));
    IN_HOST(call_forget(craft, &state));
    IN_HOST(call_forget(craft, &again));
}

static void set_terms(void *craft, int term)
{
    static const unsigned references[TERMS][2] = {{V_THRUST, V_PORT_THRUSTER},
                                                  {V_WIND_X, V_WIND_Y},
                                                  {V_SKIRT_FRICTION, V_PORT_THRUSTER},
                                                  {V_ROTATIONAL_DRAG, V_VELOCITY_YAW_RATE},
                                                  {V_THRUST, V_VELOCITY_X}};
    /* the last: at rest without thrust, but for a speed that is below what is normal */
    static const double values[TERMS][2] = {{8.0, 1.0}, {1.5, -0.5}, {0.001, 1.0}, {0.5, 0.3}, {0.0, 1e-310}};
    IN_HOST(call_set(craft, references[term], 2, values[term]));
    if (term == 1)
        IN_HOST(call_choose(craft, V_DRAG_AREA, 2));
}

static void step(void *craft)
{
    double point = 0.0;
    for (int i = 0; i < STEPS; i++) {
        const double length = 0.01 * (i + 1), next = point + length;
        IN_HOST(call_step(craft, point, length));
        point = next;
    }
}

/* Steps of Euler's. */
static void solve(void *craft)
{
    double time = 0.0, states[STATE_COUNT] = {0.0}, rates[STATE_COUNT] = {0.0};
    IN_HOST(call_go_continuous(craft));
    IN_HOST(call_get_states(craft, states, STATE_COUNT));
    for (int i = 0; i < STEPS; i++) {
        IN_HOST(call_get_rates(craft, rates, STATE_COUNT));
        add(rates, sizeof rates);
        time += 0.05;
        for (int k = 0; k < STATE_COUNT; k++)
            states[k] += 0.05 * rates[k];
        IN_HOST(call_set_time(craft, time));
        IN_HOST(call_set_states(craft, states, STATE_COUNT));
    }
}

/* A motion that leaves the range of numbers. */
static void run_away(int method, enum call_use use)
{
    static const unsigned references[] = {V_VELOCITY_X, V_VELOCITY_YAW_RATE};
    static const double values[] = {1e200, 1e200};
    void *craft = call_instantiate(use, VARIANT.guid, "");
    demand(craft != NULL, "instantiate");
    IN_HOST(call_choose(craft, V_INTEGRATOR, method));
    IN_HOST(call_set(craft, references, 2, values));
    IN_HOST(call_start(craft));
    if (use == CALL_STEPS)
        step(craft);
    else
        solve(craft);
    read(craft);
    call_free(craft);
}

static void run(int method, enum call_use use, int term)
{
    void *craft = instantiate(use);
    demand(craft != NULL, "instantiate");
    IN_HOST(call_choose(craft, V_INTEGRATOR, method));
    set_terms(craft, term);
    IN_HOST(call_start(craft));
    read(craft);
    if (use == CALL_STEPS)
        step(craft);
    else
        solve(craft);
    refuse(craft);
    save_and_restore(craft);
    read(craft);
    IN_HOST(call_reset(craft));
    call_free(craft);
}

int main(void)
{
    uint64_t expected = 0;
    const unsigned n = sizeof HOSTS / sizeof *HOSTS;
    call_tell = told;
    for (unsigned i = 0; i < n; i++) {
        host = HOSTS[i];
        hash = CHECKSUM_OF_NOTHING;
        calls = 0;
        for (int use = CALL_STEPS; use <= CALL_EXCHANGE; use++)
            for (int method = 1; method <= METHOD_COUNT; method++) {
                for (int term = 0; term < TERMS; term++)
                    run(method, use, term);
                run_away(method, use);
            }
        if (i == 0)
            expected = hash;
        demand(hash == expected, "other bits");
    }
    printf("%u %u\n", n, calls);
    return 0;
}
