/* A test FMU for FMI 2.0 and 3.0 (-DFMI=2 or 3) whose counter steps from 1 upwards at each multiple of `period`, and
   ends the simulation at `last`; `held` is the input of the last one. It handles an event at its own time only, and
   refuses to be integrated beyond it, as the standard lets it. In FMI 3's Co-Simulation it returns early at an event
   where that is allowed. -DSTATES=1 adds a state, dx/dt = counter + u, which each event raises by `jump`; -DSTATES=2
   another, dw/dt = x. */

#include <float.h>
#include <math.h>
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

#ifdef SILENT
#define TELLS 0
#else
#define TELLS 1
#endif
enum { OK, WARNING, DISCARD, ERROR };
enum { U = 1, X, DX, Y, PERIOD, JUMP, COUNTER, LAST, MIDDLE, HELD, W, DW };

typedef struct {
    double time, u, x, w, next, period, jump, held;
    int counter, last, ended, event_mode, returns;
} Stair;

static int reached(const Stair *s) { return fabs(s->time - s->next) <= 4 * DBL_EPSILON * (1 + fabs(s->time)); }

static int update(Stair *s) {
    if (!reached(s)) return 0;
    s->counter++;
    s->held = s->u;
    s->x += s->jump;
    s->next = s->counter * s->period;
    s->ended = s->counter >= s->last;
    return s->jump != 0;
}

static Status advance(Stair *s, double t, double h) {
    const double end = t + h;
    for (;;) {
        const double to = s->next < end + 1e-9 * h ? s->next : end;
        s->w += (to - s->time) * (s->x + 0.5 * (to - s->time) * (s->counter + s->u));
        s->x += (to - s->time) * (s->counter + s->u);
        s->time = to;
        if (!reached(s) || s->returns) break;
        update(s);
        if (s->ended) break;
    }
    if (!s->ended && !s->returns) s->time = end;
    return OK;
}

static Status set_real(Stair *s, Reference r, double value) {
    double *places[] = {[U] = &s->u, [X] = &s->x, [PERIOD] = &s->period, [JUMP] = &s->jump, [W] = &s->w};
    *places[r] = value;
    return OK;
}
static Status get_real(const Stair *s, Reference r, double *value) {
    const double values[] = {[U] = s->u, [X] = s->x, [DX] = s->counter + s->u, [Y] = s->counter + s->u,
                             [HELD] = s->held, [W] = s->w, [DW] = s->x};
    *value = values[r];
    return OK;
}

static Stair *create(void) {
    Stair *s = calloc(1, sizeof *s);
    s->counter = 1; s->period = 1; s->last = 1 << 30;
    return s;
}

Status F(SetDebugLogging)(void *c, Flag on, size_t n, const char *const categories[]) { return OK; }
void F(FreeInstance)(void *c) { free(c); }
Status F(ExitInitializationMode)(void *c) { Stair *s = c; s->next = s->period; s->event_mode = 1; return OK; }
Status F(Terminate)(void *c) { return OK; }
Status F(EnterEventMode)(void *c) { ((Stair *)c)->event_mode = 1; return OK; }
Status F(EnterContinuousTimeMode)(void *c) { ((Stair *)c)->event_mode = 0; return ((Stair *)c)->ended ? ERROR : OK; }
Status F(SetTime)(void *c, double t) {
    Stair *s = c;
    if (t > s->next + 4 * DBL_EPSILON * (1 + t)) return ERROR;          /* beyond an event */
    if (s->counter > 1 && t < s->next - s->period - 1e-12) return ERROR; /* back before one */
    s->time = t;
    return OK;
}
Status F(SetContinuousStates)(void *c, const double x[], size_t n) {
    Stair *s = c;
    s->x = x[0];
    if (n == 2) s->w = x[1];
    return n == STATES ? OK : ERROR;
}
Status F(GetContinuousStates)(void *c, double x[], size_t n) {
    Stair *s = c;
    x[0] = s->x;
    if (n == 2) x[1] = s->w;
    return n == STATES ? OK : ERROR;
}
Status F(GetEventIndicators)(void *c, double z[], size_t n) { return n == 0 ? OK : ERROR; }
static Status derivatives(Stair *s, double d[], size_t n) {
    d[0] = s->counter + s->u;
    if (n == 2) d[1] = s->x;
    return n == STATES ? OK : ERROR;
}

static Status keep(const Stair *s, void **kept) {
    if (!*kept) *kept = malloc(sizeof *s);
    memcpy(*kept, s, sizeof *s);
    return OK;
}
static Status go_back(Stair *s, const void *kept) { memcpy(s, kept, sizeof *s); return OK; }

#define EACH(call) do { Status status = OK; for (size_t i = 0; i < n && status == OK; i++) status = call; return status; } while (0)
#if FMI == 2
void *fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where, const fmi2CallbackFunctions *f,
                      fmi2Boolean visible, fmi2Boolean logging) { return create(); }
Status fmi2SetupExperiment(void *c, fmi2Boolean a, fmi2Real b, fmi2Real start, fmi2Boolean d, fmi2Real e) { return OK; }
Status fmi2EnterInitializationMode(void *c) { return OK; }
Status fmi2NewDiscreteStates(void *c, fmi2EventInfo *e) {
    Stair *s = c;
    memset(e, 0, sizeof *e);
    e->valuesOfContinuousStatesChanged = update(s);
    e->terminateSimulation = s->ended;
    e->nextEventTimeDefined = 1; e->nextEventTime = s->next;
    return s->event_mode ? OK : ERROR;
}
Status fmi2CompletedIntegratorStep(void *c, fmi2Boolean no, fmi2Boolean *enter, fmi2Boolean *end) { *enter = *end = 0; return OK; }
Status fmi2GetDerivatives(void *c, double d[], size_t n) { return derivatives(c, d, n); }
Status fmi2DoStep(void *c, double t, double h, fmi2Boolean keep) {
    Stair *s = c;
    advance(s, t, h);
    return s->ended ? DISCARD : OK;
}
Status fmi2GetBooleanStatus(void *c, const fmi2StatusKind kind, fmi2Boolean *value) { *value = ((Stair *)c)->ended; return kind == fmi2Terminated ? OK : ERROR; }
Status fmi2GetRealStatus(void *c, const fmi2StatusKind kind, fmi2Real *value) { *value = ((Stair *)c)->time; return kind == fmi2LastSuccessfulTime ? OK : ERROR; }
#ifndef SAVES
Status fmi2GetFMUstate(void *c, fmi2FMUstate *s) { return keep(c, s); }
Status fmi2SetFMUstate(void *c, fmi2FMUstate s) { return go_back(c, s); }
Status fmi2FreeFMUstate(void *c, fmi2FMUstate *s) { free(*s); *s = NULL; return OK; }
#endif
Status fmi2SetReal(void *c, const Reference r[], size_t n, const double v[]) { EACH(set_real(c, r[i], v[i])); }
Status fmi2GetReal(void *c, const Reference r[], size_t n, double v[]) { EACH(get_real(c, r[i], v + i)); }
Status fmi2SetInteger(void *c, const Reference r[], size_t n, const int v[]) { ((Stair *)c)->last = v[0]; return OK; }
Status fmi2GetInteger(void *c, const Reference r[], size_t n, int v[]) { v[0] = ((Stair *)c)->counter; return OK; }
#else
void *fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) { return create(); }
void *fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean eventful, fmi3Boolean early, const fmi3ValueReference required[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    Stair *s = create();
    s->returns = eventful && early;
    return s;
}
Status fmi3EnterInitializationMode(void *c, fmi3Boolean a, double b, double start, fmi3Boolean d, double e) { return OK; }
Status fmi3UpdateDiscreteStates(void *c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
                                fmi3Boolean *values, fmi3Boolean *defined, double *next) {
    Stair *s = c;
    *again = *nominals = 0; *values = update(s); *end = s->ended; *defined = TELLS; *next = s->next;
    return s->event_mode ? OK : ERROR;
}
Status fmi3CompletedIntegratorStep(void *c, fmi3Boolean no, fmi3Boolean *enter, fmi3Boolean *end) { *enter = *end = 0; return OK; }
Status fmi3GetContinuousStateDerivatives(void *c, double d[], size_t n) { return derivatives(c, d, n); }
Status fmi3DoStep(void *c, double t, double h, fmi3Boolean keep, fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early, double *last) {
    Stair *s = c;
    advance(s, t, h);
    *event = s->returns && reached(s); *end = s->ended; *early = s->time < t + h - 1e-9 * h; *last = s->time;
    return OK;
}
Status fmi3EnterStepMode(void *c) { ((Stair *)c)->event_mode = 0; return OK; }
#ifndef SAVES
Status fmi3GetFMUState(void *c, fmi3FMUState *s) { return keep(c, s); }
Status fmi3SetFMUState(void *c, fmi3FMUState s) { return go_back(c, s); }
Status fmi3FreeFMUState(void *c, fmi3FMUState *s) { free(*s); *s = NULL; return OK; }
#endif
Status fmi3SetFloat64(void *c, const Reference r[], size_t n, const double v[], size_t nv) { EACH(set_real(c, r[i], v[i])); }
Status fmi3GetFloat64(void *c, const Reference r[], size_t n, double v[], size_t nv) { EACH(get_real(c, r[i], v + i)); }
Status fmi3SetInt32(void *c, const Reference r[], size_t n, const int v[], size_t nv) { ((Stair *)c)->last = v[0]; return OK; }
Status fmi3GetInt32(void *c, const Reference r[], size_t n, int v[], size_t nv) { v[0] = ((Stair *)c)->counter; return OK; }
#endif

#ifdef SAVES
#define SAVED Stair
static void leave(Stair *s, const Stair *own) { if (SAVES == 2) s->event_mode = own->event_mode; }
#include "saving.h"
#endif
