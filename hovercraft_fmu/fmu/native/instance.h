/* One craft behind a co-simulation interface: variables, life cycle, faults, warnings, state. It knows no standard: a
   face (fmi2.c) translates. What it is given it checks, once; a refused call changes nothing. */

#ifndef HOVERCRAFT_INSTANCE_H
#define HOVERCRAFT_INSTANCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "kernel.h"
#include "variables.h"

enum verdict { FINE, WARNED, REFUSED };

struct instance;

/* Where a message goes; `sink` is the face's. */
typedef void teller(void *sink, enum verdict verdict, const char *message);

/* All that a call can change, and all that an FMU state is: no pointer in it. */
struct content {
    enum phase phase;
    double time;                      /* s, where the last step ended */
    double stop_time;                 /* s, given with the experiment; else infinite */
    double reals[VARIABLE_COUNT];     /* what is read, by value reference */
    int32_t integers[VARIABLE_COUNT];
    double rates[INPUT_COUNT];        /* per s, of the inputs */
    double hosts_tolerance;           /* given with the experiment, it comes before the parameter; else 0 */
    struct state state;
    struct controls controls;         /* at the end of the last step, before saturation */
    struct craft craft;               /* of the last step */
    struct settings settings;
    double proposed;                  /* s, the next step of the adaptive method */
    double stability, rotation;       /* 1, rad: the largest of a sub-step so far */
    bool tuned;                       /* a parameter was set since the last step: the next one takes it up */
    bool moved;                       /* the motion in `reals` is not yet that of the communication point */
    bool acted;                       /* nor is what acts on the craft */
};

struct instance {
    struct content now;
    teller *tell;
    void *sink;
    enum verdict last_step;
};

/* What a serialized state takes. */
size_t instance_serialized_size(void);

void instance_start(struct instance *instance, teller *tell, void *sink);
void instance_reset(struct instance *instance);

/* Say something, and return the verdict. For `format` see text.h. */
enum verdict instance_say(struct instance *instance, enum verdict verdict, const char *format, ...);
/* Refused, unless the instance is in this phase. */
enum verdict instance_require(struct instance *instance, const char *call, enum phase phase);
bool instance_started(const struct instance *instance);

/* `stop_time` is infinite where there is none. */
enum verdict instance_set_up(struct instance *instance, const char *call, double start_time, bool tolerance_given,
                             double tolerance, double stop_time);
enum verdict instance_initialize(struct instance *instance, const char *call);
enum verdict instance_go(struct instance *instance, const char *call);
enum verdict instance_step(struct instance *instance, const char *call, double point, double step);
enum verdict instance_terminate(struct instance *instance, const char *call);

enum verdict instance_get_reals(struct instance *instance, const unsigned *references, size_t n, double *values);
enum verdict instance_get_integers(struct instance *instance, const unsigned *references, size_t n, int *values);
enum verdict instance_set_reals(struct instance *instance, const unsigned *references, size_t n, const double *values);
enum verdict instance_set_integers(struct instance *instance, const unsigned *references, size_t n, const int *values);
/* A reference of a type that has no variables. */
enum verdict instance_no_such(struct instance *instance, const char *kind, unsigned reference);

/* First derivatives: of inputs, from the next communication point on; of outputs, at this one. */
enum verdict instance_set_rates(struct instance *instance, const unsigned *references, size_t n, const int *orders,
                                const double *values);
enum verdict instance_get_rates(struct instance *instance, const unsigned *references, size_t n, const int *orders,
                                double *values);

/* `bytes` has instance_serialized_size() bytes. The same on every platform. */
void instance_serialize(const struct content *content, unsigned char *bytes);
/* Refused: not complete and unchanged, or of another build. */
enum verdict instance_deserialize(struct instance *instance, const unsigned char *bytes, size_t size,
                                  struct content *content);

#endif
