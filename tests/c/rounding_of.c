/* What two times may differ by, for a test: it stands in line where it is used. */

#include "rounding.h"

double rounding_of(double largest, double step, double steps);

double rounding_of(double largest, double step, double steps)
{
    return time_rounding(largest, step, steps);
}
