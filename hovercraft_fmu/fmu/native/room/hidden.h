/* What the files of an FMU share is `static` where one file includes all of them: a program may link several FMUs, or
   load them side by side, and each must find its own. */

#ifndef HIDDEN
#define HIDDEN
#endif

/* Without it a compiler calls what a sub-step is made of, and keeps its numbers in memory meanwhile. */
#ifndef ALWAYS_INLINE
#ifdef __GNUC__
#define ALWAYS_INLINE inline __attribute__((always_inline))
#define NEVER_INLINE __attribute__((noinline))
#else
#define ALWAYS_INLINE inline
#define NEVER_INLINE
#endif
#endif

#if defined(__FAST_MATH__) || defined(_M_FP_FAST) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "Compile with IEEE arithmetic: -Ofast and -ffast-math take away NaN, infinity and the order of operations"
#endif
