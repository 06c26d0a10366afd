/* Beside long double functions of the C library: errors in units in the last place; and nanoseconds a call. */
#include <math.h>
#include <time.h>

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

/* The largest error of a function's results y is told, and its place returned: `bad` for a wrong infinity, NaN or sign. */
static double error(double y, long double truth) {
    const double rounded = (double)truth, bad = 1e9;
    if (isnan(y) || isnan(rounded)) return isnan(y) && isnan(rounded) ? 0.0 : bad;
    if (isinf(y) || isinf(rounded)) return y == rounded ? 0.0 : bad;
    if (y == 0.0 && rounded == 0.0) return !signbit(y) == !signbit(truth) ? 0.0 : bad;
    int exponent;
    frexp(rounded, &exponent);
    return (double)(fabsl((long double)y - truth) / ldexpl(1.0L, exponent - 53 < -1074 ? -1074 : exponent - 53));
}

#define MEASURE(name, parameters, given, lifted) \
    long worst_##name(double (*f) parameters, const double *x, const double *y, long count, double *most) { \
        long place = 0; \
        *most = 0.0; \
        for (long k = 0; k < count; k++) { \
            const double e = error(f given, name##l lifted); \
            if (e > *most) *most = e, place = k; \
        } \
        return place; \
    } \
    double time_##name(double (*f) parameters, const double *x, const double *y, long count) { \
        double sum = 0.0; \
        const double begin = now(); \
        for (long k = 0; k < count; k++) sum += f given; \
        const double end = now(); \
        volatile double kept = sum; \
        (void)kept; \
        return (end - begin) / (double)count; \
    } \
    double (*library_##name(void)) parameters { return name; }
#define ONE(name) MEASURE(name, (double), (x[k]), ((long double)x[k]))
#define TWO(name) MEASURE(name, (double, double), (x[k], y[k]), ((long double)x[k], (long double)y[k]))
ONE(sin) ONE(cos) ONE(exp) ONE(log) ONE(tanh) TWO(pow) TWO(atan2)
