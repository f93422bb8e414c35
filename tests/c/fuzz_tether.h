/* What the fuzzer has to know of the tether: it has no integers, no partial derivatives, and any step takes as long. */

enum { WORKED_OUT = V_DISTANCE, A_NUMBER = V_STIFFNESS };

static void some_references(struct bytes *bytes, unsigned unknowns[MOST], unsigned knowns[MOST])
{
    for (size_t i = 0; i < MOST; i++) {
        unknowns[i] = a_reference(bytes);
        knowns[i] = a_reference(bytes);
    }
}

static int limited_step(void *craft, double point, double size)
{
    return call_step(craft, point, size);
}
