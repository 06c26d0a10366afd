/* A test FMU for FMI 2.0 and 3.0 (-DFMI=2 or 3): a ball that bounces, d2h/dt2 = -g, in Model Exchange with an event
   indicator, h, and a state that can be kept; it counts its bounces and notes the time of the last. */

#include <stdlib.h>
#include <string.h>

#if FMI == 2
#include "fmi2Functions.h"
typedef fmi2Status Status;
typedef fmi2Boolean Flag;
typedef fmi2ValueReference Reference;
#define F(name) fmi2##name
#else
#include "fmi3Functions.h"
typedef fmi3Status Status;
typedef fmi3Boolean Flag;
typedef fmi3ValueReference Reference;
#define F(name) fmi3##name
#endif

enum { OK, WARNING, DISCARD, ERROR };
enum { H = 1, DH, V, DV, E, LAST, BOUNCES, Z };

typedef struct { double time, h, v, e, last; int bounces, kept; } Ball;

static int update(Ball *b) {
    if (b->h > 0 || b->v >= 0) return 0;
    b->v *= -b->e;
    b->last = b->time;
    b->bounces++;
    return 1;
}
static Status set_real(Ball *b, Reference r, double value) {
    double *places[] = {[H] = &b->h, [V] = &b->v, [E] = &b->e};
    *places[r] = value;
    return OK;
}
static Status get_real(const Ball *b, Reference r, double *value) {
    const double values[] = {[H] = b->h, [DH] = b->v, [V] = b->v, [DV] = -9.81, [E] = b->e, [LAST] = b->last, [Z] = b->h};
    *value = values[r];
    return OK;
}
static void *create(void) {
    Ball *b = calloc(1, sizeof *b);
    b->h = 1; b->e = 0.7; b->last = -1;
    return b;
}

Status F(SetDebugLogging)(void *c, Flag on, size_t n, const char *const categories[]) { return OK; }
void F(FreeInstance)(void *c) { free(c); }
Status F(ExitInitializationMode)(void *c) { return OK; }
Status F(Terminate)(void *c) { return OK; }
Status F(EnterEventMode)(void *c) { return OK; }
Status F(EnterContinuousTimeMode)(void *c) { return OK; }
Status F(SetTime)(void *c, double t) { ((Ball *)c)->time = t; return OK; }
Status F(SetContinuousStates)(void *c, const double x[], size_t n) { Ball *b = c; b->h = x[0]; b->v = x[1]; return OK; }
Status F(GetContinuousStates)(void *c, double x[], size_t n) { Ball *b = c; x[0] = b->h; x[1] = b->v; return OK; }
Status F(GetEventIndicators)(void *c, double z[], size_t n) { z[0] = ((Ball *)c)->h; return n == 1 ? OK : ERROR; }
static Status derivatives(Ball *b, double d[]) { d[0] = b->v; d[1] = -9.81; return OK; }
static Status keep(const Ball *b, void **state) {
    if (!*state) *state = malloc(sizeof *b);
    memcpy(*state, b, sizeof *b);
    return OK;
}
static Status go_back(Ball *b, const void *state) { memcpy(b, state, sizeof *b); return OK; }

#define EACH(call) do { Status status = OK; for (size_t i = 0; i < n && status == OK; i++) status = call; return status; } while (0)
#if FMI == 2
void *fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where, const fmi2CallbackFunctions *f,
                      fmi2Boolean visible, fmi2Boolean logging) { return create(); }
Status fmi2SetupExperiment(void *c, fmi2Boolean a, fmi2Real b, fmi2Real start, fmi2Boolean d, fmi2Real e) { return OK; }
Status fmi2EnterInitializationMode(void *c) { return OK; }
Status fmi2NewDiscreteStates(void *c, fmi2EventInfo *e) {
    memset(e, 0, sizeof *e);
    e->valuesOfContinuousStatesChanged = update(c);
    return OK;
}
Status fmi2CompletedIntegratorStep(void *c, fmi2Boolean no, fmi2Boolean *enter, fmi2Boolean *end) { *enter = *end = 0; return OK; }
Status fmi2GetDerivatives(void *c, double d[], size_t n) { return derivatives(c, d); }
Status fmi2GetFMUstate(void *c, fmi2FMUstate *s) { return keep(c, s); }
Status fmi2SetFMUstate(void *c, fmi2FMUstate s) { return go_back(c, s); }
Status fmi2FreeFMUstate(void *c, fmi2FMUstate *s) { free(*s); *s = NULL; return OK; }
Status fmi2SetReal(void *c, const Reference r[], size_t n, const double v[]) { EACH(set_real(c, r[i], v[i])); }
Status fmi2GetReal(void *c, const Reference r[], size_t n, double v[]) { EACH(get_real(c, r[i], v + i)); }
Status fmi2GetInteger(void *c, const Reference r[], size_t n, int v[]) { v[0] = ((Ball *)c)->bounces; return OK; }
#else
void *fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) { return create(); }
Status fmi3EnterInitializationMode(void *c, fmi3Boolean a, double b, double start, fmi3Boolean d, double e) { return OK; }
Status fmi3UpdateDiscreteStates(void *c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
                                fmi3Boolean *values, fmi3Boolean *defined, double *next) {
    *again = *end = *nominals = *defined = 0;
    *values = update(c);
    return OK;
}
Status fmi3CompletedIntegratorStep(void *c, fmi3Boolean no, fmi3Boolean *enter, fmi3Boolean *end) { *enter = *end = 0; return OK; }
Status fmi3GetContinuousStateDerivatives(void *c, double d[], size_t n) { return derivatives(c, d); }
Status fmi3GetFMUState(void *c, fmi3FMUState *s) { return keep(c, s); }
Status fmi3SetFMUState(void *c, fmi3FMUState s) { return go_back(c, s); }
Status fmi3FreeFMUState(void *c, fmi3FMUState *s) { free(*s); *s = NULL; return OK; }
Status fmi3SetFloat64(void *c, const Reference r[], size_t n, const double v[], size_t nv) { EACH(set_real(c, r[i], v[i])); }
Status fmi3GetFloat64(void *c, const Reference r[], size_t n, double v[], size_t nv) { EACH(get_real(c, r[i], v + i)); }
Status fmi3GetInt32(void *c, const Reference r[], size_t n, int v[], size_t nv) { v[0] = ((Ball *)c)->bounces; return OK; }
#endif
