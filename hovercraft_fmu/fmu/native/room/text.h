/* Messages, without the C library's printf: its decimal point follows the host's locale. */

#ifndef HOVERCRAFT_TEXT_H
#define HOVERCRAFT_TEXT_H

#include <stdarg.h>
#include <stddef.h>

#include "hidden.h"

enum { TEXT_SIZE = 640 };

/* Writes `format` into TEXT_SIZE characters; what does not fit is cut off. It knows
     %s  const char *, as it is
     %q  const char * from the host; what a host could take for a format is replaced by '?'
     %r  double, the shortest text with the same bits, as Python's repr
     %4  double, four significant digits, as printf's %.4g;  %3  three
     %i  long long;  %u  unsigned long long
   and no message contains a '%', which a host's logger would take for a format. */
HIDDEN void text_format(char into[TEXT_SIZE], const char *format, va_list values);

#endif
