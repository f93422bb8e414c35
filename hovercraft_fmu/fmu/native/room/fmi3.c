/* The FMI 3.0 interface: it translates, and checks types; all else is the instance's, with which a component begins.
   Which arguments must not be NULL is said here, refused in permits.c. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "fmi3Functions.h"
#include "instance.h"
#include "memory.h"
#include "variant.h"

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter" /* the standard's functions have some that nobody needs here */
#endif

struct component {
    struct instance instance;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update;
};

static fmi3Status status_of(enum verdict verdict)
{
    static const fmi3Status statuses[] = {
        [FINE] = fmi3OK, [WARNED] = fmi3Warning, [DISCARDED] = fmi3Discard, [REFUSED] = fmi3Error};
    return statuses[verdict];
}

/* What comes of a call: it is made in a floating-point environment of its own, and where it is permitted. */
#define MADE(call) status_of((instance_enter(c), instance_leave(c, (call))))
#define STATUS_OF(call, given, made) (permitted(c, call, given) ? MADE(made) : fmi3Error)

static void tell(void *sink, enum verdict verdict, const char *category, const char *message)
{
    const struct component *c = sink;
    if (c->log)
        c->log(c->environment, status_of(verdict), category, message);
}

static void *allocate(void *sink, size_t size)
{
    return memory_allocate(size);
}

static void release(void *sink, void *memory)
{
    memory_release(memory);
}

/* Inputs alone: what is read belongs to the communication point. */
static void ask(void *sink, double time)
{
    const struct component *c = sink;
    bool early = false;
    double early_time = 0.0;
    c->update(c->environment, time, true, false, false, false, &early, &early_time);
}

static fmi3Status refuse(struct instance *instance, const char *name, const char *why)
{
    return permitted_always(instance, name, true) ? status_of(instance_say(instance, REFUSED, "%s: %s", name, why))
                                                  : fmi3Error;
}

/* ---- general */

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    return STATUS_OF(SET_DEBUG_LOGGING, n == 0 || categories, instance_log(c, on, n, categories));
}

static bool is_acceptable(struct instance *instance, fmi3String token)
{
    if (token && strcmp(token, variant()->guid) == 0)
        return true;
    instance_say(instance, REFUSED, "instantiationToken = '%q': must be '%q', as in modelDescription.xml",
                 token ? token : "NULL", variant()->guid);
    return false;
}

/* NULL where there is no memory, or where start values or the token are not this FMU's. */
static struct component *made(enum use use, fmi3String token, bool logging, fmi3InstanceEnvironment environment,
                              fmi3LogMessageCallback log)
{
    struct component *c = memory_allocate(sizeof *c);
    if (!c) {
        if (log)
            log(environment, fmi3Error, "logStatusError", "fmi3Instantiate: no memory");
        return NULL;
    }
    const struct services services = {3, tell, allocate, release, NULL, c};
    c->environment = environment;
    c->log = log;
    if (instance_start(&c->instance, use, &services, logging) != REFUSED && is_acceptable(&c->instance, token))
        return c;
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
    bool refused = event_mode_used;
    if (!c)
        return NULL;
    if (event_mode_used)
        refuse(&c->instance, call, "eventModeUsed must be false: hasEventMode is false");
    for (size_t i = 0; i < n_intermediate && !refused; i++) {
        refused = !model()->asks || !intermediate || instance_place(INPUTS, INPUT_COUNT, intermediate[i]) == INPUT_COUNT;
        if (refused)
            refuse(&c->instance, call, model()->asks ? "requiredIntermediateVariables must be inputs: no other has "
                                                       "intermediateUpdate"
                                                     : "requiredIntermediateVariables must be none: no variable has "
                                                       "intermediateUpdate");
    }
    c->update = update;
    c->instance.services.ask = update && model()->asks ? ask : NULL;
    if (!refused)
        return c;
    memory_release(c);
    return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log)
{
    struct component *c = made(model()->follow ? MODEL_EXCHANGE : CO_SIMULATION, token, logging, environment, log);
    if (!c || model()->follow)
        return c;
    refuse(&c->instance, "fmi3InstantiateModelExchange", "there is no ModelExchange in modelDescription.xml");
    memory_release(c);
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock)
{
    struct component *c = made(CO_SIMULATION, token, logging, environment, log);
    if (c)
        refuse(&c->instance, "fmi3InstantiateScheduledExecution",
               "there is no ScheduledExecution in modelDescription.xml");
    memory_release(c);
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    if (!instance_is_calling(instance))
        memory_release(instance);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start_time, fmi3Boolean stop_time_defined, fmi3Float64 stop_time)
{
    const fmi3Status status = STATUS_OF(SET_UP, true, instance_set_up(c, start_time, tolerance_defined, tolerance,
                                                                      stop_time_defined ? stop_time : INFINITY));
    return status == fmi3OK ? MADE(instance_initialize(c)) : status;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    return STATUS_OF(EXIT_INITIALIZATION, true, instance_go(c));
}

fmi3Status fmi3Terminate(fmi3Instance c)
{
    return STATUS_OF(TERMINATE, true, instance_terminate(c));
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    return STATUS_OF(RESET, true, instance_reset(c));
}

/* ---- variables: all are scalars */

/* Whether there are as many values as variables. */
static bool is_list(struct instance *instance, const char *name, size_t n, size_t n_values)
{
    if (n_values == n)
        return true;
    instance_say(instance, REFUSED, "%s: nValues = %u: must be %u, a value for each of the scalars", name,
                 (unsigned long long)n_values, (unsigned long long)n);
    return false;
}

/* And whether all are of this kind. */
static bool is_list_of(struct instance *instance, enum call call, enum kind kind, const fmi3ValueReference vr[],
                       size_t n, size_t n_values)
{
    static const char *const names[] = {
        [REAL] = "Float64", [INTEGER] = "Int32", [ENUMERATION] = "Enumeration", [BOOLEAN] = "Boolean"};
    if (!is_list(instance, call_name(instance, call), n, n_values))
        return false;
    for (size_t i = 0; i < n; i++) {
        const bool fits = vr[i] == V_TIME ? kind == REAL : vr[i] < VARIABLE_COUNT && VARIABLES[vr[i]].kind == kind;
        if (!fits) {
            instance_no_such(instance, names[kind], vr[i]);
            return false;
        }
    }
    return true;
}

/* As STATUS_OF, for values of one kind. */
#define STATUS_OF_LIST(call, kind, made)                                                                               \
    (permitted(c, call, n == 0 || (vr && values)) && is_list_of(c, call, kind, vr, n, n_values) ? MADE(made)           \
                                                                                                : fmi3Error)

static enum verdict get_floats(struct instance *instance, const fmi3ValueReference vr[], size_t n, double values[])
{
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == V_TIME)
            values[i] = instance->now.time;
        else if (instance_get_reals(instance, &vr[i], 1, &values[i]) == REFUSED)
            return REFUSED;
    }
    return FINE;
}

static enum verdict set_floats(struct instance *instance, const fmi3ValueReference vr[], size_t n,
                               const double values[])
{
    for (size_t i = 0; i < n; i++)
        if (vr[i] == V_TIME)
            return instance_say(instance, REFUSED, "fmi3SetFloat64: time must not be set as a variable");
    return instance_set_reals(instance, vr, n, values);
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[],
                          size_t n_values)
{
    return STATUS_OF_LIST(GET_REALS, REAL, get_floats(c, vr, n, values));
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
                          size_t n_values)
{
    return STATUS_OF_LIST(SET_REALS, REAL, set_floats(c, vr, n, values));
}

fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int32 values[], size_t n_values)
{
    return STATUS_OF_LIST(GET_INTEGERS, INTEGER, instance_get_integers(c, INTEGER, vr, n, values));
}

fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 values[],
                        size_t n_values)
{
    return STATUS_OF_LIST(SET_INTEGERS, INTEGER, instance_set_integers(c, INTEGER, vr, n, values));
}

/* Of enumerations, which have no functions of their own. */
fmi3Status fmi3GetInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int64 values[], size_t n_values)
{
    return STATUS_OF_LIST(GET_ENUMERATIONS, ENUMERATION, instance_get_enumerations(c, vr, n, values));
}

fmi3Status fmi3SetInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int64 values[],
                        size_t n_values)
{
    return STATUS_OF_LIST(SET_ENUMERATIONS, ENUMERATION, instance_set_enumerations(c, vr, n, values));
}

fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Boolean values[],
                          size_t n_values)
{
    return STATUS_OF_LIST(GET_BOOLEANS, BOOLEAN, instance_get_booleans(c, vr, n, values));
}

fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Boolean values[],
                          size_t n_values)
{
    return STATUS_OF_LIST(SET_BOOLEANS, BOOLEAN, instance_set_booleans(c, vr, n, values));
}

/* There are no variables of these types: an empty list is fine. */
static fmi3Status none_of(struct instance *c, const char *name, const char *kind, const fmi3ValueReference vr[],
                          size_t n, size_t n_values)
{
    if (!permitted_always(c, name, n == 0 || vr) || !is_list(c, name, n, n_values))
        return fmi3Error;
    return status_of(instance_none_of(c, name, kind, vr, n));
}

#define NONE_OF(Type)                                                                                                  \
    fmi3Status fmi3Get##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3##Type values[],             \
                             size_t n_values)                                                                          \
    {                                                                                                                  \
        return none_of(c, "fmi3Get" #Type, #Type, vr, n, n_values);                                                    \
    }                                                                                                                  \
    fmi3Status fmi3Set##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3##Type values[],       \
                             size_t n_values)                                                                          \
    {                                                                                                                  \
        return none_of(c, "fmi3Set" #Type, #Type, vr, n, n_values);                                                    \
    }

NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(UInt32)
NONE_OF(UInt64)
NONE_OF(String)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[], fmi3Binary values[],
                         size_t n_values)
{
    return none_of(c, "fmi3GetBinary", "Binary", vr, n, n_values);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[],
                         const fmi3Binary values[], size_t n_values)
{
    return none_of(c, "fmi3SetBinary", "Binary", vr, n, n_values);
}

/* ---- clocks: there are none */

#define NO_CLOCKS(Call, ...)                                                                                           \
    fmi3Status fmi3##Call(fmi3Instance c, const fmi3ValueReference vr[], size_t n, __VA_ARGS__)                        \
    {                                                                                                                  \
        return none_of(c, "fmi3" #Call, "Clock", vr, n, n);                                                            \
    }

NO_CLOCKS(GetClock, fmi3Clock values[])
NO_CLOCKS(SetClock, const fmi3Clock values[])
NO_CLOCKS(GetIntervalDecimal, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
NO_CLOCKS(GetIntervalFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NO_CLOCKS(GetShiftDecimal, fmi3Float64 shifts[])
NO_CLOCKS(GetShiftFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
NO_CLOCKS(SetIntervalDecimal, const fmi3Float64 intervals[])
NO_CLOCKS(SetIntervalFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NO_CLOCKS(SetShiftDecimal, const fmi3Float64 shifts[])
NO_CLOCKS(SetShiftFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])

/* ---- what the description says this FMU has not got */

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *n)
{
    return refuse(c, "fmi3GetNumberOfVariableDependencies", "providesPerElementDependencies is false");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent, size_t elements[],
                                       fmi3ValueReference independents[], size_t elements_of_independents[],
                                       fmi3DependencyKind kinds[], size_t n)
{
    return refuse(c, "fmi3GetVariableDependencies", "providesPerElementDependencies is false");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c)
{
    return refuse(c, "fmi3EnterConfigurationMode", "there are no structural parameters");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c)
{
    return refuse(c, "fmi3ExitConfigurationMode", "there are no structural parameters");
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c)
{
    return refuse(c, "fmi3EvaluateDiscreteStates", "providesEvaluateDiscreteStates is false");
}

fmi3Status fmi3EnterStepMode(fmi3Instance c)
{
    return refuse(c, "fmi3EnterStepMode", "hasEventMode is false");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time)
{
    return refuse(c, "fmi3ActivateModelPartition", "there is no ScheduledExecution in modelDescription.xml");
}

/* ---- FMU state */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    return STATUS_OF(GET_FMU_STATE, state, instance_save(c, state));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    return STATUS_OF(SET_FMU_STATE, state, instance_restore(c, state));
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    return STATUS_OF(FREE_FMU_STATE, true, instance_forget(c, state));
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    return STATUS_OF(SIZE_FMU_STATE, state && size, instance_serialized_size(state, size));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return STATUS_OF(SERIALIZE_FMU_STATE, state && bytes, instance_serialize(c, state, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    return STATUS_OF(DESERIALIZE_FMU_STATE, bytes && state, instance_deserialize(c, bytes, size, state));
}

/* ---- co-simulation */

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t n_values)
{
    if (!permitted(c, GET_OUTPUT_RATES, n == 0 || (vr && orders && values)) ||
        !is_list(c, "fmi3GetOutputDerivatives", n, n_values))
        return fmi3Error;
    return MADE(instance_get_rates(c, vr, n, orders, values));
}

/* The step is made whole or refused: it never returns early, and never ends a run. */
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 point, fmi3Float64 step, fmi3Boolean no_set_state_before,
                      fmi3Boolean *event_handling_needed, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_successful_time)
{
    const struct instance *instance = c;
    if (!permitted(c, STEP, event_handling_needed && terminate && early_return && last_successful_time))
        return fmi3Error;
    const fmi3Status status = MADE(instance_step(c, point, step));
    *event_handling_needed = *terminate = *early_return = false;
    *last_successful_time = instance->now.time;
    return status;
}

/* ---- model exchange */

fmi3Status fmi3EnterEventMode(fmi3Instance c)
{
    return STATUS_OF(ENTER_EVENT_MODE, true, instance_enter_event_mode(c));
}

/* It has no discrete states: one call is enough. */
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *need_update, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
                                    fmi3Boolean *next_event_defined, fmi3Float64 *next_event)
{
    const bool given =
        need_update && terminate && nominals_changed && values_changed && next_event_defined && next_event;
    const fmi3Status status = STATUS_OF(UPDATE_DISCRETE_STATES, given, instance_update_discrete_states(c));
    if (status <= fmi3Warning) {
        *need_update = *terminate = *nominals_changed = *values_changed = *next_event_defined = false;
        *next_event = 0.0;
    }
    return status;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c)
{
    return STATUS_OF(ENTER_CONTINUOUS_TIME, true, instance_enter_continuous_time(c));
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_set_state_before, fmi3Boolean *enter_event_mode,
                                       fmi3Boolean *terminate)
{
    bool event_needed = false;
    const fmi3Status status = STATUS_OF(COMPLETE_INTEGRATOR_STEP, enter_event_mode && terminate,
                                        instance_complete_integrator_step(c, &event_needed));
    if (status <= fmi3Warning) {
        *enter_event_mode = event_needed;
        *terminate = false;
    }
    return status;
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time)
{
    return STATUS_OF(SET_TIME, true, instance_set_time(c, time));
}

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 states[], size_t n)
{
    return STATUS_OF(SET_STATES, states, instance_set_states(c, states, n));
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 states[], size_t n)
{
    return STATUS_OF(GET_STATES, states, instance_get_states(c, states, n));
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 derivatives[], size_t n)
{
    return STATUS_OF(GET_DERIVATIVES, derivatives, instance_get_derivatives(c, derivatives, n));
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominals[], size_t n)
{
    return STATUS_OF(GET_NOMINALS, nominals, instance_get_nominals(c, nominals, n));
}

static enum verdict counted(size_t *n, size_t number)
{
    *n = number;
    return FINE;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n)
{
    return STATUS_OF(COUNT_STATES, n, counted(n, STATE_COUNT));
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n)
{
    return STATUS_OF(COUNT_EVENT_INDICATORS, n, counted(n, 0));
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 indicators[], size_t n)
{
    return STATUS_OF(GET_EVENT_INDICATORS, true, instance_get_event_indicators(c, n));
}

/* ---- partial derivatives, for either use; all variables are scalars */

/* Whether there is a seed for each of the one kind, and a sensitivity for each of the other. */
static bool is_seeded(struct instance *instance, enum call call, size_t n_seed, size_t seeded, size_t n_sensitivity,
                      size_t sensitive)
{
    if (n_seed == seeded && n_sensitivity == sensitive)
        return true;
    instance_say(instance, REFUSED, "%s: nSeed = %u, nSensitivity = %u: must be %u and %u", call_name(instance, call),
                 (unsigned long long)n_seed, (unsigned long long)n_sensitivity, (unsigned long long)seeded,
                 (unsigned long long)sensitive);
    return false;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                        const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                        size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    const bool given = (n_unknowns == 0 || (unknowns && sensitivity)) && (n_knowns == 0 || (knowns && seed));
    if (!permitted(c, DIRECTIONAL_DERIVATIVE, given) ||
        !is_seeded(c, DIRECTIONAL_DERIVATIVE, n_seed, n_knowns, n_sensitivity, n_unknowns))
        return fmi3Error;
    return MADE(model()->directional(c, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                    size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    const bool given = (n_unknowns == 0 || (unknowns && seed)) && (n_knowns == 0 || (knowns && sensitivity));
    if (!permitted(c, ADJOINT_DERIVATIVE, given) ||
        !is_seeded(c, ADJOINT_DERIVATIVE, n_seed, n_unknowns, n_sensitivity, n_knowns))
        return fmi3Error;
    return MADE(model()->adjoint(c, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity));
}
