/* Of models without partial derivatives, where any step takes as long. */

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
