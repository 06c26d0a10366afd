/* What is computed here is computed by IEEE 754's default, to the nearest and with subnormal numbers, whatever the
   importer's thread is set to; that it gets back. */
#ifndef COSIM_ARITHMETIC_H
#define COSIM_ARITHMETIC_H

#include <stdint.h>

#if defined(__x86_64__)
#include <xmmintrin.h>
enum { CONTROL_BITS = 0xFFC0, STANDARD_CONTROL = 0x1F80 }; /* of MXCSR: all but sticky flags; no traps */
static inline uint64_t control_get(void) { return _mm_getcsr(); }
static inline void control_set(uint64_t word) { _mm_setcsr((unsigned)word); }
#elif defined(__aarch64__)
enum { CONTROL_BITS = 0x7FFFFFFF, STANDARD_CONTROL = 0 }; /* of FPCR */
static inline uint64_t control_get(void) {
    uint64_t word;
    __asm__ volatile("mrs %0, fpcr" : "=r"(word));
    return word;
}
static inline void control_set(uint64_t word) { __asm__ volatile("msr fpcr, %0" : : "r"(word) : "memory"); }
#endif

static inline uint64_t arithmetic_begin(void) {
    const uint64_t before = control_get();
    if ((before & CONTROL_BITS) != STANDARD_CONTROL) control_set(STANDARD_CONTROL);
    return before;
}

static inline void arithmetic_end(const uint64_t *before) {
    if ((*before & CONTROL_BITS) != STANDARD_CONTROL) control_set(*before);
}

/* From here to the end of the function. */
#define STANDARD_ARITHMETIC __attribute__((cleanup(arithmetic_end))) const uint64_t importers = arithmetic_begin()

#endif
