/* Times the plain C99 of a model, one state at a time, and holds its forces against those of the emitted Rust.
 *
 * Compiled with -DHEADER='"panda.h"' -DNAME(x)=panda_##x -DUPPER(x)=PANDA_##x. The argument names a file with one state in a
 * line: q, qd, qdd, and the forces of the drives. */

#define _POSIX_C_SOURCE 199309L
#include HEADER

#include <math.h>
#include <stdio.h>
#include <time.h>

#define N UPPER(N_ACTIVE)
#define DRIVES UPPER(N_DRIVES)
#define STATES 480

static double table[STATES][3 * N + DRIVES];

static double now(void) {
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return 1e9 * (double)time.tv_sec + (double)time.tv_nsec;
}

int main(int argc, char **argv) {
  static NAME(dynamics) dynamics;
  NAME(geometry) geometry;
  NAME(parameters) parameters;
  double base[UPPER(N_BASE)], forces[DRIVES], columns[DRIVES * UPPER(N_BASE)], best[2] = {1e300, 1e300};
  double worst = 0, largest = 0;
  FILE *file = argc == 2 ? fopen(argv[1], "r") : NULL;
  int i, k, round, function, n_states = 0;
  if (!file) return 2;
  for (; n_states < STATES; ++n_states)
    for (k = 0; k < 3 * N + DRIVES; ++k)
      if (fscanf(file, "%lf", &table[n_states][k]) != 1) return 2;
  fclose(file);
  NAME(default_geometry)(&geometry);
  NAME(nominal_parameters)(&parameters);
  NAME(base_parameters)(&geometry, &parameters, base);
  if (NAME(prepare)(&dynamics, &geometry, base) != UPPER(OK)) return 1;
  for (i = 0; i < STATES; ++i) {
    const double *q = table[i];
    if (NAME(inverse_dynamics)(&dynamics, q, q + N, q + 2 * N, forces) != UPPER(OK)) return 1;
    for (k = 0; k < DRIVES; ++k) {
      worst = fmax(worst, fabs(forces[k] - q[3 * N + k]));
      largest = fmax(largest, fabs(q[3 * N + k]));
    }
  }
  if (worst > 1e-10 * largest) {
    fprintf(stderr, "the forces differ by %g of %g\n", worst, largest);
    return 1;
  }
  for (round = 0; round < 100; ++round) {
    for (function = 0; function < 2; ++function) {
      double start = now();
      for (i = 0; i < STATES; ++i) {
        const double *q = table[i];
        if (function == 0)
          NAME(inverse_dynamics)(&dynamics, q, q + N, q + 2 * N, forces);
        else
          NAME(regressor)(&dynamics, q, q + N, q + 2 * N, columns);
        __asm__ volatile("" : : "r"(forces), "r"(columns) : "memory");
      }
      best[function] = fmin(best[function], (now() - start) / STATES);
    }
  }
  printf("inverse dynamics\t%.2f\nregressor\t%.2f\n", best[0], best[1]);
  return 0;
}
