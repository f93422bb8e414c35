/* What a build of the FMU says that its craft weighs at the start: in a program that has several builds in it, each is
   to answer for itself. -DNAME is this function's, FMI2_FUNCTION_PREFIX or FMI3_FUNCTION_PREFIX the build's. */

#include "calls.h"
#include "variables.h"

double NAME(void);

double NAME(void)
{
    static const unsigned mass = V_MASS;
    double value = -1.0;
    void *craft = call_instantiate(CALL_STEPS, VARIANT.guid, "");
    if (craft && call_start(craft) == CALL_OK)
        call_get(craft, &mass, 1, &value);
    if (craft)
        call_free(craft);
    return value;
}
