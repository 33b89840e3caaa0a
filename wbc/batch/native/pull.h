/* Backward passes of many ticks: the equations of each QP's active set, and the gradient that was generated.
 *
 * Before it stand sizes and places as macros, and `pulled`: (what the tick was given, what is held fixed) -> gradient.
 *
 * Generated code is compiled at -O1, at which gcc leaves vector registers in a state that slows what it calls tenfold.
 */
#pragma GCC optimize("O3")

/* LU factors of a (n x n, by rows) with the largest pivot of each column; 0: a column has none. */
static int factor(int n, double *a, int *pivots) {
    for (int c = 0; c < n; c++) {
        int best = c;
        for (int r = c + 1; r < n; r++)
            if (fabs(a[r * n + c]) > fabs(a[best * n + c])) best = r;
        pivots[c] = best;
        if (!(fabs(a[best * n + c]) > 0.0)) return 0;
        for (int j = 0; best != c && j < n; j++) {
            double kept = a[c * n + j];
            a[c * n + j] = a[best * n + j];
            a[best * n + j] = kept;
        }
        const double scale = 1.0 / a[c * n + c];
        for (int r = c + 1; r < n; r++) {
            const double share = a[r * n + c] *= scale;
            if (share != 0.0)
                for (int j = c + 1; j < n; j++) a[r * n + j] -= share * a[c * n + j];
        }
    }
    return 1;
}

/* x <- a^-1 x from these factors. */
static void solve(int n, const double *a, const int *pivots, double *x) {
    for (int c = 0; c < n; c++) {
        const double kept = x[pivots[c]];
        x[pivots[c]] = x[c];
        x[c] = kept;
    }
    for (int r = 1; r < n; r++)
        for (int j = 0; j < r; j++) x[r] -= a[r * n + j] * x[j];
    for (int r = n - 1; r >= 0; r--) {
        for (int j = r + 1; j < n; j++) x[r] -= a[r * n + j] * x[j];
        x[r] /= a[r * n + r];
    }
}

/* H's upper triangle is written. */
static double hessian(const double *H, int i, int j) { return i <= j ? H[i * H_WIDTH + j] : H[j * H_WIDTH + i]; }

/* y, and mu of bounds and rows, of H y + C' mu = w, C y = 0 for the rows C that hold; 0: they are not solvable.
 * Variables at a bound leave the problem. Rows that depend on each other leave the system regular by REGULAR times
 * H's largest entry, and a correction takes that error away. */
static int held_fixed(const double *qp, const double *force, const double *w, double *y, double *mu) {
    enum { SIZE = N + M };
    const double *H = qp + H_AT, *A = qp + A_AT, *low = qp + LOW_AT, *high = qp + HIGH_AT;
    double system[SIZE * SIZE], x[SIZE], rest[SIZE], largest = 0.0;
    int free[SIZE], pivots[SIZE], n = 0, m = 0;
    for (int i = 0; i < SIZE; i++) {
        const int holds = force[i] != 0.0 || low[i] == high[i];
        if (holds == (i >= N)) free[n + m] = i, n += i < N, m += i >= N;
    }
    for (int i = 0; i < N; i++)
        for (int j = i; j < N; j++) largest = fmax(largest, H[i * H_WIDTH + j]);
    const int size = n + m;
    for (int i = 0; i < size; i++)
        for (int j = 0; j < size; j++) {
            double value = i == j ? -REGULAR / largest : 0.0;
            if (i < n && j < n) value = hessian(H, free[i], free[j]);
            else if (i < n) value = A[(free[j] - N) * N + free[i]];
            else if (j < n) value = A[(free[i] - N) * N + free[j]];
            system[i * size + j] = value;
        }
    for (int i = 0; i < size; i++) x[i] = i < n ? w[free[i]] : 0.0;
    if (!factor(size, system, pivots)) return 0;
    solve(size, system, pivots, x);
    if (m) {
        for (int i = 0; i < size; i++) {
            rest[i] = i < n ? w[free[i]] : 0.0;
            for (int j = 0; j < size; j++) {
                if (i < n) rest[i] -= x[j] * (j < n ? hessian(H, free[i], free[j]) : A[(free[j] - N) * N + free[i]]);
                else if (j < n) rest[i] -= x[j] * A[(free[i] - N) * N + free[j]];
            }
        }
        solve(size, system, pivots, rest);
        for (int i = 0; i < size; i++) x[i] += rest[i];
    }
    memset(y, 0, N * sizeof *y);
    memset(mu, 0, SIZE * sizeof *mu);
    for (int i = 0; i < size; i++) *(i < n ? y + free[i] : mu + free[i]) = x[i];
    for (int i = 0; i < N; i++) {
        if (force[i] == 0.0 && low[i] != high[i]) continue;
        mu[i] = w[i];
        for (int k = 0; k < n; k++) mu[i] -= hessian(H, i, free[k]) * x[k];
        for (int k = n; k < size; k++) mu[i] -= A[(free[k] - N) * N + i] * x[k];
    }
    return 1;
}

/* Gradients of sum(weights * v) of `count` robots; the number of the first one whose equations have no solution, or
 * `count`. */
long long pull_many(long long count, const double *inputs, const double *problems, const double *reports,
                    const double *weights, double *out) {
    casadi_int iw[IW];
    double w[W];
    const double *arg[ARG];
    double *res[RES];
    for (long long k = 0; k < count; k++) {
        const double *report = reports + k * REPORT, *force = report + FORCE_AT;
        double given[GIVEN + 1], mu[N + M], *at = given;
        double *y = given + N + M, *rows_low = y + N, *rows_high = rows_low + M, *owned = rows_high + M;
        memset(given, 0, sizeof given);
        memcpy(at, report + V_AT, N * sizeof *at);
        memcpy(at + N, force + N, M * sizeof *at);
        if (!held_fixed(problems + k * PROBLEM, force, weights + k * N, y, mu)) return k;
        for (int i = 0; i < M; i++) *(force[N + i] > 0.0 ? rows_high + i : rows_low + i) = mu[N + i];
        for (int i = 0; i < N; i++) {
            const int upper = force[i] > 0.0, owner = (int)report[(upper ? OWNER_HIGH_AT : OWNER_LOW_AT) + i];
            if (owner >= 0) owned[upper * N * BLOCKS + owner * N + i] = mu[i];
        }
        arg[0] = inputs + k * INPUTS;
        arg[1] = given;
        res[0] = out + k * OUT;
        pulled(arg, res, iw, w, 0);
    }
    return count;
}
