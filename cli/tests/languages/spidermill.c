/* Holds the C library of the paper's SpiderMill against the independent table, and what belongs to loops against each other.
 * Usage: spidermill FOLDER-OF-TABLES. Prints "agrees" if all is well. */

#include "spidermill_paper.h"

#include "table.h"

#define STATES 40
#define COLUMNS 32

static double table[STATES][COLUMNS];

int main(int argc, char **argv) {
  static spidermill_paper_dynamics dynamics;
  double geometry[SPIDERMILL_PAPER_N_CONSTANTS], parameters[SPIDERMILL_PAPER_N_PARAMETERS], base[SPIDERMILL_PAPER_N_BASE];
  double passive[3 * SPIDERMILL_PAPER_N_PASSIVE], motion[2 + 2 + 4], matrix[4], bias[2], forces[2], found[2];
  double apart[2] = {3.14, 0.0}, still[2] = {0.0, 0.0}, step = 1e-6;
  check(argc == 2, "usage: spidermill FOLDER-OF-TABLES");
  read_table(argv[1], "spidermill-paper-H.csv", &table[0][0], STATES, COLUMNS);
  spidermill_paper_default_geometry(geometry);
  spidermill_paper_nominal_parameters(parameters);
  check(spidermill_paper_base_parameters(geometry, parameters, base) == SPIDERMILL_PAPER_OK, "base parameters");
  check(spidermill_paper_prepare(&dynamics, geometry, base) == SPIDERMILL_PAPER_OK, "prepare");
  for (int i = 0; i < STATES; ++i) {
    const double *q = table[i], *qd = q + 2, *qdd = q + 4;
    double ahead[2] = {q[0] + step * qd[0], q[1] + step * qd[1]};
    check(spidermill_paper_passive(&dynamics, q, qd, qdd, passive) == SPIDERMILL_PAPER_OK, "passive coordinates");
    check(spidermill_paper_drives(&dynamics, q, qd, qdd, motion) == SPIDERMILL_PAPER_OK, "drives");
    check(spidermill_paper_mass_matrix(&dynamics, q, qd, qdd, matrix) == SPIDERMILL_PAPER_OK, "mass matrix");
    check(spidermill_paper_bias(&dynamics, q, qd, qdd, bias) == SPIDERMILL_PAPER_OK, "bias");
    check(spidermill_paper_forward(&dynamics, q, qd, qdd, q + 30, found) == SPIDERMILL_PAPER_OK, "forward dynamics");
    check(spidermill_paper_inverse_dynamics(&dynamics, q, qd, found, forces) == SPIDERMILL_PAPER_OK, "forces");
    for (int k = 0; k < 2; ++k) {
      double size = 1000 + fabs(q[30]) + fabs(q[31]), total = bias[k] + matrix[2 * k] * qdd[0] + matrix[2 * k + 1] * qdd[1];
      /* J' f: the Jacobian has a row for each drive. */
      double generalised = motion[4 + k] * q[30] + motion[6 + k] * q[31];
      double later[3 * SPIDERMILL_PAPER_N_PASSIVE];
      check(fabs(passive[k] - q[6 + k]) < 1e-12, "passive angles miss the table");
      check(spidermill_paper_passive(&dynamics, ahead, qd, qdd, later) == SPIDERMILL_PAPER_OK, "passive coordinates later");
      check(fabs((later[k] - passive[k]) / step - passive[2 + k]) < 1e-4 * (1 + fabs(passive[2 + k])), "passive rates");
      check(fabs(total - generalised) < 1e-12 * size, "M q'' + bias misses the forces of the table");
      check(fabs(forces[k] - q[30 + k]) < 1e-12 * size, "forward dynamics do not give the forces of the table");
      check(fabs(found[k] - qdd[k]) < 1e-9 * (1 + fabs(qdd[k])), "accelerations do not come back");
    }
  }
  check(spidermill_paper_passive(&dynamics, apart, still, still, passive) == SPIDERMILL_PAPER_OUT_OF_REACH &&
            spidermill_paper_mass_matrix(&dynamics, apart, still, still, matrix) == SPIDERMILL_PAPER_OUT_OF_REACH,
        "a pose out of reach");
  puts("agrees");
  return 0;
}
