/* A test FMU for FMI 2.0 and 3.0 (-DFMI=2 or 3), Co-Simulation and Model Exchange, that keeps the importer to the
   state machine: a call that the standard does not allow now is answered with an error and a message.

   x     lag, T dx/dt = u - x                 y    2 u + x, direct feedthrough
   h, v  a ball that bounces                  off  not on        m     n + 1
   ticks time events, every 0.25 s            fault: what goes wrong from fault_time on */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#if FMI == 2
#include "fmi2Functions.h"
typedef fmi2Status Status;
typedef fmi2Boolean Flag;
typedef fmi2ValueReference Reference;
typedef fmi2Component Handle;
#define F(name) fmi2##name
#else
#include "fmi3Functions.h"
typedef fmi3Status Status;
typedef fmi3Boolean Flag;
typedef fmi3ValueReference Reference;
typedef fmi3Instance Handle;
#define F(name) fmi3##name
#endif

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { INSTANTIATED = 1, INITIALIZING = 2, RUNNING = 4, EVENT = 8, STOPPED = 16 };
enum { NONE, F_DISCARD, F_ERROR, F_FATAL, F_NAN, F_EARLY, F_END, F_WARN, F_REFUSE, F_SEGFAULT, F_HANG, F_STUCK,
       F_ABORT, F_EXIT, F_CLOSE, F_EARLY_AT_END = -1 };
enum { IN_EXIT_INITIALIZATION = 100, IN_TERMINATE = 200, IN_FREE = 300 }; /* added to a fault: not in a step, but there */
enum { U = 1, X, Y, T, FAULT_TIME, H, V, DX, DH, DV, FAULT = 20, BOUNCES, N, M, TICKS, COLOR, ON = 30, OFF, NAME = 40,
       ARRAY = 50, TWICE, SHORT, SHORT_NEXT, BYTE, BYTE_NEXT };

typedef struct {
    int state, me, eventful, early_allowed, event_due, early_done;
    double time, u, x, tau, fault_time, h, v, next;
    int fault, bounces, n, ticks, color, on;
    double array[6];
    float single;
    signed char byte;
    char name[64];
    void *environment;
#if FMI == 2
    fmi2CallbackLogger log;
#else
    fmi3LogMessageCallback log;
#endif
} Machine;

static Status say(Machine *m, Status status, const char *what) {
#if FMI == 2
    m->log(m->environment, "machine", status, "logStatusError", "%s at %g, in state %d (%s)", what, m->time, m->state, m->name);
#else
    char text[200];
    snprintf(text, sizeof text, "%s at %g, in state %d (%s)", what, m->time, m->state, m->name);
    m->log(m->environment, status, "logStatusError", text);
#endif
    return status;
}

#define ALLOWED(states) do { if (!(m->state & (states))) return say(m, ERROR, __func__); } while (0)
static int faulty(Machine *m, int fault) { return m->fault == fault && m->time >= m->fault_time - 1e-12; }

static void misbehave(int fault) {
    switch (fault) {
    case F_SEGFAULT: *(volatile int *)8 = 1; break;
    case F_HANG: /* tell the test that waits for it */
        if (getenv("MACHINE_HANGS")) fclose(fopen(getenv("MACHINE_HANGS"), "w"));
        for (volatile int k = 0;; k++) {}
    case F_ABORT: abort();
    case F_EXIT: exit(3);
    case F_CLOSE: for (int file = 3; file < 1024; file++) close(file);
    }
}

static Status set_real(Machine *m, Reference r, double value) {
    switch (r) {
    case U: if (m->state == STOPPED) return say(m, ERROR, "set u"); m->u = value; return OK;
    case X: ALLOWED(INSTANTIATED | INITIALIZING); m->x = value; return OK;
    case H: ALLOWED(INSTANTIATED | INITIALIZING); m->h = value; return OK;
    case V: ALLOWED(INSTANTIATED | INITIALIZING); m->v = value; return OK;
    case T: m->tau = value; return OK;
    case FAULT_TIME: m->fault_time = value; return OK;
    }
    return say(m, ERROR, "set real");
}
static Status get_real(Machine *m, Reference r, double *value) {
    if (m->state == INSTANTIATED) return say(m, ERROR, "get before initialization");
    switch (r) {
    case U: *value = m->u; return OK;
    case X: *value = faulty(m, F_NAN) ? NAN : m->x; return OK;
    case Y: *value = 2 * m->u + m->x; return OK;
    case T: *value = m->tau; return OK;
    case H: *value = m->h; return OK;
    case V: *value = m->v; return OK;
    case DX: *value = (m->u - m->x) / m->tau; return OK;
    case DH: *value = m->v; return OK;
    case DV: *value = -9.81; return OK;
    }
    return say(m, ERROR, "get real");
}
static Status set_integer(Machine *m, Reference r, int value) {
    if (r == FAULT) { ALLOWED(INSTANTIATED | INITIALIZING); m->fault = value; return OK; }
    if (r != N && r != COLOR) return say(m, ERROR, "set integer");
    if (m->me) ALLOWED(INSTANTIATED | INITIALIZING | EVENT); /* discrete: not in Continuous-Time Mode */
    if (r == N) m->n = value; else m->color = value;
    return OK;
}
static Status get_integer(Machine *m, Reference r, int *value) {
    switch (r) {
    case BOUNCES: *value = m->bounces; return OK;
    case M: *value = m->n + 1; return OK;
    case TICKS: *value = m->ticks; return OK;
    }
    return say(m, ERROR, "get integer");
}
static Status set_boolean(Machine *m, Reference r, int value) {
    if (r != ON) return say(m, ERROR, "set boolean");
    if (m->me) ALLOWED(INSTANTIATED | INITIALIZING | EVENT);
    m->on = value;
    return OK;
}

static void bounce(Machine *m) {
    if (m->h <= 0 && m->v < 0) { m->h = 0; m->v *= -0.7; m->bounces++; m->event_due = 0; }
}
static int tick(Machine *m) {
    int ticked = 0;
    while (m->time >= m->next - 1e-9) { m->ticks++; m->next += 0.25; ticked = 1; }
    return ticked;
}
static Status update(Machine *m, int *jumped) {
    ALLOWED(EVENT);
    double before = m->v;
    if (faulty(m, F_WARN)) say(m, WARNING, "just a warning");
    tick(m);
    bounce(m);
    *jumped = m->v != before;
    return OK;
}
static Status advance(Machine *m, double t, double h) {
    if (fabs(t - m->time) > 1e-9) return say(m, ERROR, "a step from another time");
    if (faulty(m, F_DISCARD)) return say(m, DISCARD, "cannot do this step");
    if (faulty(m, F_ERROR)) return say(m, ERROR, "cannot go on");
    if (faulty(m, F_FATAL)) return say(m, FATAL, "all is lost");
    if (m->time >= m->fault_time - 1e-12) {
        if (m->fault >= F_SEGFAULT) say(m, WARNING, "a bad feeling");
        misbehave(m->fault);
    }
    double dx = (m->u - m->x) / m->tau, dh = m->v;
    m->x += h * dx;
    m->h += h * dh;
    m->v += h * -9.81;
    m->time = t + h;
    return faulty(m, F_WARN) ? say(m, WARNING, "just a warning") : OK;
}

static Machine *create(int me, void *environment) {
    Machine *m = calloc(1, sizeof *m);
    m->state = INSTANTIATED; m->me = me; m->environment = environment;
    m->tau = 1; m->h = 1; m->next = 0.25; m->fault_time = 0;
    return m;
}

/* ---- functions that both versions have ---- */

Status F(SetDebugLogging)(Handle c, Flag on, size_t n, const char *const categories[]) { return OK; }
void F(FreeInstance)(Handle c) { misbehave(((Machine *)c)->fault - IN_FREE); free(c); }
Status F(ExitInitializationMode)(Handle c) {
    Machine *m = c; ALLOWED(INITIALIZING);
    misbehave(m->fault - IN_EXIT_INITIALIZATION);
    m->state = m->me || m->eventful ? EVENT : RUNNING;
    return OK;
}
Status F(Terminate)(Handle c) {
    Machine *m = c; ALLOWED(RUNNING | EVENT);
    misbehave(m->fault - IN_TERMINATE);
    m->state = STOPPED;
    return OK;
}
Status F(EnterEventMode)(Handle c) { Machine *m = c; ALLOWED(RUNNING); m->state = EVENT; return OK; }
Status F(EnterContinuousTimeMode)(Handle c) { Machine *m = c; ALLOWED(EVENT); m->state = RUNNING; return OK; }
Status F(SetTime)(Handle c, double t) { Machine *m = c; ALLOWED(RUNNING | EVENT); m->time = t; return OK; }
Status F(SetContinuousStates)(Handle c, const double x[], size_t n) {
    Machine *m = c; ALLOWED(RUNNING);
    if (faulty(m, F_REFUSE)) return say(m, DISCARD, "refuses these states");
    m->h = x[0]; m->x = x[1]; m->v = x[2];
    return n == 3 ? OK : say(m, ERROR, "states");
}
Status F(GetContinuousStates)(Handle c, double x[], size_t n) {
    Machine *m = c; x[0] = m->h; x[1] = m->x; x[2] = m->v;
    return n == 3 ? OK : say(m, ERROR, "states");
}
static Status derivatives(Machine *m, double d[], size_t n) {
    ALLOWED(RUNNING | EVENT);
    d[0] = m->v; d[1] = (m->u - m->x) / m->tau; d[2] = -9.81;
    return n == 3 ? OK : say(m, ERROR, "derivatives");
}
Status F(GetEventIndicators)(Handle c, double z[], size_t n) {
    Machine *m = c; ALLOWED(RUNNING | EVENT);
    z[0] = m->h;
    return n == 1 ? OK : say(m, ERROR, "event indicators");
}
Status F(CompletedIntegratorStep)(Handle c, Flag no_set, Flag *enter, Flag *end) {
    Machine *m = c; ALLOWED(RUNNING);
    *enter = 0; *end = faulty(m, F_END);
    return OK;
}

#if FMI == 2
/* ---- FMI 2.0 ---- */

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where,
                              const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean logging) {
    if (strcmp(guid, "machine") || strncmp(where, "file:///", 8)) return NULL;
    if (!strcmp(name, "crash")) misbehave(F_SEGFAULT);
    Machine *m = create(type == fmi2ModelExchange, f->componentEnvironment);
    m->log = f->logger;
    return m;
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real start, fmi2Boolean d, fmi2Real e) {
    Machine *m = c; ALLOWED(INSTANTIATED); m->time = start; return OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Machine *m = c; ALLOWED(INSTANTIATED); m->state = INITIALIZING; return OK;
}
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *e) {
    int jumped; Status s = update(c, &jumped); Machine *m = c;
    memset(e, 0, sizeof *e);
    e->valuesOfContinuousStatesChanged = jumped;
    e->nextEventTimeDefined = 1; e->nextEventTime = m->next;
    return s;
}
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real d[], size_t n) { return derivatives(c, d, n); }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keep) {
    Machine *m = c; ALLOWED(RUNNING);
    Status s = advance(m, t, h);
    tick(m);
    bounce(m);
    return s;
}
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *value) { *value = ((Machine *)c)->time; return OK; }
#define EACH(call) do { Status s = OK; for (size_t i = 0; i < n && s <= WARNING; i++) s = call; return s; } while (0)
fmi2Status fmi2SetReal(fmi2Component c, const Reference r[], size_t n, const fmi2Real v[]) { EACH(set_real(c, r[i], v[i])); }
fmi2Status fmi2GetReal(fmi2Component c, const Reference r[], size_t n, fmi2Real v[]) { EACH(get_real(c, r[i], v + i)); }
fmi2Status fmi2SetInteger(fmi2Component c, const Reference r[], size_t n, const fmi2Integer v[]) { EACH(set_integer(c, r[i], v[i])); }
fmi2Status fmi2GetInteger(fmi2Component c, const Reference r[], size_t n, fmi2Integer v[]) { EACH(get_integer(c, r[i], v + i)); }
fmi2Status fmi2SetBoolean(fmi2Component c, const Reference r[], size_t n, const fmi2Boolean v[]) { EACH(set_boolean(c, r[i], v[i])); }
fmi2Status fmi2GetBoolean(fmi2Component c, const Reference r[], size_t n, fmi2Boolean v[]) { v[0] = !((Machine *)c)->on; return OK; }
fmi2Status fmi2SetString(fmi2Component c, const Reference r[], size_t n, const fmi2String v[]) {
    strncpy(((Machine *)c)->name, v[0], 63); return OK;
}

#else
/* ---- FMI 3.0 ---- */

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    if (strcmp(token, "machine") || where[strlen(where) - 1] != '/') return NULL;
    Machine *m = create(1, environment);
    m->log = log;
    return m;
}
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean eventful, fmi3Boolean early, const fmi3ValueReference required[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback intermediate) {
    if (strcmp(token, "machine")) return NULL;
    Machine *m = create(0, environment);
    m->log = log; m->eventful = eventful; m->early_allowed = early;
    return m;
}
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 start, fmi3Boolean d, fmi3Float64 e) {
    Machine *m = c; ALLOWED(INSTANTIATED); m->state = INITIALIZING; m->time = start; return OK;
}
fmi3Status fmi3EnterStepMode(fmi3Instance c) { Machine *m = c; ALLOWED(EVENT); m->state = RUNNING; return OK; }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next) {
    int jumped; Status s = update(c, &jumped); Machine *m = c;
    *again = *end = *nominals = 0; *values = jumped; *defined = 1; *next = m->next;
    return s;
}
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 d[], size_t n) { return derivatives(c, d, n); }
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event,
                      fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last) {
    Machine *m = c; ALLOWED(RUNNING);
    *event = *end = *early = 0;
    if (faulty(m, F_STUCK)) { *early = 1; *last = t; return OK; }
    int whole = faulty(m, F_EARLY_AT_END);
    if (whole && !(h > 0)) return say(m, ERROR, "a step of no length");
    int half = faulty(m, F_EARLY) && !m->early_done;
    if (half && !m->early_allowed) return say(m, ERROR, "early return is not allowed");
    m->early_done = half;
    Status s = advance(m, t, half ? h / 2 : h);
    *early = half || whole; *last = m->time; *end = faulty(m, F_END);
    if (m->eventful) *event = (m->h <= 0 && m->v < 0) || m->time >= m->next - 1e-9;
    else { tick(m); bounce(m); }
    return s;
}
#define EACH(call) do { Status s = OK; for (size_t i = 0; i < n && s <= WARNING; i++) s = call; return s; } while (0)
#define SETTER(name, type) fmi3Status fmi3Set##name(fmi3Instance c, const Reference r[], size_t n, const type v[], size_t nv)
#define GETTER(name, type) fmi3Status fmi3Get##name(fmi3Instance c, const Reference r[], size_t n, type v[], size_t nv)
static size_t size_of(Reference r) { return r == ARRAY || r == TWICE ? 6 : 1; }
SETTER(Float64, fmi3Float64) {
    Machine *m = c;
    Status s = OK;
    for (size_t i = 0; i < n && s <= WARNING; v += size_of(r[i]), nv -= size_of(r[i]), i++) {
        if (nv < size_of(r[i])) return say(m, ERROR, "too few values");
        if (r[i] == ARRAY) memcpy(m->array, v, sizeof m->array);
        else s = set_real(m, r[i], *v);
    }
    return s <= WARNING && nv ? say(m, ERROR, "too many values") : s;
}
GETTER(Float64, fmi3Float64) {
    Machine *m = c;
    Status s = OK;
    for (size_t i = 0; i < n && s <= WARNING; v += size_of(r[i]), nv -= size_of(r[i]), i++) {
        if (nv < size_of(r[i])) return say(m, ERROR, "too few values");
        if (r[i] == TWICE) for (int j = 0; j < 6; j++) v[j] = 2 * m->array[j];
        else s = get_real(m, r[i], v);
    }
    return s <= WARNING && nv ? say(m, ERROR, "too many values") : s;
}
SETTER(Int32, fmi3Int32) { EACH(set_integer(c, r[i], v[i])); }
GETTER(Int32, fmi3Int32) { EACH(get_integer(c, r[i], v + i)); }
GETTER(Int64, fmi3Int64) { int value; Status s = get_integer(c, r[0], &value); v[0] = value; return s; }
SETTER(Int64, fmi3Int64) { EACH(set_integer(c, r[i], (int)v[i])); }
SETTER(Boolean, fmi3Boolean) { EACH(set_boolean(c, r[i], v[i])); }
GETTER(Boolean, fmi3Boolean) { v[0] = !((Machine *)c)->on; return OK; }
SETTER(Float32, fmi3Float32) { ((Machine *)c)->single = v[0]; return OK; }
GETTER(Float32, fmi3Float32) { v[0] = ((Machine *)c)->single + 1; return OK; }
SETTER(Int8, fmi3Int8) { ((Machine *)c)->byte = v[0]; return OK; }
GETTER(Int8, fmi3Int8) { v[0] = ((Machine *)c)->byte + 1; return OK; }
fmi3Status fmi3SetString(fmi3Instance c, const Reference r[], size_t n, const fmi3String v[], size_t nv) {
    strncpy(((Machine *)c)->name, v[0], 63); return OK;
}
#endif

#ifdef SAVES
#define SAVED Machine
static void leave(Machine *m, const Machine *own) {
    m->environment = own->environment; m->log = own->log;
    if (SAVES == 2) m->state = own->state; /* as the standard does not say whether that is part of it */
}
#include "saving.h"
#endif
