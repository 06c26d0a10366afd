/* As little as an FMU for Co-Simulation can be (-DFMI=2 or 3): y is 0 first, then the last step's input plus one.
   `exchange.py` adds the functions that a host may look for besides: they fail. */
#include <stdlib.h>

typedef struct {
    double values[2]; /* u, y */
} Relay;

static void set(Relay *relay, const unsigned references[], size_t n, const double values[]) {
    for (size_t k = 0; k < n; k++) relay->values[references[k]] = values[k];
}

static void get(const Relay *relay, const unsigned references[], size_t n, double values[]) {
    for (size_t k = 0; k < n; k++) values[k] = relay->values[references[k]];
}

static void advance(Relay *relay) {
    relay->values[1] = relay->values[0] + 1.0;
}

#if FMI == 2
#include "fmi2Functions.h"

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    return calloc(1, sizeof(Relay));
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop) {
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Real values[]) {
    set(c, references, n, values);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Real values[]) {
    get(c, references, n, values);
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no_set_before) {
    advance(c);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    return fmi2OK;
}

void fmi2FreeInstance(fmi2Component c) {
    free(c);
}

#else
#include "fmi3Functions.h"

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t n_intermediate,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    return calloc(1, sizeof(Relay));
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t n, const fmi3Float64 values[],
                          size_t n_values) {
    set(c, references, n, values);
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3Float64 values[],
                          size_t n_values) {
    get(c, references, n, values);
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 size, fmi3Boolean no_set_before,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    advance(c);
    *event = *terminate = *early = fmi3False;
    *last = time + size;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) {
    return fmi3OK;
}

void fmi3FreeInstance(fmi3Instance c) {
    free(c);
}
#endif
