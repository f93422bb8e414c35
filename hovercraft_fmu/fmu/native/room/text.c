/* The digits of a double by exact integer arithmetic: Steele and White, "How to print floating-point numbers
   accurately" (1990), with the fix-up of Burger and Dybvig (1996). */

#include "text.h"

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

enum { WORDS = 40, SHORTEST = 0, MOST_DIGITS = 17, FIXED_BELOW = 16 };

struct text {
    char *into;
    size_t length;
};

/* A natural number, least significant word first: at most 1074 + 55 bits, and one digit more. */
struct natural {
    uint32_t words[WORDS];
};

static void multiply(struct natural *a, uint32_t factor)
{
    uint64_t carry = 0;
    for (int i = 0; i < WORDS; i++) {
        carry += (uint64_t)a->words[i] * factor;
        a->words[i] = (uint32_t)carry;
        carry >>= 32;
    }
}

static void multiply_by_power_of_ten(struct natural *a, int power)
{
    for (; power > 0; power--)
        multiply(a, 10);
}

static struct natural shifted(uint64_t value, int bits)
{
    struct natural a = {{0}};
    const int word = bits / 32, rest = bits % 32;
    a.words[word] = (uint32_t)(value << rest);
    a.words[word + 1] = (uint32_t)(value >> (32 - rest));
    if (rest)
        a.words[word + 2] = (uint32_t)(value >> 32 >> (32 - rest));
    return a;
}

static int compared(const struct natural *a, const struct natural *b)
{
    for (int i = WORDS - 1; i >= 0; i--)
        if (a->words[i] != b->words[i])
            return a->words[i] < b->words[i] ? -1 : 1;
    return 0;
}

static struct natural sum(const struct natural *a, const struct natural *b)
{
    struct natural c;
    uint64_t carry = 0;
    for (int i = 0; i < WORDS; i++) {
        carry += (uint64_t)a->words[i] + b->words[i];
        c.words[i] = (uint32_t)carry;
        carry >>= 32;
    }
    return c;
}

static void subtract(struct natural *a, const struct natural *b)
{
    int64_t borrow = 0;
    for (int i = 0; i < WORDS; i++) {
        borrow += (int64_t)a->words[i] - b->words[i];
        a->words[i] = (uint32_t)borrow;
        borrow >>= 32;
    }
}

/* value = r/s * 10^exponent, with 0.1 <= r/s < 1; half of the gaps to the neighbours are low/s and high/s. */
struct scaled {
    struct natural r, s, low, high;
    int exponent;
    bool even;
};

/* Whether r + high reaches s, so that the shortest digits may be those of the next power of ten. */
static bool too_large(const struct scaled *v, int digits)
{
    if (digits != SHORTEST)
        return compared(&v->r, &v->s) >= 0;
    const struct natural upper = sum(&v->r, &v->high);
    return compared(&upper, &v->s) >= (v->even ? 0 : 1);
}

static void shift_digit(struct scaled *v)
{
    multiply(&v->r, 10);
    multiply(&v->low, 10);
    multiply(&v->high, 10);
}

static void scale_up(struct scaled *v, int digits)
{
    struct scaled next = *v;
    shift_digit(&next);
    while (!too_large(&next, digits)) {
        *v = next;
        v->exponent--;
        shift_digit(&next);
    }
}

static struct scaled scaled(uint64_t fraction, int exponent, bool narrow_below, int digits)
{
    struct scaled v = {.even = fraction % 2 == 0};
    const int up = exponent > 0 ? exponent : 0, down = exponent < 0 ? -exponent : 0, wide = narrow_below ? 1 : 0;
    v.r = shifted(fraction, up + 1 + wide);
    v.s = shifted(1, down + 1 + wide);
    v.low = shifted(1, up);
    v.high = shifted(1, up + wide);
    int bits = exponent;
    for (uint64_t rest = fraction; rest; rest >>= 1)
        bits++;
    v.exponent = bits * 1233 / 4096; /* log10(2), one off at most: put right below */
    multiply_by_power_of_ten(&v.s, v.exponent);
    multiply_by_power_of_ten(&v.r, -v.exponent);
    multiply_by_power_of_ten(&v.low, -v.exponent);
    multiply_by_power_of_ten(&v.high, -v.exponent);
    while (too_large(&v, digits)) {
        multiply(&v.s, 10);
        v.exponent++;
    }
    scale_up(&v, digits);
    return v;
}

static int next_digit(struct scaled *v)
{
    int digit = 0;
    shift_digit(v);
    for (; compared(&v->r, &v->s) >= 0; digit++)
        subtract(&v->r, &v->s);
    return digit;
}

/* Whether what is left over rounds the last digit up. */
static bool rounds_up(struct scaled *v, int digit)
{
    multiply(&v->r, 2);
    const int half = compared(&v->r, &v->s);
    return half > 0 || (half == 0 && digit % 2 == 1);
}

static int shortest_digits(struct scaled *v, char *into)
{
    for (int n = 0;; n++) {
        int digit = next_digit(v);
        const struct natural upper = sum(&v->r, &v->high);
        const bool low = compared(&v->r, &v->low) < (v->even ? 1 : 0);
        const bool high = compared(&upper, &v->s) >= (v->even ? 0 : 1);
        if (low || high) {
            if (high && (!low || rounds_up(v, digit)))
                digit++;
            into[n] = (char)('0' + digit);
            return n + 1;
        }
        into[n] = (char)('0' + digit);
    }
}

/* So many digits, rounded, ties to even; where that carries over, the exponent grows. Zeros at the end are left out. */
static int rounded_digits(struct scaled *v, char *into, int digits)
{
    int n = digits;
    for (int i = 0; i < digits; i++)
        into[i] = (char)('0' + next_digit(v));
    if (rounds_up(v, into[n - 1] - '0')) {
        while (n > 0 && into[n - 1] == '9')
            n--;
        if (n > 0) {
            into[n - 1]++;
        } else {
            into[n++] = '1';
            v->exponent++;
        }
    }
    while (n > 1 && into[n - 1] == '0')
        n--;
    return n;
}

static void add(struct text *text, char c)
{
    if (text->length + 1 < TEXT_SIZE)
        text->into[text->length++] = c;
}

static void add_string(struct text *text, const char *string)
{
    while (*string)
        add(text, *string++);
}

static void add_natural(struct text *text, unsigned long long value, int least)
{
    char digits[24];
    int n = 0;
    for (; value || n < least; value /= 10)
        digits[n++] = (char)('0' + value % 10);
    while (n > 0)
        add(text, digits[--n]);
}

static void add_integer(struct text *text, long long value)
{
    if (value < 0)
        add(text, '-');
    add_natural(text, value < 0 ? 0ULL - (unsigned long long)value : (unsigned long long)value, 1);
}

/* The point stands behind `point` digits. */
static void add_fixed(struct text *text, const char *digits, int n, int point, bool whole)
{
    int i;
    if (point <= 0)
        add_string(text, "0.");
    for (i = point; i < 0; i++)
        add(text, '0');
    for (i = 0; i < n || i < point; i++) {
        if (i > 0 && i == point)
            add(text, '.');
        add(text, i < n ? digits[i] : '0');
    }
    if (whole && point >= n)
        add_string(text, ".0");
}

static void add_exponential(struct text *text, const char *digits, int n, int exponent)
{
    add(text, digits[0]);
    if (n > 1)
        add(text, '.');
    for (int i = 1; i < n; i++)
        add(text, digits[i]);
    add(text, 'e');
    add(text, exponent < 0 ? '-' : '+');
    add_natural(text, (unsigned long long)(exponent < 0 ? -exponent : exponent), 2);
}

/* With SHORTEST as Python's repr, else with so many digits as printf's %.Ng. */
static void add_real(struct text *text, double value, int digits)
{
    char shown[MOST_DIGITS + 1] = "0";
    uint64_t bits;
    int n = 1, point = 1;
    memcpy(&bits, &value, sizeof bits);
    const uint64_t fraction = bits & UINT64_MAX >> 12;
    const int exponent = (int)(bits >> 52 & 0x7ff);
    if (exponent == 0x7ff && fraction) {
        add_string(text, "nan");
        return;
    }
    if (bits >> 63)
        add(text, '-');
    if (exponent == 0x7ff) {
        add_string(text, "inf");
        return;
    }
    if (exponent || fraction) {
        struct scaled v = scaled(exponent ? fraction | UINT64_C(1) << 52 : fraction, (exponent ? exponent : 1) - 1075,
                                 exponent > 1 && !fraction, digits);
        n = digits == SHORTEST ? shortest_digits(&v, shown) : rounded_digits(&v, shown, digits);
        point = v.exponent;
    }
    if (point > -4 && point <= (digits == SHORTEST ? FIXED_BELOW : digits))
        add_fixed(text, shown, n, point, digits == SHORTEST);
    else
        add_exponential(text, shown, n, point - 1);
}

static void add_foreign(struct text *text, const char *string)
{
    for (; *string; string++)
        add(text, *string < ' ' || *string > '~' || *string == '%' || *string == '#' ? '?' : *string);
}

static void add_value(struct text *text, char kind, va_list *values)
{
    switch (kind) {
    case 's':
        add_string(text, va_arg(*values, const char *));
        break;
    case 'q':
        add_foreign(text, va_arg(*values, const char *));
        break;
    case 'r':
        add_real(text, va_arg(*values, double), SHORTEST);
        break;
    case '3':
    case '4':
        add_real(text, va_arg(*values, double), kind - '0');
        break;
    case 'i':
        add_integer(text, va_arg(*values, long long));
        break;
    default: /* 'u' */
        add_natural(text, va_arg(*values, unsigned long long), 1);
        break;
    }
}

void text_format(char into[TEXT_SIZE], const char *format, va_list values)
{
    struct text text = {into, 0};
    va_list rest;
    va_copy(rest, values);
    for (; *format; format++) {
        if (*format != '%')
            add(&text, *format);
        else
            add_value(&text, *++format, &rest);
    }
    va_end(rest);
    into[text.length] = '\0';
}
