/* Holds the C99 of the Panda against the reference table, and its parts against each other.
 * Usage: panda_c99 FOLDER-OF-TABLES. Prints "agrees" if all is well. */

#include "panda.h"
#include "table.h"

#define STATES 40
#define COLUMNS 28

static double table[STATES][COLUMNS];

int main(int argc, char **argv) {
  static panda_dynamics dynamics;
  static panda_reactions reactions;
  panda_geometry geometry;
  panda_parameters parameters;
  double base[PANDA_N_BASE], forces[PANDA_N_DRIVES], h[PANDA_N_DRIVES * PANDA_N_BASE], motion[7 + 7 + 49];
  double matrix[49], bias[7], found[7], coriolis[7], gravity[7], effects[7], wrenches[PANDA_N_WRENCHES];
  double largest = 0, worst = 0, bad[7] = {0};
  int i, d, b;
  check(argc == 2, "usage: panda_c99 FOLDER-OF-TABLES");
  read_table(argv[1], "pinocchio-panda.csv", &table[0][0], STATES, COLUMNS);
  /* The table has the parameters in the order of the model file. */
  read_table(argv[1], "pinocchio-panda-parameters.csv", (double *)&parameters, 1, sizeof parameters / sizeof(double));
  panda_default_geometry(&geometry);
  check(panda_base_parameters(&geometry, &parameters, base) == PANDA_OK, "base parameters");
  check(panda_prepare(&dynamics, &geometry, base) == PANDA_OK, "prepare");
  check(panda_prepare_reactions(&reactions, &geometry, &parameters) == PANDA_OK, "prepare reactions");
  for (i = 0; i < STATES; ++i) {
    const double *q = table[i], *qd = q + 7, *qdd = q + 14;
    check(panda_inverse_dynamics(&dynamics, q, qd, qdd, forces) == PANDA_OK, "inverse dynamics");
    check(panda_regressor(&dynamics, q, qd, qdd, h) == PANDA_OK, "regressor");
    check(panda_drives(&dynamics, q, qd, qdd, motion) == PANDA_OK && motion[0] == q[0] && motion[7] == qd[0], "drives");
    check(panda_mass_matrix(&dynamics, q, qd, qdd, matrix) == PANDA_OK, "mass matrix");
    check(panda_bias(&dynamics, q, qd, qdd, bias) == PANDA_OK, "bias");
    check(panda_coriolis(&dynamics, q, qd, qdd, coriolis) == PANDA_OK, "coriolis");
    check(panda_gravity(&dynamics, q, qd, qdd, gravity) == PANDA_OK, "gravity");
    check(panda_effects(&dynamics, q, qd, qdd, effects) == PANDA_OK, "effects");
    check(panda_transmitted(&reactions, q, qd, qdd, wrenches) == PANDA_OK, "reactions");
    check(panda_forward(&dynamics, q, qd, qdd, forces, found) == PANDA_OK, "forward dynamics");
    for (d = 0; d < 7; ++d) {
      double sum = 0, total = bias[d];
      for (b = 0; b < PANDA_N_BASE; ++b) sum += h[d * PANDA_N_BASE + b] * base[b];
      for (b = 0; b < 7; ++b) total += matrix[d * 7 + b] * qdd[b];
      largest = fmax(largest, fabs(q[21 + d]));
      worst = fmax(worst, fmax(fabs(forces[d] - q[21 + d]), fabs(sum - q[21 + d])));
      worst = fmax(worst, fmax(fabs(total - q[21 + d]), fabs(coriolis[d] + gravity[d] + effects[d] - bias[d])));
      check(fabs(found[d] - qdd[d]) < 1e-8 * (1 + fabs(qdd[d])), "accelerations do not come back");
    }
  }
  check(largest > 1 && worst < 1e-12 * largest, "the torques miss the table");
  bad[3] = NAN;
  check(panda_inverse_dynamics(&dynamics, bad, table[0], table[0], forces) == PANDA_NOT_FINITE, "what is no number");
  bad[3] = 1e61;
  check(panda_inverse_dynamics(&dynamics, table[0], bad, table[0], forces) == PANDA_NOT_FINITE, "what is too large");
  check(panda_self_test(&geometry) == 0, "self-test");
  base[0] = NAN;
  check(panda_prepare(&dynamics, &geometry, base) == PANDA_NOT_FINITE, "base parameters that are no numbers");
  check(panda_gravity(&dynamics, table[0], table[0], table[0], gravity) == PANDA_NOT_FINITE, "a model of them");
  puts("agrees");
  return 0;
}
