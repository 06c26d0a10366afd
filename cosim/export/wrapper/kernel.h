/* What the C text of kernels is made of. It is a translation of LLVM's intermediate code, in which memory has no types, and
 * integers wrap: loads and stores are copies, and all integers are unsigned. */
#ifndef COSIM_KERNEL_H
#define COSIM_KERNEL_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if !defined(__GNUC__)
#error "these sources need GCC or Clang"
#elif UINTPTR_MAX != UINT64_MAX || __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "these sources need 64-bit addresses, and the least significant byte first"
#elif defined(__FAST_MATH__) || (__FLT_EVAL_METHOD__ != 0 && __FLT_EVAL_METHOD__ != 16) /* 16: half floats too */
#error "these sources need IEEE 754's arithmetic: no -ffast-math, no -mfpmath=387"
#endif
/* A product and a sum are rounded one after the other, whatever the processor could do at once; GCC's vectorizer of
 * straight code puts them together all the same where one lane adds and the other subtracts. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#else
#pragma GCC optimize("fp-contract=off", "no-tree-slp-vectorize")
#endif

typedef unsigned __int128 uint128_t;
typedef __int128 int128_t;

#define ACCESS(TYPE, NAME) \
    static inline TYPE load_##NAME(const uint8_t *p) { TYPE v; memcpy(&v, p, sizeof v); return v; } \
    static inline void store_##NAME(uint8_t *p, TYPE v) { memcpy(p, &v, sizeof v); }
ACCESS(uint8_t, i8)
ACCESS(uint16_t, i16)
ACCESS(uint32_t, i32)
ACCESS(uint64_t, i64)
ACCESS(uint128_t, i128)
ACCESS(double, double)
ACCESS(float, float)
ACCESS(uint8_t *, ptr)
#undef ACCESS

static inline uint64_t bits_of_double(double v) { uint64_t bits; memcpy(&bits, &v, sizeof bits); return bits; }
static inline double double_of_bits(uint64_t bits) { double v; memcpy(&v, &bits, sizeof v); return v; }
static inline uint32_t bits_of_float(float v) { uint32_t bits; memcpy(&bits, &v, sizeof bits); return bits; }
static inline float float_of_bits(uint32_t bits) { float v; memcpy(&v, &bits, sizeof v); return v; }

/* One bit of LLVM's classes: signalling and quiet NaN, then from -infinity to +infinity. */
static inline uint32_t class_of_double(double v) {
    const uint64_t bits = bits_of_double(v), rest = bits & UINT64_C(0x7FFFFFFFFFFFFFFF);
    const uint32_t negative = bits >> 63;
    if (rest > UINT64_C(0x7FF0000000000000)) return rest & UINT64_C(0x0008000000000000) ? 2 : 1;
    if (rest == UINT64_C(0x7FF0000000000000)) return negative ? 4 : 512;
    if (rest >= UINT64_C(0x0010000000000000)) return negative ? 8 : 256;
    if (rest) return negative ? 16 : 128;
    return negative ? 32 : 64;
}

/* The C library's functions by names of our own, so that a compiler does not replace a call by what it thinks is right:
 * the last bits are the library's, as they are of the code that the translation was made of. */
#define COSIM_TEXT(x) #x
#define COSIM_EXPAND(x) COSIM_TEXT(x)
#define COSIM_NAMED(name) __asm__(COSIM_EXPAND(__USER_LABEL_PREFIX__) #name)
#define LIBRARY1(name) extern double m_##name(double) COSIM_NAMED(name)
#define LIBRARY2(name) extern double m_##name(double, double) COSIM_NAMED(name)
LIBRARY1(sin); LIBRARY1(cos); LIBRARY1(tan); LIBRARY1(asin); LIBRARY1(acos); LIBRARY1(atan);
LIBRARY1(sinh); LIBRARY1(cosh); LIBRARY1(tanh); LIBRARY1(asinh); LIBRARY1(acosh); LIBRARY1(atanh);
LIBRARY1(exp); LIBRARY1(exp2); LIBRARY1(expm1); LIBRARY1(log); LIBRARY1(log2); LIBRARY1(log10); LIBRARY1(log1p);
LIBRARY1(cbrt); LIBRARY1(erf); LIBRARY1(erfc); LIBRARY1(tgamma); LIBRARY1(lgamma);
LIBRARY2(atan2); LIBRARY2(pow); LIBRARY2(hypot); LIBRARY2(fmod);
extern double m_ldexp(double, int) COSIM_NAMED(ldexp);

#endif
