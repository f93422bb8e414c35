/* Of fuzz.c: what FMI 3.0 has of its own. */

/* Inside a step: mostly an input, as it can be or not; now and then what must not be called there. */
static void update(fmi3InstanceEnvironment environment, double time, bool set, bool get, bool finished, bool early,
                   bool *return_early, double *when)
{
    void *craft = host.craft, *state = NULL;
    const unsigned how = a_byte(host.bytes), input = INPUTS[how % INPUT_COUNT];
    (void)environment, (void)return_early, (void)when;
    demand(fegetround() == host.is.rounding, "another rounding inside a step");
    demand(isfinite(time) && set && !get && !finished && !early, "the flags inside a step");
    if (how < 64)
        return;
    if (how < 250) {
        const double value = a_double(host.bytes);
        demand(call_set(craft, &input, 1, &value) == (isfinite(value) ? CALL_OK : CALL_REFUSED), "an input in a step");
        return;
    }
    demand(call_step(craft, time, 0.1) == CALL_REFUSED && call_terminate(craft) == CALL_REFUSED &&
               call_reset(craft) == CALL_REFUSED && call_save(craft, &state) == CALL_REFUSED,
           "a call that must not be made inside a step");
    call_free(craft);
}

static void *made(struct bytes *bytes, int *listens)
{
    static const unsigned reference = 0; /* an input */
    const unsigned how = a_byte(bytes);
    const fmi3LogMessageCallback log = how & 2 ? call_log : NULL;
    const bool logging = how & 4;
    const char *name = how & 1 ? "craft" : NULL, *token = VARIANT.guid;
    *listens = how & 2;
    char any[16];
    take(bytes, any, sizeof any - 1);
    any[sizeof any - 1] = '\0';
    if (how % 32 == 30)
        token = any;
    else if (how % 32 == 28)
        token = NULL;
    if (how & 64)
        return fmi3InstantiateModelExchange(name, token, NULL, false, logging, NULL, log);
    if (how == 15)
        return fmi3InstantiateScheduledExecution(name, token, NULL, false, logging, NULL, log, NULL, NULL, NULL);
    return fmi3InstantiateCoSimulation(name, token, NULL, false, logging, how == 23, how & 8, &reference, how == 27,
                                       NULL, log, how & 16 ? update : NULL);
}

static inline int integer_of(void *craft, unsigned reference)
{
    int64_t item = 0;
    int32_t number = 0;
    fmi3GetInt64(craft, &reference, 1, &item, 1);
    fmi3GetInt32(craft, &reference, 1, &number, 1);
    return (int)item + number; /* one of the two is refused */
}

static double time_of(void *craft)
{
    return real_of(craft, V_TIME);
}

static int set_up(void *craft, int tolerance_given, double tolerance, double start, int stop_given, double stop)
{
    return fmi3EnterInitializationMode(craft, tolerance_given, tolerance, start, stop_given, stop);
}

static int enter(void *craft)
{
    return fmi3EnterInitializationMode(craft, false, 0.0, 0.0, false, 0.0);
}

/* What the flags deny. */
static int cancel(void *craft)
{
    demand(fmi3EnterConfigurationMode(craft) == fmi3Error && fmi3ExitConfigurationMode(craft) == fmi3Error &&
               fmi3EnterStepMode(craft) == fmi3Error && fmi3ActivateModelPartition(craft, 0, 0.0) == fmi3Error,
           "a call that the flags deny");
    return fmi3EvaluateDiscreteStates(craft);
}

static int integers(void *craft, struct bytes *bytes)
{
    const unsigned how = a_byte(bytes);
    const size_t n = how % MOST;
    unsigned references[MOST];
    int64_t values[MOST] = {0};
    int32_t small[MOST] = {0};
    for (size_t i = 0; i < n; i++) {
        references[i] = a_byte(bytes) & 1 ? A_NUMBER : a_reference(bytes);
        values[i] = an_integer(bytes);
        if (how & 16)
            take(bytes, &values[i], sizeof values[i]);
        small[i] = (int32_t)values[i];
    }
    if (how & 32)
        return how & 128 ? fmi3SetInt32(craft, references, n, how == 255 ? NULL : small, n)
                         : fmi3GetInt32(craft, how == 127 ? NULL : references, n, small, n);
    return how & 128 ? fmi3SetInt64(craft, references, n, how == 223 ? NULL : values, n)
                     : fmi3GetInt64(craft, how == 95 ? NULL : references, n, values, n);
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
    }
    const int *chosen = how == 127 ? NULL : orders;
    const int status = fmi3GetOutputDerivatives(craft, references, n, chosen, values, n + (how > 250));
    for (size_t i = 0; i < n && status == fmi3OK; i++)
        demand(world->forged || isfinite(values[i]), "a derivative is not finite");
    return status;
}

static int partial_derivatives(void *craft, struct bytes *bytes, const struct world *world)
{
    const unsigned how = a_byte(bytes);
    const bool backward = a_byte(bytes) & 1;
    const size_t n = how % MOST, m = how / MOST % MOST, rows = backward ? m : n, more = how > 250;
    unsigned unknowns[MOST], knowns[MOST];
    double seeds[MOST + 1], values[MOST + 1];
    some_references(bytes, unknowns, knowns);
    for (size_t i = 0; i < MOST; i++)
        seeds[i] = a_double(bytes);
    const unsigned *k = how == 250 ? NULL : knowns;
    double *v = how == 249 ? NULL : values;
    const int status = backward ? fmi3GetAdjointDerivative(craft, unknowns, n, k, m, seeds, n + more, v, m)
                                : fmi3GetDirectionalDerivative(craft, unknowns, n, k, m, seeds, m, v, n + more);
    for (size_t i = 0; i < rows && status == fmi3OK; i++)
        demand(world->forged || isfinite(values[i]), "a partial derivative is not finite");
    return status;
}

static int new_discrete_states(void *craft, int null)
{
    bool flags[] = {true, true, true, true, true};
    double time = 7.0;
    const int status = fmi3UpdateDiscreteStates(craft, &flags[0], &flags[1], &flags[2], &flags[3], &flags[4],
                                                null ? NULL : &time);
    demand(status > fmi3Warning || !(flags[0] || flags[1] || flags[2] || flags[3] || flags[4]), "an event");
    return status;
}

static int completed_step(void *craft, int no_set_state_before, int null)
{
    bool event = true, end = true;
    const int status = fmi3CompletedIntegratorStep(craft, no_set_state_before, &event, null ? NULL : &end);
    demand(status > fmi3Warning || !end, "the end of a run");
    if (status <= fmi3Warning && event)
        demand(call_go_to_events(craft) == CALL_OK && new_discrete_states(craft, 0) == CALL_WARNED,
               "an event that has nothing to warn of");
    return status;
}

static int others(void *craft, struct bytes *bytes)
{
    const unsigned how = a_byte(bytes), reference = a_reference(bytes);
    const unsigned *vr = how & 8 ? &reference : NULL;
    const size_t n = how >> 4 & 1, n_values = how > 250 ? 2 : n;
    double value = 1.0;
    bool boolean = true;
    size_t size;
    fmi3String string = "text";
    fmi3Binary binary = NULL;
    fmi3UInt64 counter;
    fmi3IntervalQualifier qualifier;
    switch (how % 8) {
    case 0:
        return fmi3GetBoolean(craft, vr, n, &boolean, n_values);
    case 1:
        return fmi3SetString(craft, vr, n, &string, n_values);
    case 2:
        return fmi3GetBinary(craft, vr, n, &size, &binary, n_values);
    case 3:
        return fmi3GetClock(craft, vr, n, &boolean);
    case 4:
        return fmi3GetIntervalFraction(craft, vr, n, &counter, &counter, &qualifier);
    case 5:
        return fmi3SetFloat64(craft, vr, n, &value, n_values);
    case 6:
        return fmi3GetFloat64(craft, vr, n, &value, n_values);
    default:
        return fmi3SetUInt64(craft, vr, n, &counter, n_values);
    }
}

static int statuses(void *craft, struct bytes *bytes)
{
    size_t n;
    return a_byte(bytes) & 1 ? fmi3GetNumberOfContinuousStates(craft, &n) : fmi3GetNumberOfEventIndicators(craft, &n);
}

static int logging(void *craft, struct bytes *bytes)
{
    static const char *const names[] = {"logAll", "logStatusWarning", "logStatusError", "log%n", NULL};
    const unsigned how = a_byte(bytes);
    const fmi3String chosen[2] = {names[how % 5], names[how / 5 % 5]};
    return fmi3SetDebugLogging(craft, how & 1, how % 3, how == 251 ? NULL : chosen);
}
