/* As many cycles as the argument says of instantiate, a step (in model exchange, where the model has it, the time), a
   saved and serialized state, a refused call, free; prints by how many bytes the resident memory grew over the last
   90 %. */

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "calls.h"
#include "variables.h"

enum { MOST_BYTES = 4096 };

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
    void *state = NULL, *restored = NULL, *made = call_instantiate(use, VARIANT.guid, "");
    size_t size = 0;
    int good = made && call_start(made) == CALL_OK &&
               (use == CALL_EXCHANGE ? call_set_time(made, 0.0) : call_step(made, 0.0, 0.001)) == CALL_OK &&
               call_step(made, 5.0, 0.1) == CALL_REFUSED && call_save(made, &state) == CALL_OK &&
               call_size(made, state, &size) == CALL_OK && size <= MOST_BYTES &&
               call_serialize(made, state, bytes, size) == CALL_OK &&
               call_deserialize(made, bytes, size, &restored) == CALL_OK &&
               call_restore(made, restored) == CALL_OK && call_forget(made, &state) == CALL_OK &&
               call_forget(made, &restored) == CALL_OK;
    call_free(made);
    return good;
}

int main(int argc, char **argv)
{
    const int cycles = argc == 2 ? atoi(argv[1]) : 0;
    long before = 0;
    for (int i = 0; i < cycles; i++) {
        if (i == cycles / 10)
            before = resident();
        if (!cycle(i % 4 || STATE_COUNT == 0 ? CALL_STEPS : CALL_EXCHANGE))
            return 1;
    }
    printf("%ld\n", resident() - before);
    return 0;
}
