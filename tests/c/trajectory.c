/* Every bit of every run of any model, on any platform: what is SEEN at all communication points, as it lies in memory.
   The runs are in runs.h; LIBRARY is the FMU's, beside the host.

   With -DBARE, and on Windows, without a C runtime: zig would build one for a minute. */

#define FUNCTION(name) ((name##TYPE *)function(#name))

static void *function(const char *name);

#include "calls.h"
#include "variables.h"

#include "runs.h" /* made of what stands in variables.h */

#ifdef _WIN32

__declspec(dllimport) void *__stdcall LoadLibraryA(const char *name);
__declspec(dllimport) void *__stdcall GetProcAddress(void *library, const char *name);
__declspec(dllimport) void *__stdcall GetStdHandle(unsigned long which);
__declspec(dllimport) int __stdcall WriteFile(void *file, const void *bytes, unsigned long n, unsigned long *written,
                                              void *overlapped);
__declspec(dllimport) void __stdcall ExitProcess(unsigned code);

int _fltused = 0;

static void *function(const char *name)
{
    static void *library = NULL;
    if (!library)
        library = LoadLibraryA(LIBRARY);
    return library ? GetProcAddress(library, name) : NULL;
}

static void print(const void *bytes, unsigned n)
{
    unsigned long written;
    WriteFile(GetStdHandle((unsigned long)-11), bytes, n, &written, NULL);
}

static void leave(int status)
{
    ExitProcess((unsigned)status);
}

#else

#include <dlfcn.h>
#include <unistd.h>

static void *function(const char *name)
{
    static void *library = NULL;
    if (!library)
        library = dlopen(LIBRARY, RTLD_NOW | RTLD_LOCAL);
    return library ? dlsym(library, name) : NULL;
}

static void print(const void *bytes, unsigned n)
{
    if (write(1, bytes, n) != (ssize_t)n)
        _exit(4);
}

#ifdef BARE
static void leave(int status)
{
    _exit(status);
}
#endif

#endif

/* Whether every call of a run was taken. */
static bool ran(const struct run *run)
{
    enum { SEEN_COUNT = sizeof SEEN / sizeof *SEEN };
    double values[SEEN_COUNT];
    void *made = call_instantiate(CALL_STEPS, VARIANT.guid, "");
    if (!made || call_set(made, run->references, run->starts, run->values) != CALL_OK ||
        (run->choice && call_choose(made, run->choice, run->item) != CALL_OK) || call_start(made) != CALL_OK)
        return false;
    for (unsigned i = 0; i < run->steps; i++) {
        const double *row = run->rows[i]; /* time, step, inputs */
        if (call_set(made, INPUTS, INPUT_COUNT, row + 2) != CALL_OK ||
            call_step(made, row[0], row[1]) > CALL_WARNED || call_get(made, SEEN, SEEN_COUNT, values) != CALL_OK)
            return false;
        print(values, sizeof values);
    }
    call_free(made);
    return true;
}

static int all_runs(void)
{
    for (unsigned i = 0; i < sizeof RUNS / sizeof *RUNS; i++)
        if (!ran(&RUNS[i]))
            return 3;
    return 0;
}

#if defined _WIN32 || defined BARE

void start(void);

void start(void)
{
    leave(all_runs());
}

#else

int main(void)
{
    return all_runs();
}

#endif
