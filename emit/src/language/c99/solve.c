/* Solves matrix * x = rhs by Gaussian elimination with partial pivoting; rhs becomes x, the matrix is overwritten. */
static int NAME_solve(double *matrix, double *rhs, int n)
{
    int column, row, k;
    for (column = 0; column < n; column++) {
        int pivot = column;
        double largest = 0.0;
        for (row = column; row < n; row++) {
            double size = fabs(matrix[row * n + column]);
            if (size > largest) {
                largest = size;
                pivot = row;
            }
        }
        if (!(largest > 0.0))
            return UPPER_SINGULAR;
        if (pivot != column) {
            double kept = rhs[column];
            rhs[column] = rhs[pivot];
            rhs[pivot] = kept;
            for (k = 0; k < n; k++) {
                kept = matrix[column * n + k];
                matrix[column * n + k] = matrix[pivot * n + k];
                matrix[pivot * n + k] = kept;
            }
        }
        for (row = column + 1; row < n; row++) {
            double factor = matrix[row * n + column] / matrix[column * n + column];
            for (k = column + 1; k < n; k++)
                matrix[row * n + k] -= factor * matrix[column * n + k];
            rhs[row] -= factor * rhs[column];
        }
    }
    for (row = n - 1; row >= 0; row--) {
        for (k = row + 1; k < n; k++)
            rhs[row] -= matrix[row * n + k] * rhs[k];
        rhs[row] /= matrix[row * n + row];
    }
    return UPPER_OK;
}
