/* A test FMU for FMI 2.0 and 3.0 (-DFMI=2 or 3) that hands on each of its inputs at once, and counts the calls of its
   functions: as it is terminated, it appends them to the file $FEEDTHROUGH_COUNTS. */

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

enum { OK, WARNING, DISCARD, ERROR };
enum { OUTPUT = 100, SIZE = 4, ARRAY = 9, MOST = 20 }; /* an output has its input's reference and 100 */

typedef struct { double values[MOST][SIZE]; } Feedthrough; /* of each input, whatever its type */

#define FUNCTIONS(_) _(SetReal) _(GetReal) _(SetFloat64) _(GetFloat64) _(SetFloat32) _(GetFloat32) _(SetInteger) \
    _(GetInteger) _(SetInt64) _(GetInt64) _(SetInt8) _(GetInt8) _(SetBoolean) _(GetBoolean) _(DoStep) \
    _(EnterEventMode) _(Update) _(LeaveEventMode)
#define NAME(name) N_##name,
#define TEXT(name) #name,
enum { FUNCTIONS(NAME) N };
static const char *names[] = {FUNCTIONS(TEXT)};
static int counts[N];

Status F(Terminate)(Handle c) {
    const char *path = getenv("FEEDTHROUGH_COUNTS");
    FILE *file = path ? fopen(path, "a") : NULL;
    for (int k = 0; file && k < N; k++) if (counts[k]) fprintf(file, "%s %d\n", names[k], counts[k]);
    if (file) fclose(file);
    memset(counts, 0, sizeof counts);
    return OK;
}
void F(FreeInstance)(Handle c) { free(c); }
Status F(ExitInitializationMode)(Handle c) { return OK; }
Status F(EnterEventMode)(Handle c) { counts[N_EnterEventMode]++; return OK; }
Status F(EnterContinuousTimeMode)(Handle c) { counts[N_LeaveEventMode]++; return OK; }
Status F(SetTime)(Handle c, Float64 t) { return OK; }
Status F(SetContinuousStates)(Handle c, const Float64 x[], size_t n) { return OK; }
Status F(GetContinuousStates)(Handle c, Float64 x[], size_t n) { return OK; }
Status F(GetEventIndicators)(Handle c, Float64 z[], size_t n) { return OK; }

static size_t size_of(Reference r) { return r % OUTPUT == ARRAY ? SIZE : 1; }

/* v: the values of n variables, nv in all. */
#define SET(name) \
    counts[N_Set##name]++; \
    for (size_t i = 0; i < n; v += size_of(r[i]), nv -= size_of(r[i]), i++) { \
        if (r[i] >= MOST || nv < size_of(r[i])) return ERROR; \
        for (size_t j = 0; j < size_of(r[i]); j++) ((Feedthrough *)c)->values[r[i]][j] = v[j]; \
    } \
    return nv ? ERROR : OK;
#define GET(name) \
    counts[N_Get##name]++; \
    for (size_t i = 0; i < n; v += size_of(r[i]), nv -= size_of(r[i]), i++) { \
        if (r[i] < OUTPUT || nv < size_of(r[i])) return ERROR; \
        for (size_t j = 0; j < size_of(r[i]); j++) v[j] = ((Feedthrough *)c)->values[r[i] - OUTPUT][j]; \
    } \
    return nv ? ERROR : OK;

#if FMI == 2
#define BOTH(name, type) \
    Status fmi2Set##name(Handle c, const Reference r[], size_t n, const type v[]) { size_t nv = n; SET(name) } \
    Status fmi2Get##name(Handle c, const Reference r[], size_t n, type v[]) { size_t nv = n; GET(name) }
BOTH(Real, Float64)
BOTH(Integer, fmi2Integer)
BOTH(Boolean, Boolean)

Handle fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where, const fmi2CallbackFunctions *f,
                       fmi2Boolean visible, fmi2Boolean logging) { return calloc(1, sizeof(Feedthrough)); }
Status fmi2SetupExperiment(Handle c, fmi2Boolean a, fmi2Real b, fmi2Real start, fmi2Boolean d, fmi2Real e) { return OK; }
Status fmi2EnterInitializationMode(Handle c) { return OK; }
Status fmi2DoStep(Handle c, fmi2Real t, fmi2Real h, fmi2Boolean keep) { counts[N_DoStep]++; return OK; }
Status fmi2GetDerivatives(Handle c, Float64 d[], size_t n) { return OK; }
Status fmi2NewDiscreteStates(Handle c, fmi2EventInfo *info) {
    counts[N_Update]++;
    memset(info, 0, sizeof *info);
    return OK;
}
#else
#define BOTH(name, type) \
    Status fmi3Set##name(Handle c, const Reference r[], size_t n, const type v[], size_t nv) { SET(name) } \
    Status fmi3Get##name(Handle c, const Reference r[], size_t n, type v[], size_t nv) { GET(name) }
BOTH(Float64, fmi3Float64)
BOTH(Float32, fmi3Float32)
BOTH(Int64, fmi3Int64)
BOTH(Int8, fmi3Int8)
BOTH(Boolean, fmi3Boolean)

Handle fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
                                   fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                   const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment e,
                                   fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    return calloc(1, sizeof(Feedthrough));
}
Handle fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
                                    fmi3Boolean logging, fmi3InstanceEnvironment e, fmi3LogMessageCallback log) {
    return calloc(1, sizeof(Feedthrough));
}
Status fmi3EnterInitializationMode(Handle c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 start, fmi3Boolean d, fmi3Float64 e) { return OK; }
Status fmi3EnterStepMode(Handle c) { counts[N_LeaveEventMode]++; return OK; }
Status fmi3GetContinuousStateDerivatives(Handle c, Float64 d[], size_t n) { return OK; }
Status fmi3UpdateDiscreteStates(Handle c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals, fmi3Boolean *states,
                                fmi3Boolean *defined, fmi3Float64 *next) {
    counts[N_Update]++;
    *again = *end = *nominals = *states = *defined = 0;
    return OK;
}
Status fmi3DoStep(Handle c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event, fmi3Boolean *end,
                  fmi3Boolean *early, fmi3Float64 *last) {
    counts[N_DoStep]++;
    *event = *end = *early = 0;
    *last = t + h;
    return OK;
}
#endif
