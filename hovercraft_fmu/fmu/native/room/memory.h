/* Memory where the host brings none of its own. */

#ifndef HOVERCRAFT_MEMORY_H
#define HOVERCRAFT_MEMORY_H

#include <stddef.h>

#include "hidden.h"

/* As calloc and free. */
HIDDEN void *memory_allocate(size_t size);
HIDDEN void memory_release(void *memory);

#endif
