/* The calls of both standards: what they are called, and when they may be made. */

#ifndef HOVERCRAFT_PERMITS_H
#define HOVERCRAFT_PERMITS_H

#include <stdbool.h>

#include "hidden.h"

struct instance;

enum call {
    SET_DEBUG_LOGGING,
    SET_UP,
    ENTER_INITIALIZATION,
    EXIT_INITIALIZATION,
    TERMINATE,
    RESET,
    GET_REALS,
    SET_REALS,
    GET_INTEGERS,
    SET_INTEGERS,
    GET_BOOLEANS,
    SET_BOOLEANS,
    GET_ENUMERATIONS,
    SET_ENUMERATIONS,
    GET_FMU_STATE,
    SET_FMU_STATE,
    FREE_FMU_STATE,
    SIZE_FMU_STATE,
    SERIALIZE_FMU_STATE,
    DESERIALIZE_FMU_STATE,
    DIRECTIONAL_DERIVATIVE,
    ADJOINT_DERIVATIVE,
    SET_INPUT_RATES,
    GET_OUTPUT_RATES,
    STEP,
    CANCEL_STEP,
    GET_STATUS,
    GET_REAL_STATUS,
    GET_INTEGER_STATUS,
    GET_BOOLEAN_STATUS,
    GET_STRING_STATUS,
    ENTER_EVENT_MODE,
    ENTER_CONTINUOUS_TIME,
    UPDATE_DISCRETE_STATES,
    COMPLETE_INTEGRATOR_STEP,
    SET_TIME,
    SET_STATES,
    GET_STATES,
    GET_DERIVATIVES,
    GET_NOMINALS,
    GET_EVENT_INDICATORS,
    COUNT_STATES,
    COUNT_EVENT_INDICATORS,
    CALL_COUNT,
    NO_CALL = CALL_COUNT
};

/* Whether a call may be made now; said, where not. `given`: no argument is NULL that must not be. Without an instance
   it may not, nor from inside its logger. */
HIDDEN bool permitted(struct instance *instance, enum call call, bool given);
/* Of a call that is not in the table: it may be made in every state. */
HIDDEN bool permitted_always(struct instance *instance, const char *name, bool given);
/* Whether the call that is made can be discarded, by the standard of the instance. */
HIDDEN bool can_be_discarded(const struct instance *instance);
/* As the standard of the instance has it. */
HIDDEN const char *call_name(const struct instance *instance, enum call call);

#endif
