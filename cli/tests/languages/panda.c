/* Holds the C library of the Panda against the reference table: one state at a time, all at once, and what is wrong.
 * Usage: panda FOLDER-OF-TABLES. Prints "agrees" if all is well. */

#include "panda.h"

#include "table.h"

#define STATES 40
#define COLUMNS 28

static double table[STATES][COLUMNS], parameters[PANDA_N_PARAMETERS];

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

  double matrix[7 * 7], bias[7], coriolis[7], gravity[7], effects[7], found[7], motion[7 + 7 + 49], back[7];
  double largest = 0, worst = 0;
  static double q[7 * STATES], qd[7 * STATES], qdd[7 * STATES], all[7 * STATES];
  for (size_t i = 0; i < STATES; ++i) {
    const double *row = table[i];
    check(panda_inverse_dynamics(&dynamics, row, row + 7, row + 14, forces) == PANDA_OK, "inverse dynamics");
    check(panda_regressor(&dynamics, row, row + 7, row + 14, regressor) == PANDA_OK, "regressor");
    check(panda_mass_matrix(&dynamics, row, row + 7, row + 14, matrix) == PANDA_OK, "mass matrix");
    check(panda_bias(&dynamics, row, row + 7, row + 14, bias) == PANDA_OK, "bias");
    check(panda_coriolis(&dynamics, row, row + 7, row + 14, coriolis) == PANDA_OK, "coriolis");
    check(panda_gravity(&dynamics, row, row + 7, row + 14, gravity) == PANDA_OK, "gravity");
    check(panda_effects(&dynamics, row, row + 7, row + 14, effects) == PANDA_OK, "effects");
    check(panda_forward(&dynamics, row, row + 7, row + 14, row + 21, found) == PANDA_OK, "forward dynamics");
    check(panda_inverse_dynamics(&dynamics, row, row + 7, found, back) == PANDA_OK, "forces of what was found");
    check(panda_drives(&dynamics, row, row + 7, row + 14, motion) == PANDA_OK, "drives");
    for (size_t d = 0; d < 7; ++d) {
      double total = bias[d];
      for (size_t k = 0; k < 7; ++k) total += matrix[d * 7 + k] * row[14 + k];
      worst = fmax(worst, fmax(fabs(total - row[21 + d]), fabs(back[d] - row[21 + d])));
      worst = fmax(worst, fabs(coriolis[d] + gravity[d] + effects[d] - bias[d]));
      check(fabs(found[d] - row[14 + d]) < 1e-9 * (1 + fabs(row[14 + d])), "accelerations do not come back");
      check(motion[d] == row[d] && motion[7 + d] == row[7 + d], "motion of the drives");
      for (size_t k = 0; k < 7; ++k) check(motion[14 + d * 7 + k] == (d == k), "Jacobian of the drives");
    }
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
  q[0] = NAN;
  check(panda_mass_matrix(&dynamics, q, qd, qdd, matrix) == PANDA_NOT_FINITE, "a mass matrix of what is no number");
  check(panda_forward(&dynamics, table[0], table[0] + 7, table[0] + 14, q, found) == PANDA_NOT_FINITE, "forces that are none");
  check(panda_forward(&dynamics, table[0], table[0] + 7, table[0] + 14, NULL, found) == PANDA_NULL_POINTER, "no forces");
  check(panda_inverse_dynamics(&dynamics, NULL, qd, qdd, forces) == PANDA_NULL_POINTER, "null pointers must be refused");
  puts("agrees");
  return 0;
}
