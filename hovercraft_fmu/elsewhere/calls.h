/* What a host in C calls, by one set of names for both standards: FMI 2.0 or, with -DFMI=3, FMI 3.0. What they return
   is a status, the same numbers in both. FUNCTION(name) may be defined as the place of a function in a library that was
   loaded; else it is the linker's. */

#ifndef HOVERCRAFT_CALLS_H
#define HOVERCRAFT_CALLS_H

#include <stddef.h>
#include <stdint.h>

#ifndef FUNCTION
#define FUNCTION(name) name
#endif

enum call_use { CALL_STEPS, CALL_EXCHANGE };
enum { CALL_OK, CALL_WARNED, CALL_DISCARDED, CALL_REFUSED };

/* Where messages go; NULL: nowhere. */
static void (*call_tell)(int status, const char *message);

#if FMI == 3

#include "fmi3Functions.h"

static inline void call_log(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                            fmi3String message)
{
    (void)environment, (void)category;
    if (call_tell)
        call_tell(status, message);
}

static inline void *call_instantiate(enum call_use use, const char *token, const char *resources)
{
    if (use == CALL_EXCHANGE)
        return FUNCTION(fmi3InstantiateModelExchange)("craft", token, resources, fmi3False, fmi3True, NULL, call_log);
    return FUNCTION(fmi3InstantiateCoSimulation)("craft", token, resources, fmi3False, fmi3True, fmi3False, fmi3False,
                                                 NULL, 0, NULL, call_log, NULL);
}

static inline int call_start(void *craft)
{
    const fmi3Status status =
        FUNCTION(fmi3EnterInitializationMode)(craft, fmi3False, 0.0, 0.0, fmi3False, 0.0);
    return status > fmi3Warning ? status : FUNCTION(fmi3ExitInitializationMode)(craft);
}

static inline int call_set(void *craft, const unsigned *references, size_t n, const double *values)
{
    return FUNCTION(fmi3SetFloat64)(craft, references, n, values, n);
}

static inline int call_get(void *craft, const unsigned *references, size_t n, double *values)
{
    return FUNCTION(fmi3GetFloat64)(craft, references, n, values, n);
}

/* An item of an enumeration. */
static inline int call_choose(void *craft, unsigned reference, int item)
{
    const int64_t value = item;
    return FUNCTION(fmi3SetInt64)(craft, &reference, 1, &value, 1);
}

static inline int call_step(void *craft, double point, double step)
{
    bool event, terminate, early;
    double last;
    return FUNCTION(fmi3DoStep)(craft, point, step, fmi3True, &event, &terminate, &early, &last);
}

static inline int call_go_continuous(void *craft)
{
    return FUNCTION(fmi3EnterContinuousTimeMode)(craft);
}

static inline int call_set_time(void *craft, double time)
{
    return FUNCTION(fmi3SetTime)(craft, time);
}

static inline int call_get_states(void *craft, double *states, size_t n)
{
    return FUNCTION(fmi3GetContinuousStates)(craft, states, n);
}

static inline int call_set_states(void *craft, const double *states, size_t n)
{
    return FUNCTION(fmi3SetContinuousStates)(craft, states, n);
}

static inline int call_get_rates(void *craft, double *rates, size_t n)
{
    return FUNCTION(fmi3GetContinuousStateDerivatives)(craft, rates, n);
}

static inline int call_go_to_events(void *craft)
{
    return FUNCTION(fmi3EnterEventMode)(craft);
}

static inline int call_get_nominals(void *craft, double *nominals, size_t n)
{
    return FUNCTION(fmi3GetNominalsOfContinuousStates)(craft, nominals, n);
}

static inline int call_get_indicators(void *craft, double *indicators, size_t n)
{
    return FUNCTION(fmi3GetEventIndicators)(craft, indicators, n);
}

static inline int call_reset(void *craft)
{
    return FUNCTION(fmi3Reset)(craft);
}

/* Out of the initialization mode. */
static inline int call_go(void *craft)
{
    return FUNCTION(fmi3ExitInitializationMode)(craft);
}

static inline int call_terminate(void *craft)
{
    return FUNCTION(fmi3Terminate)(craft);
}

static inline void call_free(void *craft)
{
    FUNCTION(fmi3FreeInstance)(craft);
}

static inline int call_save(void *craft, void **state)
{
    return FUNCTION(fmi3GetFMUState)(craft, state);
}

static inline int call_restore(void *craft, void *state)
{
    return FUNCTION(fmi3SetFMUState)(craft, state);
}

static inline int call_forget(void *craft, void **state)
{
    return FUNCTION(fmi3FreeFMUState)(craft, state);
}

static inline int call_size(void *craft, void *state, size_t *size)
{
    return FUNCTION(fmi3SerializedFMUStateSize)(craft, state, size);
}

static inline int call_serialize(void *craft, void *state, void *bytes, size_t size)
{
    return FUNCTION(fmi3SerializeFMUState)(craft, state, bytes, size);
}

static inline int call_deserialize(void *craft, const void *bytes, size_t size, void **state)
{
    return FUNCTION(fmi3DeserializeFMUState)(craft, bytes, size, state);
}

#else

#include "fmi2Functions.h"

static inline void call_log(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                            fmi2String category, fmi2String message, ...)
{
    (void)environment, (void)instance, (void)category;
    if (call_tell)
        call_tell(status, message);
}

static inline void *call_instantiate(enum call_use use, const char *token, const char *resources)
{
    static const fmi2CallbackFunctions callbacks = {call_log, NULL, NULL, NULL, NULL};
    return FUNCTION(fmi2Instantiate)("craft", use == CALL_EXCHANGE ? fmi2ModelExchange : fmi2CoSimulation, token,
                                     resources, &callbacks, fmi2False, fmi2True);
}

static inline int call_start(void *craft)
{
    fmi2Status status = FUNCTION(fmi2SetupExperiment)(craft, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    status = status > fmi2Warning ? status : FUNCTION(fmi2EnterInitializationMode)(craft);
    return status > fmi2Warning ? status : FUNCTION(fmi2ExitInitializationMode)(craft);
}

static inline int call_set(void *craft, const unsigned *references, size_t n, const double *values)
{
    return FUNCTION(fmi2SetReal)(craft, references, n, values);
}

static inline int call_get(void *craft, const unsigned *references, size_t n, double *values)
{
    return FUNCTION(fmi2GetReal)(craft, references, n, values);
}

/* An item of an enumeration. */
static inline int call_choose(void *craft, unsigned reference, int item)
{
    return FUNCTION(fmi2SetInteger)(craft, &reference, 1, &item);
}

static inline int call_step(void *craft, double point, double step)
{
    return FUNCTION(fmi2DoStep)(craft, point, step, fmi2True);
}

static inline int call_go_continuous(void *craft)
{
    return FUNCTION(fmi2EnterContinuousTimeMode)(craft);
}

static inline int call_set_time(void *craft, double time)
{
    return FUNCTION(fmi2SetTime)(craft, time);
}

static inline int call_get_states(void *craft, double *states, size_t n)
{
    return FUNCTION(fmi2GetContinuousStates)(craft, states, n);
}

static inline int call_set_states(void *craft, const double *states, size_t n)
{
    return FUNCTION(fmi2SetContinuousStates)(craft, states, n);
}

static inline int call_get_rates(void *craft, double *rates, size_t n)
{
    return FUNCTION(fmi2GetDerivatives)(craft, rates, n);
}

static inline int call_go_to_events(void *craft)
{
    return FUNCTION(fmi2EnterEventMode)(craft);
}

static inline int call_get_nominals(void *craft, double *nominals, size_t n)
{
    return FUNCTION(fmi2GetNominalsOfContinuousStates)(craft, nominals, n);
}

static inline int call_get_indicators(void *craft, double *indicators, size_t n)
{
    return FUNCTION(fmi2GetEventIndicators)(craft, indicators, n);
}

static inline int call_reset(void *craft)
{
    return FUNCTION(fmi2Reset)(craft);
}

/* Out of the initialization mode. */
static inline int call_go(void *craft)
{
    return FUNCTION(fmi2ExitInitializationMode)(craft);
}

static inline int call_terminate(void *craft)
{
    return FUNCTION(fmi2Terminate)(craft);
}

static inline void call_free(void *craft)
{
    FUNCTION(fmi2FreeInstance)(craft);
}

static inline int call_save(void *craft, void **state)
{
    return FUNCTION(fmi2GetFMUstate)(craft, state);
}

static inline int call_restore(void *craft, void *state)
{
    return FUNCTION(fmi2SetFMUstate)(craft, state);
}

static inline int call_forget(void *craft, void **state)
{
    return FUNCTION(fmi2FreeFMUstate)(craft, state);
}

static inline int call_size(void *craft, void *state, size_t *size)
{
    return FUNCTION(fmi2SerializedFMUstateSize)(craft, state, size);
}

static inline int call_serialize(void *craft, void *state, void *bytes, size_t size)
{
    return FUNCTION(fmi2SerializeFMUstate)(craft, state, bytes, size);
}

static inline int call_deserialize(void *craft, const void *bytes, size_t size, void **state)
{
    return FUNCTION(fmi2DeSerializeFMUstate)(craft, bytes, size, state);
}

#endif

#endif
