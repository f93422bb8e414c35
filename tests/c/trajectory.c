/* A hash of every bit of every run, on any platform: each scene with each method, all outputs at all communication
   points. The runs are in runs.h, made from the scenes; LIBRARY is the FMU's, beside the host.

   On Windows without a C runtime: zig would build one for a minute. */

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

static void print(const char *text, unsigned n)
{
    unsigned long written;
    WriteFile(GetStdHandle((unsigned long)-11), text, n, &written, NULL);
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

static void print(const char *text, unsigned n)
{
    if (write(1, text, n) != (ssize_t)n)
        _exit(4);
}

#endif

static unsigned long long hash_of(unsigned long long hash, const double *values, size_t n)
{
    const unsigned char *bytes = (const unsigned char *)values;
    for (size_t i = 0; i < n * sizeof *values; i++) /* all of these platforms are little-endian */
        hash = (hash ^ bytes[i]) * 0x100000001b3ULL;
    return hash;
}

static void print_line(const char *name, unsigned long long hash)
{
    char line[120];
    unsigned n = 0;
    while (name[n] && n < 100) {
        line[n] = name[n];
        n++;
    }
    line[n++] = ' ';
    for (int shift = 60; shift >= 0; shift -= 4)
        line[n++] = "0123456789abcdef"[hash >> shift & 15];
    line[n++] = '\n';
    print(line, n);
}

/* The hash of one run, or 0 where a call failed. */
static unsigned long long hash_of_run(const struct run *run)
{
    static const unsigned outputs[] = {V_POSE_X,     V_POSE_Y,     V_POSE_HEADING,      V_VELOCITY_X, V_VELOCITY_Y,
                                       V_VELOCITY_YAW_RATE,        V_BODY_SURGE,        V_BODY_SWAY,  V_SPEED,
                                       V_FORCE_X,    V_FORCE_Y,    V_MOMENT,            V_STABILITY_NUMBER};
    enum { OUTPUTS = sizeof outputs / sizeof *outputs };
    double values[OUTPUTS];
    unsigned long long hash = 0xcbf29ce484222325ULL;
    void *craft = call_instantiate(CALL_STEPS, VARIANT.guid, "");
    if (!craft || call_set(craft, run->references, run->starts, run->values) != CALL_OK ||
        call_choose(craft, V_INTEGRATOR, run->method) != CALL_OK || call_start(craft) != CALL_OK)
        return 0;
    for (unsigned i = 0; i < run->steps; i++) {
        const double *row = run->rows[i]; /* time, step, controls */
        if (call_set(craft, INPUTS, INPUT_COUNT, row + 2) != CALL_OK ||
            call_step(craft, row[0], row[1]) > CALL_WARNED || call_get(craft, outputs, OUTPUTS, values) != CALL_OK)
            return 0;
        hash = hash_of(hash, values, OUTPUTS);
    }
    call_free(craft);
    return hash;
}

static int all_runs(void)
{
    for (unsigned i = 0; i < sizeof RUNS / sizeof *RUNS; i++) {
        const unsigned long long hash = hash_of_run(&RUNS[i]);
        if (!hash)
            return 3;
        print_line(RUNS[i].name, hash);
    }
    return 0;
}

#ifdef _WIN32

void start(void);

void start(void)
{
    ExitProcess((unsigned)all_runs());
}

#else

int main(void)
{
    return all_runs();
}

#endif
