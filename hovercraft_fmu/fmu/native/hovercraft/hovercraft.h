/* The hovercraft behind the room (model.h): what it carries from step to step. */

#ifndef HOVERCRAFT_HOVERCRAFT_H
#define HOVERCRAFT_HOVERCRAFT_H

#include "kernel.h"

struct model {
    struct state state;
    struct controls controls;   /* at the end of the last step, before saturation; in model exchange now */
    struct craft craft;         /* of the last step; in model exchange now */
    struct settings settings;
    double proposed;            /* s, the next step of the adaptive method */
    bool estimates;             /* its own error, by a companion: */
    struct companion companion;
    double stability, rotation; /* 1, rad: the largest of a sub-step so far */
};

#endif
