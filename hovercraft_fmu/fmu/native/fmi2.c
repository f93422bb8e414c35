/* FMI 2.0, co-simulation and model exchange: it translates, and checks pointers; all else is the instance's. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "fmi2Functions.h"
#include "instance.h"
#include "memory.h"

struct component {
    struct instance instance;
    fmi2CallbackFunctions callbacks;
    char name[];
};

static fmi2Status status_of(enum verdict verdict)
{
    return verdict == FINE ? fmi2OK : verdict == WARNED ? fmi2Warning : fmi2Error;
}

/* A message is its own format: it never contains a '%'. */
static void tell(void *sink, enum verdict verdict, const char *category, const char *message)
{
    const struct component *c = sink;
    if (c->callbacks.logger)
        c->callbacks.logger(c->callbacks.componentEnvironment, c->name, status_of(verdict), category, message);
}

static void *allocate(const fmi2CallbackFunctions *callbacks, size_t size)
{
    return callbacks->allocateMemory && callbacks->freeMemory ? callbacks->allocateMemory(1, size)
                                                              : memory_allocate(1, size);
}

static void release(const fmi2CallbackFunctions *callbacks, void *memory)
{
    if (callbacks->allocateMemory && callbacks->freeMemory)
        callbacks->freeMemory(memory);
    else
        memory_release(memory);
}

static fmi2Status refuse(struct component *c, const char *call, const char *why)
{
    return status_of(instance_say(&c->instance, REFUSED, "%s: %s", call, why));
}

static fmi2Status refuse_null(struct component *c, const char *call)
{
    return refuse(c, call, "no argument must be NULL");
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

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    struct component *c = component;
    return c ? status_of(instance_log(&c->instance, "fmi2SetDebugLogging", on != 0, n, categories)) : fmi2Error;
}

static bool is_acceptable(struct component *c, fmi2Type type, fmi2String guid)
{
    if (type != fmi2CoSimulation && type != fmi2ModelExchange)
        instance_say(&c->instance, REFUSED, "fmuType = %i: must be fmi2ModelExchange, %i, or fmi2CoSimulation, %i",
                     (long long)type, (long long)fmi2ModelExchange, (long long)fmi2CoSimulation);
    else if (!guid || strcmp(guid, GUID) != 0)
        instance_say(&c->instance, REFUSED, "fmuGUID = '%q': must be '%s', as in modelDescription.xml",
                     guid ? guid : "NULL", GUID);
    else
        return true;
    return false;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    static const fmi2CallbackFunctions none = {NULL, NULL, NULL, NULL, NULL};
    const fmi2CallbackFunctions *callbacks = functions ? functions : &none;
    const size_t length = name ? strlen(name) : 0;
    struct component *c = allocate(callbacks, sizeof *c + length + 1);
    (void)resources, (void)visible;
    if (!c)
        return NULL;
    c->callbacks = *callbacks;
    memcpy(c->name, name ? name : "", length);
    c->name[length] = '\0';
    instance_start(&c->instance, type == fmi2ModelExchange ? MODEL_EXCHANGE : CO_SIMULATION, tell, c, logging != 0);
    if (is_acceptable(c, type, guid))
        return c;
    release(callbacks, c);
    return NULL;
}

void fmi2FreeInstance(fmi2Component component)
{
    struct component *c = component;
    if (c) {
        const fmi2CallbackFunctions callbacks = c->callbacks;
        release(&callbacks, c);
    }
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start_time, fmi2Boolean stop_time_defined, fmi2Real stop_time)
{
    struct component *c = component;
    return c ? status_of(instance_set_up(&c->instance, "fmi2SetupExperiment", start_time, tolerance_defined != 0,
                                         tolerance, stop_time_defined ? stop_time : INFINITY))
             : fmi2Error;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    struct component *c = component;
    return c ? status_of(instance_initialize(&c->instance, "fmi2EnterInitializationMode")) : fmi2Error;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    struct component *c = component;
    return c ? status_of(instance_go(&c->instance, "fmi2ExitInitializationMode")) : fmi2Error;
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    struct component *c = component;
    return c ? status_of(instance_terminate(&c->instance, "fmi2Terminate")) : fmi2Error;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    instance_reset(&c->instance);
    return fmi2OK;
}

/* ---- variables */

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (n > 0 && (!vr || !value))
        return refuse_null(c, "fmi2GetReal");
    return status_of(instance_get_reals(&c->instance, vr, n, value));
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (n > 0 && (!vr || !value))
        return refuse_null(c, "fmi2SetReal");
    return status_of(instance_set_reals(&c->instance, vr, n, value));
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2Integer value[])
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (n > 0 && (!vr || !value))
        return refuse_null(c, "fmi2GetInteger");
    return status_of(instance_get_integers(&c->instance, vr, n, value));
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (n > 0 && (!vr || !value))
        return refuse_null(c, "fmi2SetInteger");
    return status_of(instance_set_integers(&c->instance, vr, n, value));
}

/* There are none of these types: an empty list is fine. */
static fmi2Status none_of(struct component *c, const char *call, const char *kind, const fmi2ValueReference vr[],
                          size_t n)
{
    if (!c)
        return fmi2Error;
    if (n == 0)
        return fmi2OK;
    return vr ? status_of(instance_no_such(&c->instance, kind, vr[0])) : refuse_null(c, call);
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
{
    (void)value;
    return none_of(component, "fmi2GetBoolean", "Boolean", vr, n);
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
{
    (void)value;
    return none_of(component, "fmi2SetBoolean", "Boolean", vr, n);
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2String value[])
{
    (void)value;
    return none_of(component, "fmi2GetString", "String", vr, n);
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
{
    (void)value;
    return none_of(component, "fmi2SetString", "String", vr, n);
}

/* ---- FMU state */

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (!state)
        return refuse_null(c, "fmi2GetFMUstate");
    if (!*state) /* else it is one from before, to be used again */
        *state = allocate(&c->callbacks, sizeof(struct content));
    if (!*state)
        return refuse(c, "fmi2GetFMUstate", "no memory");
    *(struct content *)*state = c->instance.now;
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state)
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (!state)
        return refuse_null(c, "fmi2SetFMUstate");
    return status_of(instance_restore(&c->instance, state));
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (state && *state) {
        release(&c->callbacks, *state);
        *state = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size)
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (!state || !size)
        return refuse_null(c, "fmi2SerializedFMUstateSize");
    *size = instance_serialized_size();
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (!state || !bytes)
        return refuse_null(c, "fmi2SerializeFMUstate");
    return status_of(
        instance_serialize(&c->instance, "fmi2SerializeFMUstate", state, (unsigned char *)bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    struct component *c = component;
    struct content content;
    if (!c)
        return fmi2Error;
    if (!bytes || !state)
        return refuse_null(c, "fmi2DeSerializeFMUstate");
    if (instance_deserialize(&c->instance, (const unsigned char *)bytes, size, &content) == REFUSED)
        return fmi2Error;
    *state = allocate(&c->callbacks, sizeof content);
    if (!*state)
        return refuse(c, "fmi2DeSerializeFMUstate", "no memory");
    *(struct content *)*state = content;
    return fmi2OK;
}

/* ---- derivatives */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known, const fmi2Real d_known[],
                                        fmi2Real d_unknown[])
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if ((n_unknown > 0 && (!unknown || !d_unknown)) || (n_known > 0 && (!known || !d_known)))
        return refuse_null(c, "fmi2GetDirectionalDerivative");
    return status_of(instance_directional_derivatives(&c->instance, "fmi2GetDirectionalDerivative", unknown, n_unknown,
                                                      known, n_known, d_known, d_unknown));
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (n > 0 && (!vr || !order || !value))
        return refuse_null(c, "fmi2SetRealInputDerivatives");
    if (instance_require_use(&c->instance, "fmi2SetRealInputDerivatives", CO_SIMULATION) == REFUSED)
        return fmi2Error;
    return status_of(instance_set_rates(&c->instance, vr, n, order, value));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[])
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (n > 0 && (!vr || !order || !value))
        return refuse_null(c, "fmi2GetRealOutputDerivatives");
    if (instance_require_use(&c->instance, "fmi2GetRealOutputDerivatives", CO_SIMULATION) == REFUSED)
        return fmi2Error;
    return status_of(instance_get_rates(&c->instance, vr, n, order, value));
}

/* ---- model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component component)
{
    struct component *c = component;
    return c ? status_of(instance_enter_event_mode(&c->instance, "fmi2EnterEventMode")) : fmi2Error;
}

/* It has no discrete states: one call is enough. */
fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info)
{
    static const fmi2EventInfo nothing = {
        .newDiscreteStatesNeeded = fmi2False,
        .terminateSimulation = fmi2False,
        .nominalsOfContinuousStatesChanged = fmi2False,
        .valuesOfContinuousStatesChanged = fmi2False,
        .nextEventTimeDefined = fmi2False,
        .nextEventTime = 0.0,
    };
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (!info)
        return refuse_null(c, "fmi2NewDiscreteStates");
    const enum verdict verdict = instance_new_discrete_states(&c->instance, "fmi2NewDiscreteStates");
    if (verdict != REFUSED)
        *info = nothing;
    return status_of(verdict);
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component)
{
    struct component *c = component;
    return c ? status_of(instance_enter_continuous_time(&c->instance, "fmi2EnterContinuousTimeMode")) : fmi2Error;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component, fmi2Boolean no_set_state_before,
                                       fmi2Boolean *enter_event_mode, fmi2Boolean *terminate)
{
    struct component *c = component;
    (void)no_set_state_before;
    if (!c)
        return fmi2Error;
    if (!enter_event_mode || !terminate)
        return refuse_null(c, "fmi2CompletedIntegratorStep");
    bool event_needed = false;
    if (instance_completed_integrator_step(&c->instance, "fmi2CompletedIntegratorStep", &event_needed) == REFUSED)
        return fmi2Error;
    *enter_event_mode = event_needed ? fmi2True : fmi2False;
    *terminate = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real time)
{
    struct component *c = component;
    return c ? status_of(instance_set_time(&c->instance, "fmi2SetTime", time)) : fmi2Error;
}

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real states[], size_t n)
{
    struct component *c = component;
    return c ? status_of(instance_set_states(&c->instance, "fmi2SetContinuousStates", states, n)) : fmi2Error;
}

fmi2Status fmi2GetContinuousStates(fmi2Component component, fmi2Real states[], size_t n)
{
    struct component *c = component;
    return c ? status_of(instance_get_states(&c->instance, "fmi2GetContinuousStates", states, n)) : fmi2Error;
}

fmi2Status fmi2GetDerivatives(fmi2Component component, fmi2Real derivatives[], size_t n)
{
    struct component *c = component;
    return c ? status_of(instance_get_derivatives(&c->instance, "fmi2GetDerivatives", derivatives, n)) : fmi2Error;
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component component, fmi2Real nominals[], size_t n)
{
    struct component *c = component;
    return c ? status_of(instance_get_nominals(&c->instance, "fmi2GetNominalsOfContinuousStates", nominals, n))
             : fmi2Error;
}

/* There are none. */
fmi2Status fmi2GetEventIndicators(fmi2Component component, fmi2Real indicators[], size_t n)
{
    struct component *c = component;
    (void)indicators;
    if (!c || instance_require_use(&c->instance, "fmi2GetEventIndicators", MODEL_EXCHANGE) == REFUSED)
        return fmi2Error;
    return n == 0 ? fmi2OK
                  : status_of(instance_say(&c->instance, REFUSED, "fmi2GetEventIndicators: %u values: must be 0; there "
                                                                  "are no event indicators", (unsigned long long)n));
}

/* ---- the step */

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real point, fmi2Real step, fmi2Boolean no_set_state_before)
{
    struct component *c = component;
    (void)no_set_state_before;
    return c ? status_of(instance_step(&c->instance, "fmi2DoStep", point, step)) : fmi2Error;
}

fmi2Status fmi2CancelStep(fmi2Component component)
{
    return component ? refuse(component, "fmi2CancelStep", "must be called while a step is pending; none ever is")
                     : fmi2Error;
}

fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Status *value)
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (!value)
        return refuse_null(c, "fmi2GetStatus");
    if (kind != fmi2DoStepStatus)
        return fmi2Discard;
    *value = status_of(c->instance.last_step);
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value)
{
    struct component *c = component;
    if (!c)
        return fmi2Error;
    if (!value)
        return refuse_null(c, "fmi2GetRealStatus");
    if (kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = c->instance.now.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)kind; /* the standard has no status that is an integer */
    return !component ? fmi2Error : value ? fmi2Discard : refuse_null(component, "fmi2GetIntegerStatus");
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value)
{
    if (!component)
        return fmi2Error;
    if (!value)
        return refuse_null(component, "fmi2GetBooleanStatus");
    if (kind != fmi2Terminated)
        return fmi2Discard;
    *value = fmi2False; /* the craft never ends a run */
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind kind, fmi2String *value)
{
    (void)kind; /* there is one for pending steps alone */
    return !component ? fmi2Error : value ? fmi2Discard : refuse_null(component, "fmi2GetStringStatus");
}
