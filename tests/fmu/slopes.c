/* A test FMU for FMI 2.0 and 3.0 (-DFMI=2 or 3) that knows its directional derivatives:

       y_i = q round((K_i1 u_1 + K_i2 u_2 + a cos(u_i) + b_i (1 + t) + (on ? 1 : 0)) / q)     q = 0: not rounded

   Its derivatives are those of what is rounded, times `lie`. What it answers when asked for them, for the n-th time and
   from then on, is `answer`. It counts calls: as it is terminated, it appends them to the file $SLOPES_COUNTS. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if FMI == 2
#include "fmi2Functions.h"
typedef fmi2Status Status;
typedef fmi2ValueReference Reference;
typedef fmi2Component Handle;
typedef fmi2Real Float64;
typedef fmi2Boolean Boolean;
#define F(name) fmi2##name
#else
#include "fmi3Functions.h"
typedef fmi3Status Status;
typedef fmi3ValueReference Reference;
typedef fmi3Instance Handle;
typedef fmi3Float64 Float64;
typedef fmi3Boolean Boolean;
#define F(name) fmi3##name
#endif

enum { OK, WARNING, DISCARD, ERROR, FATAL, NOT_A_NUMBER };
enum { U1 = 1, U2, ON, Y1 = 11, Y2, K11 = 21, K12, K21, K22, A, B1, B2, Q, LIE, ANSWER, NTH, MODE = 50, MOST };

typedef struct { double v[MOST], time; int asked, dead; } Slopes;

enum { SETS, GETS, ASKS, N };
static const char *names[] = {"Set", "Get", "GetDirectionalDerivative"};
static int counts[N];

static double raw(const Slopes *s, int i) {
    const double *v = s->v, u = v[U1 + i];
    return v[K11 + 2 * i] * v[U1] + v[K12 + 2 * i] * v[U2] + v[A] * cos(u) + v[B1 + i] * (1 + s->time) + (v[ON] != 0);
}
static double value(const Slopes *s, Reference r) {
    if (r != Y1 && r != Y2) return s->v[r];
    const double q = s->v[Q], y = raw(s, r - Y1);
    return q > 0 ? q * round(y / q) : y;
}
static double slope(const Slopes *s, Reference unknown, Reference known) {
    const int i = unknown - Y1, j = known - U1;
    return s->v[LIE] * (s->v[K11 + 2 * i + j] - (i == j ? s->v[A] * sin(s->v[known]) : 0));
}

static Status derivative(Slopes *s, const Reference unknowns[], size_t n, const Reference knowns[], size_t m,
                         const double seed[], double sensitivity[]) {
    double largest = 0;
    counts[ASKS]++;
    if (s->dead) return ERROR;
    for (size_t j = 0; j < m; j++) {
        if (knowns[j] != U1 && knowns[j] != U2) return ERROR;
        largest = fmax(largest, fabs(seed[j]));
    }
    if (largest != 1) return ERROR;
    const int answer = ++s->asked >= s->v[NTH] ? (int)s->v[ANSWER] : OK;
    if (answer == FATAL) s->dead = 1;
    if (answer == DISCARD || answer == ERROR || answer == FATAL) return answer;
    for (size_t i = 0; i < n; i++) {
        if (unknowns[i] != Y1 && unknowns[i] != Y2) return ERROR;
        sensitivity[i] = answer == NOT_A_NUMBER ? NAN : 0;
        for (size_t j = 0; j < m; j++) sensitivity[i] += slope(s, unknowns[i], knowns[j]) * seed[j];
    }
    return answer == WARNING ? WARNING : OK;
}

Status F(Terminate)(Handle c) {
    const char *path = getenv("SLOPES_COUNTS");
    FILE *file = path ? fopen(path, "a") : NULL;
    for (int k = 0; file && k < N; k++) fprintf(file, "%s %d\n", names[k], counts[k]);
    if (file) fclose(file);
    memset(counts, 0, sizeof counts);
    return OK;
}
void F(FreeInstance)(Handle c) { free(c); }
Status F(ExitInitializationMode)(Handle c) { return OK; }
Status F(EnterEventMode)(Handle c) { return OK; }
Status F(EnterContinuousTimeMode)(Handle c) { return OK; }
Status F(SetTime)(Handle c, Float64 t) { ((Slopes *)c)->time = t; return OK; }
Status F(SetContinuousStates)(Handle c, const Float64 x[], size_t n) { return OK; }
Status F(GetContinuousStates)(Handle c, Float64 x[], size_t n) { return OK; }
Status F(GetEventIndicators)(Handle c, Float64 z[], size_t n) { return OK; }

#define SET \
    counts[SETS]++; \
    if (((Slopes *)c)->dead) return ERROR; \
    for (size_t i = 0; i < n; i++) ((Slopes *)c)->v[r[i]] = v[i]; \
    return OK;
#define GET \
    counts[GETS]++; \
    for (size_t i = 0; i < n; i++) v[i] = value(c, r[i]); \
    return OK;

static Handle made(void) {
    Slopes *s = calloc(1, sizeof(Slopes));
    s->v[LIE] = s->v[NTH] = 1;
    return s;
}

#if FMI == 2
Status fmi2SetReal(Handle c, const Reference r[], size_t n, const Float64 v[]) { SET }
Status fmi2GetReal(Handle c, const Reference r[], size_t n, Float64 v[]) { GET }
Status fmi2SetInteger(Handle c, const Reference r[], size_t n, const fmi2Integer v[]) { SET }
Status fmi2SetBoolean(Handle c, const Reference r[], size_t n, const Boolean v[]) { SET }
Status fmi2GetDirectionalDerivative(Handle c, const Reference unknowns[], size_t n, const Reference knowns[], size_t m,
                                    const Float64 seed[], Float64 sensitivity[]) {
    return derivative(c, unknowns, n, knowns, m, seed, sensitivity);
}
Handle fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where, const fmi2CallbackFunctions *f,
                       fmi2Boolean visible, fmi2Boolean logging) { return made(); }
Status fmi2SetupExperiment(Handle c, fmi2Boolean a, fmi2Real b, fmi2Real start, fmi2Boolean d, fmi2Real e) { return OK; }
Status fmi2EnterInitializationMode(Handle c) { return OK; }
Status fmi2DoStep(Handle c, fmi2Real t, fmi2Real h, fmi2Boolean keep) { ((Slopes *)c)->time = t + h; return OK; }
Status fmi2CompletedIntegratorStep(Handle c, Boolean keep, Boolean *event, Boolean *end) { *event = *end = 0; return OK; }
Status fmi2GetDerivatives(Handle c, Float64 d[], size_t n) { return OK; }
Status fmi2NewDiscreteStates(Handle c, fmi2EventInfo *info) { memset(info, 0, sizeof *info); return OK; }
#else
Status fmi3SetFloat64(Handle c, const Reference r[], size_t n, const Float64 v[], size_t nv) { SET }
Status fmi3GetFloat64(Handle c, const Reference r[], size_t n, Float64 v[], size_t nv) { GET }
Status fmi3SetInt32(Handle c, const Reference r[], size_t n, const fmi3Int32 v[], size_t nv) { SET }
Status fmi3SetBoolean(Handle c, const Reference r[], size_t n, const Boolean v[], size_t nv) { SET }
Status fmi3GetDirectionalDerivative(Handle c, const Reference unknowns[], size_t n, const Reference knowns[], size_t m,
                                    const Float64 seed[], size_t n_seed, Float64 sensitivity[], size_t n_sensitivity) {
    return n_seed == m && n_sensitivity == n ? derivative(c, unknowns, n, knowns, m, seed, sensitivity) : ERROR;
}
Handle fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
                                   fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                   const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment e,
                                   fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) { return made(); }
Handle fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
                                    fmi3Boolean logging, fmi3InstanceEnvironment e, fmi3LogMessageCallback log) {
    return made();
}
Status fmi3EnterInitializationMode(Handle c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 start, fmi3Boolean d, fmi3Float64 e) { return OK; }
Status fmi3EnterStepMode(Handle c) { return OK; }
Status fmi3GetContinuousStateDerivatives(Handle c, Float64 d[], size_t n) { return OK; }
Status fmi3UpdateDiscreteStates(Handle c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals, fmi3Boolean *states,
                                fmi3Boolean *defined, fmi3Float64 *next) {
    *again = *end = *nominals = *states = *defined = 0;
    return OK;
}
Status fmi3DoStep(Handle c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event, fmi3Boolean *end,
                  fmi3Boolean *early, fmi3Float64 *last) {
    *event = *end = *early = 0;
    *last = ((Slopes *)c)->time = t + h;
    return OK;
}
#endif
