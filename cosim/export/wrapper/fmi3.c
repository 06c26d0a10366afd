/* The functions of FMI 3.0. What each may do in which state: sections 2.3, 3.2 and 4.2 of the standard. */
#include "arithmetic.h"
#include "instance.h"

#include "fmi3Functions.h"

#include <stdlib.h>
#include <string.h>

#define SELF \
    STANDARD_ARITHMETIC; \
    Instance *i = c
#define ALLOW(phases) \
    SELF; \
    if (!allowed(i, __func__, phases)) return fmi3Error
#define ALLOW_IN(interface, phases) \
    SELF; \
    if (!allowed_in(i, __func__, interface, phases)) return fmi3Error

static fmi3Status unsupported(Instance *i, const char *function) {
    return (fmi3Status)tell(i, ERROR, LOG_ERROR, "%s: this FMU does not have it", function);
}

/* ---- creation ------------------------------------------------------------------------------------------------ */

static void call_logger(const Instance *i, Status status, const char *category, const char *message) {
    fmi3LogMessageCallback log;
    memcpy(&log, &i->logger, sizeof log);
    log(i->environment, (fmi3Status)status, category, message);
}

static Instance *instantiate(fmi3String name, fmi3String token, Interface interface, fmi3Boolean logging,
                             fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    Instance *i = instance_new(name, token, interface);
    if (!i) {
        const char *message = "fmi3Instantiate: no name, another model's instantiation token, or no memory left";
        if (log) log(environment, fmi3Error, "logStatusError", message);
        return NULL;
    }
    if (log) {
        i->log = call_logger;
        memcpy(&i->logger, &log, sizeof log);
    }
    i->environment = environment;
    if (logging) i->categories = LOG_ALL;
    return i;
}

const char *fmi3GetVersion(void) {
    return fmi3Version;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
    return instantiate(name, token, MODEL_EXCHANGE, logging, environment, log);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t n_intermediate,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    Instance *i = instantiate(name, token, CO_SIMULATION, logging, environment, log);
    if (i) i->events = events;
    if (i) i->early = early_return;
    return i;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback clock_update,
                                               fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    if (log) log(environment, fmi3Error, "logStatusError", "this FMU has no Scheduled Execution");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance c) {
    instance_free(c);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    ALLOW(ANY_PHASE);
    return (fmi3Status)set_categories(i, on, n, categories);
}

/* ---- initialization, termination ----------------------------------------------------------------------------- */

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
    ALLOW(INSTANTIATED);
    return (fmi3Status)enter_initialization(i, start, stop_defined, stop);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    ALLOW(INITIALIZATION);
    return (fmi3Status)exit_initialization(i, i->interface == MODEL_EXCHANGE || i->events ? EVENT : STEP);
}

fmi3Status fmi3Terminate(fmi3Instance c) {
    ALLOW(INITIALIZED);
    i->at.phase = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c) {
    ALLOW(ANY_PHASE);
    instance_reset(i);
    return fmi3OK;
}

/* There are no structural parameters to configure. */
fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
    SELF;
    return i ? unsupported(i, __func__) : fmi3Error;
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
    SELF;
    return i ? unsupported(i, __func__) : fmi3Error;
}

/* ---- variables ----------------------------------------------------------------------------------------------- */

static fmi3Status wrong_count(Instance *i, const char *function, size_t n) {
    return (fmi3Status)tell(i, ERROR, LOG_ERROR, "%s: %u values are not what the variables have", function, (unsigned)n);
}

static fmi3Status get(Instance *i, const char *function, const fmi3ValueReference references[], size_t n, void *values,
                      size_t n_values, Type type) {
    if (!allowed(i, function, ANY_PHASE)) return fmi3Error;
    const size_t size = size_of(type);
    Status status = OK;
    size_t done = 0;
    for (size_t k = 0; k < n; k++) {
        const Item *item = find(i, function, references[k], 1u << type);
        if (!item) return fmi3Error;
        const Variable *v = variable_of(item);
        const Status s = refresh(i, v);
        if (s >= ERROR) return (fmi3Status)s;
        if (s > status) status = s;
        if (item->count > n_values - done) return wrong_count(i, function, n_values);
        memcpy((uint8_t *)values + done * size, address(i, v, item->first), item->count * size);
        done += item->count;
    }
    return done == n_values ? (fmi3Status)status : wrong_count(i, function, n_values);
}

static fmi3Status set(Instance *i, const char *function, const fmi3ValueReference references[], size_t n,
                      const void *values, size_t n_values, Type type) {
    if (!allowed(i, function, WRITABLE)) return fmi3Error;
    const size_t size = size_of(type);
    size_t done = 0;
    for (size_t k = 0; k < n; k++) {
        const Item *item = find(i, function, references[k], 1u << type);
        if (!item || settable(i, function, variable_of(item)) != OK) return fmi3Error;
        if (item->count > n_values - done) return wrong_count(i, function, n_values);
        const Variable *v = variable_of(item);
        memcpy(address(i, v, item->first), (const uint8_t *)values + done * size, item->count * size);
        if (was_set(i, function, v, item->first, item->count) != OK) return fmi3Error;
        done += item->count;
    }
    return done == n_values ? fmi3OK : wrong_count(i, function, n_values);
}

#define ACCESS(NAME, TYPE) \
    fmi3Status fmi3Get##NAME(fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3##NAME values[], \
                             size_t n_values) { \
        return get(c, __func__, references, n, values, n_values, TYPE); \
    } \
    fmi3Status fmi3Set##NAME(fmi3Instance c, const fmi3ValueReference references[], size_t n, \
                             const fmi3##NAME values[], size_t n_values) { \
        return set(c, __func__, references, n, values, n_values, TYPE); \
    }

_Static_assert(sizeof(fmi3Boolean) == 1, "numpy's bool has one byte");
ACCESS(Float32, FLOAT32)
ACCESS(Float64, FLOAT64)
ACCESS(Int8, INT8)
ACCESS(UInt8, UINT8)
ACCESS(Int16, INT16)
ACCESS(UInt16, UINT16)
ACCESS(Int32, INT32)
ACCESS(UInt32, UINT32)
ACCESS(Int64, INT64)
ACCESS(UInt64, UINT64)
ACCESS(Boolean, BOOLEAN)

fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3String values[],
                         size_t n_values) {
    ALLOW(ANY_PHASE);
    return n ? unsupported(i, __func__) : fmi3OK;
}

fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference references[], size_t n, const fmi3String values[],
                         size_t n_values) {
    ALLOW(WRITABLE);
    return n ? unsupported(i, __func__) : fmi3OK;
}

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference references[], size_t n, size_t sizes[],
                         fmi3Binary values[], size_t n_values) {
    ALLOW(ANY_PHASE);
    return n ? unsupported(i, __func__) : fmi3OK;
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference references[], size_t n, const size_t sizes[],
                         const fmi3Binary values[], size_t n_values) {
    ALLOW(WRITABLE);
    return n ? unsupported(i, __func__) : fmi3OK;
}

/* ---- dependencies, derivatives ------------------------------------------------------------------------------- */

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference reference, size_t *n) {
    ALLOW(ANY_PHASE);
    return unsupported(i, __func__);
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent, size_t elements[],
                                       fmi3ValueReference independents[], size_t independent_elements[],
                                       fmi3DependencyKind kinds[], size_t n) {
    ALLOW(ANY_PHASE);
    return unsupported(i, __func__);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                        const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                        size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity) {
    ALLOW(INITIALIZATION | INITIALIZED | TERMINATED);
    return (fmi3Status)directional_derivative(i, __func__, (References){unknowns, n_unknowns},
                                              (References){knowns, n_knowns}, seed, n_seed, sensitivity, n_sensitivity);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                    size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity) {
    ALLOW(ANY_PHASE);
    return unsupported(i, __func__);
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference references[], size_t n,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t n_values) {
    ALLOW_IN(CO_SIMULATION, STEP | TERMINATED | FAILED);
    return unsupported(i, __func__);
}

/* ---- FMU states ---------------------------------------------------------------------------------------------- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    ALLOW(ANY_PHASE);
    return (fmi3Status)snapshot_take(i, state);
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    ALLOW(ANY_PHASE);
    return (fmi3Status)snapshot_restore(i, state);
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    ALLOW(ANY_PHASE);
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    ALLOW(ANY_PHASE);
    *size = snapshot_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    ALLOW(ANY_PHASE);
    return (fmi3Status)snapshot_write(i, state, bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    ALLOW(ANY_PHASE);
    return (fmi3Status)snapshot_read(i, bytes, size, state);
}

/* ---- events -------------------------------------------------------------------------------------------------- */

fmi3Status fmi3EnterEventMode(fmi3Instance c) {
    SELF;
    if (i && i->interface == CO_SIMULATION && !i->events)
        return (fmi3Status)tell(i, ERROR, LOG_ERROR, "%s: this was instantiated without Event Mode", __func__);
    if (!allowed(i, __func__, CONTINUOUS_TIME | STEP)) return fmi3Error;
    return (fmi3Status)enter_event_mode(i);
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) {
    ALLOW(EVENT);
    return fmi3OK; /* ignored without providesEvaluateDiscreteStates */
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                    fmi3Boolean *states, fmi3Boolean *defined, fmi3Float64 *time) {
    ALLOW(EVENT);
    *again = *nominals = fmi3False;
    *time = 0;
    const Status status = handle_events(i, states, terminate);
    *defined = next_event(i, time);
    return (fmi3Status)status;
}

fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    ALLOW_IN(CO_SIMULATION, EVENT);
    return (fmi3Status)leave_event_mode(i, STEP);
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
    ALLOW_IN(MODEL_EXCHANGE, EVENT);
    return (fmi3Status)leave_event_mode(i, CONTINUOUS_TIME);
}

/* ---- clocks: there are none ---------------------------------------------------------------------------------- */

#define NO_CLOCKS(NAME, ...) \
    fmi3Status NAME(fmi3Instance c, const fmi3ValueReference references[], size_t n, __VA_ARGS__) { \
        ALLOW(ANY_PHASE); \
        return n ? unsupported(i, __func__) : fmi3OK; \
    }

NO_CLOCKS(fmi3GetClock, fmi3Clock values[])
NO_CLOCKS(fmi3SetClock, const fmi3Clock values[])
NO_CLOCKS(fmi3GetShiftDecimal, fmi3Float64 shifts[])
NO_CLOCKS(fmi3SetShiftDecimal, const fmi3Float64 shifts[])
NO_CLOCKS(fmi3GetShiftFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
NO_CLOCKS(fmi3SetShiftFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NO_CLOCKS(fmi3SetIntervalDecimal, const fmi3Float64 intervals[])
NO_CLOCKS(fmi3GetIntervalDecimal, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
NO_CLOCKS(fmi3SetIntervalFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NO_CLOCKS(fmi3GetIntervalFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time) {
    SELF;
    return i ? unsupported(i, __func__) : fmi3Error;
}

/* ---- Model Exchange ------------------------------------------------------------------------------------------ */

enum { SOLVABLE = INITIALIZATION | EVENT | CONTINUOUS_TIME | TERMINATED | FAILED };

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_set_before, fmi3Boolean *enter_event_mode,
                                       fmi3Boolean *terminate) {
    ALLOW_IN(MODEL_EXCHANGE, CONTINUOUS_TIME);
    *terminate = fmi3False;
    return (fmi3Status)complete_step(i, enter_event_mode);
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) {
    ALLOW_IN(MODEL_EXCHANGE, EVENT | CONTINUOUS_TIME);
    set_time(i, time);
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 states[], size_t n) {
    ALLOW_IN(MODEL_EXCHANGE, CONTINUOUS_TIME);
    if (n != model.n_states) return wrong_count(i, __func__, n);
    set_states(i, states);
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 states[], size_t n) {
    ALLOW_IN(MODEL_EXCHANGE, SOLVABLE);
    if (n != model.n_states) return wrong_count(i, __func__, n);
    return (fmi3Status)get_states(i, states);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 derivatives[], size_t n) {
    ALLOW_IN(MODEL_EXCHANGE, SOLVABLE);
    if (n != model.n_states) return wrong_count(i, __func__, n);
    return (fmi3Status)get_derivatives(i, derivatives);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 indicators[], size_t n) {
    ALLOW_IN(MODEL_EXCHANGE, SOLVABLE);
    if (n != indicator_count()) return wrong_count(i, __func__, n);
    return (fmi3Status)get_indicators(i, indicators);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominals[], size_t n) {
    ALLOW_IN(MODEL_EXCHANGE, SOLVABLE);
    if (n != model.n_states) return wrong_count(i, __func__, n);
    get_nominals(nominals);
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) {
    ALLOW_IN(MODEL_EXCHANGE, ANY_PHASE);
    *n = indicator_count();
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) {
    ALLOW_IN(MODEL_EXCHANGE, ANY_PHASE);
    *n = model.n_states;
    return fmi3OK;
}

/* ---- Co-Simulation ------------------------------------------------------------------------------------------- */

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 size, fmi3Boolean no_set_before,
                      fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_time) {
    ALLOW_IN(CO_SIMULATION, STEP);
    *event_needed = *terminate = *early_return = fmi3False;
    const Status status = do_step(i, time, size);
    *last_time = i->at.time;
    *terminate = i->at.ended;
    *early_return = status < DISCARD && i->at.time < time + size;
    return *early_return && !i->early ? fmi3Discard : (fmi3Status)status;
}
