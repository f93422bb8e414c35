#include "permits.h"

#include "instance.h"

#define IN(phase) (1u << (phase))
#define PAST(phase) (~0u << (phase) << 1)
#define EVER (~0u)
#define SOLVED (IN(EVENT_MODE) | IN(CONTINUOUS_TIME)) /* the phases that are model exchange's alone */

struct permit {
    const char *names[2]; /* in FMI 2.0, in FMI 3.0 */
    unsigned phases;      /* bit n: in phase n */
    unsigned named;       /* those that a refusal names; 0: all */
    bool one_use;         /* only an instance for this use has the call */
    enum use use;
};

static const struct permit PERMITS[CALL_COUNT] = {
    [SET_DEBUG_LOGGING] = {{"fmi2SetDebugLogging", "fmi3SetDebugLogging"}, EVER},
    [SET_UP] = {{"fmi2SetupExperiment", "fmi3EnterInitializationMode"}, IN(INSTANTIATED)},
    [ENTER_INITIALIZATION] = {{"fmi2EnterInitializationMode", "fmi3EnterInitializationMode"}, IN(INSTANTIATED)},
    [EXIT_INITIALIZATION] = {{"fmi2ExitInitializationMode", "fmi3ExitInitializationMode"}, IN(INITIALIZING)},
    [TERMINATE] = {{"fmi2Terminate", "fmi3Terminate"}, IN(STEPPING) | SOLVED},
    [RESET] = {{"fmi2Reset", "fmi3Reset"}, EVER},

    [GET_REALS] = {{"fmi2GetReal", "fmi3GetFloat64"}, EVER},
    [SET_REALS] = {{"fmi2SetReal", "fmi3SetFloat64"}, EVER}, /* each variable has phases of its own */
    [GET_INTEGERS] = {{"fmi2GetInteger", "fmi3GetInt32"}, EVER},
    [SET_INTEGERS] = {{"fmi2SetInteger", "fmi3SetInt32"}, EVER},
    [GET_ENUMERATIONS] = {{"fmi2GetInteger", "fmi3GetInt64"}, EVER},
    [SET_ENUMERATIONS] = {{"fmi2SetInteger", "fmi3SetInt64"}, EVER},

    [GET_FMU_STATE] = {{"fmi2GetFMUstate", "fmi3GetFMUState"}, EVER},
    [SET_FMU_STATE] = {{"fmi2SetFMUstate", "fmi3SetFMUState"}, EVER},
    [FREE_FMU_STATE] = {{"fmi2FreeFMUstate", "fmi3FreeFMUState"}, EVER},
    [SIZE_FMU_STATE] = {{"fmi2SerializedFMUstateSize", "fmi3SerializedFMUStateSize"}, EVER},
    [SERIALIZE_FMU_STATE] = {{"fmi2SerializeFMUstate", "fmi3SerializeFMUState"}, EVER},
    [DESERIALIZE_FMU_STATE] = {{"fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState"}, EVER},

    [DIRECTIONAL_DERIVATIVE] = {{"fmi2GetDirectionalDerivative", "fmi3GetDirectionalDerivative"},
                                PAST(INSTANTIATED), IN(INITIALIZING)},
    [ADJOINT_DERIVATIVE] = {{"", "fmi3GetAdjointDerivative"}, PAST(INSTANTIATED), IN(INITIALIZING)},

    [SET_INPUT_RATES] = {{"fmi2SetRealInputDerivatives", ""}, EVER, 0, true, CO_SIMULATION},
    [GET_OUTPUT_RATES] = {{"fmi2GetRealOutputDerivatives", "fmi3GetOutputDerivatives"}, EVER, 0, true, CO_SIMULATION},
    [STEP] = {{"fmi2DoStep", "fmi3DoStep"}, IN(STEPPING)},
    [CANCEL_STEP] = {{"fmi2CancelStep", ""}, EVER},
    [GET_STATUS] = {{"fmi2GetStatus", ""}, EVER},
    [GET_REAL_STATUS] = {{"fmi2GetRealStatus", ""}, EVER},
    [GET_INTEGER_STATUS] = {{"fmi2GetIntegerStatus", ""}, EVER},
    [GET_BOOLEAN_STATUS] = {{"fmi2GetBooleanStatus", ""}, EVER},
    [GET_STRING_STATUS] = {{"fmi2GetStringStatus", ""}, EVER},

    [ENTER_EVENT_MODE] = {{"fmi2EnterEventMode", "fmi3EnterEventMode"}, SOLVED},
    [ENTER_CONTINUOUS_TIME] = {{"fmi2EnterContinuousTimeMode", "fmi3EnterContinuousTimeMode"}, IN(EVENT_MODE)},
    [UPDATE_DISCRETE_STATES] = {{"fmi2NewDiscreteStates", "fmi3UpdateDiscreteStates"}, IN(EVENT_MODE)},
    [COMPLETE_INTEGRATOR_STEP] = {{"fmi2CompletedIntegratorStep", "fmi3CompletedIntegratorStep"}, IN(CONTINUOUS_TIME)},
    [SET_TIME] = {{"fmi2SetTime", "fmi3SetTime"}, SOLVED},
    [SET_STATES] = {{"fmi2SetContinuousStates", "fmi3SetContinuousStates"}, IN(CONTINUOUS_TIME)},
    [GET_STATES] = {{"fmi2GetContinuousStates", "fmi3GetContinuousStates"},
                    PAST(INSTANTIATED), IN(INITIALIZING), true, MODEL_EXCHANGE},
    [GET_DERIVATIVES] = {{"fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives"},
                         PAST(INSTANTIATED), IN(INITIALIZING), true, MODEL_EXCHANGE},
    [GET_NOMINALS] = {{"fmi2GetNominalsOfContinuousStates", "fmi3GetNominalsOfContinuousStates"},
                      EVER, 0, true, MODEL_EXCHANGE},
    [GET_EVENT_INDICATORS] = {{"fmi2GetEventIndicators", "fmi3GetEventIndicators"}, EVER, 0, true, MODEL_EXCHANGE},
    [COUNT_STATES] = {{"", "fmi3GetNumberOfContinuousStates"}, EVER, 0, true, MODEL_EXCHANGE},
    [COUNT_EVENT_INDICATORS] = {{"", "fmi3GetNumberOfEventIndicators"}, EVER, 0, true, MODEL_EXCHANGE},
};

const char *call_name(const struct instance *instance, enum call call)
{
    return PERMITS[call].names[instance->services.fmi == 3];
}

bool permitted_always(struct instance *instance, const char *name, bool given)
{
    if (instance && !given)
        instance_say(instance, REFUSED, "%s: no argument must be NULL", name);
    return instance && given;
}

/* Those that a refusal names: as many as an instance of its use can be in, if any. */
static unsigned named_phases(const struct permit *permit, enum use use)
{
    const unsigned phases = permit->named ? permit->named : permit->phases;
    const unsigned possible = phases & (use == MODEL_EXCHANGE ? ~IN(STEPPING) : ~SOLVED);
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
    if (!instance || !permitted_always(instance, call_name(instance, call), given))
        return false;
    if (permit->one_use && instance->now.use != permit->use)
        instance_say(instance, REFUSED, "%s: must be called of an instance for %s", call_name(instance, call),
                     permit->use == MODEL_EXCHANGE ? "model exchange" : "co-simulation");
    else if (!(permit->phases & IN(instance->now.phase)))
        refuse_phase(instance, call_name(instance, call), named_phases(permit, instance->now.use));
    else
        return true;
    return false;
}
