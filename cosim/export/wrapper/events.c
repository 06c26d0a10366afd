/* Events of blocks: what their indicators have crossed, and what happens there, by the loop of `cosim.master.crossings`.
 *
 * Co-Simulation finds them inside its steps. In Model Exchange the importer does, and the model says in Event Mode which
 * indicators have crossed since they were looked at last: at the end of an integrator step that crossed nothing, or a
 * moment after an event, where one has crossed back. One that is zero has the sign that it had.
 *
 * FMI's indicators have no direction, so the importer gets their distance from an event: above zero, and below it where
 * one has crossed so that it counts. No step ends at a crossing that is none, and the diagram's steps are the FMU's. */
#include "instance.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double MOMENT = 1.0 / (1 << 20); /* of a step: when the sign of what an event has reset is looked at */

static double vector_at(const Instance *i, int64_t vector, uint64_t k) {
    double value;
    memcpy(&value, i->arena + model.control[vector] + 8 * k, sizeof value);
    return value;
}

uint64_t indicator_count(void) {
    return (uint64_t)model.control[ENGINE_N_INDICATORS];
}

static bool has_crossed(const Instance *i, uint64_t k) {
    const double z = vector_at(i, ENGINE_Z, k), was = vector_at(i, ENGINE_WAS, k);
    const double direction = was < 0 && z > 0 ? 1 : z < 0 && was > 0 ? -1 : 0;
    const double wanted = vector_at(i, ENGINE_WANTED, k);
    return direction != 0 && (wanted == 0 || wanted == direction);
}

static bool have_crossed(const Instance *i) {
    for (uint64_t k = 0; k < indicator_count(); k++)
        if (has_crossed(i, k)) return true;
    return false;
}

Status get_indicators(Instance *i, double *values) {
    const Status status = provide(i, INDICATED);
    for (uint64_t k = 0; k < indicator_count() && status < ERROR; k++) {
        const double z = fabs(vector_at(i, ENGINE_Z, k));
        values[k] = has_crossed(i, k) ? -z : z == 0 ? DBL_MIN : z;
    }
    return status;
}

/* Keep the signs that the indicators have. */
static void note_indicators(Instance *i) {
    for (uint64_t k = 0; k < indicator_count(); k++) {
        const double z = vector_at(i, ENGINE_Z, k);
        if (z != 0) memcpy(i->arena + model.control[ENGINE_WAS] + 8 * k, &z, sizeof z);
    }
}

Status handle_events(Instance *i, bool *changed, bool *ends) {
    *changed = *ends = false;
    if (i->interface != MODEL_EXCHANGE || !indicator_count()) return OK;
    Status status = provide(i, EVALUATED);
    if (status >= ERROR) return status;
    const uint8_t *states = i->arena + model.x;
    const uint64_t before = hash_bytes(HASH_BEGIN, states, 8 * model.n_states);
    const bool looked = i->at.looked;
    bool happened = false;
    if (looked) {
        status = worse(status, provide(i, INDICATED));
        happened = status < ERROR && have_crossed(i);
    }
    if (status < ERROR && (happened || !looked)) status = worse(status, anticipate(i));
    if (status >= ERROR) return status;
    i->at.looked = 1;
    if (happened) {
        i->at.happened = 1;
        i->at.outputs_stale = i->at.sampling; /* which has clocks be due anew */
        i->at.derivatives_stale = 1;
    }
    *changed = hash_bytes(HASH_BEGIN, states, 8 * model.n_states) != before;
    *ends = happened && i->control[ENGINE_ENDED_BY] != 0;
    return status;
}

Status look_ahead(Instance *i) {
    if (!i->at.happened) return OK;
    i->at.happened = 0;
    Status status = provide(i, DIFFERENTIATED);
    uint8_t *kept = malloc(model.arena_bytes);
    if (!kept) return worse(status, tell(i, ERROR, LOG_ERROR, "out of memory"));
    memcpy(kept, i->arena, model.arena_bytes);
    const Progress at = i->at;
    for (uint64_t k = 0; k < model.n_states && status < ERROR; k++) {
        double x, d;
        memcpy(&x, i->arena + model.x + 8 * k, sizeof x);
        memcpy(&d, i->arena + model.d + 8 * k, sizeof d);
        x += MOMENT * model.step * d;
        memcpy(i->arena + model.x + 8 * k, &x, sizeof x);
    }
    i->at.time += MOMENT * model.step;
    i->at.sampling = 0;
    i->at.outputs_stale = 1;
    if (status < ERROR) status = worse(status, provide(i, INDICATED));
    for (uint64_t k = 0; k < indicator_count(); k++) {
        const double z = vector_at(i, ENGINE_Z, k);
        if (status < ERROR && z * vector_at(i, ENGINE_WANTED, k) < 0)
            memcpy(kept + model.control[ENGINE_WAS] + 8 * k, &z, sizeof z);
    }
    memcpy(i->arena, kept, model.arena_bytes);
    if (status < ERROR) i->at = at;
    free(kept);
    return status;
}

Status look_at_step_end(Instance *i, bool *crossed) {
    *crossed = false;
    if (!indicator_count()) return OK;
    const Status status = provide(i, INDICATED);
    if (status >= ERROR) return status;
    *crossed = have_crossed(i);
    if (!*crossed) note_indicators(i);
    return status;
}
