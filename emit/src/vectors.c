/* Written by modelmill for its own use: a program on as many states at once as a vector of the machine has numbers. */
#include <math.h>

#if defined(__AVX512F__)
#define LANES 8
#elif defined(__AVX__)
#define LANES 4
#else
#define LANES 2
#endif
/* Number of lines (the same quantity at LANES states) that are read before the program runs: with the results they take
   16 kB of the fastest cache. */
#define FITTING (16384 / (8 * LANES) / (READ + WIDTH))
#define LINES (FITTING < 1 ? 1 : FITTING > 64 / LANES ? 64 / LANES : FITTING)
/* How many states ahead memory is prefetched, and how many numbers of a column a cache line has. */
#define AHEAD (LINES * LANES < 32 ? 64 : 2 * LINES * LANES)
#define CACHE_LINE 8
typedef double V __attribute__((vector_size(8 * LANES)));
typedef long long W __attribute__((vector_size(8 * LANES)));
#define FUNCTION static inline __attribute__((always_inline))
#define EACH(x, f) for (int k = 0; k < LANES; k++) (x)[k] = f((x)[k])

FUNCTION V all(double x) { return (V){0} + x; }
FUNCTION V absolute(V x) { return (V)((W)x & 0x7fffffffffffffffLL); }
FUNCTION double sign(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : x; }

FUNCTION V angle(V y, V x)
{
    for (int k = 0; k < LANES; k++)
        y[k] = atan2(y[k], x[k]);
    return y;
}

/* Detects NaN and infinity: the sum stays zero as long as all numbers are finite. */
FUNCTION void look_at(V x, V *none) { *none += x * 0.0; }

/* Four numbers without alignment, and a selection of four from eight. */
typedef double H __attribute__((vector_size(32), aligned(8), may_alias));
#ifdef __clang__
#define PICK(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
typedef long long I __attribute__((vector_size(32)));
#define PICK(a, b, i, j, k, l) __builtin_shuffle(a, b, (I){i, j, k, l})
#endif

/* Transposes four rows of four numbers. Rows are `from_next` doubles apart, columns of the result `to_next` doubles. */
FUNCTION void turn(const double *from, long from_next, double *to, long to_next)
{
    const H a = *(const H *)from, b = *(const H *)(from + from_next);
    const H c = *(const H *)(from + 2 * from_next), d = *(const H *)(from + 3 * from_next);
    const H ab = PICK(a, b, 0, 4, 2, 6), ba = PICK(a, b, 1, 5, 3, 7);
    const H cd = PICK(c, d, 0, 4, 2, 6), dc = PICK(c, d, 1, 5, 3, 7);
    *(H *)to = PICK(ab, cd, 0, 1, 4, 5);
    *(H *)(to + to_next) = PICK(ba, dc, 0, 1, 4, 5);
    *(H *)(to + 2 * to_next) = PICK(ab, cd, 2, 3, 6, 7);
    *(H *)(to + 3 * to_next) = PICK(ba, dc, 2, 3, 6, 7);
}

/* A loop over blocks of four columns, which start at column `k`; the last block ends with the last column. */
#define BLOCKS(k, width) for (long k = 0; k < (width); k = k + 4 < (width) && k + 8 > (width) ? (width) - 4 : k + 4)

/* Copies columns of `m` states, from state `first` on, to lines. The last line is filled up with the last state. */
FUNCTION void read(
    const double *array, long first, long by_state, long by_column, long width, long m, V *lines, V *none)
{
    if (!array)
        return;
    const double *const from = array + first * by_state;
    double *const to = (double *)lines;
    long i = 0;
    if (by_state == 1) {
        for (; i + LANES <= m; i += LANES)
            for (long k = 0; k < width; k++)
                __builtin_memcpy(to + k * LINES * LANES + i, from + k * by_column + i, sizeof(V));
    } else if (by_column == 1 && width >= 4) {
        for (; i + 4 <= m; i += 4)
            BLOCKS(k, width)
                turn(from + i * by_state + k, by_state, to + k * LINES * LANES + i, LINES * LANES);
    }
    for (; i < m || i % LANES != 0; i++)
        for (long k = 0; k < width; k++)
            to[k * LINES * LANES + i] = from[(i < m ? i : m - 1) * by_state + k * by_column];
    for (long k = 0; k < width; k++)
        for (long line = 0; line * LANES < m; line++)
            look_at(lines[k * LINES + line], none);
}

/* Prefetches the states of a cache line, for reading or for writing results. */
FUNCTION void fetch(const double *array, long first, long by_state, long by_column, long width, int is_written)
{
    const double *const from = array + first * by_state;
    const long step = by_state == 1 ? by_column : CACHE_LINE;
    for (long k = 0; k < width; k++)
        if (is_written)
            __builtin_prefetch(from + k * step, 1);
        else
            __builtin_prefetch(from + k * step, 0);
}

/* Copies lines of results to the rows of `m` states. */
FUNCTION void write(const V *lines, long m, double *to, V *none)
{
    for (long k = 0; k < WIDTH; k++)
        for (long line = 0; line * LANES < m; line++)
            look_at(lines[k * LINES + line], none);
    const double *const from = (const double *)lines;
    long i = 0;
    if (WIDTH >= 4)
        for (; i + 4 <= m; i += 4)
            BLOCKS(k, WIDTH)
                turn(from + k * LINES * LANES + i, LINES * LANES, to + i * WIDTH + k, WIDTH);
    for (; i < m; i++)
        for (long k = 0; k < WIDTH; k++)
            to[i * WIDTH + k] = from[k * LINES * LANES + i];
}

/* Sine and cosine of angles below 102943 rad, 65536 quarters of a turn; `bad` gets a bit above the 17th for larger angles.
   Reduction by Cody and Waite, polynomials of FDLIBM (Sun Microsystems, 1993), terms in pairs after G. Estrin. The compiler
   computes them once where an angle has both. */
FUNCTION void sine_and_cosine(V x, V *sine, V *cosine, W *bad)
{
    const double round = 6755399441055744.0;
    const V shifted = x * 0.63661977236758134308 + round;
    *bad |= (W)shifted - (W)all(round) + 65536;
    const V turns = shifted - round;
    const V first = x - turns * 1.57079632673412561417;
    const V y = first - turns * 6.07710050630396597660e-11;
    const V tail = ((first - y) - turns * 6.07710050630396597660e-11) - turns * 2.02226624879595063154e-21;
    const V z = y * y, half = 0.5 * z, lead = 1.0 - half, zz = z * z, zy = z * y, zzzz = zz * zz;
    const V s = (-1.66666666666666324348e-1 + z * 8.33333333332248946124e-3)
        + zz * (-1.98412698298579493134e-4 + z * 2.75573137070700676789e-6)
        + zzzz * (-2.50507602534068634195e-8 + z * 1.58969099521155010221e-10);
    const V c = (4.16666666666666019037e-2 + z * -1.38888888888741095749e-3)
        + zz * (2.48015872894767294178e-5 + z * -2.75573143513906633035e-7)
        + zzzz * (2.08757232129817482790e-9 + z * -1.13596475577881948265e-11);
    const W sin_y = (W)(y + (tail * lead + zy * s));
    const W cos_y = (W)(lead + ((((1.0 - lead) - half) - y * tail) + zz * c));
    const W quarter = (W)shifted, swap = -(quarter & 1);
    *sine = (V)(((sin_y & ~swap) | (cos_y & swap)) ^ ((quarter & 2) << 62));
    *cosine = (V)(((cos_y & ~swap) | (sin_y & swap)) ^ (((quarter + 1) & 2) << 62));
}

FUNCTION int is_irregular(V none, W bad)
{
    bad |= ~(none == 0.0);
    long long any = 0;
    for (int k = 0; k < LANES; k++)
        any |= bad[k] >> 17;
    return any != 0;
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
