/* The closed loop of two native FMUs, side by side, in a process that has nothing else; of FMI 2.0 or, with -DFMI=3,
   of FMI 3.0: loop CRAFT.so GUID AUTOPILOT.so GUID STEP COUNT. Prints the craft's states after the last step, and fails
   where the process came to have Python in it. */

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FUNCTION(name) ((name##TYPE *)function(#name))

static void *function(const char *name);

#include "calls.h"

enum { STATES = 6, COMMANDS = 3 };
static const unsigned STATES_OF_CRAFT[] = {3, 4, 5, 6, 7, 8}, INPUTS_OF_CRAFT[] = {0, 1, 2};
static const unsigned INPUTS_OF_PILOT[] = {0, 1, 2, 3, 4, 5}, COMMANDS_OF_PILOT[] = {6, 7, 8};

struct part {
    void *library;
    void *instance;
};

/* Whose functions are called. */
static void *current;

static void demand(int good, const char *what)
{
    if (!good) {
        fprintf(stderr, "loop: %s\n", what);
        exit(2);
    }
}

static void *function(const char *name)
{
    void *found = dlsym(current, name);
    demand(found != NULL, name);
    return found;
}

static void *turn_to(struct part part)
{
    current = part.library;
    return part.instance;
}

static struct part part_of(const char *path, const char *guid, const unsigned *inputs, const double *values)
{
    struct part part = {dlopen(path, RTLD_NOW | RTLD_LOCAL), NULL};
    demand(part.library != NULL, path);
    turn_to(part);
    part.instance = call_instantiate(CALL_STEPS, guid, "");
    demand(part.instance != NULL, "instantiation");
    demand(call_set(part.instance, inputs, STATES, values) == CALL_OK, "start values");
    demand(call_start(part.instance) == CALL_OK, "initialization");
    return part;
}

static void get(struct part part, const unsigned *references, size_t n, double *values)
{
    demand(call_get(turn_to(part), references, n, values) == CALL_OK, "outputs");
}

static void set(struct part part, const unsigned *references, size_t n, const double *values)
{
    demand(call_set(turn_to(part), references, n, values) == CALL_OK, "inputs");
}

static void demand_no_python(void)
{
    static char line[4096];
    FILE *maps = fopen("/proc/self/maps", "r");
    demand(maps != NULL, "/proc/self/maps");
    while (fgets(line, sizeof line, maps))
        demand(!strstr(line, "python"), line);
    fclose(maps);
}

int main(int argc, char **argv)
{
    double states[STATES] = {0}, commands[COMMANDS];
    demand(argc == 7, "CRAFT.so GUID AUTOPILOT.so GUID STEP COUNT");
    const double step = atof(argv[5]);
    const int count = atoi(argv[6]);
    const struct part craft = part_of(argv[1], argv[2], STATES_OF_CRAFT, states);
    const struct part pilot = part_of(argv[3], argv[4], INPUTS_OF_PILOT, states);
    for (int k = 0; k < count; k++) {
        get(craft, STATES_OF_CRAFT, STATES, states);
        get(pilot, COMMANDS_OF_PILOT, COMMANDS, commands);
        set(craft, INPUTS_OF_CRAFT, COMMANDS, commands);
        set(pilot, INPUTS_OF_PILOT, STATES, states);
        demand(call_step(turn_to(craft), k * step, step) == CALL_OK, "a step of the craft");
        demand(call_step(turn_to(pilot), k * step, step) <= CALL_WARNED, "a step of the autopilot");
    }
    get(craft, STATES_OF_CRAFT, STATES, states);
    demand_no_python();
    for (int i = 0; i < STATES; i++)
        printf("%.17g ", states[i]);
    printf("\n");
    return 0;
}
