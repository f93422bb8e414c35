/* FNV-1a, 64 bits: no change of a single byte escapes it. */

#ifndef HOVERCRAFT_CHECKSUM_H
#define HOVERCRAFT_CHECKSUM_H

#include <stddef.h>
#include <stdint.h>

#define CHECKSUM_OF_NOTHING UINT64_C(0xcbf29ce484222325)

/* Of what `sum` is of, and these bytes behind it. */
static inline uint64_t checksum(uint64_t sum, const void *bytes, size_t n)
{
    const unsigned char *each = bytes;
    for (size_t i = 0; i < n; i++)
        sum = (sum ^ each[i]) * UINT64_C(0x100000001b3);
    return sum;
}

#endif
