/* Partial derivatives, for either use, from initialization mode on, where what is read stands, with the inputs and the
   parameters that are set: in step mode those of the step to come. In initialization mode of what is calculated then
   (ROWS), with respect to inputs, states and real parameters; later of outputs and of the states' derivatives, with
   respect to states and inputs. Refused: an unknown or a known that is none of these, and what is no finite number. */

#ifndef HOVERCRAFT_PARTIALS_H
#define HOVERCRAFT_PARTIALS_H

#include "instance.h"

/* d(ROWS)/d(KNOWNS). */
struct linearization {
    double of[ROW_COUNT][INITIAL_KNOWN_COUNT];
};

/* A value for each unknown: the sum over the knowns of seed * d(unknown)/d(known); for each known, over the unknowns. */
DOOR enum verdict instance_directional_derivatives(struct instance *instance, const unsigned *unknowns,
                                                   size_t n_unknowns, const unsigned *knowns, size_t n_knowns,
                                                   const double *seeds, double *values);
DOOR enum verdict instance_adjoint_derivatives(struct instance *instance, const unsigned *unknowns, size_t n_unknowns,
                                               const unsigned *knowns, size_t n_knowns, const double *seeds,
                                               double *values);

#endif
