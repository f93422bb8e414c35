/* What the fuzzer has to know of the tether: it has no integers. */

#include "fuzz_plain.h"

enum { WORKED_OUT = V_DISTANCE, A_NUMBER = V_STIFFNESS };
