/* A call computes in a floating-point environment of its own, whatever the host's is: rounded to nearest, nothing
   trapped, nothing flushed to zero. What it leaves is the host's, flags included. Where a machine has no such thing, as
   WebAssembly, there is nothing to do. */

#ifndef HOVERCRAFT_ENVIRONMENT_H
#define HOVERCRAFT_ENVIRONMENT_H

#include <stdint.h>

struct environment {
    uint64_t control, flags;
};

#if defined(__SSE2__) || defined(_M_X64)

#include <xmmintrin.h>

enum { SSE_FLAGS = 0x3f, SSE_OURS = 0x1f80 }; /* all masked; the rest is 0 */

/* Returns the host's. Both write what is not so already: reading takes a third of that. */
static inline struct environment environment_enter(void)
{
    const struct environment host = {.control = _mm_getcsr()};
    if ((host.control & ~(uint64_t)SSE_FLAGS) != SSE_OURS)
        _mm_setcsr(SSE_OURS);
    return host;
}

static inline void environment_leave(const struct environment *host)
{
    if (_mm_getcsr() != host->control)
        _mm_setcsr((unsigned)host->control);
}

#elif defined(__aarch64__) && defined(__GNUC__)

static inline struct environment environment_enter(void)
{
    struct environment host;
    __asm__ volatile("mrs %0, fpcr\n\tmrs %1, fpsr" : "=r"(host.control), "=r"(host.flags) : : "memory");
    if (host.control != 0)
        __asm__ volatile("msr fpcr, %0" : : "r"(UINT64_C(0)) : "memory");
    return host;
}

static inline void environment_leave(const struct environment *host)
{
    if (host->control != 0)
        __asm__ volatile("msr fpcr, %0" : : "r"(host->control) : "memory");
    __asm__ volatile("msr fpsr, %0" : : "r"(host->flags) : "memory");
}

#else

static inline struct environment environment_enter(void)
{
    return (struct environment){0, 0};
}

static inline void environment_leave(const struct environment *host)
{
    (void)host;
}

#endif

#endif
