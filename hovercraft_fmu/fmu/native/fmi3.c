/* The FMI 3.0 interface: it translates, and checks pointers and types; all else is the instance's. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "fmi3Functions.h"
#include "instance.h"
#include "memory.h"

struct component {
    struct instance instance;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
};

static fmi3Status status_of(enum verdict verdict)
{
    return verdict == FINE ? fmi3OK : verdict == WARNED ? fmi3Warning : fmi3Error;
}

static void tell(void *sink, enum verdict verdict, const char *category, const char *message)
{
    const struct component *c = sink;
    if (c->log)
        c->log(c->environment, status_of(verdict), category, message);
}

static fmi3Status refuse(struct component *c, const char *call, const char *why)
{
    return c ? status_of(instance_say(&c->instance, REFUSED, "%s: %s", call, why)) : fmi3Error;
}

static fmi3Status refuse_null(struct component *c, const char *call)
{
    return refuse(c, call, "no argument must be NULL");
}

/* ---- general */

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    struct component *c = instance;
    return c ? status_of(instance_log(&c->instance, "fmi3SetDebugLogging", on, n, categories)) : fmi3Error;
}

/* NULL where there is no memory, or where the token is not this FMU's. */
static struct component *made(enum use use, fmi3String token, bool logging, fmi3InstanceEnvironment environment,
                              fmi3LogMessageCallback log)
{
    struct component *c = memory_allocate(1, sizeof *c);
    if (!c)
        return NULL;
    c->environment = environment;
    c->log = log;
    instance_start(&c->instance, use, tell, c, logging);
    if (token && strcmp(token, GUID) == 0)
        return c;
    instance_say(&c->instance, REFUSED, "instantiationToken = '%q': must be '%s', as in modelDescription.xml",
                 token ? token : "NULL", GUID);
    memory_release(c);
    return NULL;
}

/* What this FMU has not got is refused here, not at the first call that would need it. */
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode_used, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t n_intermediate,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update)
{
    static const char call[] = "fmi3InstantiateCoSimulation";
    struct component *c = made(CO_SIMULATION, token, logging, environment, log);
    (void)name, (void)resources, (void)visible, (void)early_return, (void)intermediate, (void)update;
    if (!c || (!event_mode_used && n_intermediate == 0))
        return c;
    if (event_mode_used)
        refuse(c, call, "eventModeUsed must be false: hasEventMode is false");
    else
        refuse(c, call, "requiredIntermediateVariables must be empty: providesIntermediateUpdate is false");
    memory_release(c);
    return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log)
{
    (void)name, (void)resources, (void)visible;
    return made(MODEL_EXCHANGE, token, logging, environment, log);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock)
{
    struct component *c = made(CO_SIMULATION, token, logging, environment, log);
    (void)name, (void)resources, (void)visible, (void)update, (void)lock, (void)unlock;
    refuse(c, "fmi3InstantiateScheduledExecution", "there is no ScheduledExecution in modelDescription.xml");
    memory_release(c);
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    memory_release(instance);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start_time, fmi3Boolean stop_time_defined, fmi3Float64 stop_time)
{
    static const char call[] = "fmi3EnterInitializationMode";
    struct component *c = instance;
    if (!c || instance_set_up(&c->instance, call, start_time, tolerance_defined, tolerance,
                              stop_time_defined ? stop_time : INFINITY) == REFUSED)
        return fmi3Error;
    return status_of(instance_initialize(&c->instance, call));
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    struct component *c = instance;
    return c ? status_of(instance_go(&c->instance, "fmi3ExitInitializationMode")) : fmi3Error;
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    struct component *c = instance;
    return c ? status_of(instance_terminate(&c->instance, "fmi3Terminate")) : fmi3Error;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    struct component *c = instance;
    if (!c)
        return fmi3Error;
    instance_reset(&c->instance);
    return fmi3OK;
}

/* ---- variables: all are scalars */

/* Whether a call with these lists can be made; said, where not. */
static bool is_list(struct component *c, const char *call, const fmi3ValueReference vr[], size_t n, const void *values,
                    size_t n_values)
{
    if (!c)
        return false;
    if (n > 0 && (!vr || !values)) {
        refuse_null(c, call);
        return false;
    }
    if (n_values == n)
        return true;
    instance_say(&c->instance, REFUSED, "%s: nValues = %u: must be %u, a value for each of the scalars", call,
                 (unsigned long long)n_values, (unsigned long long)n);
    return false;
}

/* The same, and whether all are of this kind. */
static bool is_list_of(struct component *c, const char *call, enum kind kind, const fmi3ValueReference vr[], size_t n,
                       const void *values, size_t n_values)
{
    static const char *const names[] = {[REAL] = "Float64", [INTEGER] = "Int32", [ENUMERATION] = "Enumeration"};
    if (!is_list(c, call, vr, n, values, n_values))
        return false;
    for (size_t i = 0; i < n; i++) {
        const bool fits = vr[i] == V_TIME ? kind == REAL : vr[i] < VARIABLE_COUNT && VARIABLES[vr[i]].kind == kind;
        if (!fits) {
            instance_no_such(&c->instance, names[kind], vr[i]);
            return false;
        }
    }
    return true;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[],
                          size_t n_values)
{
    struct component *c = instance;
    if (!is_list_of(c, "fmi3GetFloat64", REAL, vr, n, values, n_values))
        return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == V_TIME)
            values[i] = c->instance.now.time;
        else if (instance_get_reals(&c->instance, &vr[i], 1, &values[i]) == REFUSED)
            return fmi3Error;
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
                          size_t n_values)
{
    struct component *c = instance;
    if (!is_list_of(c, "fmi3SetFloat64", REAL, vr, n, values, n_values))
        return fmi3Error;
    for (size_t i = 0; i < n; i++)
        if (vr[i] == V_TIME)
            return refuse(c, "fmi3SetFloat64", "time must not be set as a variable");
    return status_of(instance_set_reals(&c->instance, vr, n, values));
}

fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Int32 values[],
                        size_t n_values)
{
    struct component *c = instance;
    return is_list_of(c, "fmi3GetInt32", INTEGER, vr, n, values, n_values)
               ? status_of(instance_get_integers(&c->instance, vr, n, values))
               : fmi3Error;
}

fmi3Status fmi3SetInt32(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3Int32 values[],
                        size_t n_values)
{
    struct component *c = instance;
    return is_list_of(c, "fmi3SetInt32", INTEGER, vr, n, values, n_values)
               ? status_of(instance_set_integers(&c->instance, vr, n, values))
               : fmi3Error;
}

/* Of enumerations, which have no functions of their own. */
fmi3Status fmi3GetInt64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Int64 values[],
                        size_t n_values)
{
    struct component *c = instance;
    if (!is_list_of(c, "fmi3GetInt64", ENUMERATION, vr, n, values, n_values))
        return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        int value = 0;
        if (instance_get_integers(&c->instance, &vr[i], 1, &value) == REFUSED)
            return fmi3Error;
        values[i] = value;
    }
    return fmi3OK;
}

fmi3Status fmi3SetInt64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3Int64 values[],
                        size_t n_values)
{
    struct component *c = instance;
    return is_list_of(c, "fmi3SetInt64", ENUMERATION, vr, n, values, n_values)
               ? status_of(instance_set_enumerations(&c->instance, vr, n, values))
               : fmi3Error;
}

/* There are no variables of these types: an empty list is fine. */
static fmi3Status none_of(fmi3Instance instance, const char *call, const char *kind, const fmi3ValueReference vr[],
                          size_t n, size_t n_values)
{
    struct component *c = instance;
    if (!is_list(c, call, vr, n, vr, n_values))
        return fmi3Error;
    return n == 0 ? fmi3OK : status_of(instance_no_such(&c->instance, kind, vr[0]));
}

#define NONE_OF(Type)                                                                                                  \
    fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3##Type values[],      \
                             size_t n_values)                                                                          \
    {                                                                                                                  \
        (void)values;                                                                                                  \
        return none_of(instance, "fmi3Get" #Type, #Type, vr, n, n_values);                                             \
    }                                                                                                                  \
    fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,                           \
                             const fmi3##Type values[], size_t n_values)                                               \
    {                                                                                                                  \
        (void)values;                                                                                                  \
        return none_of(instance, "fmi3Set" #Type, #Type, vr, n, n_values);                                             \
    }

NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(UInt32)
NONE_OF(UInt64)
NONE_OF(Boolean)
NONE_OF(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, size_t sizes[],
                         fmi3Binary values[], size_t n_values)
{
    (void)sizes, (void)values;
    return none_of(instance, "fmi3GetBinary", "Binary", vr, n, n_values);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const size_t sizes[],
                         const fmi3Binary values[], size_t n_values)
{
    (void)sizes, (void)values;
    return none_of(instance, "fmi3SetBinary", "Binary", vr, n, n_values);
}

/* ---- clocks: there are none */

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Clock values[])
{
    (void)values;
    return none_of(instance, "fmi3GetClock", "Clock", vr, n, n);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3Clock values[])
{
    (void)values;
    return none_of(instance, "fmi3SetClock", "Clock", vr, n, n);
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                                  fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    (void)intervals, (void)qualifiers;
    return none_of(instance, "fmi3GetIntervalDecimal", "Clock", vr, n, n);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                                   fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    (void)counters, (void)resolutions, (void)qualifiers;
    return none_of(instance, "fmi3GetIntervalFraction", "Clock", vr, n, n);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Float64 shifts[])
{
    (void)shifts;
    return none_of(instance, "fmi3GetShiftDecimal", "Clock", vr, n, n);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[])
{
    (void)counters, (void)resolutions;
    return none_of(instance, "fmi3GetShiftFraction", "Clock", vr, n, n);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                                  const fmi3Float64 intervals[])
{
    (void)intervals;
    return none_of(instance, "fmi3SetIntervalDecimal", "Clock", vr, n, n);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                                   const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)counters, (void)resolutions;
    return none_of(instance, "fmi3SetIntervalFraction", "Clock", vr, n, n);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                               const fmi3Float64 shifts[])
{
    (void)shifts;
    return none_of(instance, "fmi3SetShiftDecimal", "Clock", vr, n, n);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                                const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)counters, (void)resolutions;
    return none_of(instance, "fmi3SetShiftFraction", "Clock", vr, n, n);
}

/* ---- what the description says this FMU has not got */

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference vr, size_t *n)
{
    (void)vr, (void)n;
    return refuse(instance, "fmi3GetNumberOfVariableDependencies", "providesPerElementDependencies is false");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent, size_t elements[],
                                       fmi3ValueReference independents[], size_t elements_of_independents[],
                                       fmi3DependencyKind kinds[], size_t n)
{
    (void)dependent, (void)elements, (void)independents, (void)elements_of_independents, (void)kinds, (void)n;
    return refuse(instance, "fmi3GetVariableDependencies", "providesPerElementDependencies is false");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    return refuse(instance, "fmi3EnterConfigurationMode", "there are no structural parameters");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    return refuse(instance, "fmi3ExitConfigurationMode", "there are no structural parameters");
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    return refuse(instance, "fmi3EvaluateDiscreteStates", "providesEvaluateDiscreteStates is false");
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    return refuse(instance, "fmi3EnterStepMode", "hasEventMode is false");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time)
{
    (void)clock, (void)time;
    return refuse(instance, "fmi3ActivateModelPartition", "there is no ScheduledExecution in modelDescription.xml");
}

/* ---- FMU state */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    struct component *c = instance;
    if (!c || !state)
        return refuse_null(c, "fmi3GetFMUState");
    if (!*state) /* else it is one from before, to be used again */
        *state = memory_allocate(1, sizeof(struct content));
    if (!*state)
        return refuse(c, "fmi3GetFMUState", "no memory");
    *(struct content *)*state = c->instance.now;
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    struct component *c = instance;
    if (!c || !state)
        return refuse_null(c, "fmi3SetFMUState");
    return status_of(instance_restore(&c->instance, state));
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    if (!instance)
        return fmi3Error;
    if (state) {
        memory_release(*state);
        *state = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    if (!instance || !state || !size)
        return refuse_null(instance, "fmi3SerializedFMUStateSize");
    *size = instance_serialized_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    struct component *c = instance;
    if (!c || !state || !bytes)
        return refuse_null(c, "fmi3SerializeFMUState");
    return status_of(instance_serialize(&c->instance, "fmi3SerializeFMUState", state, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    struct component *c = instance;
    struct content content;
    if (!c || !bytes || !state)
        return refuse_null(c, "fmi3DeserializeFMUState");
    if (instance_deserialize(&c->instance, bytes, size, &content) == REFUSED)
        return fmi3Error;
    *state = memory_allocate(1, sizeof content); /* unlike fmi3GetFMUState: what it was may be anything */
    if (!*state)
        return refuse(c, "fmi3DeserializeFMUState", "no memory");
    *(struct content *)*state = content;
    return fmi3OK;
}

/* ---- co-simulation */

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t n_values)
{
    struct component *c = instance;
    static const char call[] = "fmi3GetOutputDerivatives";
    if (!is_list(c, call, vr, n, orders ? (const void *)values : NULL, n_values) ||
        instance_require_use(&c->instance, call, CO_SIMULATION) == REFUSED)
        return fmi3Error;
    return status_of(instance_get_rates(&c->instance, vr, n, orders, values));
}

/* The step is made whole or refused: it never returns early, and never ends a run. */
fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 point, fmi3Float64 step, fmi3Boolean no_set_state_before,
                      fmi3Boolean *event_handling_needed, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_successful_time)
{
    struct component *c = instance;
    (void)no_set_state_before;
    if (!c || !event_handling_needed || !terminate || !early_return || !last_successful_time)
        return refuse_null(c, "fmi3DoStep");
    const enum verdict verdict = instance_step(&c->instance, "fmi3DoStep", point, step);
    *event_handling_needed = *terminate = *early_return = false;
    *last_successful_time = c->instance.now.time;
    return status_of(verdict);
}

/* ---- model exchange */

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    struct component *c = instance;
    return c ? status_of(instance_enter_event_mode(&c->instance, "fmi3EnterEventMode")) : fmi3Error;
}

/* It has no discrete states: one call is enough. */
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *need_update, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
                                    fmi3Boolean *next_event_defined, fmi3Float64 *next_event)
{
    struct component *c = instance;
    if (!c || !need_update || !terminate || !nominals_changed || !values_changed || !next_event_defined || !next_event)
        return refuse_null(c, "fmi3UpdateDiscreteStates");
    const enum verdict verdict = instance_new_discrete_states(&c->instance, "fmi3UpdateDiscreteStates");
    if (verdict != REFUSED) {
        *need_update = *terminate = *nominals_changed = *values_changed = *next_event_defined = false;
        *next_event = 0.0;
    }
    return status_of(verdict);
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    struct component *c = instance;
    return c ? status_of(instance_enter_continuous_time(&c->instance, "fmi3EnterContinuousTimeMode")) : fmi3Error;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean no_set_state_before,
                                       fmi3Boolean *enter_event_mode, fmi3Boolean *terminate)
{
    struct component *c = instance;
    (void)no_set_state_before;
    if (!c || !enter_event_mode || !terminate)
        return refuse_null(c, "fmi3CompletedIntegratorStep");
    bool event_needed = false;
    if (instance_completed_integrator_step(&c->instance, "fmi3CompletedIntegratorStep", &event_needed) == REFUSED)
        return fmi3Error;
    *enter_event_mode = event_needed;
    *terminate = false;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    struct component *c = instance;
    return c ? status_of(instance_set_time(&c->instance, "fmi3SetTime", time)) : fmi3Error;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 states[], size_t n)
{
    struct component *c = instance;
    return c ? status_of(instance_set_states(&c->instance, "fmi3SetContinuousStates", states, n)) : fmi3Error;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 states[], size_t n)
{
    struct component *c = instance;
    return c ? status_of(instance_get_states(&c->instance, "fmi3GetContinuousStates", states, n)) : fmi3Error;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[], size_t n)
{
    struct component *c = instance;
    return c ? status_of(instance_get_derivatives(&c->instance, "fmi3GetContinuousStateDerivatives", derivatives, n))
             : fmi3Error;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t n)
{
    struct component *c = instance;
    return c ? status_of(instance_get_nominals(&c->instance, "fmi3GetNominalsOfContinuousStates", nominals, n))
             : fmi3Error;
}

static fmi3Status tell_number(struct component *c, const char *call, size_t *n, size_t number)
{
    if (!c || !n)
        return refuse_null(c, call);
    if (instance_require_use(&c->instance, call, MODEL_EXCHANGE) == REFUSED)
        return fmi3Error;
    *n = number;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n)
{
    return tell_number(instance, "fmi3GetNumberOfContinuousStates", n, STATE_COUNT);
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n)
{
    return tell_number(instance, "fmi3GetNumberOfEventIndicators", n, 0);
}

/* There are none. */
fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 indicators[], size_t n)
{
    static const char call[] = "fmi3GetEventIndicators";
    struct component *c = instance;
    (void)indicators;
    if (!c || instance_require_use(&c->instance, call, MODEL_EXCHANGE) == REFUSED)
        return fmi3Error;
    return n == 0 ? fmi3OK
                  : status_of(instance_say(&c->instance, REFUSED,
                                           "%s: %u values: must be 0; there are no event indicators", call,
                                           (unsigned long long)n));
}

/* ---- partial derivatives, for either use; all variables are scalars */

struct partials {
    const fmi3ValueReference *unknowns, *knowns;
    size_t n_unknowns, n_knowns;
    const fmi3Float64 *seed;
    fmi3Float64 *sensitivity;
};

/* Whether a call with these lists can be made; said, where not. There must be a seed for each of the one kind, and
   a sensitivity for each of the other. */
static bool is_partials(struct component *c, const char *call, const struct partials *p, size_t n_seed, size_t seeded,
                        size_t n_sensitivity, size_t sensitive)
{
    if (!c)
        return false;
    if ((p->n_unknowns > 0 && !p->unknowns) || (p->n_knowns > 0 && !p->knowns) || (seeded > 0 && !p->seed) ||
        (sensitive > 0 && !p->sensitivity)) {
        refuse_null(c, call);
        return false;
    }
    if (n_seed == seeded && n_sensitivity == sensitive)
        return true;
    instance_say(&c->instance, REFUSED, "%s: nSeed = %u, nSensitivity = %u: must be %u and %u", call,
                 (unsigned long long)n_seed, (unsigned long long)n_sensitivity, (unsigned long long)seeded,
                 (unsigned long long)sensitive);
    return false;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                        const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                        size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    static const char call[] = "fmi3GetDirectionalDerivative";
    struct component *c = instance;
    const struct partials p = {unknowns, knowns, n_unknowns, n_knowns, seed, sensitivity};
    if (!is_partials(c, call, &p, n_seed, n_knowns, n_sensitivity, n_unknowns))
        return fmi3Error;
    return status_of(instance_directional_derivatives(&c->instance, call, unknowns, n_unknowns, knowns, n_knowns, seed,
                                                      sensitivity));
}

/* The sum over the unknowns of seed[i] * d(unknown i)/d(known). */
static double adjoint(const struct linearization *linearization, const struct partials *p, fmi3ValueReference known)
{
    double sum = 0.0;
    for (size_t i = 0; i < p->n_unknowns; i++)
        sum += p->seed[i] * instance_partial(linearization, p->unknowns[i], known);
    return sum;
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                    size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    static const char call[] = "fmi3GetAdjointDerivative";
    struct component *c = instance;
    const struct partials p = {unknowns, knowns, n_unknowns, n_knowns, seed, sensitivity};
    struct linearization linearization;
    if (!is_partials(c, call, &p, n_seed, n_unknowns, n_sensitivity, n_knowns) ||
        instance_linearize(&c->instance, call, unknowns, n_unknowns, knowns, n_knowns, &linearization) == REFUSED)
        return fmi3Error;
    for (size_t k = 0; k < n_knowns; k++) {
        const double value = adjoint(&linearization, &p, knowns[k]);
        if (!isfinite(value)) /* so are those with a seed that is none */
            return status_of(instance_say(&c->instance, REFUSED,
                                          "adjoint derivative of %s = %r: must be a finite number",
                                          VARIABLES[knowns[k]].name, value));
    }
    for (size_t k = 0; k < n_knowns; k++)
        sensitivity[k] = adjoint(&linearization, &p, knowns[k]);
    return fmi3OK;
}
