/* The system of diagrams/formation.yaml as one hand-written loop: what the framework is compared with.

   Six robots, forward Euler, 30 s at 1 ms; the same equations, measures, metrics and recorded signals, operation by
   operation in the same order, so that the figures agree to the last bit where the compiler fuses nothing. What one
   program can share and independent blocks cannot is shared here: the sine of the reference, the sine and cosine of a
   heading, the distances of the pairs, the tracking errors, and every constant.

   Compiled with -DROBOTS=1000, it is 10 s of the fleet of diagrams/fleet_1000.yaml: who is near whom is listed with a
   skin as cosim does, and searched anew only when a robot has moved by half of that.

   Prints one JSON object: the seconds of the loop and the metrics. Equation numbers are the paper's. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#ifdef ROBOTS
enum { N = ROBOTS, STEPS = 10000, RECORD_EVERY = 100, FROM = 5000, TO = 10000 };
#else
enum { N = 6, STEPS = 30000, RECORD_EVERY = 10, FROM = 10000, TO = 20000 };
#endif
enum { DIM = 3, NEURONS = 8, BANDS = 5, CAPACITY = 8 };
enum { RECORDED = 6 * N * DIM + N * CAPACITY + 8 };

#define PI 3.141592653589793

static const double H = 1.0e-3;
#ifdef ROBOTS
static double MASS[N], RADIUS[N], INERTIA[N], CIRCLE;
static int HEARS[N];
static const double WIDTH = 500;
#else
static const double MASS[N] = {4.8, 5.5, 4.5, 5.8, 5.3, 5.0};
static const double RADIUS[N] = {0.24, 0.30, 0.23, 0.31, 0.28, 0.25};
static const double INERTIA[N] = {0.15, 0.25, 0.12, 0.29, 0.21, 0.15};
static const int HEARS[N] = {3, 2, 0, 4, 5, 1}; /* numbers from 0 */
static const double CIRCLE = 1.8, WIDTH = 8;
#endif

static const double SPEED = 0.2, AMPLITUDE = 1.0, FREQUENCY = 0.3;               /* reference (43) */
static const double ETA[4] = {6, 8, 8, 6}, LIPSCHITZ = 0.03;                     /* differentiator (29) */
static const double ALPHA_1 = 8, ALPHA_2 = 8;                                    /* observer (10) */
static const double GAMMA_1[BANDS] = {1, 5, 50, 200, 10000}, GAMMA_2[BANDS] = {0.05, 0.25, 5, 20, 100};
static const double FIRST_CENTRE = -2, SPACING = 1;
static const double R_C = 1.5, ETA_1 = 0.2, ETA_2 = 14, ETA_3 = 1.1;             /* topology (5), (44) */
static const double ALPHA = 2, EPSILON_1 = 1.1, EPSILON_2 = 2;                   /* potential (8), (9) */
static const double C = 2, LAMBDA = 2, B = 2;                                    /* controller (33) */

/* States. */
#ifdef ROBOTS
static double x[N][DIM];
#else
static double x[N][DIM] = {{1.8, 0.1, 0},         {-0.9, 0.6, PI / 3},  {-0.7, 2.3, -PI / 3},
                           {0.8, -0.5, PI / 2}, {-0.1, -1.3, PI / 4}, {1.5, 1.5, -PI / 4}};
#endif
static double v[N][DIM], x_hat[N][DIM], v_hat[N][DIM], W_hat[N][NEURONS][DIM];
static double xi_1[N][DIM], xi_2[N][DIM], xi_3[N][DIM], xi_4[N][DIM];

/* Constants that are computed. */
static double place[N][2], phase[N], gains[4], lower_norm[BANDS], scale, falling;

/* Signals. */
static double x_d[N][DIM], dx_d[N][DIM], w[N][DIM], u[N][DIM], F[N][DIM];
static double across[N][DIM], along[N][DIM], g[N][DIM][DIM], g_inverse[N][DIM][DIM];
static double s_1[N][DIM], s_2[N][DIM], phi[N][NEURONS], w_hat[N][DIM];
static double delta_x[N][DIM], delta_v[N][DIM], e_x[N][DIM], e_v[N][DIM], s_hat[N][DIM];
static double weights[N][CAPACITY];
static int neighbours[N][CAPACITY], count[N];
static double distance[N][CAPACITY]; /* of a neighbour */
static double recorded[STEPS / RECORD_EVERY + 1][RECORDED];

/* Figures. */
static double N_x, N_v, N_w, norm_delta_x, norm_e_x, norm_S, norm_S_hat, min_gap;
static double highest[N], L_2, dL_2, max_L_2, max_dL_2, least_coverage = INFINITY;
static double max_N_x, max_N_v, max_N_w, max_delta_x, max_e_x, max_S, smallest_gap = INFINITY;
static bool collided[N][N];
static double unsafe[N]; /* first time; NaN: never */

/* The cube root: see blocks/cube_root.py. Faster than libm's, and the same bits as the block's. */
static const double LOWEST = 1e-280, HIGHEST = 1e280;

static inline double cube_root_within(double a) {
    int64_t bits;
    double inverse;
    memcpy(&bits, &a, 8);
    bits = 0x553EEC6D51E95C00 - (bits >> 32) * 0x55555556;
    memcpy(&inverse, &bits, 8);
    double e = 1.0 - a * inverse * inverse * inverse;
    inverse *= 1.0 + e * (1.0 / 3.0 + e * (2.0 / 9.0 + e * (14.0 / 81.0)));
    double root = a * inverse * inverse;
    double shifted = root * (0x1p36 + 1.0);
    root = shifted - (shifted - root);
    double cube = root * root * root;
    double r = (a - cube) / cube;
    double series = r * (1.0 / 3.0 - r * (1.0 / 9.0 - r * (5.0 / 81.0 - r * (10.0 / 243.0))));
    return root + root * series;
}

static double cube_root(double a) {
    if (LOWEST < a && a < HIGHEST) return cube_root_within(a);
    if (!(0.0 < a && a < INFINITY)) return a;
    return a < 1.0 ? 0x1p-100 * cube_root_within(0x1p300 * a) : 0x1p100 * cube_root_within(0x1p-300 * a);
}

static inline void cube_roots(const double *e, double *roots) {
    bool ordinary = true;
    for (int q = 0; q < DIM; q++) ordinary &= LOWEST < fabs(e[q]) && fabs(e[q]) < HIGHEST;
    if (ordinary)
        for (int q = 0; q < DIM; q++) roots[q] = cube_root_within(fabs(e[q]));
    else
        for (int q = 0; q < DIM; q++) roots[q] = cube_root(fabs(e[q]));
}

#ifdef ROBOTS
static void lay_out(void) { /* as the fleet's diagram has it, with numbers from 1 */
    CIRCLE = 1.8 * N / (2 * PI);
    for (int i = 0; i < N; i++) {
        int number = i + 1;
        double turn = cos(PI * number), angle = 2 * PI * (number + turn) / N;
        MASS[i] = 4.5 + number % 14 / 10.0;
        RADIUS[i] = 0.23 + number % 9 / 100.0;
        INERTIA[i] = 0.12 + number % 18 / 100.0;
        HEARS[i] = number % N;
        x[i][0] = (CIRCLE + 0.2 * turn) * cos(angle);
        x[i][1] = (CIRCLE + 0.2 * turn) * sin(angle);
        x[i][2] = PI * sin(3.0 * number);
    }
}
#else
static void lay_out(void) {}
#endif

static void initialize(void) {
    lay_out();
    double root = sqrt(LIPSCHITZ);
    gains[0] = ETA[0] * sqrt(root);
    double two_thirds = cube_root(gains[0]);
    gains[1] = ETA[1] * cube_root(LIPSCHITZ) * (two_thirds * two_thirds);
    gains[2] = ETA[2] * root * sqrt(gains[1]);
    gains[3] = ETA[3] * LIPSCHITZ;
    for (int k = 0; k < BANDS - 1; k++) lower_norm[k] = pow(10.0, -k);
    scale = 2 * DIM * SPACING / (WIDTH * WIDTH);
    falling = exp(-2.0 * scale * SPACING);
    for (int i = 0; i < N; i++) {
        double angle = 2 * PI * (i + 1) / N;
        place[i][0] = CIRCLE * cos(angle);
        place[i][1] = CIRCLE * sin(angle);
        phase[i] = (i + 1) * PI / 5.0;
        for (int q = 0; q < DIM; q++) x_hat[i][q] = x[i][q];
        xi_1[i][0] = place[i][0];
        xi_1[i][1] = place[i][1];
        unsafe[i] = NAN;
    }
}

static void reference(double time) { /* (43) */
    double sine = sin(FREQUENCY * time), cosine = cos(FREQUENCY * time);
    for (int i = 0; i < N; i++) {
        x_d[i][0] = place[i][0] + SPEED * time;
        x_d[i][1] = place[i][1] + AMPLITUDE * sine;
        dx_d[i][0] = SPEED;
        dx_d[i][1] = AMPLITUDE * FREQUENCY * cosine;
    }
}

static void plant(double time) { /* (42): control gain, its inverse, uncertainty */
    static const double HALF_ROOT_3 = 0.5 * 1.7320508075688772;
    for (int i = 0; i < N; i++) {
        double s = sin(x[i][2]), c = cos(x[i][2]);
        across[i][0] = -s;
        across[i][1] = 0.5 * s - HALF_ROOT_3 * c;
        across[i][2] = 0.5 * s + HALF_ROOT_3 * c;
        along[i][0] = c;
        along[i][1] = -0.5 * c - HALF_ROOT_3 * s;
        along[i][2] = HALF_ROOT_3 * s - 0.5 * c;
        for (int k = 0; k < 3; k++) {
            g[i][0][k] = across[i][k] / MASS[i];
            g[i][1][k] = along[i][k] / MASS[i];
            g[i][2][k] = RADIUS[i] / INERTIA[i];
            g_inverse[i][k][0] = 2.0 / 3.0 * MASS[i] * across[i][k];
            g_inverse[i][k][1] = 2.0 / 3.0 * MASS[i] * along[i][k];
            g_inverse[i][k][2] = INERTIA[i] / (3.0 * RADIUS[i]);
        }
        w[i][0] = 0.5 * sin(x[i][0]) + tanh(x[i][0]) + 0.6 * sin(0.6 * time + phase[i]);
        w[i][1] = 0.3 * sin(x[i][1]) - 1.4 * exp(-fabs(x[i][1]) - 1.0) + 0.8 * sin(0.4 * time + phase[i]);
        w[i][2] = 0.2 * c + sin(0.5 * time + phase[i]);
    }
}

static double fading_weight(double d) { /* (44) */
    double z = ETA_2 * (d - ETA_3);
    if (z < 0.0) return ETA_1 / (1.0 + exp(z));
    double near = exp(-z);
    return ETA_1 * near / (1.0 + near);
}

static inline double apart(int i, int j) {
    double dx = x[i][0] - x[j][0], dy = x[i][1] - x[j][1];
    return sqrt(dx * dx + dy * dy);
}

static inline void look_at_gap(int i, int j, double d) {
    double gap = d - RADIUS[i] - RADIUS[j];
    min_gap = gap < min_gap ? gap : min_gap;
    if (gap <= 0.0) collided[i][j] = true;
}

static inline void add_neighbour(int i, int j, double d, double fading) {
    if (HEARS[i] != j && d > R_C) return;
    int n = count[i]++;
    neighbours[i][n] = j;
    distance[i][n] = d;
    weights[i][n] = HEARS[i] == j ? 1.0 : fading;
}

static inline void look_at_pair(int i, int j) {
    double d = apart(i, j), fading = d <= R_C ? fading_weight(d) : 0.0;
    look_at_gap(i, j, d);
    add_neighbour(i, j, d, fading);
    add_neighbour(j, i, d, fading);
}

#ifdef ROBOTS
/* Pairs i < j that are nearer than the range and the skin, or of which one hears the other, ordered by i, then j. */
enum { LISTED = 16, SIDE = 1024, CELLS = SIDE * SIDE };
static const double SKIN = 0.3;
static double searched[N][2];
static int listed[N][LISTED], listed_count[N], head[CELLS], following[N], cell_of[N];
static bool has_list;

static inline int cell(int i, int dx, int dy) {
    double size = R_C + SKIN;
    int a = (int)floor(x[i][0] / size) + dx, b = (int)floor(x[i][1] / size) + dy;
    return (a & (SIDE - 1)) * SIDE + (b & (SIDE - 1));
}

static void list(int i, int j) {
    int n = listed_count[i]++;
    while (n > 0 && listed[i][n - 1] > j) listed[i][n] = listed[i][n - 1], n--;
    listed[i][n] = j;
}

static void search(void) {
    for (int i = 0; i < N; i++) {
        if (has_list) head[cell_of[i]] = 0;
        listed_count[i] = 0;
    }
    for (int i = 0; i < N; i++) {
        searched[i][0] = x[i][0];
        searched[i][1] = x[i][1];
        cell_of[i] = cell(i, 0, 0);
        following[i] = head[cell_of[i]];
        head[cell_of[i]] = i + 1;
    }
    for (int i = 0; i < N; i++) {
        for (int dx = -1; dx <= 1; dx++)
            for (int dy = -1; dy <= 1; dy++)
                for (int j = head[cell(i, dx, dy)] - 1; j >= 0; j = following[j] - 1)
                    if (i < j && apart(i, j) <= R_C + SKIN && HEARS[i] != j && HEARS[j] != i) list(i, j);
        int h = HEARS[i];
        if (HEARS[h] != i || i < h) list(i < h ? i : h, i < h ? h : i);
    }
    has_list = true;
}

static bool is_current(void) {
    const double most = 0.25 * SKIN * SKIN;
    for (int i = 0; i < N; i++) {
        double dx = x[i][0] - searched[i][0], dy = x[i][1] - searched[i][1];
        if (!(dx * dx + dy * dy < most)) return false;
    }
    return has_list;
}

static void pairs(void) {
    if (!is_current()) search();
    for (int i = 0; i < N; i++)
        for (int k = 0; k < listed_count[i]; k++) look_at_pair(i, listed[i][k]);
}
#else
static void pairs(void) {
    for (int i = 0; i < N; i++)
        for (int j = i + 1; j < N; j++) look_at_pair(i, j);
}
#endif

static void topology(void) { /* (5), and the smallest gap of all pairs */
    min_gap = INFINITY;
    for (int i = 0; i < N; i++) count[i] = 0;
    pairs();
    for (int i = 0; i < N; i++)
        for (int n = count[i]; n < CAPACITY; n++) weights[i][n] = 0.0;
}

static void potential_field(double time) { /* (9) */
    for (int i = 0; i < N; i++) {
        F[i][0] = F[i][1] = 0.0;
        for (int k = 0; k < count[i]; k++) {
            int j = neighbours[i][k];
            double both = RADIUS[i] + RADIUS[j], d = distance[i][k];
            double lower = EPSILON_1 * both, outer = EPSILON_2 * both;
            if (d <= lower) {
                if (isnan(unsafe[i])) unsafe[i] = time;
            } else if (d <= outer) {
                double clearance = d - lower, force = ALPHA * (outer - d) / (clearance * clearance);
                F[i][0] += force * (x[i][0] - x[j][0]) / d;
                F[i][1] += force * (x[i][1] - x[j][1]) / d;
            }
        }
    }
}

#ifdef EACH_NEURON /* one exponential each, as the block has them: the same bits, but twice as slow without vectors */
static double activations(const double *x, const double *v, double *phi) {
    double largest = 0.0;
    for (int j = 0; j < NEURONS; j++) {
        double square = 0.0, centre = FIRST_CENTRE + j * SPACING;
        for (int q = 0; q < DIM; q++)
            square += (x[q] - centre) * (x[q] - centre) + (v[q] - centre) * (v[q] - centre);
        phi[j] = exp(square * (-1.0 / (WIDTH * WIDTH)));
        if (phi[j] > largest) largest = phi[j];
    }
    return largest;
}
#else
static double activation(const double *x, const double *v, double centre) { /* (7) */
    double square = 0.0;
    for (int q = 0; q < DIM; q++)
        square += (x[q] - centre) * (x[q] - centre) + (v[q] - centre) * (v[q] - centre);
    return exp(-square / (WIDTH * WIDTH));
}

/* The quotient of two neighbours' activations is itself a geometric sequence, so that three exponentials do for all;
   going outwards from the centre nearest to y, all quotients are below 1. Returns the largest activation. */
static double activations(const double *x, const double *v, double *phi) {
    double middle = 0.0;
    for (int q = 0; q < DIM; q++) middle += x[q] + v[q];
    middle *= 0.5 / DIM;
    double steps = (middle - FIRST_CENTRE) / SPACING;
    int nearest = !(steps > 0.0) ? 0 : steps >= NEURONS - 1 ? NEURONS - 1 : (int)(steps + 0.5);
    double centre = FIRST_CENTRE + nearest * SPACING;
    phi[nearest] = activation(x, v, centre);
    double shift = 2.0 * (middle - centre);
    if (nearest < NEURONS - 1) {
        double quotient = exp(scale * (shift - SPACING));
        for (int j = nearest + 1; j < NEURONS; j++, quotient *= falling) phi[j] = phi[j - 1] * quotient;
    }
    if (nearest > 0) {
        double quotient = exp(scale * (-shift - SPACING));
        for (int j = nearest - 1; j >= 0; j--, quotient *= falling) phi[j] = phi[j + 1] * quotient;
    }
    return phi[nearest];
}
#endif

static void observer(void) { /* outputs of (10) */
    for (int i = 0; i < N; i++) {
        double e[DIM], r[DIM];
        for (int q = 0; q < DIM; q++) e[q] = x[i][q] - x_hat[i][q];
        cube_roots(e, r);
        for (int q = 0; q < DIM; q++) {
            s_1[i][q] = copysign(r[q] * r[q], e[q]);
            s_2[i][q] = copysign(r[q], e[q]);
        }
        highest[i] = activations(x[i], v_hat[i], phi[i]);
        for (int q = 0; q < DIM; q++) w_hat[i][q] = 0.0;
        for (int j = 0; j < NEURONS; j++)
            for (int q = 0; q < DIM; q++) w_hat[i][q] += W_hat[i][j][q] * phi[i][j];
    }
}

static void local_error(double delta[N][DIM], double e[N][DIM]) { /* (26) */
    for (int i = 0; i < N; i++) {
        for (int q = 0; q < DIM; q++) e[i][q] = B * delta[i][q];
        for (int k = 0; k < count[i]; k++) {
            int j = neighbours[i][k];
            for (int q = 0; q < DIM; q++) e[i][q] += weights[i][k] * (delta[i][q] - delta[j][q]);
        }
    }
}

static void controller(void) { /* (26), (30), (33) */
    for (int i = 0; i < N; i++) {
        for (int q = 0; q < DIM; q++) {
            delta_x[i][q] = x[i][q] - x_d[i][q];
            delta_v[i][q] = v_hat[i][q] - xi_2[i][q];
        }
    }
    local_error(delta_x, e_x);
    local_error(delta_v, e_v);
    for (int i = 0; i < N; i++) {
        double a[DIM];
        for (int q = 0; q < DIM; q++) {
            s_hat[i][q] = e_v[i][q] + LAMBDA * e_x[i][q];
            double known = xi_3[i][q] - w_hat[i][q] - LAMBDA * delta_v[i][q] - delta_x[i][q];
            a[q] = known - C * s_hat[i][q] + F[i][q];
        }
        for (int k = 0; k < DIM; k++) {
            u[i][k] = 0.0;
            for (int q = 0; q < DIM; q++) u[i][k] += g_inverse[i][k][q] * a[q];
        }
    }
}

static double norm(double values[N][DIM]) {
    double square = 0.0;
    for (int i = 0; i < N; i++) {
        double row = 0.0;
        for (int q = 0; q < DIM; q++) row += values[i][q] * values[i][q];
        square += row;
    }
    return sqrt(square);
}

static double sum_of_norms(double estimate[N][DIM], double truth[N][DIM]) {
    double total = 0.0;
    for (int i = 0; i < N; i++) {
        double square = 0.0;
        for (int q = 0; q < DIM; q++)
            square += (estimate[i][q] - truth[i][q]) * (estimate[i][q] - truth[i][q]);
        total += sqrt(square);
    }
    return total;
}

static inline double larger(double a, double b) { return a > b ? a : b; }

static void topology_rate(void) { /* norms of L_2 and of its derivative */
    double square = 0.0, square_of_rate = 0.0;
    for (int i = 0; i < N; i++) {
        double degree = 0.0, rate_of_degree = 0.0;
        for (int k = 0; k < count[i]; k++) {
            int j = neighbours[i][k];
            double a = weights[i][k];
            if (a == 1.0) continue;
            double across = (x[i][0] - x[j][0]) * (v[i][0] - v[j][0]) + (x[i][1] - x[j][1]) * (v[i][1] - v[j][1]);
            double d = distance[i][k], rate = d > 0.0 ? -ETA_2 * a * (1.0 - a / ETA_1) * across / d : 0.0;
            degree += a;
            rate_of_degree += rate;
            square += a * a;
            square_of_rate += rate * rate;
        }
        square += degree * degree;
        square_of_rate += rate_of_degree * rate_of_degree;
    }
    L_2 = sqrt(square);
    dL_2 = sqrt(square_of_rate);
}

static void measure(int k) {
    static double error_v[N][DIM], S[N][DIM];
    N_x = sum_of_norms(x_hat, x);
    N_v = sum_of_norms(v_hat, v);
    N_w = sum_of_norms(w_hat, w);
    for (int i = 0; i < N; i++)
        for (int q = 0; q < DIM; q++) error_v[i][q] = v[i][q] - dx_d[i][q];
    local_error(error_v, S);
    for (int i = 0; i < N; i++)
        for (int q = 0; q < DIM; q++) S[i][q] += LAMBDA * e_x[i][q];
    norm_delta_x = norm(delta_x);
    norm_e_x = norm(e_x);
    norm_S = norm(S);
    norm_S_hat = norm(s_hat);
    smallest_gap = min_gap < smallest_gap ? min_gap : smallest_gap;
    topology_rate();
    max_L_2 = larger(max_L_2, L_2);
    max_dL_2 = larger(max_dL_2, dL_2);
    for (int i = 0; i < N; i++) least_coverage = highest[i] < least_coverage ? highest[i] : least_coverage;
    if (k >= FROM) {
        max_delta_x = larger(max_delta_x, norm_delta_x);
        max_e_x = larger(max_e_x, norm_e_x);
        max_S = larger(max_S, norm_S);
        if (k <= TO) {
            max_N_x = larger(max_N_x, N_x);
            max_N_v = larger(max_N_v, N_v);
            max_N_w = larger(max_N_w, N_w);
        }
    }
}

static void record(double *row) {
    const double figures[8] = {N_x, N_v, N_w, norm_delta_x, norm_e_x, norm_S, norm_S_hat, min_gap};
    const void *signals[6] = {x, x_d, v_hat, w_hat, w, u};
    for (int k = 0; k < 6; k++, row += N * DIM) memcpy(row, signals[k], sizeof x);
    memcpy(row, weights, sizeof weights);
    memcpy(row + N * CAPACITY, figures, sizeof figures);
}

static void step_differentiator(void) { /* (29) */
    for (int i = 0; i < N; i++) {
        for (int q = 0; q < DIM; q++) {
            double e = xi_1[i][q] - x_d[i][q];
            double half = sqrt(fabs(e)), quarter = sqrt(half), sign = e > 0.0 ? 1.0 : e < 0.0 ? -1.0 : 0.0;
            xi_1[i][q] += H * (xi_2[i][q] - gains[0] * sign * half * quarter);
            xi_2[i][q] += H * (xi_3[i][q] - gains[1] * sign * half);
            xi_3[i][q] += H * (xi_4[i][q] - gains[2] * sign * quarter);
            xi_4[i][q] += H * (-gains[3] * sign);
        }
    }
}

static void step_observer(void) { /* (10), (13), (22) */
    for (int i = 0; i < N; i++) {
        double square = 0.0;
        for (int q = 0; q < DIM; q++) {
            double gu = 0.0;
            for (int k = 0; k < DIM; k++) gu += g[i][q][k] * u[i][k];
            double d_x_hat = v_hat[i][q] + ALPHA_1 * s_1[i][q];
            double d_v_hat = w_hat[i][q] + ALPHA_2 * s_2[i][q] + gu;
            x_hat[i][q] += H * d_x_hat;
            v_hat[i][q] += H * d_v_hat;
            square += s_1[i][q] * s_1[i][q];
        }
        double size = sqrt(square);
        int band = 0;
        while (size < lower_norm[band]) band++;
        double forgetting = GAMMA_2[band] * size;
        for (int j = 0; j < NEURONS; j++) {
            double learning = GAMMA_1[band] * phi[i][j];
            for (int q = 0; q < DIM; q++)
                W_hat[i][j][q] += H * (learning * s_1[i][q] - forgetting * W_hat[i][j][q]);
        }
    }
}

static void step_plant(void) { /* (42) */
    for (int i = 0; i < N; i++) {
        const double *a = across[i], *b = along[i], *f = u[i];
        double d_v[DIM] = {(a[0] * f[0] + a[1] * f[1] + a[2] * f[2]) / MASS[i] + w[i][0],
                           (b[0] * f[0] + b[1] * f[1] + b[2] * f[2]) / MASS[i] + w[i][1],
                           RADIUS[i] * (f[0] + f[1] + f[2]) / INERTIA[i] + w[i][2]};
        for (int q = 0; q < DIM; q++) {
            x[i][q] += H * v[i][q];
            v[i][q] += H * d_v[q];
        }
    }
}

static void evaluate(int k) {
    double time = k * H;
    reference(time);
    plant(time);
    topology();
    potential_field(time);
    observer();
    controller();
    measure(k);
    if (k % RECORD_EVERY == 0) record(recorded[k / RECORD_EVERY]);
}

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

int main(void) {
    double began = seconds();
    initialize();
    for (int k = 0; k < STEPS; k++) {
        evaluate(k);
        step_differentiator();
        step_observer();
        step_plant();
    }
    evaluate(STEPS);
    double spent = seconds() - began;
    int collisions = 0;
    for (int i = 0; i < N; i++)
        for (int j = i + 1; j < N; j++) collisions += collided[i][j];
    printf("{\"seconds\": %.9g, \"N_x\": %.17g, \"N_v\": %.17g, \"N_w\": %.17g, \"delta_x\": %.17g, \"e_x\": %.17g, "
           "\"S\": %.17g, \"min_gap\": %.17g, \"collisions\": %d, \"L_2\": %.17g, \"dL_2\": %.17g, \"coverage\": %.17g}\n",
           spent, max_N_x, max_N_v, max_N_w, max_delta_x, max_e_x, max_S, smallest_gap, collisions, max_L_2, max_dL_2,
           least_coverage);
    return 0;
}
