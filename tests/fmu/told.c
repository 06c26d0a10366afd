/* A test FMU for FMI 2.0 and 3.0 (-DFMI=2 or 3), Co-Simulation and Model Exchange, that tells what it has been told:
   settings of the experiment, parameters of all types, texts and bytes as a sum of their bytes, each times its place.

   -DREFUSES_EVENT_MODE: as an FMU that declares event mode and cannot do it. */

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if FMI == 2
#include "fmi2Functions.h"
typedef fmi2Status Status;
typedef fmi2ValueReference Reference;
typedef fmi2Component Handle;
#define F(name) fmi2##name
#else
#include "fmi3Functions.h"
typedef fmi3Status Status;
typedef fmi3ValueReference Reference;
typedef fmi3Instance Handle;
#define F(name) fmi3##name
#endif

enum { OK, WARNING, DISCARD, ERROR };
enum { TOLERANCE = 1, START, CLOCK, EVENTS, LOGGING, CATEGORIES, K, U, Y, LEVEL, LEVEL_TOLD, HEAT, HEAT_TOLD, TEXT,
       TEXT_TOLD, WORDS, WORDS_TOLD, BLOB, BLOB_TOLD, BIG, BIG_TOLD, SIZE, GAINS, IN, OUT, TOTAL, NOTE, NOTE_TOLD };
enum { MOST = 16 };
enum { MADE, CONFIGURING, READY };

typedef struct {
    int state, events, logging, categories;
    char category[4][32];
    double tolerance, start, clock, k, u, gains[MOST], in[MOST];
    int64_t level, heat, text, words, note, blob;
    uint64_t big, size;
    void *environment;
#if FMI == 2
    fmi2CallbackLogger log;
#else
    fmi3LogMessageCallback log;
#endif
} Told;

static void say(Told *t, Status status, const char *category, const char *text) {
    int wanted = t->logging && !t->categories;
    for (int k = 0; k < t->categories; k++) wanted |= t->logging && !strcmp(category, t->category[k]);
    if (!wanted) return;
#if FMI == 2
    t->log(t->environment, "told", status, category, "%s", text);
#else
    t->log(t->environment, status, category, text);
#endif
}
static int64_t sum(const char *bytes, size_t n) {
    int64_t total = 0;
    for (size_t j = 0; j < n; j++) total += (int64_t)(j + 1) * (unsigned char)bytes[j];
    return total;
}
static Told *made(int logging, int events) {
    Told *t = calloc(1, sizeof *t);
    t->tolerance = t->start = -1;
    t->k = 1;
    t->level = t->heat = 1;
    t->big = UINT64_MAX;
    t->size = 3;
    t->text = sum("nobody", 6);
    t->note = sum("none", 4);
    for (int j = 0; j < 3; j++) t->gains[j] = j + 1;
    t->logging = logging;
    t->events = events;
    return t;
}
static Status begin(Told *t, int defined, double tolerance, double start) {
    t->tolerance = defined ? tolerance : -1;
    t->start = t->clock = start;
    return OK;
}
static Status step(Told *t, double from, double h) {
    char text[80];
    if (from > t->clock + 1e-9 || from < t->clock - 1e-9) return ERROR;
    t->clock = from + h;
    snprintf(text, sizeof text, "step to %g", t->clock);
    say(t, OK, "logSteps", text);
    return OK;
}
static Status real(Told *t, Reference r, double **at, size_t *n) {
    static double total;
    *n = 1;
    switch (r) {
    case TOLERANCE: *at = &t->tolerance; return OK;
    case START: *at = &t->start; return OK;
    case CLOCK: *at = &t->clock; return OK;
    case K: *at = &t->k; return OK;
    case U: *at = &t->u; return OK;
    case Y: total = t->k * t->u; *at = &total; return OK;
    case GAINS: *at = t->gains; *n = t->size; return OK;
    case IN: *at = t->in; *n = t->size; return OK;
    case TOTAL:
        total = 0;
        for (uint64_t j = 0; j < t->size; j++) total += t->gains[j] * (t->in[j] + 1);
        *at = &total;
        return OK;
    }
    return ERROR;
}
static Status integer(Told *t, Reference r, int64_t *value) {
    switch (r) {
    case LEVEL: case LEVEL_TOLD: *value = t->level; return OK;
    case HEAT: case HEAT_TOLD: *value = t->heat; return OK;
    case EVENTS: *value = t->events; return OK;
    case LOGGING: *value = t->logging; return OK;
    case CATEGORIES: *value = t->categories; return OK;
    case TEXT_TOLD: *value = t->text; return OK;
    case WORDS_TOLD: *value = t->words; return OK;
    case NOTE_TOLD: *value = t->note; return OK;
    case BLOB_TOLD: *value = t->blob; return OK;
    }
    return ERROR;
}
static Status set_integer(Told *t, Reference r, int64_t value) {
    if (r == LEVEL) t->level = value;
    else if (r == HEAT) t->heat = value;
    else return ERROR;
    return OK;
}
static Status debug(Told *t, int on, size_t n, const char *const names[]) {
    t->logging = on;
    t->categories = (int)n;
    for (size_t k = 0; k < n && k < 4; k++) strncpy(t->category[k], names[k], 31);
    return OK;
}
static Status ready(Told *t) {
    t->state = READY;
    say(t, OK, "logEvents", "ready");
    say(t, WARNING, "logStatusWarning", "be careful");
    return OK;
}

Status F(Terminate)(Handle c) { return OK; }
void F(FreeInstance)(Handle c) { free(c); }
Status F(ExitInitializationMode)(Handle c) { return ready(c); }
Status F(EnterEventMode)(Handle c) { return OK; }
Status F(EnterContinuousTimeMode)(Handle c) { return OK; }
Status F(SetTime)(Handle c, double t) { ((Told *)c)->clock = t; return OK; }
Status F(SetContinuousStates)(Handle c, const double x[], size_t n) { return OK; }
Status F(GetContinuousStates)(Handle c, double x[], size_t n) { return OK; }
Status F(GetEventIndicators)(Handle c, double z[], size_t n) { return OK; }

#define EACH_REAL(copy) \
    Status s = OK; \
    double *at; \
    for (size_t i = 0, n1; i < n && s == OK; i++) { \
        s = real(c, r[i], &at, &n1); \
        for (size_t j = 0; j < n1 && s == OK; j++, v++, nv--) { if (!nv) return ERROR; copy; } \
    } \
    return s == OK && nv ? ERROR : s;

#if FMI == 2
void *fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where, const fmi2CallbackFunctions *f,
                      fmi2Boolean visible, fmi2Boolean logging) {
    Told *t = made(logging, 0);
    t->log = f->logger;
    t->environment = f->componentEnvironment;
    return t;
}
Status fmi2SetDebugLogging(Handle c, fmi2Boolean on, size_t n, const fmi2String names[]) { return debug(c, on, n, names); }
Status fmi2SetupExperiment(Handle c, fmi2Boolean a, double b, double start, fmi2Boolean d, double e) { return begin(c, a, b, start); }
Status fmi2EnterInitializationMode(Handle c) { return OK; }
Status fmi2DoStep(Handle c, double t, double h, fmi2Boolean keep) { return step(c, t, h); }
Status fmi2GetDerivatives(Handle c, double d[], size_t n) { return OK; }
Status fmi2NewDiscreteStates(Handle c, fmi2EventInfo *info) { memset(info, 0, sizeof *info); return OK; }
Status fmi2SetReal(Handle c, const Reference r[], size_t n, const double v[]) { size_t nv = n; EACH_REAL(at[j] = *v) }
Status fmi2GetReal(Handle c, const Reference r[], size_t n, double v[]) { size_t nv = n; EACH_REAL(*v = at[j]) }
Status fmi2SetInteger(Handle c, const Reference r[], size_t n, const int v[]) {
    Status s = OK;
    for (size_t i = 0; i < n && s == OK; i++) s = set_integer(c, r[i], v[i]);
    return s;
}
Status fmi2GetInteger(Handle c, const Reference r[], size_t n, int v[]) {
    Status s = OK;
    for (size_t i = 0; i < n && s == OK; i++) { int64_t value; s = integer(c, r[i], &value); v[i] = (int)value; }
    return s;
}
Status fmi2SetString(Handle c, const Reference r[], size_t n, const fmi2String v[]) {
    for (size_t i = 0; i < n; i++) *(r[i] == TEXT ? &((Told *)c)->text : &((Told *)c)->note) = sum(v[i], strlen(v[i]));
    return OK;
}
#else
Handle fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
                                   fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                   const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment e,
                                   fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
#ifdef REFUSES_EVENT_MODE
    if (events) {
        if (logging) log(e, fmi3Error, "logStatusError", "no event mode here");
        return NULL;
    }
#endif
    Told *t = made(logging, events);
    t->log = log;
    t->environment = e;
    return t;
}
Handle fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
                                    fmi3Boolean logging, fmi3InstanceEnvironment e, fmi3LogMessageCallback log) {
    return fmi3InstantiateCoSimulation(name, token, where, visible, logging, 0, 0, NULL, 0, e, log, NULL);
}
Status fmi3SetDebugLogging(Handle c, fmi3Boolean on, size_t n, const fmi3String names[]) { return debug(c, on, n, names); }
Status fmi3EnterInitializationMode(Handle c, fmi3Boolean a, double b, double start, fmi3Boolean d, double e) { return begin(c, a, b, start); }
Status fmi3EnterConfigurationMode(Handle c) {
    Told *t = c;
    if (t->state != MADE) return ERROR;
    t->state = CONFIGURING;
    return OK;
}
Status fmi3ExitConfigurationMode(Handle c) { /* what has another size is forgotten */
    Told *t = c;
    if (t->state != CONFIGURING) return ERROR;
    t->state = MADE;
    memset(t->gains, 0, sizeof t->gains);
    return OK;
}
Status fmi3EnterStepMode(Handle c) { return OK; }
Status fmi3GetContinuousStateDerivatives(Handle c, double d[], size_t n) { return OK; }
Status fmi3CompletedIntegratorStep(Handle c, fmi3Boolean a, fmi3Boolean *event, fmi3Boolean *end) { *event = *end = 0; return OK; }
Status fmi3UpdateDiscreteStates(Handle c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals, fmi3Boolean *states,
                                fmi3Boolean *defined, double *next) {
    *again = *end = *nominals = *states = *defined = 0;
    return OK;
}
Status fmi3DoStep(Handle c, double t, double h, fmi3Boolean keep, fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early,
                  double *last) {
    *event = *end = *early = 0;
    *last = t + h;
    return step(c, t, h);
}
Status fmi3SetFloat64(Handle c, const Reference r[], size_t n, const double v[], size_t nv) { EACH_REAL(at[j] = *v) }
Status fmi3GetFloat64(Handle c, const Reference r[], size_t n, double v[], size_t nv) { EACH_REAL(*v = at[j]) }
Status fmi3SetInt64(Handle c, const Reference r[], size_t n, const int64_t v[], size_t nv) {
    Status s = nv == n ? OK : ERROR;
    for (size_t i = 0; i < n && s == OK; i++) s = set_integer(c, r[i], v[i]);
    return s;
}
Status fmi3GetInt64(Handle c, const Reference r[], size_t n, int64_t v[], size_t nv) {
    Status s = nv == n ? OK : ERROR;
    for (size_t i = 0; i < n && s == OK; i++) s = integer(c, r[i], v + i);
    return s;
}
Status fmi3SetUInt64(Handle c, const Reference r[], size_t n, const uint64_t v[], size_t nv) {
    Told *t = c;
    for (size_t i = 0; i < n; i++) {
        if (r[i] == SIZE && (t->state != CONFIGURING || v[i] > MOST)) return ERROR;
        *(r[i] == SIZE ? &t->size : &t->big) = v[i];
    }
    return OK;
}
Status fmi3GetUInt64(Handle c, const Reference r[], size_t n, uint64_t v[], size_t nv) {
    for (size_t i = 0; i < n; i++) v[i] = r[i] == SIZE ? ((Told *)c)->size : ((Told *)c)->big;
    return OK;
}
Status fmi3SetString(Handle c, const Reference r[], size_t n, const fmi3String v[], size_t nv) {
    Told *t = c;
    if (r[0] == WORDS) {
        t->words = 0;
        for (size_t j = 0; j < nv; j++) t->words += (int64_t)(1000 * j + 1) * sum(v[j], strlen(v[j]));
        return nv == 2 ? OK : ERROR;
    }
    for (size_t i = 0; i < n; i++) *(r[i] == TEXT ? &t->text : &t->note) = sum(v[i], strlen(v[i]));
    return OK;
}
Status fmi3SetBinary(Handle c, const Reference r[], size_t n, const size_t sizes[], const fmi3Binary v[], size_t nv) {
    if (n != 1 || nv != 1 || r[0] != BLOB) return ERROR;
    ((Told *)c)->blob = sum((const char *)v[0], sizes[0]) + 1000000 * (int64_t)sizes[0];
    return OK;
}
#endif
