/* What the FMUs' own functions cost: the calls that cosim makes, from C (-DFMI=2 or 3).

   exchange LIBRARY TOKEN LIBRARY TOKEN U Y EVENTS STEPS    prints seconds and both outputs after the last step
   exchange TRIPS                                           prints seconds of so many round trips through two pipes */
#include <dlfcn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#if FMI == 2
#include "fmi2Functions.h"
#define F(name) fmi2##name
#else
#include "fmi3Functions.h"
#define F(name) fmi3##name
#endif
#define CHECK(call) \
    if (call) { \
        fprintf(stderr, "%s failed\n", #call); \
        exit(1); \
    }
#define LOAD(name) *(void **)&f->name = symbol(library, #name)

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void *symbol(void *library, const char *name) {
    void *found = dlsym(library, name);
    CHECK(!found);
    return found;
}

typedef struct {
    void *handle;
    double u, y;
#if FMI == 2
    fmi2SetRealTYPE *fmi2SetReal;
    fmi2GetRealTYPE *fmi2GetReal;
    fmi2DoStepTYPE *fmi2DoStep;
#else
    fmi3SetFloat64TYPE *fmi3SetFloat64;
    fmi3GetFloat64TYPE *fmi3GetFloat64;
    fmi3DoStepTYPE *fmi3DoStep;
    fmi3EnterEventModeTYPE *fmi3EnterEventMode;
    fmi3UpdateDiscreteStatesTYPE *fmi3UpdateDiscreteStates;
    fmi3EnterStepModeTYPE *fmi3EnterStepMode;
#endif
} Fmu;

#if FMI == 2
static void log_message(fmi2ComponentEnvironment e, fmi2String name, fmi2Status s, fmi2String category,
                        fmi2String text, ...) {
    if (s > fmi2Warning) fprintf(stderr, "%s: %s\n", name, text);
}

static void open_fmu(Fmu *f, void *library, const char *token, bool events) {
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    *(void **)&instantiate = symbol(library, "fmi2Instantiate");
    *(void **)&setup = symbol(library, "fmi2SetupExperiment");
    *(void **)&enter = symbol(library, "fmi2EnterInitializationMode");
    *(void **)&leave = symbol(library, "fmi2ExitInitializationMode");
    LOAD(fmi2SetReal);
    LOAD(fmi2GetReal);
    LOAD(fmi2DoStep);
    static const fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};
    f->handle = instantiate("relay", fmi2CoSimulation, token, NULL, &callbacks, fmi2False, fmi2False);
    CHECK(!f->handle);
    CHECK(setup(f->handle, fmi2False, 0, 0, fmi2False, 0));
    CHECK(enter(f->handle));
    CHECK(leave(f->handle));
}

static void get(Fmu *f, fmi2ValueReference y, bool events) {
    CHECK(f->fmi2GetReal(f->handle, &y, 1, &f->y));
}

static void set_and_step(Fmu *f, fmi2ValueReference u, double time, double step, bool events) {
    CHECK(f->fmi2SetReal(f->handle, &u, 1, &f->u));
    CHECK(f->fmi2DoStep(f->handle, time, step, fmi2True));
}
#else
static void log_message(fmi3InstanceEnvironment e, fmi3Status s, fmi3String category, fmi3String text) {
    if (s > fmi3Warning) fprintf(stderr, "%s\n", text);
}

static void update(Fmu *f) {
    bool again, terminate, nominals, states, defined;
    double next;
    do {
        CHECK(f->fmi3UpdateDiscreteStates(f->handle, &again, &terminate, &nominals, &states, &defined, &next));
        CHECK(terminate);
    } while (again);
}

static void open_fmu(Fmu *f, void *library, const char *token, bool events) {
    fmi3InstantiateCoSimulationTYPE *instantiate;
    fmi3EnterInitializationModeTYPE *enter;
    fmi3ExitInitializationModeTYPE *leave;
    *(void **)&instantiate = symbol(library, "fmi3InstantiateCoSimulation");
    *(void **)&enter = symbol(library, "fmi3EnterInitializationMode");
    *(void **)&leave = symbol(library, "fmi3ExitInitializationMode");
    LOAD(fmi3SetFloat64);
    LOAD(fmi3GetFloat64);
    LOAD(fmi3DoStep);
    LOAD(fmi3EnterEventMode);
    LOAD(fmi3UpdateDiscreteStates);
    LOAD(fmi3EnterStepMode);
    f->handle = instantiate("relay", token, NULL, false, false, events, false, NULL, 0, NULL, log_message, NULL);
    CHECK(!f->handle);
    CHECK(enter(f->handle, false, 0, 0, false, 0));
    CHECK(leave(f->handle));
    if (!events) return;
    update(f);
    CHECK(f->fmi3EnterStepMode(f->handle));
}

static void get(Fmu *f, fmi3ValueReference y, bool events) {
    if (events) CHECK(f->fmi3EnterEventMode(f->handle));
    CHECK(f->fmi3GetFloat64(f->handle, &y, 1, &f->y, 1));
}

static void set_and_step(Fmu *f, fmi3ValueReference u, double time, double step, bool events) {
    bool event, terminate, early;
    double last;
    CHECK(f->fmi3SetFloat64(f->handle, &u, 1, &f->u, 1));
    if (events) {
        update(f);
        CHECK(f->fmi3EnterStepMode(f->handle));
    }
    CHECK(f->fmi3DoStep(f->handle, time, step, true, &event, &terminate, &early, &last));
    CHECK(terminate || early);
}
#endif

static void run(char **argv) {
    static Fmu one, other;
    const unsigned u = (unsigned)atoi(argv[5]), y = (unsigned)atoi(argv[6]);
    const bool events = atoi(argv[7]);
    const long steps = atol(argv[8]);
    for (int k = 0; k < 2; k++) {
        void *library = dlopen(argv[1 + 2 * k], RTLD_NOW | RTLD_LOCAL);
        CHECK(!library);
        open_fmu(k ? &other : &one, library, argv[2 + 2 * k], events);
    }
    const double began = now();
    for (long k = 0; k < steps; k++) {
        get(&one, y, events);
        get(&other, y, events);
        one.u = other.y;
        other.u = one.y;
        set_and_step(&one, u, (double)k * 1e-3, 1e-3, events);
        set_and_step(&other, u, (double)k * 1e-3, 1e-3, events);
    }
    get(&one, y, events);
    get(&other, y, events);
    printf("%.9g %.17g %.17g\n", now() - began, one.y, other.y);
}

static void echo(long trips) {
    int there[2], back[2];
    int64_t word = 0;
    CHECK(pipe(there) || pipe(back));
    const pid_t child = fork();
    CHECK(child < 0);
    if (child == 0) {
        close(there[1]);
        while (read(there[0], &word, sizeof word) == sizeof word) CHECK(write(back[1], &word, sizeof word) < 0);
        _exit(0);
    }
    const double began = now();
    for (long k = 0; k < trips; k++) {
        CHECK(write(there[1], &word, sizeof word) < 0);
        CHECK(read(back[0], &word, sizeof word) != sizeof word);
    }
    printf("%.9g\n", now() - began);
}

int main(int argc, char **argv) {
    if (argc == 9) run(argv);
    else if (argc == 2) echo(atol(argv[1]));
    else return 2;
    return 0;
}
