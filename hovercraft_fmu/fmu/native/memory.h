/* Memory where the host brings none of its own. */

#ifndef HOVERCRAFT_MEMORY_H
#define HOVERCRAFT_MEMORY_H

#include <stddef.h>

/* As calloc and free. */
void *memory_allocate(size_t count, size_t size);
void memory_release(void *memory);

#endif
