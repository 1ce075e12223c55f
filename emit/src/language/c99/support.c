/* What a determinant must exceed, as a share of the magnitude of its terms, and what inputs must stay below. */
#define SINGULAR_SHARE 1e-9
#define LARGEST_INPUT 1e60

/* Whether all numbers are finite and not too large to compute with. */
static int NAME_all_fine(const double *values, int n)
{
    int k, fine = 1;
    for (k = 0; k < n; k++)
        fine &= fabs(values[k]) < LARGEST_INPUT;
    return fine;
}
