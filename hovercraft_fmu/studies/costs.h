/* What the programs that measure in C share. */

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

/* s, of a clock that only goes on. */
static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* Ends the program where something is not as it must be. */
static void demand(int good, const char *what)
{
    if (!good) {
        fprintf(stderr, "%s failed\n", what);
        exit(1);
    }
}
