/* One instance of a model behind an interface for co-simulation or model exchange: variables, life cycle, faults,
   warnings, state. It knows no standard: a face (fmi2.c, fmi3.c) translates; and no physics: that is the model's
   (model.h). What it is given it checks, once; a refused call changes nothing. */

#ifndef HOVERCRAFT_INSTANCE_H
#define HOVERCRAFT_INSTANCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "environment.h"
#include "hidden.h"
#include "model.h"
#include "permits.h"
#include "variables.h"

/* What the faces call stands by itself: no arithmetic of it is moved in front of the call, or behind. */
#ifdef __GNUC__
#define DOOR HIDDEN __attribute__((noinline))
#else
#define DOOR HIDDEN
#endif

/* What the host takes it for: steps, or equations for a solver of its own. */
enum use { CO_SIMULATION, MODEL_EXCHANGE };

/* What the face brings: its standard, where a message goes, the host's memory (all zeros); `sink` is the face's. */
struct services {
    int fmi; /* 2 or 3 */
    void (*tell)(void *sink, enum verdict verdict, const char *category, const char *message);
    void *(*allocate)(void *sink, size_t size);
    void (*release)(void *sink, void *memory);
    void (*ask)(void *sink, double time); /* for inputs inside a step; NULL: nobody to ask */
    void *sink;
};

/* All that a call can change, and all that an FMU state is: no pointer in it. */
struct content {
    enum use use;                     /* as it was started; a reset keeps it */
    enum phase phase;
    double time;                      /* s, where the last step ended; in model exchange as the solver sets it */
    double completed;                 /* s, in model exchange: where the last completed step ended */
    double start_time;                /* s, given with the experiment */
    double stop_time;                 /* s, given with the experiment; else infinite */
    double reals[VARIABLE_COUNT];     /* what is read, by value reference */
    int32_t integers[VARIABLE_COUNT];
    double inputs[INPUT_COUNT];       /* where the next step begins: as the host set them, and as ramps led on */
    double rates[INPUT_COUNT];        /* per s, of the inputs */
    int32_t rated;                    /* bit i: that of input i was set at this communication point */
    double hosts_tolerance;           /* given with the experiment, it comes before the parameter; else 0 */
    bool tuned;                       /* a parameter was set since the last step: the next one takes it up */
    bool unread;                      /* what is read is not yet that of the communication point */
    bool unread_on_demand;            /* nor is what is worked out on demand */
    struct model model;
};

/* Of the model, in the order of STATES. */
static inline double *states_of(struct content *content)
{
    return (double *)(void *)&content->model;
}

struct instance {
    struct content now;
    struct services services;
    unsigned logged;        /* bit n: verdict n, each a category */
    enum call call;         /* that is made, or was last */
    enum verdict refusal;   /* of it: as what it was said */
    unsigned errors;        /* that were said */
    bool failed;            /* one of them since the start or the last state that was set */
    enum verdict last_step;
    uint64_t discarded;     /* what the step before was made of, if it was discarded; else 0 */
    struct environment host; /* its floating-point environment, while a call is inside */
    bool inside;
    bool telling;           /* the host's logger is at work */
};

/* Around what a call computes. */
static inline void instance_enter(struct instance *instance)
{
    instance->host = environment_enter();
    instance->inside = true;
}

static inline enum verdict instance_leave(struct instance *instance, enum verdict verdict)
{
    if (instance->inside)
        environment_leave(&instance->host);
    instance->inside = false;
    return verdict == REFUSED ? instance->refusal : verdict;
}

/* Around what a call asks of the host. */
static inline bool instance_go_out(struct instance *instance)
{
    const bool inside = instance->inside;
    instance_leave(instance, FINE);
    return inside;
}

static inline void instance_come_back(struct instance *instance, bool inside)
{
    if (inside)
        instance_enter(instance);
}

/* It has called the host, which has not come back: from inside that it must not be freed. */
static inline bool instance_is_calling(const struct instance *instance)
{
    return instance && (instance->telling || instance->now.phase == INTERMEDIATE_UPDATE);
}

/* Of memory that is zero. Errors are told even where `logging` is off: an instance that fails without a word helps
   nobody. Refused: the library's start values (variant.h) cannot be. */
DOOR enum verdict instance_start(struct instance *instance, enum use use, const struct services *services,
                                 bool logging);
DOOR enum verdict instance_reset(struct instance *instance);

/* What permits.c lets through (permits.h) is in the right phase and of the right use; no array is NULL. */

/* Say something, and return the verdict: REFUSED for DISCARDED, too. For `format` see text.h. */
DOOR enum verdict instance_say(struct instance *instance, enum verdict verdict, const char *format, ...);
/* Switched on, these categories are told, in FMI 2.0 only these, in FMI 3.0 these too; switched off, these no more.
   Without categories it is all of them. */
DOOR enum verdict instance_log(struct instance *instance, bool on, size_t n, const char *const *categories);

/* ---- instance.c: the life cycle. `stop_time` is infinite where there is none. */
DOOR enum verdict instance_set_up(struct instance *instance, double start_time, bool tolerance_given, double tolerance,
                                  double stop_time);
DOOR enum verdict instance_initialize(struct instance *instance);
DOOR enum verdict instance_go(struct instance *instance);
DOOR enum verdict instance_terminate(struct instance *instance);
DOOR bool instance_has_started(const struct content *content);
/* The inputs and the parameters as they are now: before the start, and in model exchange; refused where the parameters
   contradict one another. */
DOOR enum verdict instance_take_up(struct instance *instance);
/* What an enumeration and the integer beside it say together. Refused: both are set, and differ. */
DOOR enum verdict instance_choose(struct instance *instance, unsigned enumeration, int32_t *item);
/* From some of the variables to a structure of doubles in their order, and back. */
DOOR void instance_copy(void *into, const double *reals, const unsigned *references, unsigned n);
DOOR void instance_spread(double *reals, const void *from, const unsigned *references, unsigned n);
/* A state for the host, in memory of its own where *state is NULL; else it is one from before, to be used again. */
DOOR enum verdict instance_save(struct instance *instance, void **state);
DOOR enum verdict instance_keep(struct instance *instance, enum call call, const struct content *content, void **state);
DOOR enum verdict instance_forget(struct instance *instance, void **state);
/* Take up a content as a whole. Refused: one of another use. */
DOOR enum verdict instance_restore(struct instance *instance, const struct content *content);

/* ---- step.c */
DOOR enum verdict instance_step(struct instance *instance, double point, double step);
/* For a model's step: let the host set inputs that are to hold at a time [s] of the step; false where it was asked for
   that before, as the end of a sub-step is the start of the next. And whether a call of its in there was refused. */
DOOR bool instance_ask(struct instance *instance, struct interval *interval, double time);
DOOR enum verdict instance_check_asked(struct instance *instance, const struct interval *interval);
/* Whether this bit of a variable that sums up warnings was not yet set; then it is, now. */
HIDDEN bool instance_is_first(struct instance *instance, unsigned reference, int bit);
static inline enum verdict worse(enum verdict a, enum verdict b)
{
    return a > b ? a : b;
}

/* ---- variables.c */
DOOR enum verdict instance_get_reals(struct instance *instance, const unsigned *references, size_t n, double *values);
/* Booleans, too, as 0 and 1: `kind` is BOOLEAN, or INTEGER for Integers and Enumerations. */
DOOR enum verdict instance_get_integers(struct instance *instance, enum kind kind, const unsigned *references, size_t n,
                                        int *values);
DOOR enum verdict instance_set_reals(struct instance *instance, const unsigned *references, size_t n,
                                     const double *values);
DOOR enum verdict instance_set_integers(struct instance *instance, enum kind kind, const unsigned *references, size_t n,
                                        const int *values);
/* Enumerations as 64-bit numbers. */
DOOR enum verdict instance_get_enumerations(struct instance *instance, const unsigned *references, size_t n,
                                            int64_t *values);
DOOR enum verdict instance_set_enumerations(struct instance *instance, const unsigned *references, size_t n,
                                            const int64_t *values);
/* Booleans as such. */
DOOR enum verdict instance_get_booleans(struct instance *instance, const unsigned *references, size_t n, bool *values);
DOOR enum verdict instance_set_booleans(struct instance *instance, const unsigned *references, size_t n,
                                        const bool *values);
/* Refused: a start value that a host could not set either. */
DOOR enum verdict instance_check_start(struct instance *instance, unsigned reference, double value);
/* A call for a type that has no variables: an empty list is fine. */
DOOR enum verdict instance_none_of(struct instance *instance, const char *name, const char *kind,
                                   const unsigned *references, size_t n);
/* A reference of a type that has no variables. */
DOOR enum verdict instance_no_such(struct instance *instance, const char *kind, unsigned reference);
/* Why a value cannot be, by the model or by the rule in the table; NULL where it can. */
HIDDEN const char *instance_why_not(const struct content *content, const struct variable *variable, double value);
/* Where a reference is in a list, or its length. */
HIDDEN unsigned instance_place(const unsigned *references, unsigned n, unsigned reference);
static inline bool is_among(const unsigned *references, unsigned n, unsigned reference)
{
    return instance_place(references, n, reference) < n;
}
DOOR enum verdict instance_check_settable(struct instance *instance, const struct variable *variable, double value);
/* Bring what is read up to the communication point; and, after that, what is worked out on demand. */
DOOR enum verdict instance_observe(struct instance *instance);
DOOR enum verdict instance_observe_on_demand(struct instance *instance);
/* Refused: one of these is no finite number. */
DOOR enum verdict instance_check_finite(struct instance *instance, const unsigned *references, unsigned n);

/* ---- rates.c: first derivatives, of inputs, from the next communication point on; of outputs, at this one. */
DOOR enum verdict instance_set_rates(struct instance *instance, const unsigned *references, size_t n, const int *orders,
                                     const double *values);
DOOR enum verdict instance_get_rates(struct instance *instance, const unsigned *references, size_t n, const int *orders,
                                     double *values);

/* ---- exchange.c: model exchange. From initialization it goes to event mode, from there to and fro between that and
   continuous-time mode. What is read follows states, inputs and parameters at once. Its one event is a warning. */
DOOR enum verdict instance_enter_event_mode(struct instance *instance);
DOOR enum verdict instance_enter_continuous_time(struct instance *instance);
DOOR enum verdict instance_update_discrete_states(struct instance *instance);
/* An event is needed where there is something to warn of: `warnings` is discrete, so it changes in event mode alone. */
DOOR enum verdict instance_complete_integrator_step(struct instance *instance, bool *event_needed);
DOOR enum verdict instance_set_time(struct instance *instance, double time);
/* In the order of STATES; refused where `n` is not STATE_COUNT. */
DOOR enum verdict instance_set_states(struct instance *instance, const double *values, size_t n);
DOOR enum verdict instance_get_states(struct instance *instance, double *values, size_t n);
DOOR enum verdict instance_get_derivatives(struct instance *instance, double *values, size_t n);
DOOR enum verdict instance_get_nominals(struct instance *instance, double *values, size_t n);
/* There are none. */
DOOR enum verdict instance_get_event_indicators(struct instance *instance, size_t n);

/* ---- serialize.c: the same bytes on every platform. */
DOOR enum verdict instance_serialized_size(const struct content *content, size_t *size);
/* Of all that the next step follows, and it. */
DOOR uint64_t instance_checksum(const struct content *content, double point, double step);
/* Refused: less than that. */
DOOR enum verdict instance_serialize(struct instance *instance, const struct content *content, unsigned char *bytes,
                                     size_t size);
/* A state in memory of its own. Refused: bytes that are not complete and unchanged, or of another build. */
DOOR enum verdict instance_deserialize(struct instance *instance, const unsigned char *bytes, size_t size,
                                       void **state);

#endif
