/* What a generated model.c says of one exported model: the program of `cosim.engine.program` as constants.
 *
 * All offsets are bytes from the begin of the arena, so that every instance is a copy of the arena's image. */
#ifndef COSIM_MODEL_H
#define COSIM_MODEL_H

#include <stdint.h>

/* Kernels are object code, or C in the same file. */
#ifndef KERNEL
#define KERNEL extern
#endif

/* The C ABI of kernels and of the loop, see `cosim.compiling.kernels`; the result is an FMI status. */
typedef int32_t (*Kernel)(double time, uint8_t *base, int64_t *frame);

/* What a kernel that fails leaves at the begin of its frame, see `cosim.compiling.checks`. text: a format for both numbers. */
typedef struct {
    const char *text;
    int64_t first, second, instance;
    double time;
} Fault;

typedef enum { FLOAT64, FLOAT32, INT8, UINT8, INT16, UINT16, INT32, UINT32, INT64, UINT64, BOOLEAN } Type;

/* What must have been computed before a variable can be read. */
typedef enum { NOTHING, CALCULATED, EVALUATED, DIFFERENTIATED, INDICATED } Need;

/* A variable: `count` elements side by side. settable: the phases in which it may be set (see instance.h). */
typedef struct {
    const char *name;
    uint64_t offset;
    uint32_t count;
    uint8_t type;
    uint8_t need;
    uint8_t settable;
    uint8_t kind; /* a Kind */
    const double *nominal, *min, *max; /* of every element, or NULL */
} Variable;

/* DISCRETE_OUTPUT: one that is no real, and changes whenever what it is computed from does. */
typedef enum { TIME, PARAMETER, CONTINUOUS_STATE, DISCRETE_OUTPUT, OTHER } Kind;

/* What a value reference stands for: elements of a variable. Value references count the items from 1. */
typedef struct {
    uint32_t variable, first, count;
} Item;

/* Rows begin … end-1 of the program. */
typedef struct {
    int64_t begin, end;
} Range;

/* A state that a `start` function computes, right after `row`, unless its own value was set: `shadow` holds
 * set values, and the bytes behind them whether each byte was set. */
typedef struct {
    int64_t row;
    uint64_t offset, bytes, shadow;
} Started;

/* An algebraic loop that the row solves: its blocks, and what it is solved for. */
typedef struct {
    int64_t row;
    const char *blocks, *torn;
} Unsolved;

/* What algebraic loops are solved for, and where it is kept as it was before it was evaluated at this point. */
typedef struct {
    uint64_t offset, bytes, kept;
} Guess;

/* Words of the arena that are not zero at first. */
typedef struct {
    uint64_t offset;
    uint32_t first, words; /* in `Model.words` */
} Segment;

typedef struct {
    const char *token; /* FMI 2 guid, FMI 3 instantiationToken */
    double step;       /* the communication step of the diagram (s), the longest inner step */
    double tick;       /* what the step and all periods are multiples of (s) */
    int64_t grid;      /* the communication step, in ticks */

    uint64_t arena_bytes;
    const Segment *segments;
    uint32_t n_segments;
    const uint64_t *words;

    const int64_t *rows, *banks;
    const Range *phases; /* as layout.h counts them */
    const Kernel *functions;
    const char *const *labels; /* of each function: the block and the function's name */
    const char *const *blocks; /* of each function: the block */

    const Unsolved *loops;
    uint32_t n_loops;
    const Guess *guesses;
    uint32_t n_guesses;

    const int64_t *control; /* the words of a control block that are no addresses */
    uint64_t n_states;
    uint64_t x, d; /* the vectors of states and derivatives, see loop.py */

    const Started *started;
    uint32_t n_started;
    uint64_t clocks; /* of sampled blocks, in the arena, as layout.h has them */
    uint32_t n_clocks;

    const Variable *variables;
    uint32_t n_variables;
    const Item *items;
    uint32_t n_items;
} Model;

static const Model model;

KERNEL int32_t engine_run(double step, uint8_t *base, int64_t *control);
KERNEL int32_t engine_execute(double time, uint8_t *base, int64_t *control);
KERNEL int32_t engine_begin(double time, uint8_t *base, int64_t *control);

#endif
