#include "permits.h"

#include "instance.h"

#define IN(phase) (1u << (phase))
#define EVER (~IN(INTERMEDIATE_UPDATE)) /* inside a step almost nothing may be called */
#define PAST(phase) (~0u << (phase) << 1 & EVER)
#define EITHER_USE (IN(CO_SIMULATION) | IN(MODEL_EXCHANGE))
#define SOLVED (IN(EVENT_MODE) | IN(CONTINUOUS_TIME)) /* the phases that are model exchange's alone */

struct permit {
    const char *names[2]; /* in FMI 2.0, in FMI 3.0 */
    unsigned phases;      /* bit n: in phase n */
    unsigned not_in_2;    /* of these, those that FMI 2.0 has not */
    unsigned discarded;   /* in FMI 2.0 (2.1.3) it can be, of an instance for this use; in FMI 3.0 (2.2.4) any can */
    unsigned named;       /* those that a refusal names; 0: all */
    enum { FOR_BOTH, FOR_STEPS, FOR_EXCHANGE } only; /* instances for this use have the call */
};

static const struct permit PERMITS[CALL_COUNT] = {
    [SET_DEBUG_LOGGING] = {.names = {"fmi2SetDebugLogging", "fmi3SetDebugLogging"}, .phases = EVER},
    [SET_UP] = {.names = {"fmi2SetupExperiment", "fmi3EnterInitializationMode"}, .phases = IN(INSTANTIATED)},
    [ENTER_INITIALIZATION] = {.names = {"fmi2EnterInitializationMode", "fmi3EnterInitializationMode"},
                              .phases = IN(INSTANTIATED)},
    [EXIT_INITIALIZATION] = {.names = {"fmi2ExitInitializationMode", "fmi3ExitInitializationMode"},
                             .phases = IN(INITIALIZING)},
    [TERMINATE] = {.names = {"fmi2Terminate", "fmi3Terminate"}, .phases = IN(STEPPING) | SOLVED},
    [RESET] = {.names = {"fmi2Reset", "fmi3Reset"}, .phases = EVER},

    [GET_REALS] = {.names = {"fmi2GetReal", "fmi3GetFloat64"}, .phases = EVER, .not_in_2 = IN(INSTANTIATED),
                   .discarded = IN(MODEL_EXCHANGE)},
    [SET_REALS] = {.names = {"fmi2SetReal", "fmi3SetFloat64"},
                   .phases = EVER | IN(INTERMEDIATE_UPDATE), /* each variable has phases of its own */
                   .discarded = EITHER_USE},
    [GET_INTEGERS] = {.names = {"fmi2GetInteger", "fmi3GetInt32"}, .phases = EVER, .not_in_2 = IN(INSTANTIATED)},
    [SET_INTEGERS] = {.names = {"fmi2SetInteger", "fmi3SetInt32"}, .phases = EVER, .discarded = EITHER_USE},
    [GET_BOOLEANS] = {.names = {"fmi2GetBoolean", "fmi3GetBoolean"}, .phases = EVER, .not_in_2 = IN(INSTANTIATED)},
    [SET_BOOLEANS] = {.names = {"fmi2SetBoolean", "fmi3SetBoolean"}, .phases = EVER, .discarded = EITHER_USE},
    [GET_ENUMERATIONS] = {.names = {"fmi2GetInteger", "fmi3GetInt64"}, .phases = EVER},
    [SET_ENUMERATIONS] = {.names = {"fmi2SetInteger", "fmi3SetInt64"}, .phases = EVER},

    [GET_FMU_STATE] = {.names = {"fmi2GetFMUstate", "fmi3GetFMUState"}, .phases = EVER},
    [SET_FMU_STATE] = {.names = {"fmi2SetFMUstate", "fmi3SetFMUState"}, .phases = EVER},
    [FREE_FMU_STATE] = {.names = {"fmi2FreeFMUstate", "fmi3FreeFMUState"}, .phases = EVER},
    [SIZE_FMU_STATE] = {.names = {"fmi2SerializedFMUstateSize", "fmi3SerializedFMUStateSize"}, .phases = EVER},
    [SERIALIZE_FMU_STATE] = {.names = {"fmi2SerializeFMUstate", "fmi3SerializeFMUState"}, .phases = EVER},
    [DESERIALIZE_FMU_STATE] = {.names = {"fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState"}, .phases = EVER},

    [DIRECTIONAL_DERIVATIVE] = {.names = {"fmi2GetDirectionalDerivative", "fmi3GetDirectionalDerivative"},
                                .phases = PAST(INSTANTIATED), .named = IN(INITIALIZING)},
    [ADJOINT_DERIVATIVE] = {.names = {"", "fmi3GetAdjointDerivative"},
                            .phases = PAST(INSTANTIATED), .named = IN(INITIALIZING)},

    [SET_INPUT_RATES] = {.names = {"fmi2SetRealInputDerivatives", ""},
                         .phases = EVER, .only = FOR_STEPS},
    [GET_OUTPUT_RATES] = {.names = {"fmi2GetRealOutputDerivatives", "fmi3GetOutputDerivatives"},
                          .phases = EVER, .not_in_2 = IN(INSTANTIATED) | IN(INITIALIZING), .only = FOR_STEPS},
    [STEP] = {.names = {"fmi2DoStep", "fmi3DoStep"}, .phases = IN(STEPPING), .discarded = IN(CO_SIMULATION)},
    [CANCEL_STEP] = {.names = {"fmi2CancelStep", ""}, .phases = EVER},
    [GET_STATUS] = {.names = {"fmi2GetStatus", ""}, .phases = EVER},
    [GET_REAL_STATUS] = {.names = {"fmi2GetRealStatus", ""}, .phases = EVER},
    [GET_INTEGER_STATUS] = {.names = {"fmi2GetIntegerStatus", ""}, .phases = EVER},
    [GET_BOOLEAN_STATUS] = {.names = {"fmi2GetBooleanStatus", ""}, .phases = EVER},
    [GET_STRING_STATUS] = {.names = {"fmi2GetStringStatus", ""}, .phases = EVER},

    [ENTER_EVENT_MODE] = {.names = {"fmi2EnterEventMode", "fmi3EnterEventMode"}, .phases = SOLVED},
    [ENTER_CONTINUOUS_TIME] = {.names = {"fmi2EnterContinuousTimeMode", "fmi3EnterContinuousTimeMode"},
                               .phases = IN(EVENT_MODE)},
    [UPDATE_DISCRETE_STATES] = {.names = {"fmi2NewDiscreteStates", "fmi3UpdateDiscreteStates"},
                                .phases = IN(EVENT_MODE)},
    [COMPLETE_INTEGRATOR_STEP] = {.names = {"fmi2CompletedIntegratorStep", "fmi3CompletedIntegratorStep"},
                                  .phases = IN(CONTINUOUS_TIME)},
    [SET_TIME] = {.names = {"fmi2SetTime", "fmi3SetTime"}, .phases = SOLVED},
    [SET_STATES] = {.names = {"fmi2SetContinuousStates", "fmi3SetContinuousStates"}, .phases = IN(CONTINUOUS_TIME),
                    .discarded = IN(MODEL_EXCHANGE)},
    [GET_STATES] = {.names = {"fmi2GetContinuousStates", "fmi3GetContinuousStates"}, .discarded = IN(MODEL_EXCHANGE),
                    .phases = PAST(INSTANTIATED), .named = IN(INITIALIZING), .only = FOR_EXCHANGE},
    [GET_DERIVATIVES] = {.names = {"fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives"},
                         .discarded = IN(MODEL_EXCHANGE),
                         .phases = PAST(INSTANTIATED), .named = IN(INITIALIZING), .only = FOR_EXCHANGE},
    [GET_NOMINALS] = {.names = {"fmi2GetNominalsOfContinuousStates", "fmi3GetNominalsOfContinuousStates"},
                      .phases = EVER, .only = FOR_EXCHANGE},
    [GET_EVENT_INDICATORS] = {.names = {"fmi2GetEventIndicators", "fmi3GetEventIndicators"},
                              .phases = EVER, .only = FOR_EXCHANGE},
    [COUNT_STATES] = {.names = {"", "fmi3GetNumberOfContinuousStates"},
                      .phases = EVER, .only = FOR_EXCHANGE},
    [COUNT_EVENT_INDICATORS] = {.names = {"", "fmi3GetNumberOfEventIndicators"},
                                .phases = EVER, .only = FOR_EXCHANGE},
};

const char *call_name(const struct instance *instance, enum call call)
{
    return PERMITS[call].names[instance->services.fmi == 3];
}

/* From inside its logger it is not, without a word: what it tells of is half done, and to tell would call the logger. */
static bool is_callable(const struct instance *instance)
{
    return instance && !instance->telling;
}

bool permitted_always(struct instance *instance, const char *name, bool given)
{
    if (!is_callable(instance))
        return false;
    if (!given)
        instance_say(instance, REFUSED, "%s: no argument must be NULL", name);
    return given;
}

bool can_be_discarded(const struct instance *instance)
{
    if (instance->call == NO_CALL || instance->now.phase == INTERMEDIATE_UPDATE)
        return false;
    return instance->services.fmi == 3 || PERMITS[instance->call].discarded & IN(instance->now.use);
}

/* What this FMU has not got, whatever it is used for; NULL where it has it. */
static const char *missing(enum call call)
{
    const struct model_functions *has = model();
    switch (call) {
    case DIRECTIONAL_DERIVATIVE:
    case ADJOINT_DERIVATIVE:
        return has->linearize ? NULL : "partial derivatives";
    case SET_INPUT_RATES:
        return has->takes_rates ? NULL : "use for derivatives of inputs";
    case GET_OUTPUT_RATES:
        return has->output_rate ? NULL : "derivatives of outputs";
    default:
        return NULL;
    }
}

static unsigned phases_of(const struct permit *permit, const struct instance *instance)
{
    return instance->services.fmi == 3 ? permit->phases : permit->phases & ~permit->not_in_2;
}

/* Those that a refusal names: as many as an instance of its use can be in, if any. */
static unsigned named_phases(const struct permit *permit, const struct instance *instance)
{
    const unsigned phases = permit->named ? permit->named : phases_of(permit, instance);
    const unsigned possible = phases & (instance->now.use == MODEL_EXCHANGE ? ~IN(STEPPING) : ~SOLVED);
    return possible ? possible : phases;
}

static void refuse_phase(struct instance *instance, const char *name, unsigned phases)
{
    const char *found[2] = {NULL, NULL};
    for (unsigned phase = 0, n = 0; phase < PHASE_COUNT && n < 2; phase++)
        if (phases & IN(phase))
            found[n++] = PHASE_NAMES[phase];
    const char *now = PHASE_NAMES[instance->now.phase];
    if (found[1])
        instance_say(instance, REFUSED, "%s in state '%s': must be called in state '%s' or '%s'", name, now, found[0],
                     found[1]);
    else
        instance_say(instance, REFUSED, "%s in state '%s': must be called in state '%s'", name, now, found[0]);
}

bool permitted(struct instance *instance, enum call call, bool given)
{
    const struct permit *permit = &PERMITS[call];
    if (!is_callable(instance))
        return false;
    instance->call = call;
    if (!permitted_always(instance, call_name(instance, call), given))
        return false;
    if (missing(call))
        instance_say(instance, REFUSED, "%s: must not be called: the model has no %s", call_name(instance, call),
                     missing(call));
    else if (permit->only && permit->only != (instance->now.use == MODEL_EXCHANGE ? FOR_EXCHANGE : FOR_STEPS))
        instance_say(instance, REFUSED, "%s: must be called of an instance for %s", call_name(instance, call),
                     permit->only == FOR_EXCHANGE ? "model exchange" : "co-simulation");
    else if (!(phases_of(permit, instance) & IN(instance->now.phase)))
        refuse_phase(instance, call_name(instance, call), named_phases(permit, instance));
    else if (call == TERMINATE && instance->failed)
        instance_say(instance, REFUSED, "%s after an error: the instance must be reset or freed, or given a state",
                     call_name(instance, call));
    else
        return true;
    return false;
}
