/* Comparisons as Python has them, and what two times may differ by. */

#ifndef HOVERCRAFT_ROUNDING_H
#define HOVERCRAFT_ROUNDING_H

static const double UNIT = 0x1p-52; /* relative: one or two units in the last place of a double */

/* Python's max(a, b): the first, unless the second is beyond it; so NaN in b changes nothing. */
static inline double larger(double a, double b)
{
    return b > a ? b : a;
}

/* Python's min(a, b). */
static inline double smaller(double a, double b)
{
    return b < a ? b : a;
}

/* s: what two times that mean the same may differ by; see subcycling.py. */
static inline double time_rounding(double largest, double step, double steps)
{
    return smaller((4.0 + steps) * UNIT * largest, 0.1 * step);
}

#endif
