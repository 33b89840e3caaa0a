/* Depth-first subdivision of joint space: every box is proved, cut in two, or left undecided. */
#include "tests.h"

typedef struct {
    double boxes, regular, tube, undecided;             /* numbers of boxes */
    double regular_part, tube_part, undecided_part;     /* parts of the whole volume */
    long pending, kept;
} Totals;

/* Works on `stack` (each box: centre, half widths, 1 where it is known to be outside the tube; the last one first)
   until it is empty or `budget` boxes are done. Joints without width are not cut. Boxes narrower than `smallest` in
   the joint to be cut are undecided, and the first of them are kept. `volume`: of all boxes together. Returns 0, or 1
   where the stack is full. */
int subdivide(const Form *augmented, const Form *task, double eps, double smallest, double volume, long budget,
              double *stack, long capacity, double *kept, long most_kept, Totals *totals)
{
    const int n = augmented->joints, size = 2 * n + 1;
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
        const double ratio = regular(augmented, centre, half, cut, &work);
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
        for (int i = 0; i < n; ++i)
            if (half[i] > 0.0 && (joint < 0 || cut[i] > cut[joint]))
                joint = i;
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
            double *place = stack + totals->pending++ * size;
            memcpy(place, box, sizeof(double) * (size_t)size);
            place[joint] += side * half[joint];
        }
    }
    return 0;
}
