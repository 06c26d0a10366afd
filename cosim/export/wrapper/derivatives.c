/* Directional derivatives: how the unknowns change as the knowns move along a seed, by differences of fourth order.
 *
 *     h     a power of two, such that the known that moves most for its size, the larger of its value and its nominal
 *           value, moves by about 2^-13 of that
 *     f'    (8 (f(h) - f(-h)) - (f(2 h) - f(-2 h))) / 12 h, or the same to one side where f ends, as sqrt(x) does at 0
 *
 * With f and its derivatives of the order of 1 over these sizes, the error is some 2 eps / 2^-13 = 3e-12 of f, and
 * h^4 / 30 of the fifth derivative. Where numbers of single precision take part, 2^-5 and 1e-5; where algebraic loops do,
 * their tolerance instead of eps, 1e-9. A kink or jump within 2 h gives the slope across it. The instance is afterwards
 * what it was, to the last bit. */
#include "instance.h"

#include <math.h>
#include <stdlib.h>

enum { MOST_POINTS = 5, DOUBLE_EXPONENT = -13, SINGLE_EXPONENT = -5 };

/* Where f is evaluated, in units of h, and how much each counts, in units of 1 / 12 h. */
typedef struct {
    int points, shifts[MOST_POINTS], weights[MOST_POINTS];
} Stencil;
static const Stencil stencils[] = {
    {4, {-2, -1, 1, 2}, {1, -8, 8, -1}},
    {5, {0, 1, 2, 3, 4}, {-25, 48, -36, 16, -3}},
    {5, {0, -1, -2, -3, -4}, {25, -48, 36, -16, 3}},
};

static bool is_known(const Instance *i, const Variable *v) {
    if (v->kind == TIME) return true;
    if (i->at.phase == INITIALIZATION) return v->settable & INITIALIZATION;
    return v->kind == CONTINUOUS_STATE || v->kind == PARAMETER || v->settable & STEP;
}

/* How many numbers some value references stand for; -1, and the instance fails, if one is wrong. */
static long count(Instance *i, const char *function, const References *list, bool known) {
    long n = 0;
    for (size_t k = 0; k < list->n; k++) {
        const Item *item = find(i, function, list->references[k], 1u << FLOAT64 | 1u << FLOAT32);
        if (!item) return -1;
        const Variable *v = variable_of(item);
        if (known ? !is_known(i, v) : v->kind == TIME) {
            tell(i, ERROR, LOG_ERROR, "%s: `%s` is no %s now", function, v->name, known ? "known" : "unknown");
            return -1;
        }
        n += item->count;
    }
    return n;
}

static const Item *item_of(const References *list, size_t k) {
    return &model.items[list->references[k] - 1];
}

/* The step along the seed; 0 where nothing moves. */
static double step_along(Instance *i, const References *knowns, const double *seed, int exponent) {
    double most = INFINITY;
    size_t s = 0;
    for (size_t k = 0; k < knowns->n; k++) {
        const Item *item = item_of(knowns, k);
        const Variable *v = variable_of(item);
        for (uint32_t e = item->first; e < item->first + item->count; e++, s++) {
            if (seed[s] == 0) continue;
            const double nominal = v->nominal ? v->nominal[e] : 1;
            const double size = v->kind == TIME ? fmax(fabs(i->at.time), model.step) : fmax(fabs(number_at(i, v, e)), nominal);
            most = fmin(most, size / fabs(seed[s]));
        }
    }
    return isinf(most) ? 0 : ldexp(1, ilogb(most) + exponent);
}

static void move(Instance *i, const References *knowns, const double *seed, double step) {
    size_t s = 0;
    for (size_t k = 0; k < knowns->n; k++) {
        const Item *item = item_of(knowns, k);
        const Variable *v = variable_of(item);
        for (uint32_t e = item->first; e < item->first + item->count; e++, s++) {
            if (v->kind == TIME) {
                move_time(i, step * seed[s]);
            } else if (seed[s] != 0) {
                put_number(i, v, e, number_at(i, v, e) + step * seed[s]);
                was_set(i, "", v, e, 1);
            }
        }
    }
}

static bool evaluate_at(Instance *i, const References *unknowns, double *values) {
    Need need = NOTHING;
    for (size_t k = 0; k < unknowns->n; k++) {
        const Need own = need_of(i, variable_of(item_of(unknowns, k)));
        if (own > need) need = own;
    }
    if (i->at.phase == FAILED || provide(i, need) >= ERROR) return false;
    size_t s = 0;
    for (size_t k = 0; k < unknowns->n; k++) {
        const Item *item = item_of(unknowns, k);
        for (uint32_t e = item->first; e < item->first + item->count; e++) {
            values[s] = number_at(i, variable_of(item), e);
            if (!isfinite(values[s++])) return false;
        }
    }
    return true;
}

/* sensitivity by one stencil; first, values: work space. Returns whether f could be evaluated everywhere. */
static bool differ(Instance *i, const Stencil *stencil, const void *origin, const References *unknowns,
                   const References *knowns, const double *seed, double h, double *sensitivity, size_t n, double *first) {
    double *values = first + n;
    for (size_t u = 0; u < n; u++) sensitivity[u] = 0;
    for (int p = 0; p < stencil->points; p++) {
        snapshot_restore(i, origin);
        move(i, knowns, seed, stencil->shifts[p] * h);
        if (!evaluate_at(i, unknowns, p ? values : first)) return false;
        for (size_t u = 0; p && u < n; u++) sensitivity[u] += stencil->weights[p] * (values[u] - first[u]);
    }
    for (size_t u = 0; u < n; u++) sensitivity[u] /= 12 * h;
    return true;
}

static bool has_single(const References *list) {
    for (size_t k = 0; k < list->n; k++)
        if (variable_of(item_of(list, k))->type == FLOAT32) return true;
    return false;
}

Status directional_derivative(Instance *i, const char *function, References unknowns, References knowns,
                              const double *seed, size_t n_seed, double *sensitivity, size_t n_sensitivity) {
    const long n = count(i, function, &unknowns, false), m = n < 0 ? -1 : count(i, function, &knowns, true);
    if (n < 0 || m < 0) return ERROR;
    if ((size_t)n != n_sensitivity || (size_t)m != n_seed)
        return tell(i, ERROR, LOG_ERROR, "%s: there are %ld unknowns and %ld knowns", function, n, m);
    for (size_t s = 0; s < n_seed; s++)
        if (!isfinite(seed[s])) return tell(i, ERROR, LOG_ERROR, "%s: a seed is not finite", function);
    const double h = step_along(i, &knowns, seed, has_single(&knowns) || has_single(&unknowns) ? SINGLE_EXPONENT : DOUBLE_EXPONENT);
    for (size_t u = 0; u < n_sensitivity; u++) sensitivity[u] = 0;
    if (h == 0 || n == 0) return OK;
    void *origin = NULL;
    double *work = malloc(2 * n_sensitivity * sizeof *work);
    if (!work || snapshot_take(i, &origin) != OK) {
        free(work);
        return tell(i, ERROR, LOG_ERROR, "%s: out of memory", function);
    }
    const Instance before = *i;
    i->log = NULL; /* what fails beside the point is nobody's concern */
    bool done = false;
    for (size_t k = 0; k < sizeof stencils / sizeof *stencils && !done; k++)
        done = differ(i, &stencils[k], origin, &unknowns, &knowns, seed, h, sensitivity, n_sensitivity, work);
    snapshot_restore(i, origin);
    *i = before;
    free(origin);
    free(work);
    return done ? OK : tell(i, DISCARD, LOG_WARNING, "%s: what is asked for cannot be computed on either side", function);
}
