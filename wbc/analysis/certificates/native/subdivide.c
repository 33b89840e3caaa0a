/* Depth-first subdivision of joint space: every box is proved, cut in two, or left undecided. */
#include "tests.h"

/* How a proof is chosen that says where to cut: ratios beyond the first count like it, and narrow joints against it */
static const double CAP = 3.0, WEIGHT = 0.7;

typedef struct {
    double boxes, regular, tube, undecided;             /* numbers of boxes */
    double regular_part, tube_part, undecided_part;     /* parts of the whole volume */
    long pending, kept;
} Totals;

/* Proofs of full column rank of one matrix, any of which will do: each a run of forms that must all have it.
 * `ends`: where runs end. */
typedef struct {
    int proofs;
    const int *ends;
    const Form *forms;
} Proofs;

/* The joint that counts most of those that have width. */
static int widest(const double *cut, const double *half, int n)
{
    int joint = -1;
    for (int i = 0; i < n; ++i)
        if (half[i] > 0.0 && (joint < 0 || cut[i] > cut[joint]))
            joint = i;
    return joint;
}

/* Whether one of the proofs holds on the box: a ratio below 1. Else the ratio of the proof that seems nearest to it, and
   how much each joint adds to it: the least sum of log ratio over the joints of its forms. A joint that is narrow
   already counts against its proof, which may fail however small the box is. */
static double proved(const Proofs *all, int n, const double *centre, const double *half, double *cut, Workspace *work)
{
    double best = INFINITY, out = INFINITY;
    for (int p = 0, f = 0; p < all->proofs; ++p) {
        double worst = 0.0, effort = 0.0, mine[MOST_JOINTS], trial[MOST_JOINTS];
        for (; f < all->ends[p]; ++f) {
            memset(trial, 0, sizeof trial);
            const double ratio = regular(&all->forms[f], centre, half, trial, work);
            if (ratio < 1.0)
                continue;
            for (int k = 0; k < work->local.count; ++k)
                if (half[work->local.used[k]] > 0.0)
                    effort += log(fmin(ratio, CAP));
            if (ratio > worst) {
                worst = ratio;
                memcpy(mine, trial, sizeof mine);
            }
        }
        if (worst < 1.0)
            return worst;
        effort -= WEIGHT * log(half[widest(mine, half, n)]);
        if (effort < best || p == 0) {
            best = effort;
            out = worst;
            memcpy(cut, mine, sizeof mine);
        }
    }
    return out;
}

/* Works on `stack` (each box: centre, half widths, 1 where it is known to be outside the tube; the last one first)
   until it is empty or `budget` boxes are done. Joints without width are not cut. Boxes narrower than `smallest` in
   the joint to be cut are undecided, and the first of them are kept. `volume`: of all boxes together. Returns 0, or 1
   where the stack is full. */
int subdivide(const Proofs *augmented, const Form *task, double eps, double smallest, double volume, long budget,
              double *stack, long capacity, double *kept, long most_kept, Totals *totals)
{
    const int n = task->joints, size = 2 * n + 1;
    Workspace work;
    for (long done = 0; done < budget && totals->pending > 0; ++done) {
        double box[2 * MOST_JOINTS + 1], cut[MOST_JOINTS] = { 0.0 }, other[MOST_JOINTS] = { 0.0 }, part = 1.0 / volume;
        memcpy(box, stack + (totals->pending - 1) * size, sizeof(double) * (size_t)size);
        double *centre = box, *half = box + n;
        int joint = -1;
        --totals->pending;
        totals->boxes += 1.0;
        for (int i = 0; i < n; ++i)
            if (half[i] > 0.0)
                part *= 2.0 * half[i];
        const double ratio = proved(augmented, n, centre, half, cut, &work);
        if (ratio < 1.0) {
            totals->regular += 1.0;
            totals->regular_part += part;
            continue;
        }
        if (eps > 0.0 && box[2 * n] == 0.0) {
            double here, least;
            const double bound = tube(task, centre, half, other, &here, &least, &work);
            if (bound < eps) {
                totals->tube += 1.0;
                totals->tube_part += part;
                continue;
            }
            box[2 * n] = least > eps;
            if (here < eps / 2.0 || (here < eps && bound / eps < ratio))
                memcpy(cut, other, sizeof cut);
        }
        joint = widest(cut, half, n);
        if (half[joint] < smallest) {
            totals->undecided += 1.0;
            totals->undecided_part += part;
            if (totals->kept < most_kept)
                memcpy(kept + totals->kept++ * size, box, sizeof(double) * (size_t)size);
            continue;
        }
        if (totals->pending + 2 > capacity) {
            memcpy(stack + totals->pending++ * size, box, sizeof(double) * (size_t)size);
            totals->boxes -= 1.0;
            return 1;
        }
        half[joint] /= 2.0;
        for (int side = -1; side <= 1; side += 2) {
            double *child = stack + totals->pending++ * size;
            memcpy(child, box, sizeof(double) * (size_t)size);
            child[joint] += side * half[joint];
        }
    }
    return 0;
}
