/* Least singular values of several matrices that share their rows, with both singular vectors and the slope along q.
 *
 * Before this text stand the generated functions `rates` (q -> all rows, by columns) and `slope` (q, left, right ->
 * gradient of left' rows right along the tangent space), the sizes and tables of the groups, and singular.c. A group
 * has some of the rows, and the columns of the joints that are not braked. */

/* Group g: its least singular value; where wanted the left vector over all rows, the right one over all joints */
static double group(const double *rows, int g, double *left, double *right) {
    double matrix[MOST * NV], own[MOST], along[NV];
    const int *row = group_row + row_start[g], *column = group_column + column_start[g];
    const int height = row_start[g + 1] - row_start[g], width = column_start[g + 1] - column_start[g];
    for (int i = 0; i < height; i++)
        for (int j = 0; j < width; j++)
            matrix[i * width + j] = row_scale[row[i]] * rows[column[j] * ROWS + row[i]] * dof_scale[column[j]];
    if (!left) return least_singular(matrix, height, width, 0, 0);
    const double sigma = least_singular(matrix, height, width, own, along);
    memset(left, 0, ROWS * sizeof(double));
    memset(right, 0, NV * sizeof(double));
    for (int i = 0; i < height; i++) left[row[i]] = own[i];
    for (int j = 0; j < width; j++) right[column[j]] = along[j];
    return sigma;
}

/* sigma: GROUPS numbers, of which those are written that `wanted` has ones for, all of them where it is null.
 * slopes: GROUPS x NV along q; right: GROUPS x NV; both null, or both not */
void conditioning(const double *q, const unsigned char *wanted, double *sigma, double *slopes, double *right) {
    double rows[ROWS * NV], left[ROWS], work[WORK_W];
    long long int integers[WORK_IW];
    const double *arguments[ARGUMENTS];
    double *results[ARGUMENTS];
    arguments[0] = q;
    results[0] = rows;
    rates(arguments, results, integers, work, 0);
    for (int g = 0; g < GROUPS; g++) {
        if (wanted && !wanted[g]) continue;
        if (!slopes) {
            sigma[g] = group(rows, g, 0, 0);
            continue;
        }
        double scaled[NV];
        sigma[g] = group(rows, g, left, right + g * NV);
        for (int i = 0; i < ROWS; i++) left[i] *= row_scale[i];
        for (int j = 0; j < NV; j++) scaled[j] = right[g * NV + j] * dof_scale[j];
        arguments[0] = q;
        arguments[1] = left;
        arguments[2] = scaled;
        results[0] = slopes + g * NV;
        slope(arguments, results, integers, work, 0);
    }
}
