/* The closed loop of two native FMUs of FMI 2.0, side by side, in a process that has nothing else:
   loop CRAFT.so GUID AUTOPILOT.so GUID STEP COUNT. Prints the craft's states and the commands after the last step, and
   fails where the process came to have Python in it. */

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

enum { STATES = 6, COMMANDS = 3 };
static const fmi2ValueReference STATES_OF_CRAFT[] = {3, 4, 5, 6, 7, 8}, INPUTS_OF_CRAFT[] = {0, 1, 2};
static const fmi2ValueReference INPUTS_OF_PILOT[] = {0, 1, 2, 3, 4, 5}, COMMANDS_OF_PILOT[] = {6, 7, 8};

struct part {
    fmi2Component component;
    fmi2SetRealTYPE *set;
    fmi2GetRealTYPE *get;
    fmi2DoStepTYPE *step;
};

static void *function(void *library, const char *name)
{
    void *found = dlsym(library, name);
    if (!found) {
        fprintf(stderr, "loop: no %s\n", name);
        exit(2);
    }
    return found;
}

static void demand(int good, const char *what)
{
    if (!good) {
        fprintf(stderr, "loop: %s\n", what);
        exit(2);
    }
}

static struct part part_of(const char *path, const char *guid, const fmi2ValueReference *inputs, const double *values,
                           size_t n)
{
    static const fmi2CallbackFunctions none = {NULL, NULL, NULL, NULL, NULL};
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    demand(library != NULL, path);
    fmi2InstantiateTYPE *instantiate = (fmi2InstantiateTYPE *)function(library, "fmi2Instantiate");
    fmi2SetupExperimentTYPE *set_up = (fmi2SetupExperimentTYPE *)function(library, "fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE *enter =
        (fmi2EnterInitializationModeTYPE *)function(library, "fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE *leave =
        (fmi2ExitInitializationModeTYPE *)function(library, "fmi2ExitInitializationMode");
    struct part part = {instantiate("part", fmi2CoSimulation, guid, "", &none, fmi2False, fmi2False),
                        (fmi2SetRealTYPE *)function(library, "fmi2SetReal"),
                        (fmi2GetRealTYPE *)function(library, "fmi2GetReal"),
                        (fmi2DoStepTYPE *)function(library, "fmi2DoStep")};
    demand(part.component && set_up(part.component, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK, "instantiation");
    demand(enter(part.component) == fmi2OK && part.set(part.component, inputs, n, values) == fmi2OK &&
               leave(part.component) == fmi2OK,
           "initialization");
    return part;
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
    const struct part craft = part_of(argv[1], argv[2], STATES_OF_CRAFT, states, STATES);
    const struct part pilot = part_of(argv[3], argv[4], INPUTS_OF_PILOT, states, STATES);
    for (int k = 0; k < count; k++) {
        demand(craft.get(craft.component, STATES_OF_CRAFT, STATES, states) == fmi2OK &&
                   pilot.get(pilot.component, COMMANDS_OF_PILOT, COMMANDS, commands) == fmi2OK &&
                   craft.set(craft.component, INPUTS_OF_CRAFT, COMMANDS, commands) == fmi2OK &&
                   pilot.set(pilot.component, INPUTS_OF_PILOT, STATES, states) == fmi2OK &&
                   craft.step(craft.component, k * step, step, fmi2True) == fmi2OK &&
                   pilot.step(pilot.component, k * step, step, fmi2True) <= fmi2Warning,
               "a step");
    }
    demand(craft.get(craft.component, STATES_OF_CRAFT, STATES, states) == fmi2OK, "states");
    demand_no_python();
    for (int i = 0; i < STATES; i++)
        printf("%.17g ", states[i]);
    printf("\n");
    return 0;
}
