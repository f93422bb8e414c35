/* What the room asks of a model. The room is every native FMU: variables from a generated table, life cycle, faults,
   warnings, states, both standards; it knows no physics. A model is a table and a few functions. To add one:

   1. Its table in Python, a Model (fmu/variable.py), and beside it a Native (fmu/native_header.py): the folder of its C,
      its files, its inputs in order, a rule for each value that has one, and what of the table its own C wants to have
      by name. From both variables.h is made; what that says of a structure is asserted when it is compiled.
   2. A folder beside this one with NAME.h: `struct model`, what the model carries from step to step; no pointer in it,
      and its continuous states first, doubles in the order of STATES.
   3. NAME.c there: `model()`, the table of its functions below; NULL is what it has not, and the room refuses the calls
      that want it. A function that is refused changes nothing; it says why (instance_say).
   4. A Flavour for each standard (fmu/description.py), a line in libraries.py, a row in building/.

   Models that share functions have them in arithmetic/; what a model includes goes into the FMU, and nothing else. */

#ifndef HOVERCRAFT_MODEL_H
#define HOVERCRAFT_MODEL_H

#include "hidden.h"
#include "permits.h"
#include "variables.h"

struct instance;
struct content;
struct cursor;
struct linearization;

/* A refused call changes nothing. It is DISCARDED where the standard has that for the call and other values, another
   step or another state could be taken; else REFUSED, an error. So it is said, and a face hears of it when it leaves
   (instance_leave); within the instance both are REFUSED. */
enum verdict { FINE, WARNED, DISCARDED, REFUSED };

/* A communication step that the host asks for. */
struct interval {
    double point, end; /* s: as the host has them */
    double size;       /* s: as it is made: where the model takes it for a whole number of sub-steps, that */
    double asked;      /* s, after the point: when the host was last asked for inputs */
    unsigned errors;   /* that were said before it */
};

struct model_functions {
    /* At the start, and before it as often as something is read: the model of the variables as they are (parameters in
       `reals` and `integers`; inputs and states of `now` are those of the variables already), and what is calculated of
       parameters alone. */
    enum verdict (*take_up)(struct instance *instance);
    /* A communication step, with `now->inputs`, and the parameters where `now->tuned`. It may say a warning. */
    enum verdict (*step)(struct instance *instance, struct interval *interval);
    /* What is read of the communication point, but for states and what is on demand. */
    enum verdict (*observe)(struct instance *instance);
    /* And that, which most hosts never ask for. */
    enum verdict (*observe_on_demand)(struct instance *instance);
    /* Why a value must not be set, beyond the rule in the table; NULL where it can be. */
    const char *(*why_not)(const struct content *content, unsigned reference, double value);

    /* The model in an FMU state (cursor.h), the same for writing and reading; and whether what was read can be. */
    void (*exchange)(struct cursor *cursor, struct content *content);
    bool (*is_possible)(const struct content *content);

    /* The slope of an output at the communication point, after all was observed; false where it has none. */
    bool (*output_rate)(const double *reals, unsigned reference, double *rate);
    /* Model exchange: take up inputs and parameters as they are now; whether there is something to warn of, and do. */
    enum verdict (*follow)(struct instance *instance);
    bool (*has_to_warn)(const struct instance *instance);
    enum verdict (*warn)(struct instance *instance);
    /* Partial derivatives: instance_directional_derivatives and instance_adjoint_derivatives of partials.c, which is
       then one of its files, and d(ROWS)/d(KNOWNS) for them, where these unknowns have any. Without `parameters` the
       first KNOWN_COUNT columns are enough. */
    enum verdict (*directional)(struct instance *instance, const unsigned *unknowns, size_t n_unknowns,
                                const unsigned *knowns, size_t n_knowns, const double *seeds, double *values);
    enum verdict (*adjoint)(struct instance *instance, const unsigned *unknowns, size_t n_unknowns,
                            const unsigned *knowns, size_t n_knowns, const double *seeds, double *values);
    enum verdict (*linearize)(struct instance *instance, enum call call, const unsigned *unknowns, size_t n_unknowns,
                              bool parameters, struct linearization *linearization);

    bool asks;               /* for inputs inside a step (instance_ask) */
    bool takes_rates;        /* of inputs */
    bool discrete_is_worked_out; /* Integers and Booleans are observed; else they are always there */
};

HIDDEN const struct model_functions *model(void);

#endif
