/* The library's blocks as loops in C, over N elements: what `library.py` compares their kernels with. */

#include <math.h>
#include <stdint.h>

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

EXPORT void TransferFunction(int n, const double *u, int coefficients, const double *den, const double *x, double *d_x) {
    int order = coefficients - 1;
    for (int q = 0; q < n; q++) {
        const double *own = x + q * order;
        double highest = u[q];
        for (int k = 0; k < order; k++) highest -= den[k + 1] * own[k];
        d_x[q * order] = highest;
        for (int k = 1; k < order; k++) d_x[q * order + k] = own[k - 1];
    }
}

EXPORT void StateSpace(int n, const double *u, int m, const double *A, const double *B, const double *x, double *d_x) {
    for (int i = 0; i < n; i++) {
        double total = 0.0;
        for (int j = 0; j < n; j++) total += A[i * n + j] * x[j];
        for (int j = 0; j < m; j++) total += B[i * m + j] * u[j];
        d_x[i] = total;
    }
}

EXPORT void TransportDelay(int n, const double *u, const double *T, const double *x, double *d_x) {
    for (int q = 0; q < n; q++) {
        d_x[2 * q] = u[q] - 6.0 / T[q] * x[2 * q] - 12.0 / (T[q] * T[q]) * x[2 * q + 1];
        d_x[2 * q + 1] = x[2 * q];
    }
}

EXPORT void Notch(int n, const double *u, const double *centre, const double *Q, const double *x, const double *z,
                  double *d_x, double *d_z) {
    for (int q = 0; q < n; q++) {
        double w = 2.0 * 3.141592653589793 * centre[q];
        d_x[q] = w * z[q];
        d_z[q] = w * ((u[q] - z[q]) / Q[q] - x[q]);
    }
}

EXPORT void PID(int n, const double *r, const double *y, const double *feed_forward, const double *k_p, const double *k_d,
                const double *T_f, const double *b, const double *c, const double *lower, const double *upper,
                const double *i, const double *x, double *v, double *u) {
    for (int q = 0; q < n; q++) {
        double slope = (c[q] * r[q] - y[q] - x[q]) / T_f[q];
        v[q] = k_p[q] * (b[q] * r[q] - y[q]) + i[q] + k_d[q] * slope + feed_forward[q];
        u[q] = v[q] < lower[q] ? lower[q] : (v[q] < upper[q] ? v[q] : upper[q]);
    }
}

static int interval(int size, const double *points, double value) {
    int below = 0, above = size - 1;
    while (above - below > 1) {
        int middle = (below + above) / 2;
        if (points[middle] <= value) below = middle; else above = middle;
    }
    return below;
}

static double part(const double *points, int k, double value) {
    double found = (value - points[k]) / (points[k + 1] - points[k]);
    return found < 0.0 ? 0.0 : (found < 1.0 ? found : 1.0);
}

EXPORT void LookUp2D(int n, const double *u_1, const double *u_2, int rows, int columns, const double *points_1,
                     const double *points_2, const double *values, double *y) {
    for (int q = 0; q < n; q++) {
        int i = interval(rows, points_1, u_1[q]), j = interval(columns, points_2, u_2[q]);
        double a = part(points_1, i, u_1[q]), b = part(points_2, j, u_2[q]);
        const double *here = values + i * columns + j, *next = here + columns;
        y[q] = (1.0 - b) * ((1.0 - a) * here[0] + a * next[0]) + b * ((1.0 - a) * here[1] + a * next[1]);
    }
}

static double fraction(uint64_t high, uint64_t low) { return ((high << 20) + (low >> 12) + 0.5) / 4503599627370496.0; }

/* Philox 4x32-10 by Salmon and others, and Box and Muller's transform. */
static double normal(int64_t *stream) {
    uint32_t c[4] = {(uint32_t)stream[1], (uint32_t)(stream[1] >> 32), 0, 0};
    uint32_t k[2] = {(uint32_t)stream[0], (uint32_t)(stream[0] >> 32)};
    for (int round = 0; round < 10; round++) {
        uint64_t a = (uint64_t)0xD2511F53 * c[0], b = (uint64_t)0xCD9E8D57 * c[2];
        uint32_t first = (uint32_t)(b >> 32) ^ c[1] ^ k[0], third = (uint32_t)(a >> 32) ^ c[3] ^ k[1];
        c[0] = first, c[1] = (uint32_t)b, c[2] = third, c[3] = (uint32_t)a;
        k[0] += 0x9E3779B9, k[1] += 0xBB67AE85;
    }
    stream[1]++;
    return sqrt(-2.0 * log(fraction(c[0], c[1]))) * cos(2.0 * 3.141592653589793 * fraction(c[2], c[3]));
}

EXPORT void WhiteNoise(int n, const double *mean, const double *deviation, int64_t *stream, double *y) {
    for (int q = 0; q < n; q++) y[q] = mean[q] + deviation[q] * normal(stream);
}

EXPORT void Delay(int n, const int32_t *samples, int depth, const double *past, const int32_t *head, double *y) {
    for (int q = 0; q < n; q++) y[q] = past[((*head - *samples) % depth + depth) % depth * n + q];
}

EXPORT void KalmanFilter(int n, const double *y, int p, const double *C, const double *R, const double *x, const double *P,
                         double *x_hat, double *P_hat) {
    double gain[n], kept[n * n], half[n * n];
    for (int i = 0; i < n; i++) x_hat[i] = x[i];
    for (int i = 0; i < n * n; i++) P_hat[i] = P[i];
    for (int k = 0; k < p; k++) {
        const double *row = C + k * n;
        double innovation = y[k], total = 0.0;
        for (int i = 0; i < n; i++) innovation -= row[i] * x_hat[i];
        for (int i = 0; i < n; i++) {
            gain[i] = 0.0;
            for (int j = 0; j < n; j++) gain[i] += P_hat[i * n + j] * row[j];
        }
        for (int i = 0; i < n; i++) total += row[i] * gain[i];
        for (int i = 0; i < n; i++) gain[i] /= total + R[k];
        for (int i = 0; i < n; i++) x_hat[i] += gain[i] * innovation;
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) kept[i * n + j] = (i == j) - gain[i] * row[j];
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) {
                half[i * n + j] = 0.0;
                for (int l = 0; l < n; l++) half[i * n + j] += kept[i * n + l] * P_hat[l * n + j];
            }
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) {
                total = 0.0;
                for (int l = 0; l < n; l++) total += half[i * n + l] * kept[j * n + l];
                P_hat[i * n + j] = total + R[k] * (gain[i] * gain[j]);
            }
    }
}
