/* Holds the C library or, with PLAIN_C99, the C99 of the 3-RRR, whose loops are followed by Newton's method, against itself: M q'' + bias = J' f, forward
 * dynamics, and passive coordinates from the nominal pose and from one near by. Prints "agrees" if all is well. */

#include "three_rrr.h"

#include "check.h"

#ifdef PLAIN_C99
typedef three_rrr_geometry constants[1];
typedef three_rrr_parameters values[1];
#define three_rrr_forward_near(dynamics, q, qd, qdd, forces, near, found) three_rrr_forward(dynamics, q, qd, qdd, forces, found)
#else
typedef double constants[THREE_RRR_N_CONSTANTS];
typedef double values[THREE_RRR_N_PARAMETERS];
#endif

int main(void) {
  static three_rrr_dynamics dynamics;
  constants geometry;
  values parameters;
  double base[THREE_RRR_N_BASE], bias_near[3];
  const double nominal[3] = {-0.37568, 1.70899, -2.37896};
  double near[4], plain[4], passive[12], followed[12], motion[3 + 3 + 9], matrix[9], again[9], bias[3], forces[3], found[3];
  double worst = 0, largest = 0;
  three_rrr_default_geometry(geometry);
  three_rrr_nominal_parameters(parameters);
  check(three_rrr_base_parameters(geometry, parameters, base) == THREE_RRR_OK, "base parameters");
  check(three_rrr_prepare(&dynamics, geometry, base) == THREE_RRR_OK, "prepare");
  for (int i = 0; i < 50; ++i) {
    double q[3], qd[3], qdd[3];
    for (int k = 0; k < 3; ++k) {
      double phase = 0.05 * i + 2 * k;
      q[k] = nominal[k] + 0.1 * sin(phase);
      qd[k] = cos(1.3 * phase);
      qdd[k] = 3 * sin(0.7 * phase);
    }
    check(three_rrr_passive_position(&dynamics, q, plain) == THREE_RRR_OK, "passive position");
    if (i == 0) check(three_rrr_passive_position(&dynamics, q, near) == THREE_RRR_OK, "first pose");
    check(three_rrr_passive_position_near(&dynamics, q, near) == THREE_RRR_OK, "passive position from near by");
    check(three_rrr_passive(&dynamics, q, qd, qdd, passive) == THREE_RRR_OK, "passive coordinates");
    check(three_rrr_passive_near(&dynamics, q, qd, qdd, near, followed) == THREE_RRR_OK, "passive coordinates from near by");
    check(three_rrr_drives(&dynamics, q, qd, qdd, motion) == THREE_RRR_OK, "drives");
    check(three_rrr_mass_matrix(&dynamics, q, qd, qdd, matrix) == THREE_RRR_OK, "mass matrix");
    check(three_rrr_mass_matrix_near(&dynamics, q, qd, qdd, near, again) == THREE_RRR_OK, "mass matrix from near by");
    check(three_rrr_bias(&dynamics, q, qd, qdd, bias) == THREE_RRR_OK, "bias");
    check(three_rrr_bias_near(&dynamics, q, qd, qdd, near, bias_near) == THREE_RRR_OK, "bias from near by");
    check(three_rrr_inverse_dynamics(&dynamics, q, qd, qdd, forces) == THREE_RRR_OK, "forces");
    check(three_rrr_forward_near(&dynamics, q, qd, qdd, forces, near, found) == THREE_RRR_OK, "forward dynamics");
    for (int k = 0; k < 12; ++k) check(fabs(passive[k] - followed[k]) < 1e-11 * (1 + fabs(passive[k])), "followed otherwise");
    for (int k = 0; k < 4; ++k) check(fabs(passive[k] - plain[k]) < 1e-12 && fabs(near[k] - plain[k]) < 1e-12, "positions");
    for (int k = 0; k < 3; ++k) {
      double total = bias[k], generalised = 0;
      check(fabs(bias[k] - bias_near[k]) < 1e-11 * (1 + fabs(bias[k])), "another bias from near by");
      for (int j = 0; j < 3; ++j) {
        total += matrix[3 * k + j] * qdd[j];
        generalised += motion[6 + 3 * j + k] * forces[j];
        check(fabs(matrix[3 * k + j] - matrix[3 * j + k]) < 1e-11 && fabs(matrix[3 * k + j] - again[3 * k + j]) < 1e-11,
              "the mass matrix is not symmetric, or another from near by");
      }
      worst = fmax(worst, fabs(total - generalised));
      largest = fmax(largest, fabs(forces[k]));
      check(fabs(found[k] - qdd[k]) < 1e-10 * (1 + fabs(qdd[k])), "accelerations do not come back");
    }
  }
  check(largest > 1 && worst < 1e-12 * largest, "M q'' + bias misses the forces");
  puts("agrees");
  return 0;
}
