"""Holds the Python module of the paper's SpiderMill against the independent table: loops, passive angles, equation of motion.

    python spidermill.py <folder of the module> <folder of reference tables>
"""

import pathlib
import sys

sys.path.insert(0, sys.argv[1])
import numpy as np
import spidermill_paper as mill

table = np.loadtxt(pathlib.Path(sys.argv[2]) / "spidermill-paper-H.csv", delimiter=",", skiprows=1).T.copy()
q, qd, qdd, angles, forces = table[0:2], table[2:4], table[4:6], table[6:8], table[30:32]
p = mill.base_parameters()
assert len(mill.PASSIVE) == 2 and mill.DRIVES


def close(found, expected, tolerance, what):
    error = np.abs(found - expected).max() / np.abs(expected).max()
    assert error < tolerance, f"{what}: {error}"


passive, rates, accelerations = mill.passive(q, qd, qdd)
assert passive.shape == rates.shape == accelerations.shape == (2, 40)
close(passive, angles, 1e-12, "passive angles")
step = 1e-6
ahead = mill.passive(q + step * qd, qd, qdd)[0]
close((ahead - passive) / step, rates, 1e-4, "passive rates")
close(mill.inverse_dynamics(q, qd, qdd, p), forces, 1e-12, "forces")
jacobian = mill.drives(q, qd, qdd)[2]
generalised = np.einsum("dai,di->ai", jacobian, forces)
M, bias = mill.mass_matrix(q, qd, p), mill.bias(q, qd, p)
close(np.einsum("abi,bi->ai", M, qdd) + bias, generalised, 1e-12, "M q'' + bias")
found = mill.forward_dynamics(q, qd, forces, p)
close(found, qdd, 1e-9, "accelerations")
close(mill.inverse_dynamics(q, qd, found, p), forces, 1e-12, "forces of the accelerations found")
apart = q.copy()
apart[:, 7] = 3.14, 0.0
try:
    mill.passive(apart, qd, qdd)
except ValueError as error:
    assert "at sample 7: the loops cannot close" in str(error), error
else:
    raise AssertionError("a pose out of reach has passive coordinates")
print("agrees with the table")
