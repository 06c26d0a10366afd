/* The library's blocks as loops in C, over N elements: what `library.py` compares their kernels with. */

#include <math.h>

#define EXPORT __attribute__((noinline))

EXPORT void Gain(int n, const double *u, const double *k, double *y) {
    for (int q = 0; q < n; q++) y[q] = k[q] * u[q];
}

EXPORT void Saturation(int n, const double *u, const double *lower, const double *upper, double *y) {
    for (int q = 0; q < n; q++) y[q] = u[q] < lower[q] ? lower[q] : (u[q] < upper[q] ? u[q] : upper[q]);
}

EXPORT void Sin(int n, const double *u, double *y) {
    for (int q = 0; q < n; q++) y[q] = sin(u[q]);
}

EXPORT void FirstOrder(int n, const double *u, const double *k, const double *T, const double *x, double *d_x) {
    for (int q = 0; q < n; q++) d_x[q] = (k[q] * u[q] - x[q]) / T[q];
}

EXPORT void LowPass(int n, const double *u, const double *cutoff, const double *x, const double *v, double *d_x, double *d_v) {
    for (int q = 0; q < n; q++) {
        double w = 2.0 * 3.141592653589793 * cutoff[q];
        d_x[q] = v[q];
        d_v[q] = w * (w * (u[q] - x[q]) - sqrt(2.0) * v[q]);
    }
}

EXPORT void LookUp1D(int n, const double *u, int k, const double *points, const double *values, double *y) {
    for (int q = 0; q < n; q++) {
        int below = 0, above = k - 1;
        while (above - below > 1) {
            int middle = (below + above) / 2;
            if (points[middle] <= u[q]) below = middle; else above = middle;
        }
        double part = (u[q] - points[below]) / (points[below + 1] - points[below]);
        part = part < 0.0 ? 0.0 : (part < 1.0 ? part : 1.0);
        y[q] = part == 1.0 ? values[below + 1] : values[below] + (values[below + 1] - values[below]) * part;
    }
}

EXPORT void FIR(int n, const double *u, int taps, const double *b, const double *x, double *y) {
    for (int q = 0; q < n; q++) {
        y[q] = b[0] * u[q];
        for (int k = 1; k < taps; k++) y[q] += b[k] * x[q * (taps - 1) + k - 1];
    }
}

EXPORT void MatrixGain(int n, const double *u, const double *K, double *y) {
    for (int i = 0; i < n; i++) {
        y[i] = 0.0;
        for (int j = 0; j < n; j++) y[i] += K[i * n + j] * u[j];
    }
}
