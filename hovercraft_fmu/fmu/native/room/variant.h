/* Which FMU of this code it is: its build, GUID and start values. They are data that stand in one place, so that a
   variant of the FMU can be made without a compiler. */

#ifndef HOVERCRAFT_VARIANT_H
#define HOVERCRAFT_VARIANT_H

#include "instance.h"

/* The compiler knows nothing of what is in it: what stands in the library counts, not what stood in the sources. */
HIDDEN const struct variant *variant(void);
/* Refused, with a word: a block that is not whole, not of this code, or has start values that cannot be. The instance
   must be in state 'instantiated'. */
HIDDEN enum verdict variant_check(struct instance *instance);

#endif
