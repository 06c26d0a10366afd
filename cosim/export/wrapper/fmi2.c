/* The functions of FMI 2.0.4. What each may do in which state: sections 3.2.3 and 4.2.4. */
#include "arithmetic.h"
#include "instance.h"

#include "fmi2Functions.h"

#include <stdlib.h>
#include <string.h>

enum { READABLE = ANY_PHASE & ~INSTANTIATED, DIFFERENTIABLE = READABLE & ~FAILED };

#define SELF \
    STANDARD_ARITHMETIC; \
    Instance *i = c
#define ALLOW(phases) \
    SELF; \
    if (!allowed(i, __func__, phases)) return fmi2Error
#define ALLOW_IN(interface, phases) \
    SELF; \
    if (!allowed_in(i, __func__, interface, phases)) return fmi2Error

static fmi2Status unsupported(Instance *i, const char *function) {
    return (fmi2Status)tell(i, ERROR, LOG_ERROR, "%s: this FMU does not have it", function);
}

/* ---- creation ------------------------------------------------------------------------------------------------ */

static void call_logger(const Instance *i, Status status, const char *category, const char *message) {
    const fmi2CallbackFunctions *functions = i->logger;
    /* Importers without C's printf show the format as it is. */
    const char *format = strchr(message, '%') ? "%s" : message;
    functions->logger(i->environment, i->name, (fmi2Status)status, category, format, message);
}

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    const bool logs = functions && functions->logger;
    Instance *i = instance_new(name, guid, type == fmi2ModelExchange ? MODEL_EXCHANGE : CO_SIMULATION);
    if (!i) {
        if (logs)
            functions->logger(functions->componentEnvironment, name ? name : "", fmi2Error, "logStatusError",
                              "fmi2Instantiate: no name, another model's GUID, or no memory left");
        return NULL;
    }
    if (logs) {
        i->log = call_logger;
        i->logger = malloc(sizeof *functions);
        if (!i->logger) {
            instance_free(i);
            return NULL;
        }
        memcpy(i->logger, functions, sizeof *functions);
        i->environment = functions->componentEnvironment;
    }
    if (logging) i->categories = LOG_ALL;
    return i;
}

void fmi2FreeInstance(fmi2Component c) {
    SELF;
    if (!i) return;
    free(i->logger);
    instance_free(i);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    ALLOW(ANY_PHASE);
    return (fmi2Status)set_categories(i, on, n, categories);
}

/* ---- initialization, termination ----------------------------------------------------------------------------- */

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop) {
    ALLOW(INSTANTIATED);
    i->at.start = start;
    i->at.stop_defined = stop_defined != fmi2False;
    i->at.stop = stop;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    ALLOW(INSTANTIATED);
    return (fmi2Status)enter_initialization(i, i->at.start, i->at.stop_defined, i->at.stop);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    ALLOW(INITIALIZATION);
    return (fmi2Status)exit_initialization(i, i->interface == MODEL_EXCHANGE ? EVENT : STEP);
}

fmi2Status fmi2Terminate(fmi2Component c) {
    ALLOW(INITIALIZED);
    i->at.phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    ALLOW(ANY_PHASE);
    instance_reset(i);
    return fmi2OK;
}

/* ---- variables ----------------------------------------------------------------------------------------------- */

enum { REALS = 1 << FLOAT64 | 1 << FLOAT32, BOOLEANS = 1 << BOOLEAN, INTEGERS = 0x7FF & ~(REALS | BOOLEANS) };

#define READ(type) { type value; memcpy(&value, place, sizeof value); return value; }

static int64_t read_integer(const Variable *v, const uint8_t *place) {
    switch (v->type) {
    case INT8: READ(int8_t)
    case UINT8: READ(uint8_t)
    case INT16: READ(int16_t)
    case UINT16: READ(uint16_t)
    case INT32: READ(int32_t)
    case UINT32: READ(uint32_t)
    case UINT64: {
        uint64_t value;
        memcpy(&value, place, sizeof value);
        return value > INT64_MAX ? INT64_MAX : (int64_t)value;
    }
    default: READ(int64_t)
    }
}

/* Integers are stored as in two's complement, least significant byte first, on all platforms that are built. */
static bool write_integer(const Variable *v, uint8_t *place, int64_t value) {
    memcpy(place, &value, size_of(v->type));
    return read_integer(v, place) == value;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Real values[]) {
    ALLOW(READABLE);
    Status status = OK;
    for (size_t k = 0; k < n; k++) {
        const Item *item = find(i, __func__, references[k], REALS);
        if (!item) return fmi2Error;
        const Variable *v = variable_of(item);
        const Status s = refresh(i, v);
        if (s >= ERROR) return (fmi2Status)s;
        if (s > status) status = s;
        const uint8_t *place = address(i, v, item->first);
        if (v->type == FLOAT64) {
            memcpy(&values[k], place, sizeof(double));
        } else {
            float value;
            memcpy(&value, place, sizeof value);
            values[k] = value;
        }
    }
    return (fmi2Status)status;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Integer values[]) {
    ALLOW(READABLE);
    Status status = OK;
    for (size_t k = 0; k < n; k++) {
        const Item *item = find(i, __func__, references[k], INTEGERS);
        if (!item) return fmi2Error;
        const Variable *v = variable_of(item);
        const Status s = refresh(i, v);
        if (s >= ERROR) return (fmi2Status)s;
        if (s > status) status = s;
        const int64_t value = read_integer(v, address(i, v, item->first));
        if (value < INT32_MIN || value > INT32_MAX)
            return (fmi2Status)tell(i, ERROR, LOG_ERROR, "%s: a value of `%s` does not fit", __func__, v->name);
        values[k] = (fmi2Integer)value;
    }
    return (fmi2Status)status;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Boolean values[]) {
    ALLOW(READABLE);
    Status status = OK;
    for (size_t k = 0; k < n; k++) {
        const Item *item = find(i, __func__, references[k], BOOLEANS);
        if (!item) return fmi2Error;
        const Variable *v = variable_of(item);
        const Status s = refresh(i, v);
        if (s >= ERROR) return (fmi2Status)s;
        if (s > status) status = s;
        values[k] = *address(i, v, item->first) ? fmi2True : fmi2False;
    }
    return (fmi2Status)status;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Real values[]) {
    ALLOW(WRITABLE);
    for (size_t k = 0; k < n; k++) {
        const Item *item = find(i, __func__, references[k], REALS);
        if (!item || settable(i, __func__, variable_of(item)) != OK) return fmi2Error;
        const Variable *v = variable_of(item);
        if (v->type == FLOAT64) {
            memcpy(address(i, v, item->first), &values[k], sizeof(double));
        } else {
            const float value = (float)values[k];
            memcpy(address(i, v, item->first), &value, sizeof value);
        }
        if (was_set(i, __func__, v, item->first, 1) != OK) return fmi2Error;
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Integer values[]) {
    ALLOW(WRITABLE);
    for (size_t k = 0; k < n; k++) {
        const Item *item = find(i, __func__, references[k], INTEGERS);
        if (!item || settable(i, __func__, variable_of(item)) != OK) return fmi2Error;
        const Variable *v = variable_of(item);
        if (!write_integer(v, address(i, v, item->first), values[k]))
            return (fmi2Status)tell(i, ERROR, LOG_ERROR, "%s: `%s` cannot be %d", __func__, v->name, values[k]);
        if (was_set(i, __func__, v, item->first, 1) != OK) return fmi2Error;
    }
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Boolean values[]) {
    ALLOW(WRITABLE);
    for (size_t k = 0; k < n; k++) {
        const Item *item = find(i, __func__, references[k], BOOLEANS);
        if (!item || settable(i, __func__, variable_of(item)) != OK) return fmi2Error;
        const Variable *v = variable_of(item);
        *address(i, v, item->first) = values[k] != fmi2False;
        if (was_set(i, __func__, v, item->first, 1) != OK) return fmi2Error;
    }
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2String values[]) {
    ALLOW(READABLE);
    return n ? unsupported(i, __func__) : fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2String values[]) {
    ALLOW(WRITABLE);
    return n ? unsupported(i, __func__) : fmi2OK;
}

/* ---- FMU states ---------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    ALLOW(ANY_PHASE);
    return (fmi2Status)snapshot_take(i, state);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    ALLOW(ANY_PHASE);
    return (fmi2Status)snapshot_restore(i, state);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    ALLOW(ANY_PHASE);
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    ALLOW(ANY_PHASE);
    *size = snapshot_size();
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    ALLOW(ANY_PHASE);
    return (fmi2Status)snapshot_write(i, state, (uint8_t *)bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    ALLOW(ANY_PHASE);
    return (fmi2Status)snapshot_read(i, (const uint8_t *)bytes, size, state);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t n_unknowns,
                                        const fmi2ValueReference knowns[], size_t n_knowns, const fmi2Real seed[],
                                        fmi2Real sensitivity[]) {
    ALLOW(DIFFERENTIABLE);
    return (fmi2Status)directional_derivative(i, __func__, (References){unknowns, n_unknowns},
                                              (References){knowns, n_knowns}, seed, n_knowns, sensitivity, n_unknowns);
}

/* ---- Model Exchange ------------------------------------------------------------------------------------------ */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    ALLOW_IN(MODEL_EXCHANGE, EVENT | CONTINUOUS_TIME);
    return (fmi2Status)enter_event_mode(i);
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    ALLOW_IN(MODEL_EXCHANGE, EVENT);
    memset(info, 0, sizeof *info);
    bool changed, ends;
    const Status status = handle_events(i, &changed, &ends);
    info->valuesOfContinuousStatesChanged = changed ? fmi2True : fmi2False;
    info->terminateSimulation = ends ? fmi2True : fmi2False;
    info->nextEventTimeDefined = next_event(i, &info->nextEventTime) ? fmi2True : fmi2False;
    return (fmi2Status)status;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    ALLOW_IN(MODEL_EXCHANGE, EVENT);
    return (fmi2Status)leave_event_mode(i, CONTINUOUS_TIME);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_set_before, fmi2Boolean *enter_event_mode,
                                       fmi2Boolean *terminate) {
    ALLOW_IN(MODEL_EXCHANGE, CONTINUOUS_TIME);
    bool event;
    const Status status = complete_step(i, &event);
    *enter_event_mode = event ? fmi2True : fmi2False;
    *terminate = fmi2False;
    return (fmi2Status)status;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    ALLOW_IN(MODEL_EXCHANGE, EVENT | CONTINUOUS_TIME);
    set_time(i, time);
    return fmi2OK;
}

static fmi2Status wrong_size(Instance *i, const char *function, size_t n) {
    return (fmi2Status)tell(i, ERROR, LOG_ERROR, "%s: there are not %u of them", function, (unsigned)n);
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real states[], size_t n) {
    ALLOW_IN(MODEL_EXCHANGE, CONTINUOUS_TIME);
    if (n != model.n_states) return wrong_size(i, __func__, n);
    set_states(i, states);
    return fmi2OK;
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real states[], size_t n) {
    ALLOW_IN(MODEL_EXCHANGE, READABLE);
    if (n != model.n_states) return wrong_size(i, __func__, n);
    return (fmi2Status)get_states(i, states);
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t n) {
    ALLOW_IN(MODEL_EXCHANGE, READABLE & ~INITIALIZATION);
    if (n != model.n_states) return wrong_size(i, __func__, n);
    return (fmi2Status)get_derivatives(i, derivatives);
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t n) {
    ALLOW_IN(MODEL_EXCHANGE, READABLE);
    if (n != indicator_count()) return wrong_size(i, __func__, n);
    return (fmi2Status)get_indicators(i, indicators);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominals[], size_t n) {
    ALLOW_IN(MODEL_EXCHANGE, ANY_PHASE & ~INITIALIZATION);
    if (n != model.n_states) return wrong_size(i, __func__, n);
    get_nominals(nominals);
    return fmi2OK;
}

/* ---- Co-Simulation ------------------------------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no_set_before) {
    ALLOW_IN(CO_SIMULATION, STEP);
    const Status status = do_step(i, time, size);
    return status < DISCARD && i->at.ended ? fmi2Discard : (fmi2Status)status;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    ALLOW_IN(CO_SIMULATION, 0); /* no step is ever pending */
    return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t n,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
    ALLOW_IN(CO_SIMULATION, INSTANTIATED | INITIALIZATION | STEP);
    return unsupported(i, __func__);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t n,
                                        const fmi2Integer orders[], fmi2Real values[]) {
    ALLOW_IN(CO_SIMULATION, STEP | TERMINATED | FAILED);
    return unsupported(i, __func__);
}

static fmi2Status no_status(Instance *i, const char *function) {
    return (fmi2Status)tell(i, DISCARD, LOG_WARNING, "%s: steps are never pending here", function);
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    ALLOW_IN(CO_SIMULATION, STEP | TERMINATED | FAILED);
    return no_status(i, __func__);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    ALLOW_IN(CO_SIMULATION, STEP | TERMINATED | FAILED);
    if (kind != fmi2LastSuccessfulTime) return no_status(i, __func__);
    *value = i->at.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    ALLOW_IN(CO_SIMULATION, STEP | TERMINATED | FAILED);
    return no_status(i, __func__);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    ALLOW_IN(CO_SIMULATION, STEP | TERMINATED | FAILED);
    if (kind != fmi2Terminated) return no_status(i, __func__);
    *value = i->at.ended ? fmi2True : fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    ALLOW_IN(CO_SIMULATION, STEP | TERMINATED | FAILED);
    return no_status(i, __func__);
}
