/* Written by modelmill for its own use: a program on eight states at once. */
#include <math.h>

#define LANES 8
typedef double V __attribute__((vector_size(64)));
typedef long long W __attribute__((vector_size(64)));
#define FUNCTION static inline __attribute__((always_inline))
#define EACH(x, f) for (int k = 0; k < LANES; k++) (x)[k] = f((x)[k])

FUNCTION V all(double x) { return (V){0} + x; }
FUNCTION W irregular(V x) { return ~((x - x) == 0.0); }
FUNCTION V absolute(V x) { return (V)((W)x & 0x7fffffffffffffffLL); }
FUNCTION double sign(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : x; }

FUNCTION V read_column(const double *first, long stride)
{
    V x;
    for (int k = 0; k < LANES; k++)
        x[k] = first[k * stride];
    return x;
}

FUNCTION V angle(V y, V x)
{
    for (int k = 0; k < LANES; k++)
        y[k] = atan2(y[k], x[k]);
    return y;
}

/* Both for angles below 102943 rad: reduction by Cody and Waite, polynomials of FDLIBM (Sun Microsystems, 1993). The
   compiler computes them once where an angle has both. */
FUNCTION void sine_and_cosine(V x, V *sine, V *cosine, W *bad)
{
    *bad |= ~(absolute(x) < 102943.0);
    const double round = 6755399441055744.0;
    const V shifted = x * 0.63661977236758134308 + round;
    const V turns = shifted - round;
    const V first = x - turns * 1.57079632673412561417;
    const V product = turns * 6.07710050630396597660e-11;
    const V y = first - product;
    const V tail = ((first - y) - product) - turns * 2.02226624879595063154e-21;
    const V z = y * y, half = 0.5 * z, lead = 1.0 - half;
    const V s = -1.66666666666666324348e-1
        + z * (8.33333333332248946124e-3 + z * (-1.98412698298579493134e-4
        + z * (2.75573137070700676789e-6 + z * (-2.50507602534068634195e-8 + z * 1.58969099521155010221e-10))));
    const V c = 4.16666666666666019037e-2
        + z * (-1.38888888888741095749e-3 + z * (2.48015872894767294178e-5
        + z * (-2.75573143513906633035e-7 + z * (2.08757232129817482790e-9 + z * -1.13596475577881948265e-11))));
    const W sin_y = (W)(y + (tail * lead + z * y * s));
    const W cos_y = (W)(lead + (((1.0 - lead) - half) - y * tail + z * z * c));
    const W quarter = (W)shifted, swap = -(quarter & 1);
    *sine = (V)(((sin_y & ~swap) | (cos_y & swap)) ^ ((quarter & 2) << 62));
    *cosine = (V)(((cos_y & ~swap) | (sin_y & swap)) ^ (((quarter + 1) & 2) << 62));
}

FUNCTION V sine(V x, W *bad)
{
    V s, c;
    sine_and_cosine(x, &s, &c, bad);
    return s;
}

FUNCTION V cosine(V x, W *bad)
{
    V s, c;
    sine_and_cosine(x, &s, &c, bad);
    return c;
}
