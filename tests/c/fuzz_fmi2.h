/* Of fuzz.c: what FMI 2.0 has of its own. */

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    (void)environment, (void)instance, (void)category;
    heard(status, message);
}

/* The FMU says canNotUseMemoryManagementFunctions. */
static void *no_memory_of_the_hosts(size_t count, size_t size)
{
    (void)count, (void)size;
    demand(0, "the host was asked for memory");
    return NULL;
}

static void *made(struct bytes *bytes, int *listens)
{
    static const fmi2CallbackFunctions callbacks = {logger, no_memory_of_the_hosts, free, NULL, NULL};
    static const fmi2CallbackFunctions silent = {NULL, no_memory_of_the_hosts, free, NULL, NULL};
    const unsigned how = a_byte(bytes);
    *listens = how & 2;
    char guid[16];
    take(bytes, guid, sizeof guid - 1);
    guid[sizeof guid - 1] = '\0';
    const fmi2Type type = how & 64 ? fmi2ModelExchange : how == 15 ? (fmi2Type)2 : fmi2CoSimulation;
    return fmi2Instantiate(how & 1 ? "craft" : NULL, type,
                           how % 32 == 30 ? guid : how % 32 == 28 ? NULL : VARIANT.guid, NULL,
                           how & 2 ? &callbacks : how & 8 ? &silent : NULL, fmi2False, how & 4 ? fmi2True : fmi2False);
}

static inline int integer_of(void *craft, unsigned reference)
{
    int value = 0;
    fmi2GetInteger(craft, &reference, 1, &value);
    return value;
}

static double time_of(void *craft)
{
    double time = 0.0;
    fmi2GetRealStatus(craft, fmi2LastSuccessfulTime, &time);
    return time;
}

static int set_up(void *craft, int tolerance_given, double tolerance, double start, int stop_given, double stop)
{
    return fmi2SetupExperiment(craft, tolerance_given, tolerance, start, stop_given, stop);
}

static int enter(void *craft)
{
    return fmi2EnterInitializationMode(craft);
}

static int cancel(void *craft)
{
    return fmi2CancelStep(craft);
}

static int integers(void *craft, struct bytes *bytes)
{
    const unsigned how = a_byte(bytes);
    const size_t n = how % MOST;
    unsigned references[MOST];
    int values[MOST] = {0};
    for (size_t i = 0; i < n; i++) {
        references[i] = a_byte(bytes) & 1 ? A_NUMBER : a_reference(bytes);
        values[i] = an_integer(bytes);
    }
    return how & 128 ? fmi2SetInteger(craft, references, n, how == 255 ? NULL : values)
                     : fmi2GetInteger(craft, how == 127 ? NULL : references, n, values);
}

static int derivatives(void *craft, struct bytes *bytes, const struct world *world)
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

static int partial_derivatives(void *craft, struct bytes *bytes, const struct world *world)
{
    const unsigned how = a_byte(bytes);
    const size_t n = how % MOST, m = how / MOST % MOST;
    unsigned unknowns[MOST], knowns[MOST];
    double seeds[MOST], values[MOST];
    some_references(bytes, unknowns, knowns);
    for (size_t i = 0; i < MOST; i++)
        seeds[i] = a_double(bytes);
    const fmi2Status status = fmi2GetDirectionalDerivative(craft, unknowns, n, how == 255 ? NULL : knowns, m, seeds,
                                                           how == 254 ? NULL : values);
    for (size_t i = 0; i < n && status == fmi2OK; i++)
        demand(world->forged || isfinite(values[i]), "a directional derivative is not finite");
    return status;
}

static int new_discrete_states(void *craft, int null)
{
    fmi2EventInfo info;
    const fmi2Status status = fmi2NewDiscreteStates(craft, null ? NULL : &info);
    demand(status > fmi2Warning || (!info.newDiscreteStatesNeeded && !info.nextEventTimeDefined), "an event");
    return status;
}

static int completed_step(void *craft, int no_set_state_before, int null)
{
    fmi2Boolean event = 7, end = 7;
    const fmi2Status status = fmi2CompletedIntegratorStep(craft, no_set_state_before, &event, null ? NULL : &end);
    demand(status > fmi2Warning || !end, "the end of a run");
    if (status <= fmi2Warning && event)
        demand(call_go_to_events(craft) == CALL_OK && new_discrete_states(craft, 0) == CALL_WARNED,
               "an event that has nothing to warn of");
    return status;
}

static int others(void *craft, struct bytes *bytes)
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

static int statuses(void *craft, struct bytes *bytes)
{
    const fmi2StatusKind kind = (fmi2StatusKind)(a_byte(bytes) % 5);
    fmi2Status status = fmi2OK;
    fmi2Boolean boolean;
    fmi2Integer integer;
    fmi2String string;
    fmi2Real real;
    demand(fmi2GetStatus(craft, kind, &status) <= fmi2Discard, "fmi2GetStatus");
    demand(status >= fmi2OK && status <= fmi2Error, "the status of a step");
    demand(fmi2GetRealStatus(craft, kind, &real) <= fmi2Discard, "fmi2GetRealStatus");
    demand(fmi2GetBooleanStatus(craft, kind, &boolean) <= fmi2Discard, "fmi2GetBooleanStatus");
    demand(fmi2GetIntegerStatus(craft, kind, &integer) == fmi2Discard, "fmi2GetIntegerStatus");
    demand(fmi2GetStringStatus(craft, kind, &string) == fmi2Discard, "fmi2GetStringStatus");
    return CALL_OK;
}

static int logging(void *craft, struct bytes *bytes)
{
    static const char *const names[] = {"logAll", "logStatusWarning", "logStatusError", "log%n", NULL};
    const unsigned how = a_byte(bytes);
    const fmi2String chosen[2] = {names[how % 5], names[how / 5 % 5]};
    return fmi2SetDebugLogging(craft, how & 1, how % 3, how == 251 ? NULL : chosen);
}
