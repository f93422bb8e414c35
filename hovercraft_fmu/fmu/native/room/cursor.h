/* Words that go into an FMU state, or come out of it. */

#ifndef HOVERCRAFT_CURSOR_H
#define HOVERCRAFT_CURSOR_H

#include <stddef.h>
#include <stdint.h>

#include "hidden.h"

struct cursor;

HIDDEN void exchange_double(struct cursor *cursor, double *value);
HIDDEN void exchange_integer(struct cursor *cursor, int32_t *value);
/* Of a structure that is doubles alone. */
HIDDEN void exchange_doubles(struct cursor *cursor, void *first, size_t bytes);

#endif
