/* A plain C importer: no Python, no FMI library. host LIBRARY TOKEN STEP STEPS U X prints the bits of x after each step. */
#include <dlfcn.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

static void log_message(fmi3InstanceEnvironment e, fmi3Status s, fmi3String category, fmi3String message) {
    printf("%s %d %s\n", category, (int)s, message);
}

#define FUNCTION(NAME) \
    NAME##TYPE *NAME; \
    *(void **)&NAME = dlsym(library, #NAME); \
    if (!NAME) return puts(#NAME " is missing"), 2

int main(int argc, char **argv) {
    if (argc != 7) return 2;
    void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return puts(dlerror()), 2;
    const double step = atof(argv[3]);
    const fmi3ValueReference u = (fmi3ValueReference)atoi(argv[5]), x = (fmi3ValueReference)atoi(argv[6]);
    FUNCTION(fmi3InstantiateCoSimulation);
    FUNCTION(fmi3EnterInitializationMode);
    FUNCTION(fmi3ExitInitializationMode);
    FUNCTION(fmi3SetFloat64);
    FUNCTION(fmi3GetFloat64);
    FUNCTION(fmi3DoStep);
    FUNCTION(fmi3Terminate);
    FUNCTION(fmi3FreeInstance);
    fmi3Instance one = fmi3InstantiateCoSimulation("one", argv[2], NULL, false, true, false, false, NULL, 0, NULL,
                                                   log_message, NULL);
    if (!one) return 3;
    if (fmi3EnterInitializationMode(one, false, 0, 0, false, 0) || fmi3ExitInitializationMode(one)) return 4;
    for (long k = 0; k < atol(argv[4]); k++) {
        const double push[2] = {0.01 * (double)k, -1};
        double place[2], last;
        bool event, terminate, early;
        if (fmi3SetFloat64(one, &u, 1, push, 2)) return 5;
        if (fmi3DoStep(one, (double)k * step, step, true, &event, &terminate, &early, &last)) return 6;
        if (fmi3GetFloat64(one, &x, 1, place, 2)) return 7;
        uint64_t bits[2];
        memcpy(bits, place, sizeof bits);
        printf("%016" PRIx64 " %016" PRIx64 "\n", bits[0], bits[1]);
    }
    if (fmi3Terminate(one)) return 8;
    fmi3FreeInstance(one);
    return 0;
}
