/* One craft behind an interface for co-simulation or model exchange: variables, life cycle, faults, warnings, state. It
   knows no standard: a face (fmi2.c, fmi3.c) translates. What it is given it checks, once; a refused call changes
   nothing. */

#ifndef HOVERCRAFT_INSTANCE_H
#define HOVERCRAFT_INSTANCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "kernel.h"
#include "variables.h"

enum verdict { FINE, WARNED, REFUSED };

/* What the host takes it for: steps, or equations for a solver of its own. */
enum use { CO_SIMULATION, MODEL_EXCHANGE };

struct instance;

/* Where a message goes; `sink` is the face's. */
typedef void teller(void *sink, enum verdict verdict, const char *category, const char *message);

/* All that a call can change, and all that an FMU state is: no pointer in it. */
struct content {
    enum use use;                     /* as it was started; a reset keeps it */
    enum phase phase;
    double time;                      /* s, where the last step ended; in model exchange as the solver sets it */
    double stop_time;                 /* s, given with the experiment; else infinite */
    double reals[VARIABLE_COUNT];     /* what is read, by value reference */
    int32_t integers[VARIABLE_COUNT];
    double rates[INPUT_COUNT];        /* per s, of the inputs */
    double hosts_tolerance;           /* given with the experiment, it comes before the parameter; else 0 */
    struct state state;
    struct controls controls;         /* at the end of the last step, before saturation; in model exchange now */
    struct craft craft;               /* of the last step; in model exchange now */
    struct settings settings;
    double proposed;                  /* s, the next step of the adaptive method */
    double stability, rotation;       /* 1, rad: the largest of a sub-step so far */
    bool tuned;                       /* a parameter was set since the last step: the next one takes it up */
    bool motion_unread;                       /* the motion in `reals` is not yet that of the communication point */
    bool action_unread;                       /* nor is what acts on the craft */
};

struct instance {
    struct content now;
    teller *tell;
    void *sink;
    bool warnings, errors; /* the categories that are logged */
    enum verdict last_step;
};

/* What a serialized state takes. */
size_t instance_serialized_size(void);

/* Errors are told even where `logging` is off: an instance that fails without a word helps nobody. */
void instance_start(struct instance *instance, enum use use, teller *tell, void *sink, bool logging);
void instance_reset(struct instance *instance);

/* Say something, and return the verdict. For `format` see text.h. */
enum verdict instance_say(struct instance *instance, enum verdict verdict, const char *format, ...);
/* Switched on, only these categories are told; switched off, these no more. Without categories it is all of them. */
enum verdict instance_log(struct instance *instance, const char *call, bool on, size_t n,
                          const char *const *categories);
/* Refused, unless the instance is in this phase. */
enum verdict instance_require(struct instance *instance, const char *call, enum phase phase);
enum verdict instance_require_either(struct instance *instance, const char *call, enum phase one, enum phase other);
/* Refused, unless it was started for this use. */
enum verdict instance_require_use(struct instance *instance, const char *call, enum use use);
bool instance_has_started(const struct content *content);

/* `stop_time` is infinite where there is none. */
enum verdict instance_set_up(struct instance *instance, const char *call, double start_time, bool tolerance_given,
                             double tolerance, double stop_time);
enum verdict instance_initialize(struct instance *instance, const char *call);
enum verdict instance_go(struct instance *instance, const char *call);
enum verdict instance_step(struct instance *instance, const char *call, double point, double step);
enum verdict instance_terminate(struct instance *instance, const char *call);

/* Model exchange (exchange.c): from initialization it goes to event mode, from there to and fro between that and
   continuous-time mode. What is read follows states, inputs and parameters at once. Its one event is a warning. */
enum verdict instance_enter_event_mode(struct instance *instance, const char *call);
enum verdict instance_enter_continuous_time(struct instance *instance, const char *call);
enum verdict instance_new_discrete_states(struct instance *instance, const char *call);
/* An event is needed where there is something to warn of: `warnings` is discrete, so it changes in event mode alone. */
enum verdict instance_completed_integrator_step(struct instance *instance, const char *call, bool *event_needed);
enum verdict instance_set_time(struct instance *instance, const char *call, double time);
/* In the order of STATES; `values` must not be NULL, `n` must be STATE_COUNT. */
enum verdict instance_set_states(struct instance *instance, const char *call, const double *values, size_t n);
enum verdict instance_get_states(struct instance *instance, const char *call, double *values, size_t n);
enum verdict instance_get_derivatives(struct instance *instance, const char *call, double *values, size_t n);
enum verdict instance_get_nominals(struct instance *instance, const char *call, double *values, size_t n);

/* The partial derivatives, for either use, from initialization mode on, where what is read stands: in co-simulation
   with the controls of the last step. In initialization mode of what is calculated then (ROWS), with respect to inputs,
   states and real parameters; later of outputs and of the states' derivatives, with respect to states and inputs.
   Refused: an unknown or a known that is none of these, what is no finite number, accelerations of a craft at rest on
   ground that rubs. */
enum verdict instance_linearize(struct instance *instance, const char *call, const unsigned *unknowns,
                                size_t n_unknowns, const unsigned *knowns, size_t n_knowns,
                                struct linearization *linearization);
/* d(unknown)/d(known), of references that were not refused. */
double instance_partial(const struct linearization *linearization, unsigned unknown, unsigned known);
/* The sum over the knowns of seeds[k] * d(unknown)/d(known k), for each of the unknowns. */
enum verdict instance_directional_derivatives(struct instance *instance, const char *call, const unsigned *unknowns,
                                              size_t n_unknowns, const unsigned *knowns, size_t n_knowns,
                                              const double *seeds, double *values);

enum verdict instance_get_reals(struct instance *instance, const unsigned *references, size_t n, double *values);
enum verdict instance_get_integers(struct instance *instance, const unsigned *references, size_t n, int *values);
enum verdict instance_set_reals(struct instance *instance, const unsigned *references, size_t n, const double *values);
enum verdict instance_set_integers(struct instance *instance, const unsigned *references, size_t n, const int *values);
/* As 64-bit numbers. */
enum verdict instance_set_enumerations(struct instance *instance, const unsigned *references, size_t n,
                                       const int64_t *values);
/* A reference of a type that has no variables. */
enum verdict instance_no_such(struct instance *instance, const char *kind, unsigned reference);

/* First derivatives: of inputs, from the next communication point on; of outputs, at this one. */
enum verdict instance_set_rates(struct instance *instance, const unsigned *references, size_t n, const int *orders,
                                const double *values);
enum verdict instance_get_rates(struct instance *instance, const unsigned *references, size_t n, const int *orders,
                                double *values);

/* What exchange.c needs of instance.c: the inputs and the parameters as they are now, taken up where it is in use for
   model exchange; refused where the parameters contradict one another. And a word where inputs are out of limits. */
enum verdict instance_take_up(struct instance *instance);
enum verdict instance_warn_of_held_inputs(struct instance *instance, const struct controls *controls);
/* Whether that word is still to be said of the inputs as they are now. */
bool instance_has_to_warn(const struct instance *instance);

/* Take up a content as a whole. Refused: one of another use. */
enum verdict instance_restore(struct instance *instance, const struct content *content);
/* The same on every platform. Refused: less than instance_serialized_size() bytes. */
enum verdict instance_serialize(struct instance *instance, const char *call, const struct content *content,
                                unsigned char *bytes, size_t size);
/* Refused: not complete and unchanged, or of another build. */
enum verdict instance_deserialize(struct instance *instance, const unsigned char *bytes, size_t size,
                                  struct content *content);

#endif
