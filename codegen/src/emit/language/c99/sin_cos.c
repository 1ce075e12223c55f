#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD == 0
/* Sine and cosine within an ulp up to 16 000 turns, without branches: after K. C. Ng's k_sin.c, k_cos.c and e_rem_pio2.c of
 * FDLIBM 5.3 (Sun Microsystems, 1993; freely distributable), polynomials added up in pairs. */
static inline void NAME_sin_cos(double x, double *sine, double *cosine)
{
    const double round = 6755399441055744.0;
    double shifted, turns, first, y, tail, z, half, lead, zz, zzzz, zx, s, c, rest;
    uint64_t quarter, swap, bits_s, bits_c, turned_s, turned_c;
    if (!(fabs(x) < 102943.0)) {
        *sine = sin(x);
        *cosine = cos(x);
        return;
    }
    shifted = round + x * 0.63661977236758134308;
    turns = shifted - round;
    first = x - turns * 1.57079632673412561417;
    y = first - turns * 6.07710050630396597660e-11;
    tail = (first - y) - turns * 6.07710050630396597660e-11 - turns * 2.02226624879595063154e-21;
    z = y * y;
    half = 0.5 * z;
    lead = 1.0 - half;
    zz = z * z;
    zx = z * y;
    zzzz = zz * zz;
    s = (-1.66666666666666324348e-1 + z * 8.33333333332248946124e-3)
        + zz * (-1.98412698298579493134e-4 + z * 2.75573137070700676789e-6)
        + zzzz * (-2.50507602534068634195e-8 + z * 1.58969099521155010221e-10);
    s = y + (tail * lead + zx * s);
    c = (4.16666666666666019037e-2 + z * -1.38888888888741095749e-3)
        + zz * (2.48015872894767294178e-5 + z * -2.75573143513906633035e-7)
        + zzzz * (2.08757232129817482790e-9 + z * -1.13596475577881948265e-11);
    rest = ((1.0 - lead) - half) - y * tail;
    c = lead + (rest + zz * c);
    memcpy(&quarter, &shifted, sizeof quarter);
    memcpy(&bits_s, &s, sizeof bits_s);
    memcpy(&bits_c, &c, sizeof bits_c);
    swap = (uint64_t)0 - (quarter & 1u);
    turned_s = ((bits_s & ~swap) | (bits_c & swap)) ^ ((quarter & 2u) << 62);
    turned_c = ((bits_c & ~swap) | (bits_s & swap)) ^ (((quarter + 1u) & 2u) << 62);
    memcpy(sine, &turned_s, sizeof *sine);
    memcpy(cosine, &turned_c, sizeof *cosine);
}
#else
/* Where numbers are rounded late, the tricks of the other branch do not hold. */
static void NAME_sin_cos(double x, double *sine, double *cosine)
{
    *sine = sin(x);
    *cosine = cos(x);
}
#endif
