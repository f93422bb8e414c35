/* The autopilot behind the room (model.h): what it carries from step to step. */

#ifndef HOVERCRAFT_AUTOPILOT_H
#define HOVERCRAFT_AUTOPILOT_H

#include "guidance.h"

enum { COURSE_MAX = 32 };

struct model {
    struct pilot pilot;
    struct waypoint points[COURSE_MAX]; /* as the last step had them, as the next two */
    int32_t count;
    struct orders orders;
    struct commands commands;           /* what was sampled last: read until the next step */
    struct sight sight;
};

#endif
