/* A test FMU for FMI 2.0's Co-Simulation: dx/dt = u - x, for two elements, with inputs that go on in a step as the
   importer says by their derivatives, of any order up to 3; solved to rounding by steps of Runge and Kutta's method. */

#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { N = 2, ORDERS = 3, U = 1, X = 11, STEPS = 200 };

typedef struct {
    double u[N], x[N], derivatives[N][ORDERS];
} Smooth;

static double input(const Smooth *s, int k, double t) {
    double value = s->u[k], power = 1;
    for (int d = 0; d < ORDERS; d++) {
        power *= t / (d + 1);
        value += s->derivatives[k][d] * power;
    }
    return value;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where,
                              const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean logging) {
    return calloc(1, sizeof(Smooth));
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) { return fmi2OK; }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real start, fmi2Boolean d, fmi2Real e) { return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[]) {
    Smooth *s = c;
    for (size_t i = 0; i < n; i++) *(r[i] >= X ? &s->x[r[i] - X] : &s->u[r[i] - U]) = v[i];
    return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[]) {
    Smooth *s = c;
    for (size_t i = 0; i < n; i++) v[i] = r[i] >= X ? s->x[r[i] - X] : s->u[r[i] - U];
    return fmi2OK;
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer orders[],
                                       const fmi2Real v[]) {
    Smooth *s = c;
    for (size_t i = 0; i < n; i++) {
        if (orders[i] < 1 || orders[i] > ORDERS || r[i] >= X) return fmi2Error;
        s->derivatives[r[i] - U][orders[i] - 1] = v[i];
    }
    return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean keep) {
    Smooth *s = c;
    const double h = size / STEPS;
    for (int k = 0; k < N; k++)
        for (int i = 0; i < STEPS; i++) {
            const double x = s->x[k], a = input(s, k, i * h), b = input(s, k, (i + 0.5) * h), e = input(s, k, (i + 1) * h);
            const double k1 = a - x, k2 = b - (x + 0.5 * h * k1), k3 = b - (x + 0.5 * h * k2), k4 = e - (x + h * k3);
            s->x[k] = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
        }
    memset(s->derivatives, 0, sizeof s->derivatives);
    return fmi2OK;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *kept) {
    if (!*kept) *kept = malloc(sizeof(Smooth));
    memcpy(*kept, c, sizeof(Smooth));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate kept) { memcpy(c, kept, sizeof(Smooth)); return fmi2OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *kept) { free(*kept); *kept = NULL; return fmi2OK; }
