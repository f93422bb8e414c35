/* What the fuzzer has to know of the hovercraft. */

enum { WORKED_OUT = V_SPEED, A_NUMBER = V_INTEGRATOR };
static const double FEW_SUBSTEPS = 2000.0, TOO_MANY = 2e9; /* between them a step would only take long */

/* Of partial derivatives: mostly all of initialization mode, or all of the later ones. */
static void some_references(struct bytes *bytes, unsigned unknowns[MOST], unsigned knowns[MOST])
{
    const unsigned initial = a_byte(bytes) & 1, count = initial ? INITIAL_KNOWN_COUNT : KNOWN_COUNT;
    for (size_t i = 0; i < MOST; i++) {
        const unsigned row = a_byte(bytes), column = a_byte(bytes);
        unknowns[i] = row >= 224 ? a_reference(bytes) : initial ? ROWS[row % ROW_COUNT] : V_POSE_X + row % 16;
        knowns[i] = column >= 224 ? a_reference(bytes) : KNOWNS[column % count];
    }
}

/* Whatever the host's rounding: the fuzzer itself goes on in the same way. */
static double quotient(double a, double b)
{
    fesetround(FE_TONEAREST);
    const volatile double nearest = a / b;
    fesetround(host.is.rounding);
    return nearest;
}

/* A step that does not take long. */
static int limited_step(void *craft, double point, double size)
{
    if (integer_of(craft, V_INTEGRATOR) == ADAPTIVE || integer_of(craft, V_INTEGRATOR_NUMBER) == ADAPTIVE) {
        const double turn = real_of(craft, V_VELOCITY_YAW_RATE);
        if (size > 1e-4)
            size = quotient(1e-4, isfinite(turn) ? fmax(1.0, 2.0 * fabs(turn)) : 1.0);
        return call_step(craft, point, size);
    }
    const double n = quotient(size, real_of(craft, V_STEP_SIZE));
    return n <= FEW_SUBSTEPS || n >= TOO_MANY ? call_step(craft, point, size) : CALL_OK;
}
