#define NOTHING 1e-9

/* Random numbers that are the same on every machine (SplitMix64; Steele, Lea and Flood 2014). */
static double NAME_between(uint64_t *state, double low, double high)
{
    uint64_t z;
    *state += UINT64_C(0x9E3779B97F4A7C15);
    z = *state;
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    z ^= z >> 31;
    return low + (double)(z >> 11) / 9007199254740992.0 * (high - low);
}

/* Adds a row to the R factor of a QR factorisation, by rotations (Givens 1958). */
static void NAME_take_row(double *triangle, double *row, int n)
{
    int k, i;
    for (k = 0; k < n; k++) {
        double a = triangle[k * n + k], b = row[k], length = sqrt(a * a + b * b);
        if (b == 0.0)
            continue;
        for (i = 0; i < n; i++) {
            double x = triangle[k * n + i], y = row[i];
            triangle[k * n + i] = a / length * x + b / length * y;
            row[i] = a / length * y - b / length * x;
        }
    }
}

/* Number of singular values that are not zero, after scaling all columns to length 1 (one-sided rotations; Hestenes 1958). */
static int NAME_rank(double *m, int n)
{
    int sweep, p, q, i, rank = 0, turned = 1;
    double largest = 0.0;
    for (q = 0; q < n; q++) {
        double length = 0.0;
        for (i = 0; i < n; i++)
            length += m[i * n + q] * m[i * n + q];
        length = sqrt(length);
        for (i = 0; length > 0.0 && i < n; i++)
            m[i * n + q] /= length;
    }
    for (sweep = 0; sweep < 30 && turned; sweep++) {
        turned = 0;
        for (q = 1; q < n; q++) {
            for (p = 0; p < q; p++) {
                double a = 0.0, b = 0.0, mixed = 0.0, zeta, t, c, s;
                for (i = 0; i < n; i++) {
                    a += m[i * n + p] * m[i * n + p];
                    b += m[i * n + q] * m[i * n + q];
                    mixed += m[i * n + p] * m[i * n + q];
                }
                if (fabs(mixed) <= 1e-15 * sqrt(a * b) || a * b == 0.0)
                    continue;
                turned = 1;
                zeta = (b - a) / (2.0 * mixed);
                t = (zeta < 0.0 ? -1.0 : 1.0) / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
                c = 1.0 / sqrt(1.0 + t * t);
                s = c * t;
                for (i = 0; i < n; i++) {
                    double x = m[i * n + p], y = m[i * n + q];
                    m[i * n + p] = c * x - s * y;
                    m[i * n + q] = s * x + c * y;
                }
            }
        }
    }
    for (q = 0; q < n; q++) {
        double size = 0.0;
        for (i = 0; i < n; i++)
            size += m[i * n + q] * m[i * n + q];
        if (sqrt(size) > largest)
            largest = sqrt(size);
    }
    for (q = 0; q < n; q++) {
        double size = 0.0;
        for (i = 0; i < n; i++)
            size += m[i * n + q] * m[i * n + q];
        rank += sqrt(size) > NOTHING * largest;
    }
    return rank;
}
