/* One instance of the model behind either standard: its memory, its phase, and what can be done with it.
 *
 * An FMU is one C file that includes all others, so that nothing is visible but FMI's functions. */
#ifndef COSIM_INSTANCE_H
#define COSIM_INSTANCE_H

#include "layout.h"
#include "model.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* FMI 2 and FMI 3 number their statuses alike. */
typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;

/* The states of the standards' state machines; STEP is FMI 2's stepComplete, FAILED its error. */
typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,
    CONTINUOUS_TIME = 8,
    STEP = 16,
    TERMINATED = 32,
    FAILED = 64
} Phase;
enum {
    ANY_PHASE = 127,
    INITIALIZED = EVENT | CONTINUOUS_TIME | STEP,
    WRITABLE = INSTANTIATED | INITIALIZATION | INITIALIZED
};

typedef enum { MODEL_EXCHANGE, CO_SIMULATION } Interface;

/* Log categories; the names are in `category_names`. */
enum { LOG_EVENTS = 1, LOG_WARNING = 2, LOG_ERROR = 4, LOG_ALL = 7 };
enum { N_CATEGORIES = 3 };
static const char *const category_names[N_CATEGORIES];

/* Where a run stands. With the arena, this is all that an FMU state holds. */
typedef struct {
    uint32_t phase;
    uint8_t calculate_stale, outputs_stale, derivatives_stale;
    uint8_t inputs_set;  /* Co-Simulation: something was set after the last step */
    uint8_t sampling;    /* Model Exchange: a sample instant is being handled in Event Mode */
    uint8_t stop_defined;
    uint8_t guess_kept;  /* Co-Simulation: outputs were evaluated after the last step */
    uint8_t ended;       /* Co-Simulation: a block has ended the run, at `time` */
    uint8_t looked;      /* Model Exchange: at the event indicators, since the initialization */
    uint8_t happened;    /* Model Exchange: an event of a block, since Event Mode was entered */
    double time;         /* as the importer counts it (s) */
    double start, stop;
    double origin;       /* the grid of inner steps: tick k is at origin + (k - origin_tick) * tick */
    double tick;
    int64_t origin_tick;
    int64_t k;           /* the tick of the inner step, or of the last sample instant in Model Exchange */
    int64_t next;        /* Model Exchange: the tick of the next sample instant */
    uint64_t discrete;   /* Model Exchange: a hash of the discrete outputs when Event Mode was left */
} Progress;

typedef struct Instance Instance;
struct Instance {
    char *name;
    void *environment;
    void (*log)(const Instance *, Status, const char *category, const char *message);
    void *logger; /* the importer's callback, which `log` knows how to call */
    unsigned categories;
    Interface interface;
    bool events; /* FMI 3 Co-Simulation: the importer uses Event Mode */
    bool early;  /* FMI 3 Co-Simulation: a step may return early */
    Progress at;
    int64_t control[ENGINE_CONTROL_WORDS];
    uint8_t *arena; /* aligned */
    void *memory;   /* as allocated */
};

static Instance *instance_new(const char *name, const char *token, Interface interface);
static void instance_free(Instance *);
static void instance_reset(Instance *);

/* Tell the importer, and leave the instance FAILED if the status is an error. Returns the status. */
static Status tell(Instance *, Status, unsigned category, const char *format, ...);
/* Whether a function may be called in this phase and interface; if not, the instance fails. */
static bool allowed(Instance *, const char *function, unsigned phases);
static bool allowed_in(Instance *, const char *function, Interface, unsigned phases);
/* Turn log categories on or off; with no names, all. */
static Status set_categories(Instance *, bool on, size_t n, const char *const names[]);

/* What a value reference stands for, if its type is one of `types`, a bit for each; else NULL, and the instance fails. */
static const Item *find(Instance *, const char *function, uint32_t reference, uint32_t types);
static inline const Variable *variable_of(const Item *item) { return &model.variables[item->variable]; }
/* See that a variable's value is current. */
static Status refresh(Instance *, const Variable *);
/* What has to be computed before a variable can be read now, and computing it, whatever has been set. */
static Need need_of(const Instance *, const Variable *);
static Status provide(Instance *, Need);
/* Whether a variable may be set now; if not, the instance fails. */
static Status settable(Instance *, const char *function, const Variable *);
/* What follows from having set `count` elements of a variable; an error where a parameter is beyond its limits. */
static Status was_set(Instance *, const char *function, const Variable *, uint32_t element, uint32_t count);
/* A number of any type; of 64-bit integers the nearest. */
static double number_at(const Instance *, const Variable *, uint32_t element);
static void put_number(Instance *, const Variable *, uint32_t element, double value); /* of the types FLOAT64 and FLOAT32 */
/* FNV-1a. */
#define HASH_BEGIN 14695981039346656037u
static uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t size);
static uint8_t *address(Instance *, const Variable *, uint32_t element);
static size_t size_of(Type);

static Status enter_initialization(Instance *, double start, bool stop_defined, double stop);
static Status exit_initialization(Instance *, Phase next);
/* DISCARD where a step cannot be done to its end. */
static Status do_step(Instance *, double time, double size);
static Status enter_event_mode(Instance *);
static Status leave_event_mode(Instance *, Phase next);
/* Event indicators: see events.c. changed: whether an event has changed states; ends: whether one ends the run. */
static uint64_t indicator_count(void);
static Status get_indicators(Instance *, double *values);
static Status handle_events(Instance *, bool *changed, bool *ends);
static Status look_ahead(Instance *);
static Status look_at_step_end(Instance *, bool *crossed);
static Status anticipate(Instance *); /* an event as of now, if indicators have crossed since they were looked at last */
static Status worse(Status, Status);
/* Model Exchange: whether discrete outputs have changed since, or an indicator has crossed: an event. */
static Status complete_step(Instance *, bool *event);
/* Model Exchange: the time of the next sample instant; false if there is none. */
static bool next_event(Instance *, double *time);
static void set_time(Instance *, double time);
static void move_time(Instance *, double change); /* and all that is counted from it */
static void set_states(Instance *, const double *values);
static Status get_states(Instance *, double *values);
static Status get_derivatives(Instance *, double *values);
static void get_nominals(double *values);

/* Directional derivatives, see derivatives.c. DISCARD where there are none here. */
typedef struct {
    const uint32_t *references;
    size_t n;
} References;
static Status directional_derivative(Instance *, const char *function, References unknowns, References knowns,
                              const double *seed, size_t n_seed, double *sensitivity, size_t n_sensitivity);

/* FMU states: one block of memory, the same as its serialized form. */
static size_t snapshot_size(void);
static Status snapshot_take(Instance *, void **snapshot);
static Status snapshot_restore(Instance *, const void *snapshot);
static Status snapshot_write(Instance *, const void *snapshot, uint8_t *bytes, size_t size);
static Status snapshot_read(Instance *, const uint8_t *bytes, size_t size, void **snapshot);

#endif
