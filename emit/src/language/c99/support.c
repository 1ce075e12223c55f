/* A determinant below this share of the magnitude of its terms is singular; an input above this limit is refused. */
#define SINGULAR_SHARE 1e-9
#define LARGEST_INPUT 1e60

/* Whether all numbers are finite and below the limit for inputs. */
static int NAME_all_fine(const double *values, int n)
{
    int k, fine = 1;
    for (k = 0; k < n; k++)
        fine &= fabs(values[k]) < LARGEST_INPUT;
    return fine;
}
