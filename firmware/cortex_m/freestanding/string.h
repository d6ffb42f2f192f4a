/* The three functions of the C library that the core and the generated code use, so that this
 * port needs the compiler and nothing else. */

#ifndef SMAD_FREESTANDING_STRING_H
#define SMAD_FREESTANDING_STRING_H

#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t size);
void *memset(void *to, int value, size_t size);
void *memmove(void *to, const void *from, size_t size);

#endif
