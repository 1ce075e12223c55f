/* Holds the C99 of the paper's SpiderMill against the independent table: passive angles, columns of H, forces.
 * Usage: spidermill_c99 FOLDER-OF-TABLES. Prints "agrees" if all is well. */

#include "spidermill_paper.h"
#include "table.h"

#define STATES 40
#define COLUMNS 32

static double table[STATES][COLUMNS];

int main(int argc, char **argv) {
  /* Where the table has the columns of the first drive that are retained. */
  static const int retained[SPIDERMILL_PAPER_N_BASE] = {8, 9, 12, 14, 16};
  static spidermill_paper_dynamics dynamics;
  spidermill_paper_geometry geometry;
  spidermill_paper_parameters parameters;
  double base[SPIDERMILL_PAPER_N_BASE], forces[2], h[2 * SPIDERMILL_PAPER_N_BASE], passive[6], found[2];
  double apart[2] = {3.14, 0.0}, still[2] = {0.0, 0.0};
  int i, d, b;
  check(argc == 2, "usage: spidermill_c99 FOLDER-OF-TABLES");
  read_table(argv[1], "spidermill-paper-H.csv", &table[0][0], STATES, COLUMNS);
  spidermill_paper_default_geometry(&geometry);
  spidermill_paper_nominal_parameters(&parameters);
  check(spidermill_paper_base_parameters(&geometry, &parameters, base) == SPIDERMILL_PAPER_OK, "base parameters");
  check(spidermill_paper_prepare(&dynamics, &geometry, base) == SPIDERMILL_PAPER_OK, "prepare");
  for (i = 0; i < STATES; ++i) {
    const double *q = table[i], *qd = q + 2, *qdd = q + 4;
    check(spidermill_paper_inverse_dynamics(&dynamics, q, qd, qdd, forces) == SPIDERMILL_PAPER_OK, "forces");
    check(spidermill_paper_regressor(&dynamics, q, qd, qdd, h) == SPIDERMILL_PAPER_OK, "regressor");
    check(spidermill_paper_passive(&dynamics, q, qd, qdd, passive) == SPIDERMILL_PAPER_OK, "passive coordinates");
    check(spidermill_paper_forward(&dynamics, q, qd, qdd, forces, found) == SPIDERMILL_PAPER_OK, "forward dynamics");
    for (d = 0; d < 2; ++d) {
      check(fabs(passive[d] - q[6 + d]) < 1e-11, "passive angles");
      check(fabs(forces[d] - q[30 + d]) < 1e-11 * (1000 + fabs(q[30 + d])), "forces miss the table");
      check(fabs(found[d] - qdd[d]) < 1e-8 * (1 + fabs(qdd[d])), "accelerations do not come back");
      for (b = 0; b < SPIDERMILL_PAPER_N_BASE; ++b) {
        double expected = q[retained[b] + 11 * d];
        check(fabs(h[d * SPIDERMILL_PAPER_N_BASE + b] - expected) < 1e-11 * (100 + fabs(expected)), "columns of H");
      }
    }
  }
  check(spidermill_paper_inverse_dynamics(&dynamics, apart, still, still, forces) == SPIDERMILL_PAPER_OUT_OF_REACH,
        "a pose out of reach");
  check(spidermill_paper_self_test(&geometry) == 0, "self-test");
  puts("agrees");
  return 0;
}
