/* text_format with one value, for ctypes. */

#include "text.h"

static void formatted(char *into, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    text_format(into, format, values);
    va_end(values);
}

void text_of_real(char *into, const char *format, double value)
{
    formatted(into, format, value);
}

void text_of_integer(char *into, const char *format, long long value)
{
    formatted(into, format, value);
}

void text_of_string(char *into, const char *format, const char *value)
{
    formatted(into, format, value);
}
