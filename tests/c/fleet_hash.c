/* A hash of every bit of 600 wild starts with each method and each term, on any platform; "method term hash". With
   -DBARE, and on Windows, without a C runtime: zig would build one, which takes longer than all the rest. */

#include "checksum.h"
#include "fleet.c"

#ifdef _WIN32
__declspec(dllimport) void *__stdcall GetStdHandle(unsigned long which);
__declspec(dllimport) int __stdcall WriteFile(void *file, const void *bytes, unsigned long n, unsigned long *written,
                                              void *overlapped);
__declspec(dllimport) void __stdcall ExitProcess(unsigned code);

static void print(const char *text, unsigned n)
{
    unsigned long written;
    WriteFile(GetStdHandle((unsigned long)-11), text, n, &written, NULL);
}
#else
#include <unistd.h>

static void print(const char *text, unsigned n)
{
    (void)!write(1, text, n);
}
#endif

enum { COUNT = 600, KINDS = 6 };

static double states[FLEET_STATES][COUNT], controls[FLEET_CONTROLS][COUNT], constants[FLEET_CONSTANTS][COUNT];
static double ends[FLEET_STATES][COUNT], reals[5][COUNT];
static int64_t counts[COUNT];
static int32_t whys[COUNT], parts[COUNT];
static uint64_t dice = 88172645463325252u;

/* From 0 to 1. */
static double drawn(void)
{
    dice ^= dice << 13;
    dice ^= dice >> 7;
    dice ^= dice << 17;
    return (double)(dice >> 11) * 0x1p-53;
}

/* Of either sign, over some powers of two. */
static double sized(int least, int most)
{
    double size = drawn() - 0.5;
    for (int power = least + (int)(drawn() * (most - least)); power != 0; power += power < 0 ? 1 : -1)
        size *= power < 0 ? 0.5 : 2.0;
    return size;
}

static void draw(int term)
{
    static const double craft[FLEET_CONSTANTS] = {100, 500, 20, 10, 5, 1.25, 1.225, -0.25, 3, 0, 10, 1, 0, 9.80665, 0};
    for (int i = 0; i < COUNT; i++) {
        static const int most[FLEET_STATES] = {10, 10, 24, 8, 8, 4};
        for (int k = 0; k < FLEET_STATES; k++)
            states[k][i] = sized(-10, most[k]);
        for (int k = 0; k < 3; k++)
            controls[k][i] = drawn() * (k == 0 ? 12.0 : 1.2);
        for (int k = 3; k < FLEET_CONTROLS; k++)
            controls[k][i] = term == 1 ? sized(-4, 2) : 0.0;
        for (int k = 0; k < FLEET_CONSTANTS; k++)
            constants[k][i] = craft[k] * (k < 5 ? 0.5 + drawn() : 1.0);
        constants[11][i] = term == 2 ? 2.0 : 1.0;
        constants[12][i] = term == 3 ? 0.01 * drawn() : 0.0;
        constants[14][i] = term == 4 ? drawn() : 0.0;
        constants[5][i] = term == 5 ? 0.0 : 1.25;
    }
}

static uint64_t hash_of(int method, const double *slopes)
{
    static const double step = 0.3, size = 0.01, tolerance = 1e-6, nothing = 0.0;
    struct fleet fleet = {.count = COUNT};
    const struct way way = {{&step, 0}, {&size, 0}, {&tolerance, 0}, {&nothing, 0}, method};
    struct reached reached = {.substeps = counts, .stability = reals[0], .rotation = reals[1], .proposed = reals[2],
                              .why = whys, .part = parts, .value = reals[3], .substep = reals[4]};
    for (int k = 0; k < FLEET_STATES; k++) {
        fleet.states[k] = (struct column){states[k], 1};
        reached.states[k] = ends[k];
    }
    for (int k = 0; k < FLEET_CONTROLS; k++) {
        fleet.controls[k] = (struct column){controls[k], 1};
        fleet.slopes[k] = (struct column){&slopes[k], 0};
    }
    for (int k = 0; k < FLEET_CONSTANTS; k++)
        fleet.constants[k] = (struct column){constants[k], 1};
    const int64_t refused = fleet_advance(&fleet, &way, &reached);
    uint64_t hash = checksum(CHECKSUM_OF_NOTHING, &refused, sizeof refused);
    hash = checksum(hash, ends, sizeof ends);
    hash = checksum(hash, reals[0], 3 * sizeof reals[0]);
    return checksum(checksum(hash, counts, sizeof counts), whys, sizeof whys);
}

static void all(void)
{
    for (int term = 0; term < KINDS; term++) {
        static const double slopes[2][FLEET_CONTROLS] = {{0.0}, {1.0, 0.1, -0.1, 0.0, 0.0}};
        draw(term);
        for (int method = SEMI_IMPLICIT_EULER; method <= SPLITTING; method++)
            for (int ramped = 0; ramped < 2; ramped++) {
                uint64_t hash = hash_of(method, slopes[ramped]);
                char line[24] = {(char)('0' + term), (char)('0' + method), (char)('0' + ramped), ' '};
                for (int digit = 0; digit < 16; digit++, hash <<= 4)
                    line[4 + digit] = "0123456789abcdef"[hash >> 60];
                line[20] = '\n';
                print(line, 21);
            }
    }
}

#if defined _WIN32 || defined BARE
void start(void);

#ifdef __x86_64__
__attribute__((force_align_arg_pointer)) /* nobody called it, so nobody aligned the stack as a call does */
#endif
void start(void)
{
    all();
#ifdef _WIN32
    ExitProcess(0);
#else
    _exit(0);
#endif
}
#else
int main(void)
{
    all();
    return 0;
}
#endif
