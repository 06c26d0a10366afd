/* An FMU with many ports of several types (-DFMU), FMI 3 with event mode, whose outputs are its inputs at once; and
   without that a program that steps a chain of two in the same way, by hand:

   ports LIBRARY LIBRARY WIRES STEPS    prints seconds; WIRES of the first one's 20, 10 and 10 outputs lead to the other */
#include <dlfcn.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "fmi3Functions.h"

/* Of each type so many ports; references of inputs count all of them, those of outputs are 100 more. */
enum { REALS = 20, INTEGERS = 10, TRUTHS = 10, ALL = REALS + INTEGERS + TRUTHS, OUTPUTS = 100 };

#ifdef FMU
typedef struct { fmi3Float64 real[REALS]; fmi3Int32 integer[INTEGERS]; fmi3Boolean truth[TRUTHS]; } Ports;

#define ACCESS(type, member, first) \
    fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3##type v[], size_t nv) { \
        for (size_t k = 0; k < n; k++) ((Ports *)c)->member[r[k] - (first)] = v[k]; \
        return fmi3OK; \
    } \
    fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3##type v[], size_t nv) { \
        for (size_t k = 0; k < n; k++) v[k] = ((Ports *)c)->member[r[k] - (first) - OUTPUTS]; \
        return fmi3OK; \
    }
ACCESS(Float64, real, 0)
ACCESS(Int32, integer, REALS)
ACCESS(Boolean, truth, REALS + INTEGERS)

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment e,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    return calloc(1, sizeof(Ports));
}
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 d, fmi3Boolean e, fmi3Float64 f) { return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3EnterEventMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3EnterStepMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
                                    fmi3Boolean *states, fmi3Boolean *defined, fmi3Float64 *next) {
    *again = *end = *nominals = *states = *defined = false;
    return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event, fmi3Boolean *end,
                      fmi3Boolean *early, fmi3Float64 *last) {
    *event = *end = *early = false;
    *last = t + h;
    return fmi3OK;
}
#else
#define CHECK(call) \
    if (call) { \
        fprintf(stderr, "%s failed\n", #call); \
        exit(1); \
    }

typedef struct {
    fmi3Instance handle;
    fmi3InstantiateCoSimulationTYPE *fmi3InstantiateCoSimulation;
    fmi3EnterInitializationModeTYPE *fmi3EnterInitializationMode;
    fmi3ExitInitializationModeTYPE *fmi3ExitInitializationMode;
    fmi3EnterEventModeTYPE *fmi3EnterEventMode;
    fmi3UpdateDiscreteStatesTYPE *fmi3UpdateDiscreteStates;
    fmi3EnterStepModeTYPE *fmi3EnterStepMode;
    fmi3DoStepTYPE *fmi3DoStep;
    fmi3GetFloat64TYPE *fmi3GetFloat64;
    fmi3SetFloat64TYPE *fmi3SetFloat64;
    fmi3GetInt32TYPE *fmi3GetInt32;
    fmi3SetInt32TYPE *fmi3SetInt32;
    fmi3GetBooleanTYPE *fmi3GetBoolean;
    fmi3SetBooleanTYPE *fmi3SetBoolean;
} Fmu;

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void update(Fmu *f) {
    bool again, terminate, nominals, states, defined;
    double next;
    CHECK(f->fmi3UpdateDiscreteStates(f->handle, &again, &terminate, &nominals, &states, &defined, &next));
}

static void open_fmu(Fmu *f, const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    CHECK(!library);
#define LOAD(name) CHECK(!(*(void **)&f->name = dlsym(library, #name)))
    LOAD(fmi3InstantiateCoSimulation) LOAD(fmi3EnterInitializationMode) LOAD(fmi3ExitInitializationMode)
    LOAD(fmi3EnterEventMode) LOAD(fmi3UpdateDiscreteStates) LOAD(fmi3EnterStepMode) LOAD(fmi3DoStep)
    LOAD(fmi3GetFloat64) LOAD(fmi3SetFloat64) LOAD(fmi3GetInt32) LOAD(fmi3SetInt32) LOAD(fmi3GetBoolean) LOAD(fmi3SetBoolean)
    f->handle = f->fmi3InstantiateCoSimulation("ports", "ports", NULL, false, false, true, false, NULL, 0, NULL, NULL, NULL);
    CHECK(f->fmi3EnterInitializationMode(f->handle, false, 0, 0, false, 0));
    CHECK(f->fmi3ExitInitializationMode(f->handle));
    update(f);
    CHECK(f->fmi3EnterStepMode(f->handle));
}

static size_t least(size_t a, size_t b) { return a < b ? a : b; }

int main(int argc, char **argv) {
    static Fmu one, other;
    fmi3ValueReference inputs[ALL], outputs[ALL];
    fmi3Float64 real[REALS];
    fmi3Int32 integer[INTEGERS];
    fmi3Boolean truth[TRUTHS];
    if (argc != 5) return 2;
    const size_t wires = (size_t)atoi(argv[3]);
    const size_t reals = least(wires, REALS), integers = least(wires - reals, INTEGERS), truths = wires - reals - integers;
    const long steps = atol(argv[4]);
    for (unsigned k = 0; k < ALL; k++) outputs[k] = (inputs[k] = k) + OUTPUTS;
    open_fmu(&one, argv[1]);
    open_fmu(&other, argv[2]);
    const double began = now();
    for (long k = 0; k < steps; k++) {
        CHECK(one.fmi3EnterEventMode(one.handle));
        CHECK(other.fmi3EnterEventMode(other.handle));
#define HAND_ON(type, values, first, n) \
    if (n) { \
        CHECK(one.fmi3Get##type(one.handle, outputs + (first), n, values, n)); \
        CHECK(other.fmi3Set##type(other.handle, inputs + (first), n, values, n)); \
    }
        HAND_ON(Float64, real, 0, reals)
        HAND_ON(Int32, integer, REALS, integers)
        HAND_ON(Boolean, truth, REALS + INTEGERS, truths)
        for (int j = 0; j < 2; j++) {
            Fmu *f = j ? &other : &one;
            bool event, terminate, early;
            double last;
            update(f);
            CHECK(f->fmi3EnterStepMode(f->handle));
            CHECK(f->fmi3DoStep(f->handle, (double)k * 1e-3, 1e-3, true, &event, &terminate, &early, &last));
        }
    }
    printf("%.9g\n", now() - began);
    return 0;
}
#endif
