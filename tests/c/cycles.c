/* 100 000 cycles of instantiate, a step (in model exchange the time), a saved and serialized state, a refused call,
   free; prints by how many bytes the resident memory grew over the last 90 %. */

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "calls.h"
#include "variables.h"

enum { CYCLES = 100000, MOST_BYTES = 4096 };

static long resident(void)
{
    long size, pages = -1;
    FILE *file = fopen("/proc/self/statm", "r");
    if (!file || fscanf(file, "%ld %ld", &size, &pages) != 2)
        exit(2);
    fclose(file);
    return pages * sysconf(_SC_PAGESIZE);
}

static int cycle(enum call_use use)
{
    static char bytes[MOST_BYTES];
    void *state = NULL, *restored = NULL, *craft = call_instantiate(use, VARIANT.guid, "");
    size_t size = 0;
    int good = craft && call_start(craft) == CALL_OK &&
               (use == CALL_EXCHANGE ? call_set_time(craft, 0.0) : call_step(craft, 0.0, 0.001)) == CALL_OK &&
               call_step(craft, 5.0, 0.1) == CALL_REFUSED && call_save(craft, &state) == CALL_OK &&
               call_size(craft, state, &size) == CALL_OK && size <= MOST_BYTES &&
               call_serialize(craft, state, bytes, size) == CALL_OK &&
               call_deserialize(craft, bytes, size, &restored) == CALL_OK &&
               call_restore(craft, restored) == CALL_OK && call_forget(craft, &state) == CALL_OK &&
               call_forget(craft, &restored) == CALL_OK;
    call_free(craft);
    return good;
}

int main(void)
{
    long before = 0;
    for (int i = 0; i < CYCLES; i++) {
        if (i == CYCLES / 10)
            before = resident();
        if (!cycle(i % 4 ? CALL_STEPS : CALL_EXCHANGE))
            return 1;
    }
    printf("%ld\n", resident() - before);
    return 0;
}
