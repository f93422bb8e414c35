/* With HOVERCRAFT_NO_LIBC, for Windows and WebAssembly: what a library needs that is linked to the kernel's functions
   alone, or to none, so that it depends on no C runtime. */

#include "memory.h"

#ifndef HOVERCRAFT_NO_LIBC

#include <stdlib.h>

void *memory_allocate(size_t size)
{
    return calloc(1, size);
}

void memory_release(void *memory)
{
    free(memory);
}

#else

#include <stdint.h>
#include <string.h>

#ifdef __wasm__

enum { PAGE = 65536 };
struct block {
    struct block *next;
    size_t size; /* bytes, with this */
};
static struct block *freed;

/* The first of what was given back that is large enough, or else whole pages: there are few instances, and states of one
   size. NULL where there is no more. */
static struct block *block_of(size_t size)
{
    for (struct block **at = &freed; *at; at = &(*at)->next) {
        struct block *block = *at;
        if (block->size >= size) {
            *at = block->next;
            return block;
        }
    }
    const size_t pages = (size + PAGE - 1) / PAGE, before = __builtin_wasm_memory_grow(0, pages);
    if (before == SIZE_MAX)
        return NULL;
    struct block *block = (struct block *)(before * PAGE);
    block->size = pages * PAGE;
    return block;
}

void *memory_allocate(size_t size)
{
    struct block *block = block_of(sizeof *block + size);
    return block ? memset(block + 1, 0, size) : NULL;
}

void memory_release(void *memory)
{
    if (!memory)
        return;
    struct block *block = (struct block *)memory - 1;
    block->next = freed;
    freed = block;
}

#else

__declspec(dllimport) void *__stdcall GetProcessHeap(void);
__declspec(dllimport) void *__stdcall HeapAlloc(void *heap, unsigned long flags, size_t bytes);
__declspec(dllimport) int __stdcall HeapFree(void *heap, unsigned long flags, void *memory);

enum { HEAP_ZERO_MEMORY = 8 };
int _fltused = 0; /* the linker asks for it where there are floats */

int __stdcall DllMain(void *library, unsigned long reason, void *reserved);

int __stdcall DllMain(void *library, unsigned long reason, void *reserved)
{
    (void)library, (void)reason, (void)reserved;
    return 1;
}

void *memory_allocate(size_t size)
{
    return HeapAlloc(GetProcessHeap(), HEAP_ZERO_MEMORY, size);
}

void memory_release(void *memory)
{
    if (memory)
        HeapFree(GetProcessHeap(), 0, memory);
}

#endif

/* Or the compiler would make a call of memcpy of the loop in memcpy. */
#define OWN __attribute__((no_builtin))

OWN void *memcpy(void *restrict to, const void *restrict from, size_t size)
{
    for (size_t i = 0; i < size; i++)
        ((unsigned char *)to)[i] = ((const unsigned char *)from)[i];
    return to;
}

OWN void *memset(void *to, int value, size_t size)
{
    for (size_t i = 0; i < size; i++)
        ((unsigned char *)to)[i] = (unsigned char)value;
    return to;
}

OWN int memcmp(const void *a, const void *b, size_t size)
{
    const unsigned char *p = a, *q = b;
    for (size_t i = 0; i < size; i++)
        if (p[i] != q[i])
            return p[i] < q[i] ? -1 : 1;
    return 0;
}

OWN size_t strlen(const char *string)
{
    size_t n = 0;
    while (string[n])
        n++;
    return n;
}

OWN int strcmp(const char *a, const char *b)
{
    while (*a && *a == *b)
        a++, b++;
    return (unsigned char)*a - (unsigned char)*b;
}

#endif
