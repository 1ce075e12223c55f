/* Holds the C library of the Panda against the reference table: one state at a time, all at once, and what is wrong.
 * Usage: panda FOLDER-OF-TABLES. Prints "agrees" if all is well. */

#include "panda.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define STATES 40
#define COLUMNS 28

static double table[STATES][COLUMNS], parameters[PANDA_N_PARAMETERS];

/* Reads rows of numbers behind a line of names. */
static void read_table(const char *folder, const char *name, double *to, size_t rows, size_t columns) {
  static char path[4096], line[65536];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  FILE *file = fopen(path, "r");
  if (!file || !fgets(line, sizeof line, file)) {
    fprintf(stderr, "%s cannot be read\n", path);
    exit(1);
  }
  for (size_t i = 0; i < rows; ++i) {
    char *next = fgets(line, sizeof line, file);
    for (size_t k = 0; next && k < columns; ++k, ++next) *to++ = strtod(next, &next);
  }
  fclose(file);
}

static void check(int good, const char *what) {
  if (!good) {
    fprintf(stderr, "%s\n", what);
    exit(1);
  }
}

int main(int argc, char **argv) {
  check(argc == 2, "usage: panda FOLDER-OF-TABLES");
  read_table(argv[1], "pinocchio-panda.csv", &table[0][0], STATES, COLUMNS);
  /* The table has the parameters in the order of the model file. */
  read_table(argv[1], "pinocchio-panda-parameters.csv", parameters, 1, PANDA_N_PARAMETERS);

  double geometry[PANDA_N_CONSTANTS], nominal[PANDA_N_PARAMETERS], base[PANDA_N_BASE];
  check(panda_default_geometry(geometry) == PANDA_OK && geometry[PANDA_CONSTANT_g] == 9.81, "geometry");
  check(panda_nominal_parameters(nominal) == PANDA_OK, "nominal parameters");
  check(panda_base_parameters(geometry, parameters, base) == PANDA_OK, "base parameters");
  static panda_dynamics dynamics;
  double forces[PANDA_N_DRIVES], regressor[PANDA_N_DRIVES * PANDA_N_BASE];
  check(panda_inverse_dynamics(&dynamics, table[0], table[0] + 7, table[0] + 14, forces) == PANDA_NOT_PREPARED,
        "an unprepared model must be refused");
  check(panda_prepare(&dynamics, geometry, base) == PANDA_OK, "prepare");

  double largest = 0, worst = 0;
  static double q[7 * STATES], qd[7 * STATES], qdd[7 * STATES], all[7 * STATES];
  for (size_t i = 0; i < STATES; ++i) {
    const double *row = table[i];
    check(panda_inverse_dynamics(&dynamics, row, row + 7, row + 14, forces) == PANDA_OK, "inverse dynamics");
    check(panda_regressor(&dynamics, row, row + 7, row + 14, regressor) == PANDA_OK, "regressor");
    for (size_t d = 0; d < 7; ++d) {
      double sum = 0;
      for (size_t b = 0; b < PANDA_N_BASE; ++b) sum += regressor[d * PANDA_N_BASE + b] * base[b];
      largest = fmax(largest, fabs(row[21 + d]));
      worst = fmax(worst, fmax(fabs(forces[d] - row[21 + d]), fabs(sum - row[21 + d])));
      q[d * STATES + i] = row[d], qd[d * STATES + i] = row[7 + d], qdd[d * STATES + i] = row[14 + d];
    }
  }
  size_t failed = 12345;
  check(panda_inverse_dynamics_many(&dynamics, STATES, q, qd, qdd, all, &failed) == PANDA_OK && failed == 12345, "many");
  double *h = malloc(sizeof(double) * STATES * PANDA_N_DRIVES * PANDA_N_BASE);
  check(h && panda_regressor_many(&dynamics, STATES, q, qd, qdd, h, NULL) == PANDA_OK, "many regressors");
  for (size_t i = 0; i < STATES; ++i) {
    for (size_t d = 0; d < 7; ++d) {
      double sum = 0;
      for (size_t b = 0; b < PANDA_N_BASE; ++b) sum += h[(d * PANDA_N_BASE + b) * STATES + i] * base[b];
      worst = fmax(worst, fmax(fabs(all[d * STATES + i] - table[i][21 + d]), fabs(sum - table[i][21 + d])));
    }
  }
  free(h);
  check(largest > 1 && worst < 1e-12 * largest, "the torques miss the table");

  q[2 * STATES + 17] = NAN;
  check(panda_inverse_dynamics_many(&dynamics, STATES, q, qd, qdd, all, &failed) == PANDA_NOT_FINITE && failed == 17,
        "what is no number must be found where it stands");
  check(panda_inverse_dynamics(&dynamics, NULL, qd, qdd, forces) == PANDA_NULL_POINTER, "null pointers must be refused");
  puts("agrees");
  return 0;
}
