/* Computing: initial values, outputs, derivatives, steps and sample instants, all by the loop of `cosim.master.loop`. */
#include "instance.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double ROUNDING = 1e-9; /* relative to a step: what rounding may do to a time */
static const double MOST_TICKS = 0x1p62; /* of a run, as they are counted in 64 bits */

/* ---- calling the loop ---------------------------------------------------------------------------------------- */

/* What went wrong, with `#` doubled, as FMI's log messages want it. */
static void fault_text(const Fault *fault, char *text, size_t size) {
    char plain[512];
    snprintf(plain, sizeof plain, fault->text ? fault->text : "an error", (long long)fault->first,
             (long long)fault->second);
    size_t n = 0;
    for (const char *c = plain; *c && n + 2 < size; c++) {
        if (*c == '#') text[n++] = '#';
        text[n++] = *c;
    }
    text[n] = 0;
}

static Status explain(Instance *i, int32_t status, double time) {
    const int64_t *c = i->control;
    if (status == ENGINE_NON_FINITE) {
        const uint64_t place = (uint64_t)c[ENGINE_ELEMENT];
        const char *name = "a local variable";
        for (uint32_t v = 0; v < model.n_variables; v++) {
            const Variable *variable = &model.variables[v];
            const uint64_t end = variable->offset + size_of(variable->type) * (uint64_t)variable->count;
            if (variable->offset <= place && place < end) name = variable->name;
        }
        return tell(i, ERROR, LOG_ERROR, "`%s` is not finite, or beyond 1e100, at t = %g s: try a smaller step", name,
                    time);
    }
    if (status == ENGINE_RESTLESS)
        return tell(i, ERROR, LOG_ERROR, "events follow each other without end after t = %g s", time);
    if (status == ENGINE_STALLED)
        return tell(i, ERROR, LOG_ERROR, "no inner step keeps the tolerance after t = %g s", time);
    for (uint32_t l = 0; status == ENGINE_UNSOLVED && l < model.n_loops; l++)
        if (model.loops[l].row == c[ENGINE_AT])
            return tell(i, ERROR, LOG_ERROR, "no solution was found of the algebraic loop of %s at t = %g s, for %s",
                        model.loops[l].blocks, time, model.loops[l].torn);
    const int64_t *row = model.rows + c[ENGINE_AT] * ENGINE_ROW_WORDS;
    const int64_t function = row[ENGINE_A];
    uint8_t *frame = i->arena + row[ENGINE_B];
    Fault fault;
    char text[768];
    memcpy(&fault, frame, sizeof fault);
    memset(frame, 0, sizeof fault);
    fault_text(&fault, text, sizeof text);
    return tell(i, status == FATAL ? FATAL : ERROR, LOG_ERROR, "%s: %s in %s() at t = %g s", model.blocks[function],
                text, model.labels[function], fault.text ? fault.time : time);
}

static double grid_time(const Instance *i) {
    const Progress *at = &i->at;
    return at->origin + (double)(at->k - at->origin_tick) * at->tick;
}

static Status conclude(Instance *i, int32_t status, int64_t warnings, double time) {
    if (status > ENGINE_WARNING) return explain(i, status, time);
    if (i->control[ENGINE_WARNINGS] == warnings) return OK;
    return tell(i, WARNING, LOG_WARNING, "a block warned at t = %g s", time);
}

/* Rows once, as of tick k. */
static Status execute(Instance *i, Range range, double time) {
    int64_t *c = i->control, warnings = c[ENGINE_WARNINGS];
    if (range.begin == range.end) return OK;
    c[ENGINE_FIRST_ROW] = range.begin;
    c[ENGINE_END_ROW] = range.end;
    c[ENGINE_TICK] = i->at.k;
    return conclude(i, engine_execute(time, i->arena, c), warnings, time);
}

/* The same in the middle of the initialization, when what comes later has not been written yet. */
static Status execute_part(Instance *i, Range range, double time) {
    int64_t *c = i->control;
    c[ENGINE_N_PUBLISHED] = c[ENGINE_N_PUBLISHED32] = 0;
    const Status status = execute(i, range, time);
    c[ENGINE_N_PUBLISHED] = model.control[ENGINE_N_PUBLISHED];
    c[ENGINE_N_PUBLISHED32] = model.control[ENGINE_N_PUBLISHED32];
    return status;
}

/* n ticks from tick k; for n = 0 what a communication point evaluates, once, as of tick k. */
static Status run(Instance *i, int64_t n) {
    int64_t *c = i->control, warnings = c[ENGINE_WARNINGS];
    c[ENGINE_TICK] = i->at.k;
    c[ENGINE_LAST] = i->at.k + n;
    c[ENGINE_FINAL] = n == 0;
    c[ENGINE_ORIGIN_TICK] = i->at.origin_tick;
    memcpy(&c[ENGINE_ORIGIN], &i->at.origin, sizeof(double));
    memcpy(&c[ENGINE_TICK_SIZE], &i->at.tick, sizeof(double));
    const int32_t status = engine_run(0, i->arena, c);
    i->at.k = c[ENGINE_TICK];
    return conclude(i, status, warnings, grid_time(i));
}

static double now(const Instance *i) {
    return i->interface == CO_SIMULATION || i->at.sampling ? grid_time(i) : i->at.time;
}

Status anticipate(Instance *i) {
    int64_t *c = i->control, warnings = c[ENGINE_WARNINGS];
    c[ENGINE_TICK] = i->at.k;
    c[ENGINE_LOOKED] = i->at.looked;
    c[ENGINE_ENDING] = c[ENGINE_ENDED_BY] = 0;
    return conclude(i, engine_begin(now(i), i->arena, c), warnings, now(i));
}

Status worse(Status a, Status b) {
    return a > b ? a : b;
}

/* ---- values at one time -------------------------------------------------------------------------------------- */

static Status initialize(Instance *i) {
    const Range calculate = model.phases[ENGINE_CALCULATE], start = model.phases[ENGINE_START];
    Range part = {calculate.begin, calculate.begin};
    Status status = OK;
    for (uint32_t s = 0; s < model.n_started && status < ERROR; s++) {
        const Started *started = &model.started[s];
        part.end = started->row + 1;
        status = worse(status, execute_part(i, part, i->at.start));
        part.begin = part.end;
        const uint8_t *shadow = i->arena + started->shadow;
        for (uint64_t b = 0; b < started->bytes; b++)
            if (shadow[started->bytes + b]) i->arena[started->offset + b] = shadow[b];
    }
    part.end = start.end;
    if (status < ERROR) status = worse(status, execute(i, part, i->at.start));
    i->at.calculate_stale = i->at.outputs_stale = status >= ERROR;
    i->at.derivatives_stale = 1;
    return status;
}

/* Co-Simulation: whatever is read between two steps, each evaluation of a communication point begins with the same
 * guess, as that of a run does, so that a loop's solution has the same bits. */
static void guess_again(Instance *i) {
    for (uint32_t g = 0; g < model.n_guesses; g++) {
        const Guess *guess = &model.guesses[g];
        uint8_t *published = i->arena + guess->offset, *kept = i->arena + guess->kept;
        memcpy(i->at.guess_kept ? published : kept, i->at.guess_kept ? kept : published, guess->bytes);
    }
    i->at.guess_kept = 1;
}

static Status evaluate(Instance *i) {
    if (i->interface == CO_SIMULATION) guess_again(i);
    const bool sampled = i->interface == CO_SIMULATION || i->at.sampling;
    i->control[ENGINE_LEFT] = !sampled; /* what a wire brings late jumps at sample instants only */
    const Status status = sampled ? run(i, 0) : execute(i, model.phases[ENGINE_HELD], i->at.time);
    i->at.outputs_stale = status >= ERROR;
    return status;
}

static Status calculate(Instance *i) {
    if (!i->at.calculate_stale) return OK;
    const Status status = execute(i, model.phases[ENGINE_CALCULATE], i->at.time);
    i->at.calculate_stale = status >= ERROR;
    return status;
}

Need need_of(const Instance *i, const Variable *v) {
    const bool started = i->at.phase == INITIALIZATION && v->kind == CONTINUOUS_STATE;
    return started ? EVALUATED : (Need)v->need;
}

Status provide(Instance *i, Need need) {
    Progress *at = &i->at;
    Status status = OK;
    if (need == NOTHING || at->phase & (INSTANTIATED | FAILED)) return OK;
    if (at->phase == INITIALIZATION) {
        if (at->outputs_stale || at->calculate_stale) status = initialize(i);
    } else {
        status = calculate(i);
        if (status < ERROR && need > CALCULATED && at->outputs_stale) status = worse(status, evaluate(i));
    }
    if (status < ERROR && need == INDICATED)
        status = worse(status, execute(i, model.phases[ENGINE_INDICATORS], now(i)));
    if (status < ERROR && need == DIFFERENTIATED && at->derivatives_stale) {
        const double time = i->interface == CO_SIMULATION ? grid_time(i) : at->time;
        status = worse(status, execute(i, model.phases[ENGINE_DERIVATIVES], time));
        at->derivatives_stale = status >= ERROR;
    }
    return status;
}

Status refresh(Instance *i, const Variable *v) {
    const Need need = need_of(i, v);
    if (need > CALCULATED && i->at.phase == STEP && i->at.inputs_set)
        return tell(i, ERROR, LOG_ERROR,
                    "`%s` cannot be read: something was set since the last step, and Co-Simulation computes in steps "
                    "only (FMI 3 can in Event Mode)",
                    v->name);
    return provide(i, need);
}

Status get_derivatives(Instance *i, double *values) {
    const Status status = provide(i, DIFFERENTIATED);
    if (status < ERROR && model.n_states > 0) memcpy(values, i->arena + model.d, 8 * model.n_states);
    return status;
}

Status get_states(Instance *i, double *values) {
    const Status status = i->at.phase == INITIALIZATION ? provide(i, EVALUATED) : OK;
    if (status < ERROR && model.n_states > 0) memcpy(values, i->arena + model.x, 8 * model.n_states);
    return status;
}

void get_nominals(double *values) {
    for (uint64_t k = 0; k < model.n_states; k++) values[k] = 1.0;
    for (uint32_t v = 0; v < model.n_variables; v++) {
        const Variable *state = &model.variables[v];
        if (state->kind != CONTINUOUS_STATE || !state->nominal) continue;
        memcpy(values + (state->offset - model.x) / 8, state->nominal, 8 * (size_t)state->count);
    }
}

void set_states(Instance *i, const double *values) {
    if (model.n_states > 0) memcpy(i->arena + model.x, values, 8 * model.n_states);
    i->at.outputs_stale = i->at.derivatives_stale = 1;
}

void set_time(Instance *i, double time) {
    i->at.time = time;
    i->at.outputs_stale = i->at.derivatives_stale = 1;
}

void move_time(Instance *i, double change) {
    i->at.time += change;
    i->at.start += change;
    i->at.origin += change;
    i->at.outputs_stale = i->at.derivatives_stale = 1;
}

/* ---- from phase to phase ------------------------------------------------------------------------------------- */

static int64_t sample_after(const Instance *i, int64_t k) {
    int64_t next = INT64_MAX;
    for (uint32_t n = 0; n < model.n_clocks; n++) {
        const int64_t *clock = (const int64_t *)(i->arena + model.clocks) + n * ENGINE_CLOCK_WORDS;
        const int64_t period = clock[ENGINE_PERIOD], offset = clock[ENGINE_OFFSET];
        const int64_t candidate = k < offset ? offset : offset + ((k - offset) / period + 1) * period;
        if (candidate < next) next = candidate;
    }
    return next;
}

Status enter_initialization(Instance *i, double start, bool stop_defined, double stop) {
    if (!isfinite(start) || (stop_defined && !(stop >= start)))
        return tell(i, ERROR, LOG_ERROR, "the start time %g s and the stop time %g s make no sense", start, stop);
    Progress *at = &i->at;
    at->start = at->time = at->origin = start;
    at->stop_defined = stop_defined;
    at->stop = stop;
    at->phase = INITIALIZATION;
    at->calculate_stale = at->outputs_stale = at->derivatives_stale = 1;
    return OK;
}

Status exit_initialization(Instance *i, Phase next) {
    const Status status = provide(i, EVALUATED);
    if (status >= ERROR) return status;
    i->at.phase = next;
    /* A run evaluates once more at its first communication point, which solves algebraic loops to other last bits. */
    if (i->interface == CO_SIMULATION) i->at.outputs_stale = 1;
    i->at.sampling = i->interface == MODEL_EXCHANGE && model.n_clocks > 0;
    i->at.next = sample_after(i, 0);
    return worse(status, tell(i, OK, LOG_EVENTS, "initialized at t = %g s", i->at.start));
}

bool next_event(Instance *i, double *time) {
    if (i->interface != MODEL_EXCHANGE || model.n_clocks == 0) return false;
    *time = i->at.origin + (double)i->at.next * model.tick;
    return true;
}

Status enter_event_mode(Instance *i) {
    double due;
    i->at.phase = EVENT;
    i->at.inputs_set = 0;
    if (!next_event(i, &due) || i->at.time < due - ROUNDING * model.step) return OK;
    i->at.k = i->at.next;
    i->at.next = sample_after(i, i->at.k);
    i->at.sampling = 1;
    i->at.outputs_stale = i->at.derivatives_stale = 1;
    return tell(i, OK, LOG_EVENTS, "sampled at t = %g s", due);
}

static uint64_t hash_discrete(Instance *i) {
    uint64_t hash = HASH_BEGIN;
    for (uint32_t v = 0; v < model.n_variables; v++) {
        const Variable *variable = &model.variables[v];
        if (variable->kind != DISCRETE_OUTPUT) continue;
        hash = hash_bytes(hash, address(i, variable, 0), variable->count * size_of(variable->type));
    }
    return hash;
}

Status leave_event_mode(Instance *i, Phase next) {
    Status status = i->interface == MODEL_EXCHANGE ? provide(i, EVALUATED) : OK;
    if (status < ERROR && i->at.sampling) {
        /* The inputs have settled: now the sampled states' next values, which the next instant publishes. */
        status = worse(status, execute(i, model.phases[ENGINE_UPDATE], grid_time(i)));
        i->at.sampling = 0;
    }
    if (status < ERROR && i->interface == MODEL_EXCHANGE) status = worse(status, look_ahead(i));
    if (status >= ERROR) return status;
    i->at.discrete = hash_discrete(i);
    i->at.phase = next;
    return status;
}

Status complete_step(Instance *i, bool *event) {
    bool crossed;
    const Status status = worse(provide(i, EVALUATED), look_at_step_end(i, &crossed));
    *event = status < ERROR && (crossed || hash_discrete(i) != i->at.discrete);
    return status;
}

/* The time of tick k is kept on a grid as long as the importer's times lie on it within rounding, so that a run gets
 * the same times as the diagram that it was exported from. */
static void follow(Progress *at, double time, double step) {
    const double expected = at->origin + (double)(at->k - at->origin_tick) * at->tick;
    const double tick = step == model.step ? model.tick : step / (double)model.grid;
    if (tick != at->tick || fabs(time - expected) > ROUNDING * step) {
        at->origin = time;
        at->origin_tick = at->k;
        at->tick = tick;
    }
}

/* A block has ended the run: be at that time, with what is published there. */
static Status end(Instance *i, double time) {
    Progress *at = &i->at;
    if (i->control[ENGINE_ENDING] == ENGINE_BETWEEN || i->control[ENGINE_ENDING] == ENGINE_ENDED)
        memcpy(&time, &i->control[ENGINE_ENDED_AT], sizeof time);
    at->time = time;
    at->ended = 1;
    at->outputs_stale = 0;
    return tell(i, OK, LOG_EVENTS, "a block has ended the simulation at t = %g s", time);
}

Status do_step(Instance *i, double time, double size) {
    Progress *at = &i->at;
    if (at->ended) return tell(i, ERROR, LOG_ERROR, "doStep: a block has ended the simulation at t = %g s", at->time);
    if (!(size > 0) || !isfinite(size))
        return tell(i, ERROR, LOG_ERROR, "doStep: a step of %g s at t = %.17g s is not positive", size, time);
    if (!(fabs(time - at->time) <= 1e-6 * size + 1e-12 * fabs(time)))
        return tell(i, ERROR, LOG_ERROR, "doStep: begins at t = %.17g s, but this is at %.17g s", time, at->time);
    if (at->stop_defined && time + size > at->stop + 1e-6 * size)
        return tell(i, ERROR, LOG_ERROR, "doStep: ends at t = %g s, after the stop time %g s", time + size, at->stop);
    const double n = fmax(1, ceil(size / model.step - ROUNDING));
    if (!((double)at->k + n * (double)model.grid < MOST_TICKS))
        return tell(i, DISCARD, LOG_WARNING, "doStep: %g s are too many steps of %g s", size, model.step);
    double step = size / n;
    if (fabs(step - model.step) <= ROUNDING * model.step) step = model.step;
    if (model.n_clocks && step != model.step)
        return tell(i, DISCARD, LOG_WARNING, "doStep: sampled blocks and delays need a multiple of %g s, not %g s", model.step, size);
    Status status = calculate(i);
    if (status >= ERROR) return status;
    guess_again(i);
    at->guess_kept = 0;
    i->control[ENGINE_ENDING] = i->control[ENGINE_ENDED_BY] = 0; /* of a step that was undone */
    follow(at, time, step);
    status = worse(status, run(i, (int64_t)n * model.grid));
    at->time = time + size;
    at->outputs_stale = at->derivatives_stale = 1;
    at->inputs_set = 0;
    return i->control[ENGINE_ENDED_BY] ? worse(status, end(i, at->time)) : status;
}
