/* A host that is not Python: loads a co-simulation FMU of FMI 2.0 (with -DFMI=3: 3.0), steps it, prints what it gives.

   host LIBRARY TOKEN RESOURCES STEP INPUT,... OUTPUT,...      (the GUID or instantiation token; value references)
   Standard input has a line of input values for every step; a line of output values answers each. */

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FUNCTION(name) ((name##TYPE *)function(#name))

static void *function(const char *name);

#include "calls.h"

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

static void tell(int status, const char *message)
{
    (void)status;
    fprintf(stderr, "%s\n", message);
}

static void demand(int status, const char *call)
{
    if (status > CALL_WARNED) {
        fprintf(stderr, "%s: status %d\n", call, status);
        exit(3);
    }
}

static size_t references(char *text, unsigned *into)
{
    size_t n = 0;
    for (char *part = strtok(text, ","); part && n < MOST; part = strtok(NULL, ","))
        into[n++] = (unsigned)strtoul(part, NULL, 10);
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
    unsigned inputs[MOST], outputs[MOST];
    const double h = strtod(argv[4], NULL);
    const size_t n_inputs = references(argv[5], inputs), n_outputs = references(argv[6], outputs);
    call_tell = tell;
    void *craft = call_instantiate(CALL_STEPS, argv[2], argv[3]);
    if (!craft)
        return 3;
    demand(call_start(craft), "initialization");
    for (unsigned long k = 0;; k++) {
        double values[MOST];
        for (size_t i = 0; i < n_inputs; i++) {
            if (scanf("%lf", &values[i]) == 1)
                continue;
            demand(call_terminate(craft), "terminate");
            call_free(craft);
            return 0;
        }
        demand(call_set(craft, inputs, n_inputs, values), "set");
        demand(call_step(craft, (double)k * h, h), "step");
        demand(call_get(craft, outputs, n_outputs, values), "get");
        for (size_t i = 0; i < n_outputs; i++)
            printf(i + 1 < n_outputs ? "%.17g " : "%.17g\n", values[i]);
    }
}
