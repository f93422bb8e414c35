/* FMI 2.0, co-simulation and model exchange: it translates; all else is the instance's, with which a component
   begins. Which arguments must not be NULL is said here, refused in permits.c. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "fmi2Functions.h"
#include "instance.h"
#include "memory.h"
#include "variant.h"

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter" /* the standard's functions have some that nobody needs here */
#endif

struct component {
    struct instance instance;
    fmi2CallbackFunctions callbacks;
    char name[];
};

static fmi2Status status_of(enum verdict verdict)
{
    static const fmi2Status statuses[] = {
        [FINE] = fmi2OK, [WARNED] = fmi2Warning, [DISCARDED] = fmi2Discard, [REFUSED] = fmi2Error};
    return statuses[verdict];
}

/* What comes of a call: it is made in a floating-point environment of its own, and where it is permitted. */
#define MADE(call) status_of((instance_enter(c), instance_leave(c, (call))))
#define STATUS_OF(call, given, made) (permitted(c, call, given) ? MADE(made) : fmi2Error)

/* A message is its own format: it never contains a '%'. */
static void tell(void *sink, enum verdict verdict, const char *category, const char *message)
{
    const struct component *c = sink;
    if (c->callbacks.logger)
        c->callbacks.logger(c->callbacks.componentEnvironment, c->name, status_of(verdict), category, message);
}

/* The host's own memory management is not asked: canNotUseMemoryManagementFunctions. */
static void *allocate(void *sink, size_t size)
{
    (void)sink;
    return memory_allocate(size);
}

static void release(void *sink, void *memory)
{
    (void)sink;
    memory_release(memory);
}

/* ---- general */

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    return STATUS_OF(SET_DEBUG_LOGGING, n == 0 || categories, instance_log(c, on != 0, n, categories));
}

static bool is_acceptable(struct instance *instance, fmi2Type type, fmi2String guid)
{
    if (type == fmi2ModelExchange && !model()->follow)
        instance_say(instance, REFUSED, "fmuType = %i: must be fmi2CoSimulation, %i: there is no ModelExchange in "
                     "modelDescription.xml", (long long)type, (long long)fmi2CoSimulation);
    else if (type != fmi2CoSimulation && type != fmi2ModelExchange)
        instance_say(instance, REFUSED, "fmuType = %i: must be fmi2ModelExchange, %i, or fmi2CoSimulation, %i",
                     (long long)type, (long long)fmi2ModelExchange, (long long)fmi2CoSimulation);
    else if (!guid || strcmp(guid, variant()->guid) != 0)
        instance_say(instance, REFUSED, "fmuGUID = '%q': must be '%q', as in modelDescription.xml",
                     guid ? guid : "NULL", variant()->guid);
    else
        return true;
    return false;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    static const fmi2CallbackFunctions none = {NULL, NULL, NULL, NULL, NULL};
    const size_t length = name ? strlen(name) : 0;
    struct component *c = memory_allocate(sizeof *c + length + 1);
    if (!c) {
        if (functions && functions->logger)
            functions->logger(functions->componentEnvironment, name ? name : "", fmi2Error, "logStatusError",
                              "fmi2Instantiate: no memory");
        return NULL;
    }
    c->callbacks = functions ? *functions : none;
    memcpy(c->name, name ? name : "", length);
    c->name[length] = '\0';
    const struct services services = {2, tell, allocate, release, NULL, c};
    const enum use use = type == fmi2ModelExchange ? MODEL_EXCHANGE : CO_SIMULATION;
    if (instance_start(&c->instance, use, &services, logging != 0) != REFUSED &&
        is_acceptable(&c->instance, type, guid))
        return c;
    memory_release(c);
    return NULL;
}

void fmi2FreeInstance(fmi2Component component)
{
    if (!instance_is_calling(component))
        memory_release(component);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start_time,
                               fmi2Boolean stop_time_defined, fmi2Real stop_time)
{
    return STATUS_OF(SET_UP, true, instance_set_up(c, start_time, tolerance_defined != 0, tolerance,
                                                   stop_time_defined ? stop_time : INFINITY));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    return STATUS_OF(ENTER_INITIALIZATION, true, instance_initialize(c));
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    return STATUS_OF(EXIT_INITIALIZATION, true, instance_go(c));
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    return STATUS_OF(TERMINATE, true, instance_terminate(c));
}

fmi2Status fmi2Reset(fmi2Component c)
{
    return STATUS_OF(RESET, true, instance_reset(c));
}

/* ---- variables */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    return STATUS_OF(GET_REALS, n == 0 || (vr && value), instance_get_reals(c, vr, n, value));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    return STATUS_OF(SET_REALS, n == 0 || (vr && value), instance_set_reals(c, vr, n, value));
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[])
{
    return STATUS_OF(GET_INTEGERS, n == 0 || (vr && value), instance_get_integers(c, INTEGER, vr, n, value));
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
{
    return STATUS_OF(SET_INTEGERS, n == 0 || (vr && value), instance_set_integers(c, INTEGER, vr, n, value));
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
{
    return STATUS_OF(GET_BOOLEANS, n == 0 || (vr && value), instance_get_integers(c, BOOLEAN, vr, n, value));
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
{
    return STATUS_OF(SET_BOOLEANS, n == 0 || (vr && value), instance_set_integers(c, BOOLEAN, vr, n, value));
}

/* There are none of this type: an empty list is fine. */
#define NONE_OF(Type)                                                                                                  \
    fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2##Type value[])             \
    {                                                                                                                  \
        return status_of(instance_none_of(c, "fmi2Get" #Type, #Type, vr, n));                                         \
    }                                                                                                                  \
    fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2##Type value[])       \
    {                                                                                                                  \
        return status_of(instance_none_of(c, "fmi2Set" #Type, #Type, vr, n));                                         \
    }

NONE_OF(String)

/* ---- FMU state */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return STATUS_OF(GET_FMU_STATE, state, instance_save(c, state));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    return STATUS_OF(SET_FMU_STATE, state, instance_restore(c, state));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return STATUS_OF(FREE_FMU_STATE, true, instance_forget(c, state));
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    return STATUS_OF(SIZE_FMU_STATE, state && size, instance_serialized_size(state, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return STATUS_OF(SERIALIZE_FMU_STATE, state && bytes, instance_serialize(c, state, (unsigned char *)bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return STATUS_OF(DESERIALIZE_FMU_STATE, bytes && state,
                     instance_deserialize(c, (const unsigned char *)bytes, size, state));
}

/* ---- derivatives */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known, const fmi2Real d_known[],
                                        fmi2Real d_unknown[])
{
    const bool given = (n_unknown == 0 || (unknown && d_unknown)) && (n_known == 0 || (known && d_known));
    return STATUS_OF(DIRECTIONAL_DERIVATIVE, given,
                     model()->directional(c, unknown, n_unknown, known, n_known, d_known, d_unknown));
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    return STATUS_OF(SET_INPUT_RATES, n == 0 || (vr && order && value), instance_set_rates(c, vr, n, order, value));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[])
{
    return STATUS_OF(GET_OUTPUT_RATES, n == 0 || (vr && order && value), instance_get_rates(c, vr, n, order, value));
}

/* ---- model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    return STATUS_OF(ENTER_EVENT_MODE, true, instance_enter_event_mode(c));
}

/* It has no discrete states: one call is enough. */
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    static const fmi2EventInfo nothing = {
        .newDiscreteStatesNeeded = fmi2False,
        .terminateSimulation = fmi2False,
        .nominalsOfContinuousStatesChanged = fmi2False,
        .valuesOfContinuousStatesChanged = fmi2False,
        .nextEventTimeDefined = fmi2False,
        .nextEventTime = 0.0,
    };
    const fmi2Status status = STATUS_OF(UPDATE_DISCRETE_STATES, info, instance_update_discrete_states(c));
    if (status <= fmi2Warning)
        *info = nothing;
    return status;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    return STATUS_OF(ENTER_CONTINUOUS_TIME, true, instance_enter_continuous_time(c));
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_set_state_before, fmi2Boolean *enter_event_mode,
                                       fmi2Boolean *terminate)
{
    bool event_needed = false;
    const fmi2Status status = STATUS_OF(COMPLETE_INTEGRATOR_STEP, enter_event_mode && terminate,
                                        instance_complete_integrator_step(c, &event_needed));
    if (status <= fmi2Warning) {
        *enter_event_mode = event_needed ? fmi2True : fmi2False;
        *terminate = fmi2False;
    }
    return status;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    return STATUS_OF(SET_TIME, true, instance_set_time(c, time));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real states[], size_t n)
{
    return STATUS_OF(SET_STATES, states, instance_set_states(c, states, n));
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real states[], size_t n)
{
    return STATUS_OF(GET_STATES, states, instance_get_states(c, states, n));
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t n)
{
    return STATUS_OF(GET_DERIVATIVES, derivatives, instance_get_derivatives(c, derivatives, n));
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominals[], size_t n)
{
    return STATUS_OF(GET_NOMINALS, nominals, instance_get_nominals(c, nominals, n));
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t n)
{
    return STATUS_OF(GET_EVENT_INDICATORS, true, instance_get_event_indicators(c, n));
}

/* ---- the step */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real point, fmi2Real step, fmi2Boolean no_set_state_before)
{
    return STATUS_OF(STEP, true, instance_step(c, point, step));
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    return STATUS_OF(CANCEL_STEP, true, instance_say(c, REFUSED, "fmi2CancelStep: must be called while a step is "
                                                                  "pending; none ever is"));
}

fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Status *value)
{
    const struct component *c = component;
    if (!permitted(component, GET_STATUS, value))
        return fmi2Error;
    if (kind != fmi2DoStepStatus)
        return fmi2Discard;
    *value = status_of(c->instance.last_step);
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value)
{
    const struct component *c = component;
    if (!permitted(component, GET_REAL_STATUS, value))
        return fmi2Error;
    if (kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = c->instance.now.time;
    return fmi2OK;
}

/* The standard has no status that is an integer. */
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    return permitted(c, GET_INTEGER_STATUS, value) ? fmi2Discard : fmi2Error;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    if (!permitted(c, GET_BOOLEAN_STATUS, value))
        return fmi2Error;
    if (kind != fmi2Terminated)
        return fmi2Discard;
    *value = fmi2False; /* no model ends a run */
    return fmi2OK;
}

/* There is one for pending steps alone. */
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    return permitted(c, GET_STRING_STATUS, value) ? fmi2Discard : fmi2Error;
}
