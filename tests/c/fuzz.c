/* Any bytes as a sequence of FMI calls with any arguments, on a few instances: libFuzzer calls LLVMFuzzerTestOneInput.

   Beside what the sanitizers see it demands that only the statuses of the standard that this FMU has come back, that a
   refused call changes nothing, and that what is read is finite. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "variables.h"

enum { INSTANCES = 2, SLOTS = 4, MOST = 5, BLOB = 1024, CALLS = 28 };
static const double FEW_SUBSTEPS = 2000.0, TOO_MANY = 2e9; /* between them a step would only take long */

struct bytes {
    const uint8_t *at;
    size_t left;
};

struct world {
    fmi2Component craft[INSTANCES];
    fmi2FMUstate saved[SLOTS];
    char blob[BLOB];
    size_t blob_size;
    int forged; /* a state with a right checksum and any content was made: then numbers need not be finite */
};

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void demand(int good, const char *what)
{
    if (!good) {
        fprintf(stderr, "fuzz: %s\n", what);
        abort();
    }
}

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    (void)environment, (void)instance, (void)category;
    demand(status == fmi2Warning || status == fmi2Error, "a message of another status");
    demand(strlen(message) > 0 && !strchr(message, '%'), "a message that is empty, or a format");
}

static void take(struct bytes *bytes, void *into, size_t size)
{
    const size_t n = size < bytes->left ? size : bytes->left;
    memset(into, 0, size);
    if (n > 0)
        memcpy(into, bytes->at, n);
    bytes->at += n;
    bytes->left -= n;
}

static unsigned a_byte(struct bytes *bytes)
{
    uint8_t value;
    take(bytes, &value, 1);
    return value;
}

static double a_double(struct bytes *bytes)
{
    static const double usual[] = {0.0,  -0.0, 1.0,   -1.0, 5.0,  10.0,     0.1,       0.001,     1e-9,   0.5,
                                   -0.5, 1e6,  -1e12, 1e30, 1e300, INFINITY, -INFINITY, NAN, 5e-324, 1.7e308};
    const unsigned kind = a_byte(bytes);
    double value;
    if (kind < 160)
        return usual[kind % (sizeof usual / sizeof *usual)];
    if (kind < 220)
        return ((double)a_byte(bytes) - 64.0) / 16.0;
    take(bytes, &value, sizeof value);
    return value;
}

static unsigned a_reference(struct bytes *bytes)
{
    const unsigned kind = a_byte(bytes);
    unsigned value;
    if (kind < 250)
        return kind % (VARIABLE_COUNT + 2);
    take(bytes, &value, sizeof value);
    return value;
}

static int an_integer(struct bytes *bytes)
{
    const unsigned kind = a_byte(bytes);
    int value;
    if (kind < 230)
        return (int)(kind % 7);
    take(bytes, &value, sizeof value);
    return value;
}

static fmi2Component made(struct bytes *bytes)
{
    static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    const unsigned how = a_byte(bytes);
    char guid[16];
    take(bytes, guid, sizeof guid - 1);
    guid[sizeof guid - 1] = '\0';
    const fmi2Type type = how & 64 ? fmi2ModelExchange : how == 15 ? (fmi2Type)2 : fmi2CoSimulation;
    fmi2Component craft = fmi2Instantiate(how & 1 ? "craft" : NULL, type,
                                          how % 32 == 30 ? guid : how % 32 == 28 ? NULL : GUID, NULL,
                                          how & 2 ? &callbacks : NULL, fmi2False, how & 4 ? fmi2True : fmi2False);
    if (craft && how & 128) { /* half of them are past their start already */
        demand(fmi2EnterInitializationMode(craft) == fmi2OK && fmi2ExitInitializationMode(craft) == fmi2OK,
               "initialization");
        demand(type == fmi2CoSimulation || fmi2EnterContinuousTimeMode(craft) == fmi2OK, "continuous-time mode");
    }
    return craft;
}

static double real_of(fmi2Component craft, unsigned reference)
{
    double value = NAN;
    return fmi2GetReal(craft, &reference, 1, &value) == fmi2OK ? value : NAN;
}

static int integer_of(fmi2Component craft, unsigned reference)
{
    int value = 0;
    fmi2GetInteger(craft, &reference, 1, &value);
    return value;
}

/* A step that does not take long. */
static fmi2Status step(fmi2Component craft, struct bytes *bytes)
{
    double point = 0.0, size = a_double(bytes);
    if (a_byte(bytes) < 240)
        fmi2GetRealStatus(craft, fmi2LastSuccessfulTime, &point);
    else
        point = a_double(bytes);
    if (integer_of(craft, V_INTEGRATOR) == ADAPTIVE) {
        const double turn = real_of(craft, V_VELOCITY_YAW_RATE);
        if (size > 1e-4)
            size = 1e-4 / (1.0 + (isfinite(turn) ? fabs(turn) : 0.0));
        return fmi2DoStep(craft, point, size, fmi2True);
    }
    const double n = size / real_of(craft, V_STEP_SIZE);
    return n <= FEW_SUBSTEPS || n >= TOO_MANY ? fmi2DoStep(craft, point, size, fmi2True) : fmi2OK;
}

static fmi2Status reals(fmi2Component craft, struct bytes *bytes, const struct world *world)
{
    const unsigned how = a_byte(bytes);
    const size_t n = how % MOST;
    unsigned references[MOST];
    double values[MOST] = {0};
    for (size_t i = 0; i < n; i++) {
        references[i] = a_reference(bytes);
        values[i] = a_double(bytes);
    }
    if (how & 128)
        return fmi2SetReal(craft, how == 255 ? NULL : references, n, values);
    const fmi2Status status = fmi2GetReal(craft, references, n, how == 127 ? NULL : values);
    for (size_t i = 0; i < n && status == fmi2OK; i++)
        demand(world->forged || isfinite(values[i]), "a number is not finite");
    return status;
}

static fmi2Status integers(fmi2Component craft, struct bytes *bytes)
{
    const unsigned how = a_byte(bytes);
    const size_t n = how % MOST;
    unsigned references[MOST];
    int values[MOST] = {0};
    for (size_t i = 0; i < n; i++) {
        references[i] = a_byte(bytes) & 1 ? V_INTEGRATOR : a_reference(bytes);
        values[i] = an_integer(bytes);
    }
    return how & 128 ? fmi2SetInteger(craft, references, n, how == 255 ? NULL : values)
                     : fmi2GetInteger(craft, how == 127 ? NULL : references, n, values);
}

static fmi2Status derivatives(fmi2Component craft, struct bytes *bytes, const struct world *world)
{
    const unsigned how = a_byte(bytes);
    const size_t n = how % MOST;
    unsigned references[MOST];
    int orders[MOST];
    double values[MOST];
    for (size_t i = 0; i < n; i++) {
        references[i] = a_byte(bytes) & 1 ? a_reference(bytes) % 12 : a_reference(bytes);
        orders[i] = a_byte(bytes) < 240 ? 1 : an_integer(bytes);
        values[i] = a_double(bytes);
    }
    if (how & 128)
        return fmi2SetRealInputDerivatives(craft, references, n, orders, how == 255 ? NULL : values);
    const fmi2Status status = fmi2GetRealOutputDerivatives(craft, references, n, how == 127 ? NULL : orders, values);
    for (size_t i = 0; i < n && status == fmi2OK; i++)
        demand(world->forged || isfinite(values[i]), "a derivative is not finite");
    return status;
}

static fmi2Status partial_derivatives(fmi2Component craft, struct bytes *bytes, const struct world *world)
{
    const unsigned how = a_byte(bytes);
    const size_t n = how % MOST, m = how / MOST % MOST;
    unsigned unknowns[MOST], knowns[MOST];
    double seeds[MOST], values[MOST];
    for (size_t i = 0; i < MOST; i++) {
        unknowns[i] = a_byte(bytes) & 7 ? V_POSE_X + a_byte(bytes) % 16 : a_reference(bytes);
        knowns[i] = a_byte(bytes) & 7 ? a_byte(bytes) % V_BODY_SURGE : a_reference(bytes);
        seeds[i] = a_double(bytes);
    }
    const fmi2Status status = fmi2GetDirectionalDerivative(craft, unknowns, n, how == 255 ? NULL : knowns, m, seeds,
                                                           how == 254 ? NULL : values);
    for (size_t i = 0; i < n && status == fmi2OK; i++)
        demand(world->forged || isfinite(values[i]), "a directional derivative is not finite");
    return status;
}

/* The calls of model exchange, on whatever the instance is for. */
static fmi2Status exchange(fmi2Component craft, struct bytes *bytes, const struct world *world)
{
    const unsigned how = a_byte(bytes), call = how % 16;
    const size_t n = how < 240 ? STATE_COUNT : how % 16;
    double values[16] = {0};
    fmi2EventInfo info;
    fmi2Boolean event = 7, end = 7;
    fmi2Status status;
    switch (call) {
    case 0:
    case 1:
        return fmi2EnterEventMode(craft);
    case 2:
    case 3:
        return fmi2EnterContinuousTimeMode(craft);
    case 4:
        status = fmi2NewDiscreteStates(craft, how == 244 ? NULL : &info);
        demand(status > fmi2Warning || (!info.newDiscreteStatesNeeded && !info.nextEventTimeDefined), "an event");
        return status;
    case 5:
        status = fmi2CompletedIntegratorStep(craft, how & 1, &event, how == 245 ? NULL : &end);
        demand(status > fmi2Warning || (!event && !end), "an event of the step");
        return status;
    case 6:
        return fmi2SetTime(craft, a_double(bytes));
    case 7:
        return fmi2GetNominalsOfContinuousStates(craft, values, n);
    case 8:
        return fmi2GetEventIndicators(craft, values, how == 248);
    case 9:
    case 10:
    case 11:
        for (int i = 0; i < STATE_COUNT; i++)
            values[i] = a_double(bytes);
        return fmi2SetContinuousStates(craft, how == 249 ? NULL : values, n);
    default:
        status = call < 14 ? fmi2GetDerivatives(craft, how == 252 ? NULL : values, n)
                           : fmi2GetContinuousStates(craft, how == 254 ? NULL : values, n);
        for (size_t i = 0; i < n && status == fmi2OK; i++)
            demand(world->forged || isfinite(values[i]), "a state or its derivative is not finite");
        return status;
    }
}

static fmi2Status others(fmi2Component craft, struct bytes *bytes)
{
    const unsigned how = a_byte(bytes), reference = a_reference(bytes);
    fmi2Boolean boolean = how & 16;
    fmi2String string = "text";
    switch (how % 4) {
    case 0:
        return fmi2GetBoolean(craft, how & 8 ? &reference : NULL, how & 1, &boolean);
    case 1:
        return fmi2SetBoolean(craft, how & 8 ? &reference : NULL, how & 1, &boolean);
    case 2:
        return fmi2GetString(craft, how & 8 ? &reference : NULL, how >> 2 & 1, &string);
    default:
        return fmi2SetString(craft, how & 8 ? &reference : NULL, how >> 2 & 1, &string);
    }
}

static void statuses(fmi2Component craft, struct bytes *bytes)
{
    const fmi2StatusKind kind = (fmi2StatusKind)(a_byte(bytes) % 5);
    fmi2Status status = fmi2OK;
    fmi2Boolean boolean;
    fmi2Integer integer;
    fmi2String string;
    fmi2Real real;
    demand(fmi2GetStatus(craft, kind, &status) <= fmi2Discard, "fmi2GetStatus");
    demand(status == fmi2OK || status == fmi2Warning || status == fmi2Error, "the status of a step");
    demand(fmi2GetRealStatus(craft, kind, &real) <= fmi2Discard, "fmi2GetRealStatus");
    demand(fmi2GetBooleanStatus(craft, kind, &boolean) <= fmi2Discard, "fmi2GetBooleanStatus");
    demand(fmi2GetIntegerStatus(craft, kind, &integer) == fmi2Discard, "fmi2GetIntegerStatus");
    demand(fmi2GetStringStatus(craft, kind, &string) == fmi2Discard, "fmi2GetStringStatus");
}

static fmi2Status logging(fmi2Component craft, struct bytes *bytes)
{
    static const char *const names[] = {"logAll", "logStatusWarning", "logStatusError", "log%n", NULL};
    const unsigned how = a_byte(bytes);
    const fmi2String chosen[2] = {names[how % 5], names[how / 5 % 5]};
    return fmi2SetDebugLogging(craft, how & 1, how % 3, how == 251 ? NULL : chosen);
}

static uint64_t checksum(const char *bytes, size_t n)
{
    uint64_t sum = UINT64_C(0xcbf29ce484222325);
    for (size_t i = 0; i < n; i++)
        sum = (sum ^ (unsigned char)bytes[i]) * UINT64_C(0x100000001b3);
    return sum;
}

/* Some bytes of the blob are other ones; now and then with the right checksum. */
static void spoil(struct world *world, struct bytes *bytes)
{
    const unsigned how = a_byte(bytes);
    if (world->blob_size <= 8 || how < 128)
        return;
    for (unsigned i = 0; i < how % 8; i++) {
        const size_t at = (a_byte(bytes) << 8 | a_byte(bytes)) % world->blob_size;
        world->blob[at] = (char)a_byte(bytes);
    }
    if (how >= 200) {
        const uint64_t sum = checksum(world->blob, world->blob_size - 8);
        memcpy(world->blob + world->blob_size - 8, &sum, 8);
        world->forged = 1;
    }
    if (how == 199)
        world->blob_size -= 1 + how % 7;
}

static fmi2Status states(fmi2Component craft, struct bytes *bytes, struct world *world)
{
    const unsigned how = a_byte(bytes);
    fmi2FMUstate *slot = &world->saved[how / 8 % SLOTS], restored = NULL;
    switch (how % 8) {
    case 0:
    case 1:
        return fmi2GetFMUstate(craft, how == 249 ? NULL : slot);
    case 2:
    case 3:
        return *slot || how > 200 ? fmi2SetFMUstate(craft, *slot) : fmi2OK;
    case 4:
        return fmi2FreeFMUstate(craft, how == 252 ? NULL : slot);
    case 5:
        if (!*slot || fmi2SerializedFMUstateSize(craft, *slot, &world->blob_size) != fmi2OK)
            return fmi2OK;
        demand(world->blob_size <= BLOB, "the size of a state");
        return fmi2SerializeFMUstate(craft, *slot, world->blob, how > 240 ? 5 : world->blob_size);
    case 6:
        spoil(world, bytes);
        return fmi2OK;
    default: {
        const fmi2Status status = fmi2DeSerializeFMUstate(craft, world->blob, world->blob_size, &restored);
        demand((status == fmi2OK) == (restored != NULL), "a refused blob made a state");
        fmi2FreeFMUstate(craft, slot);
        *slot = restored;
        return status;
    }
    }
}

static fmi2Status called(struct bytes *bytes, struct world *world, fmi2Component *craft)
{
    double values[3];
    switch (a_byte(bytes) % CALLS) {
    case 0:
        values[0] = a_double(bytes), values[1] = a_double(bytes), values[2] = a_double(bytes);
        return fmi2SetupExperiment(*craft, a_byte(bytes) & 1, values[0], values[1], a_byte(bytes) < 64, values[2]);
    case 1:
    case 2:
        return fmi2EnterInitializationMode(*craft);
    case 3:
    case 4:
        return fmi2ExitInitializationMode(*craft);
    case 5:
        return a_byte(bytes) < 64 ? fmi2Terminate(*craft) : fmi2OK;
    case 6:
        return a_byte(bytes) < 64 ? fmi2Reset(*craft) : fmi2OK;
    case 7:
        fmi2FreeInstance(*craft);
        *craft = NULL;
        return fmi2OK;
    case 8:
        return logging(*craft, bytes);
    case 9:
        return others(*craft, bytes);
    case 10:
        statuses(*craft, bytes);
        return fmi2OK;
    case 11:
        return a_byte(bytes) & 1 ? fmi2CancelStep(*craft) : partial_derivatives(*craft, bytes, world);
    case 12:
    case 13:
        return integers(*craft, bytes);
    case 14:
    case 15:
        return derivatives(*craft, bytes, world);
    case 16:
    case 17:
    case 18:
        return states(*craft, bytes, world);
    case 19:
    case 20:
    case 21:
        return reals(*craft, bytes, world);
    case 22:
    case 23:
    case 24:
    case 25:
        return exchange(*craft, bytes, world);
    default:
        return step(*craft, bytes);
    }
}

/* All that an instance is, as bytes; what is worked out when it is read has been. */
static size_t whole(fmi2Component craft, char into[BLOB])
{
    fmi2FMUstate state = NULL;
    size_t size = 0;
    real_of(craft, V_SPEED);
    demand(fmi2GetFMUstate(craft, &state) == fmi2OK && fmi2SerializedFMUstateSize(craft, state, &size) == fmi2OK &&
               size <= BLOB && fmi2SerializeFMUstate(craft, state, into, size) == fmi2OK,
           "a state must always be there");
    fmi2FreeFMUstate(craft, &state);
    return size;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct bytes bytes = {data, size};
    struct world world = {.blob_size = 0};
    while (bytes.left > 0) {
        fmi2Component *craft = &world.craft[a_byte(&bytes) % INSTANCES];
        char before[BLOB], after[BLOB];
        if (!*craft && !(*craft = made(&bytes)))
            continue;
        const size_t n = whole(*craft, before);
        const fmi2Status status = called(&bytes, &world, craft);
        demand(status == fmi2OK || status == fmi2Warning || status == fmi2Error, "a status that never comes");
        if (status == fmi2Error)
            demand(whole(*craft, after) == n && memcmp(before, after, n) == 0, "a refused call changed something");
    }
    for (int i = 0; i < SLOTS; i++)
        free(world.saved[i]); /* the hosts' own memory, with or without callbacks */
    for (int i = 0; i < INSTANCES; i++)
        fmi2FreeInstance(world.craft[i]);
    return 0;
}
