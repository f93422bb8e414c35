/* What the fuzzer has to know of the autopilot. */

#include "fuzz_plain.h"

enum { WORKED_OUT = V_DISTANCE, A_NUMBER = V_WAYPOINT_COUNT };
