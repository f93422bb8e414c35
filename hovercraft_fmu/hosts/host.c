/* A host that is not Python: loads an FMI 2.0 co-simulation FMU, steps it, prints what it gives.

   host LIBRARY GUID RESOURCES STEP INPUT,... OUTPUT,...      (value references)
   Standard input has a line of input values for every step; a line of output values answers each. */

#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

#define MOST 64

static void *library;

static void *function(const char *name)
{
    void *found = dlsym(library, name);
    if (!found) {
        fprintf(stderr, "%s: not in the library\n", name);
        exit(2);
    }
    return found;
}

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    va_list arguments;
    (void)environment, (void)instance, (void)status, (void)category;
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static void demand(fmi2Status status, const char *call)
{
    if (status > fmi2Warning) {
        fprintf(stderr, "%s: status %d\n", call, (int)status);
        exit(3);
    }
}

static size_t references(char *text, fmi2ValueReference *into)
{
    size_t n = 0;
    for (char *part = strtok(text, ","); part && n < MOST; part = strtok(NULL, ","))
        into[n++] = (fmi2ValueReference)strtoul(part, NULL, 10);
    return n;
}

int main(int argc, char **argv)
{
    if (argc != 7)
        return 1;
    library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 2;
    }
    fmi2InstantiateTYPE *instantiate = (fmi2InstantiateTYPE *)function("fmi2Instantiate");
    fmi2SetupExperimentTYPE *setup = (fmi2SetupExperimentTYPE *)function("fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE *enter =
        (fmi2EnterInitializationModeTYPE *)function("fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE *leave = (fmi2ExitInitializationModeTYPE *)function("fmi2ExitInitializationMode");
    fmi2SetRealTYPE *set = (fmi2SetRealTYPE *)function("fmi2SetReal");
    fmi2DoStepTYPE *step = (fmi2DoStepTYPE *)function("fmi2DoStep");
    fmi2GetRealTYPE *get = (fmi2GetRealTYPE *)function("fmi2GetReal");
    fmi2TerminateTYPE *terminate = (fmi2TerminateTYPE *)function("fmi2Terminate");
    fmi2FreeInstanceTYPE *release = (fmi2FreeInstanceTYPE *)function("fmi2FreeInstance");

    fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    fmi2ValueReference inputs[MOST], outputs[MOST];
    const double h = strtod(argv[4], NULL);
    const size_t n_inputs = references(argv[5], inputs), n_outputs = references(argv[6], outputs);

    fmi2Component craft = instantiate("craft", fmi2CoSimulation, argv[2], argv[3], &callbacks, fmi2False, fmi2True);
    if (!craft)
        return 3;
    demand(setup(craft, fmi2False, 0.0, 0.0, fmi2False, 0.0), "fmi2SetupExperiment");
    demand(enter(craft), "fmi2EnterInitializationMode");
    demand(leave(craft), "fmi2ExitInitializationMode");
    for (unsigned long k = 0;; k++) {
        double values[MOST];
        for (size_t i = 0; i < n_inputs; i++) {
            if (scanf("%lf", &values[i]) == 1)
                continue;
            demand(terminate(craft), "fmi2Terminate");
            release(craft);
            return 0;
        }
        demand(set(craft, inputs, n_inputs, values), "fmi2SetReal");
        demand(step(craft, (double)k * h, h, fmi2True), "fmi2DoStep");
        demand(get(craft, outputs, n_outputs, values), "fmi2GetReal");
        for (size_t i = 0; i < n_outputs; i++)
            printf(i + 1 < n_outputs ? "%.17g " : "%.17g\n", values[i]);
    }
}
