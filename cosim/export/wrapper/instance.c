/* The life of an instance: memory, log, and which calls its phase allows. */
#include "instance.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ALIGNMENT = 64 };

static const char *const category_names[N_CATEGORIES] = {"logEvents", "logStatusWarning", "logStatusError"};

static const char *phase_name(uint32_t phase) {
    switch (phase) {
    case INSTANTIATED: return "before initialization";
    case INITIALIZATION: return "in Initialization Mode";
    case EVENT: return "in Event Mode";
    case CONTINUOUS_TIME: return "in Continuous-Time Mode";
    case STEP: return "between two steps";
    case TERMINATED: return "after termination";
    default: return "after an error";
    }
}

static void set_control(Instance *i) {
    int64_t *c = i->control;
    memcpy(c, model.control, sizeof i->control);
    c[ENGINE_ROWS] = (int64_t)(intptr_t)model.rows;
    c[ENGINE_PHASE] = (int64_t)(intptr_t)model.phases;
    c[ENGINE_BANKS] = (int64_t)(intptr_t)model.banks;
    c[ENGINE_FUNCTIONS] = (int64_t)(intptr_t)model.functions;
    c[ENGINE_LOOPS] = (int64_t)model.n_loops;
}

Instance *instance_new(const char *name, const char *token, Interface interface) {
    if (!name || !token || strcmp(token, model.token)) return NULL;
    Instance *i = calloc(1, sizeof *i);
    if (!i) return NULL;
    i->name = malloc(strlen(name) + 1);
    i->memory = malloc(model.arena_bytes + ALIGNMENT);
    if (!i->name || !i->memory) {
        instance_free(i);
        return NULL;
    }
    strcpy(i->name, name);
    i->arena = (uint8_t *)(((uintptr_t)i->memory + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT);
    i->interface = interface;
    i->categories = LOG_WARNING | LOG_ERROR;
    instance_reset(i);
    return i;
}

void instance_free(Instance *i) {
    if (!i) return;
    free(i->name);
    free(i->memory);
    free(i);
}

void instance_reset(Instance *i) {
    memset(i->arena, 0, model.arena_bytes);
    for (uint32_t s = 0; s < model.n_segments; s++) {
        const Segment *segment = &model.segments[s];
        memcpy(i->arena + segment->offset, model.words + segment->first, 8 * (size_t)segment->words);
    }
    memset(&i->at, 0, sizeof i->at);
    set_control(i);
    i->at.phase = INSTANTIATED;
    i->at.tick = model.tick;
    i->at.calculate_stale = i->at.outputs_stale = i->at.derivatives_stale = 1;
}

Status tell(Instance *i, Status status, unsigned category, const char *format, ...) {
    if (i->log && (i->categories & category)) {
        char message[1024];
        va_list values;
        va_start(values, format);
        vsnprintf(message, sizeof message, format, values);
        va_end(values);
        int n = 0;
        while (n < N_CATEGORIES - 1 && category != 1u << n) n++;
        i->log(i, status, category_names[n], message);
    }
    if (status >= ERROR) i->at.phase = FAILED;
    return status;
}

bool allowed(Instance *i, const char *function, unsigned phases) {
    if (!i) return false;
    if (i->at.phase & phases) return true;
    tell(i, ERROR, LOG_ERROR, "%s: not allowed %s", function, phase_name(i->at.phase));
    return false;
}

bool allowed_in(Instance *i, const char *function, Interface interface, unsigned phases) {
    if (!i) return false;
    if (i->interface == interface) return allowed(i, function, phases);
    const char *name = interface == MODEL_EXCHANGE ? "Model Exchange" : "Co-Simulation";
    tell(i, ERROR, LOG_ERROR, "%s: belongs to %s, as which this was not instantiated", function, name);
    return false;
}

Status set_categories(Instance *i, bool on, size_t n, const char *const names[]) {
    unsigned chosen = n == 0 ? LOG_ALL : 0;
    for (size_t k = 0; k < n; k++) {
        int c = 0;
        while (c < N_CATEGORIES && (!names[k] || strcmp(names[k], category_names[c]))) c++;
        if (c == N_CATEGORIES) return tell(i, ERROR, LOG_ERROR, "there is no such log category");
        chosen |= 1u << c;
    }
    i->categories = on ? i->categories | chosen : i->categories & ~chosen;
    return OK;
}

size_t size_of(Type type) {
    switch (type) {
    case FLOAT64: case INT64: case UINT64: return 8;
    case FLOAT32: case INT32: case UINT32: return 4;
    case INT16: case UINT16: return 2;
    default: return 1;
    }
}

uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t size) {
    for (const uint8_t *b = bytes; size > 0; size--) hash = (hash ^ *b++) * 1099511628211u;
    return hash;
}

uint8_t *address(Instance *i, const Variable *v, uint32_t element) {
    if (v->kind == TIME) return (uint8_t *)&i->at.time;
    return i->arena + v->offset + element * size_of(v->type);
}

const Item *find(Instance *i, const char *function, uint32_t reference, uint32_t types) {
    const Item *item = reference - 1 < model.n_items ? &model.items[reference - 1] : NULL;
    if (item && types >> variable_of(item)->type & 1) return item;
    tell(i, ERROR, LOG_ERROR, "%s: there is no such variable with the value reference %u", function, reference);
    return NULL;
}

Status settable(Instance *i, const char *function, const Variable *v) {
    if (v->settable & i->at.phase) return OK;
    return tell(i, ERROR, LOG_ERROR, "%s: `%s` cannot be set %s", function, v->name, phase_name(i->at.phase));
}

#define READ(type) { type value; memcpy(&value, place, sizeof value); return (double)value; }

double number_at(const Instance *i, const Variable *v, uint32_t element) {
    const uint8_t *place = i->arena + v->offset + element * size_of(v->type);
    switch (v->type) {
    case FLOAT64: READ(double)
    case FLOAT32: READ(float)
    case INT8: READ(int8_t)
    case INT16: READ(int16_t)
    case UINT16: READ(uint16_t)
    case INT32: READ(int32_t)
    case UINT32: READ(uint32_t)
    case INT64: READ(int64_t)
    case UINT64: READ(uint64_t)
    default: READ(uint8_t)
    }
}

#undef READ

void put_number(Instance *i, const Variable *v, uint32_t element, double value) {
    uint8_t *place = i->arena + v->offset + element * size_of(v->type);
    const float single = (float)value;
    if (v->type == FLOAT64) memcpy(place, &value, sizeof value);
    if (v->type == FLOAT32) memcpy(place, &single, sizeof single);
}

static Status within_limits(Instance *i, const char *function, const Variable *v, uint32_t element, uint32_t count) {
    for (uint32_t e = element; e < element + count; e++) {
        const double value = number_at(i, v, e);
        if (v->min && !(value >= v->min[e]))
            return tell(i, ERROR, LOG_ERROR, "%s: `%s` is %g, below its minimum, %g", function, v->name, value, v->min[e]);
        if (v->max && !(value <= v->max[e]))
            return tell(i, ERROR, LOG_ERROR, "%s: `%s` is %g, above its maximum, %g", function, v->name, value, v->max[e]);
    }
    return OK;
}

Status was_set(Instance *i, const char *function, const Variable *v, uint32_t element, uint32_t count) {
    const size_t size = size_of(v->type);
    const uint64_t first = v->offset + element * size, bytes = count * size;
    Progress *at = &i->at;
    /* Inputs and states may leave theirs while an importer iterates, so FMI wants them to be taken. */
    if (v->kind == PARAMETER && within_limits(i, function, v, element, count) != OK) return ERROR;
    if (v->kind == PARAMETER) at->calculate_stale = 1;
    at->outputs_stale = at->derivatives_stale = 1;
    if (at->phase == STEP) at->inputs_set = 1;
    if (!(at->phase & (INSTANTIATED | INITIALIZATION))) return OK;
    for (uint32_t s = 0; s < model.n_started; s++) {
        const Started *started = &model.started[s];
        if (first < started->offset || first >= started->offset + started->bytes) continue;
        uint8_t *shadow = i->arena + started->shadow + (first - started->offset);
        memcpy(shadow, i->arena + first, bytes);
        memset(shadow + started->bytes, 1, bytes);
    }
    return OK;
}
