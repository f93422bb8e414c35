/* 100 000 cycles of instantiate, a step (in model exchange the time), a saved and serialized state, a refused call,
   free; prints by how many bytes the resident memory grew over the last 90 %. */

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "fmi2Functions.h"
#include "variables.h"

enum { CYCLES = 100000, MOST_BYTES = 4096 };

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    (void)environment, (void)instance, (void)status, (void)category, (void)message;
}

static long resident(void)
{
    long size, pages = -1;
    FILE *file = fopen("/proc/self/statm", "r");
    if (!file || fscanf(file, "%ld %ld", &size, &pages) != 2)
        exit(2);
    fclose(file);
    return pages * sysconf(_SC_PAGESIZE);
}

static int cycle(fmi2Type type)
{
    const int exchange = type == fmi2ModelExchange;
    static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    static char bytes[MOST_BYTES];
    fmi2FMUstate state = NULL, restored = NULL;
    size_t size = 0;
    fmi2Component craft = fmi2Instantiate("craft", type, GUID, "", &callbacks, fmi2False, fmi2True);
    int good = craft && fmi2SetupExperiment(craft, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK &&
               fmi2EnterInitializationMode(craft) == fmi2OK && fmi2ExitInitializationMode(craft) == fmi2OK &&
               (exchange ? fmi2SetTime(craft, 0.0) : fmi2DoStep(craft, 0.0, 0.001, fmi2True)) == fmi2OK &&
               fmi2DoStep(craft, 5.0, 0.1, fmi2True) == fmi2Error &&
               fmi2GetFMUstate(craft, &state) == fmi2OK &&
               fmi2SerializedFMUstateSize(craft, state, &size) == fmi2OK && size <= MOST_BYTES &&
               fmi2SerializeFMUstate(craft, state, bytes, size) == fmi2OK &&
               fmi2DeSerializeFMUstate(craft, bytes, size, &restored) == fmi2OK &&
               fmi2SetFMUstate(craft, restored) == fmi2OK && fmi2FreeFMUstate(craft, &state) == fmi2OK &&
               fmi2FreeFMUstate(craft, &restored) == fmi2OK;
    fmi2FreeInstance(craft);
    return good;
}

int main(void)
{
    long before = 0;
    for (int i = 0; i < CYCLES; i++) {
        if (i == CYCLES / 10)
            before = resident();
        if (!cycle(i % 4 ? fmi2CoSimulation : fmi2ModelExchange))
            return 1;
    }
    printf("%ld\n", resident() - before);
    return 0;
}
