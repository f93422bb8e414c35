/* libFuzzer over the fleet's entry: any numbers, any number of craft, missing arrays. A craft has the same bits alone; one
   that is refused stays where it is. */

#include <stdlib.h>

#include "fleet.c"

enum { MANY = 19, CRAFT = FLEET_STATES + 2 * FLEET_CONTROLS, COLUMNS = CRAFT + FLEET_CONSTANTS + 4 };

static double given[COLUMNS][MANY];

static struct column column_of(int k, int64_t first, int strides)
{
    return (struct column){&given[k][strides >> k % 31 & 1 ? first : 0], strides >> k % 31 & 1};
}

static int64_t advanced(int64_t first, int64_t count, int strides, int method, int missing, double ends[FLEET_STATES][MANY],
                        int32_t *why)
{
    static double reals[5][MANY];
    static int64_t counts[MANY];
    static int32_t parts[MANY];
    struct fleet fleet = {.count = count};
    struct way way = {.integrator = method};
    struct reached reached = {.substeps = counts, .stability = reals[0], .rotation = reals[1], .proposed = reals[2],
                              .why = why, .part = parts, .value = reals[3], .substep = reals[4]};
    int k = 0;
    for (int i = 0; i < FLEET_STATES; i++) {
        fleet.states[i] = column_of(k++, first, strides);
        reached.states[i] = ends[i];
    }
    for (int i = 0; i < FLEET_CONTROLS; i++)
        fleet.controls[i] = column_of(k++, first, strides);
    for (int i = 0; i < FLEET_CONTROLS; i++)
        fleet.slopes[i] = column_of(k++, first, strides);
    for (int i = 0; i < FLEET_CONSTANTS; i++)
        fleet.constants[i] = column_of(k++, first, strides);
    way.communication_step = column_of(k++, first, strides);
    way.step_size = column_of(k++, first, strides);
    way.tolerance = column_of(k++, first, strides);
    way.proposed = column_of(k++, first, strides);
    if (missing == 1)
        fleet.states[2].values = NULL;
    if (missing == 2)
        fleet.constants[14].values = NULL;
    if (missing == 3)
        reached.states[5] = NULL;
    if (missing == 4)
        way.proposed.values = NULL;
    const bool no_method = method < SEMI_IMPLICIT_EULER || method > SPLITTING;
    const int64_t refused =
        fleet_advance(missing == 5 ? NULL : &fleet, missing == 6 ? NULL : &way, missing == 7 ? NULL : &reached);
    if ((refused < 0) != (no_method || missing || count < 0))
        abort();
    return refused;
}

/* So that it ends: at most a thousand sub-steps. */
static void bound(int method)
{
    double *steps = given[COLUMNS - 4], *sizes = given[COLUMNS - 3];
    for (int i = 0; i < MANY; i++)
        for (int j = 0; j < MANY; j++)
            if (method == ADAPTIVE ? steps[i] > 1e-9 : steps[i] > 1e3 * sizes[j] && steps[i] <= 2e9 * sizes[j])
                steps[i] = method == ADAPTIVE ? 1e-9 : 1e3 * sizes[j];
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const double usual[COLUMNS] = {
        [2] = 1.0, [3] = 0.3, [6] = 5.0, [CRAFT] = 100.0, [CRAFT + 1] = 500.0, [CRAFT + 2] = 20.0, [CRAFT + 3] = 10.0,
        [CRAFT + 4] = 5.0, [CRAFT + 5] = 1.25, [CRAFT + 6] = 1.225, [CRAFT + 7] = -.25, [CRAFT + 8] = 3.0,
        [CRAFT + 10] = 10.0, [CRAFT + 11] = 1.0, [CRAFT + 13] = 9.8, [COLUMNS - 4] = 0.3, [COLUMNS - 3] = 0.01,
        [COLUMNS - 2] = 1e-6};
    static double ends[FLEET_STATES][MANY], alone[FLEET_STATES][MANY];
    static int32_t why[MANY], own[MANY];
    int strides;
    if (size < 8)
        return 0;
    const int64_t count = data[0] % (MANY + 2) - 1;
    const int method = data[1] % 7, missing = data[2] % 16 < 8 ? 0 : data[2] % 8;
    memcpy(&strides, data + 3, sizeof strides);
    for (int k = 0; k < COLUMNS; k++)
        for (int i = 0; i < MANY; i++)
            given[k][i] = usual[k];
    for (size_t at = 8; at + 10 <= size; at += 10)
        memcpy(&given[data[at] % COLUMNS][data[at + 1] % MANY], data + at + 2, sizeof(double));
    bound(method);
    if (advanced(0, count, strides, method, missing, ends, why) < 0)
        return 0;
    for (int64_t i = 0; i < count; i++) {
        advanced(i, 1, strides, method, 0, alone, own);
        if (own[0] != why[i])
            abort();
        for (int k = 0; k < FLEET_STATES; k++) {
            const double *before = column_of(k, i, strides).values;
            if (memcmp(&alone[k][0], &ends[k][i], sizeof(double)) || (why[i] && memcmp(before, &ends[k][i], sizeof(double))))
                abort();
        }
    }
    return 0;
}
