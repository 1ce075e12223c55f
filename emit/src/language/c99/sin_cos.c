#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD == 0
/* Sine and cosine within an ulp up to 16 000 turns, without branches: after K. C. Ng's k_sin.c, k_cos.c and e_rem_pio2.c of
 * FDLIBM 5.3 (Sun Microsystems, 1993; freely distributable), polynomials summed in pairs. `real` is a number or a vector of
 * numbers, `bits` as many 64-bit integers. */
#define NAME_SIN_COS(real, bits, x, sine, cosine) do { \
    const real shifted = 6755399441055744.0 + (x) * 0.63661977236758134308; \
    const real turns = shifted - 6755399441055744.0; \
    const real first = (x) - turns * 1.57079632673412561417; \
    const real y = first - turns * 6.07710050630396597660e-11; \
    const real tail = (first - y) - turns * 6.07710050630396597660e-11 - turns * 2.02226624879595063154e-21; \
    const real z = y * y, half = 0.5 * z, lead = 1.0 - half, zz = z * z, zx = z * y, zzzz = zz * zz; \
    const real s = (-1.66666666666666324348e-1 + z * 8.33333333332248946124e-3) \
        + zz * (-1.98412698298579493134e-4 + z * 2.75573137070700676789e-6) \
        + zzzz * (-2.50507602534068634195e-8 + z * 1.58969099521155010221e-10); \
    const real c = (4.16666666666666019037e-2 + z * -1.38888888888741095749e-3) \
        + zz * (2.48015872894767294178e-5 + z * -2.75573143513906633035e-7) \
        + zzzz * (2.08757232129817482790e-9 + z * -1.13596475577881948265e-11); \
    const real sin_y = y + (tail * lead + zx * s); \
    const real cos_y = lead + ((((1.0 - lead) - half) - y * tail) + zz * c); \
    bits quarter, swap, bits_s, bits_c, turned_s, turned_c; \
    memcpy(&quarter, &shifted, sizeof quarter); \
    memcpy(&bits_s, &sin_y, sizeof bits_s); \
    memcpy(&bits_c, &cos_y, sizeof bits_c); \
    swap = -(quarter & 1u); \
    turned_s = ((bits_s & ~swap) | (bits_c & swap)) ^ ((quarter & 2u) << 62); \
    turned_c = ((bits_c & ~swap) | (bits_s & swap)) ^ (((quarter + 1u) & 2u) << 62); \
    memcpy((sine), &turned_s, sizeof turned_s); \
    memcpy((cosine), &turned_c, sizeof turned_c); \
} while (0)

static inline void NAME_sin_cos(double x, double *sine, double *cosine)
{
    if (!(fabs(x) < 102943.0)) {
        *sine = sin(x);
        *cosine = cos(x);
        return;
    }
    NAME_SIN_COS(double, uint64_t, x, sine, cosine);
}

/* Sines and cosines of n angles, two at a time with GCC vector types. The last two angles may be the same. */
static inline void NAME_sin_cos_all(int n, const double *angles, double *sines, double *cosines)
{
    int k;
#if defined(__GNUC__)
    typedef double pair __attribute__((vector_size(16)));
    typedef uint64_t bits_of_pair __attribute__((vector_size(16)));
    int regular = 1;
    for (k = 0; k < n; k++)
        regular &= fabs(angles[k]) < 102943.0;
    if (regular) {
        for (k = 0; k + 1 < n; k += 2) {
            const pair x = {angles[k], angles[k + 1]};
            NAME_SIN_COS(pair, bits_of_pair, x, sines + k, cosines + k);
        }
        return;
    }
#endif
    for (k = 0; k < n; k++)
        NAME_sin_cos(angles[k], sines + k, cosines + k);
}
#else
/* Intermediate results have more than double precision here, so the reduction of the other branch would be wrong. */
static inline void NAME_sin_cos(double x, double *sine, double *cosine)
{
    *sine = sin(x);
    *cosine = cos(x);
}

static inline void NAME_sin_cos_all(int n, const double *angles, double *sines, double *cosines)
{
    int k;
    for (k = 0; k < n; k++)
        NAME_sin_cos(angles[k], sines + k, cosines + k);
}
#endif
