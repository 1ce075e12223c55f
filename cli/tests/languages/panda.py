"""Holds the Python module of the Panda against the reference table, and against Pinocchio where it can be imported.

    python panda.py <folder of the module> <folder of reference tables>
"""

import csv
import math
import pathlib
import sys

sys.path.insert(0, sys.argv[1])
try:
    import numpy as np
except ImportError:
    print("skipped: this Python has no numpy")
    sys.exit(0)
import panda

tables = pathlib.Path(sys.argv[2])
table = np.loadtxt(tables / "pinocchio-panda.csv", delimiter=",", skiprows=1)
with open(tables / "pinocchio-panda-parameters.csv") as file:
    parameters = {name: float(value) for name, value in next(csv.DictReader(file)).items()}
p = panda.base_parameters(parameters)
assert p.shape == (len(panda.BASE_PARAMETERS),) == (43,)
assert panda.COORDINATES == [f"q{k}" for k in range(1, 8)] and panda.CONSTANTS["g"] == 9.81


def close(found, expected, tolerance, what):
    error = np.abs(found - expected).max() / np.abs(expected).max()
    assert error < tolerance, f"{what}: {error}"


# Many states at once, read as they lie in memory; on one core and on all.
q, qd, qdd, expected = (np.ascontiguousarray(table[:, 7 * k : 7 * k + 7].T) for k in range(4))
for parallel in (False, True):
    tau = panda.inverse_dynamics(q, qd, qdd, p, parallel=parallel)
    assert tau.shape == expected.shape == (7, 40) and tau.flags["C_CONTIGUOUS"]
    close(tau, expected, 1e-12, "torques")
h = panda.regressor(q, qd, qdd)
assert h.shape == (7, 43, 40)
close(np.einsum("dbi,b->di", h, p), expected, 1e-12, "regressor times parameters")

# The equation of motion: M q'' + c + g + e are the torques of the table, and forward dynamics give their accelerations.
M, bias = panda.mass_matrix(q, qd, p), panda.bias(q, qd, p)
assert M.shape == (7, 7, 40) and bias.shape == (7, 40)
close(np.einsum("abi,bi->ai", M, qdd) + bias, expected, 1e-12, "M q'' + bias")
parts = panda.coriolis(q, qd, p) + panda.gravity(q, qd, p) + panda.effects(q, qd, p)
close(parts, bias, 1e-12, "c + g + e")
found = panda.forward_dynamics(q, qd, expected, p)
close(found, qdd, 1e-9, "accelerations")
close(panda.inverse_dynamics(q, qd, found, p), expected, 1e-12, "torques of the accelerations found")
lengths, rates, jacobian = panda.drives(q, qd, qdd)
assert (lengths == q).all() and (rates == qd).all() and (jacobian == np.eye(7)[:, :, None]).all()
assert panda.PASSIVE == [] and not hasattr(panda, "passive")
none = np.zeros((7, 0))
assert panda.mass_matrix(none, none, p).shape == (7, 7, 0)

# One state.
one = [np.ascontiguousarray(x[:, 3]) for x in (q, qd, qdd)]
close(panda.inverse_dynamics(*one, p), expected[:, 3], 1e-12, "torques of one state")
close(panda.regressor(*one) @ p, expected[:, 3], 1e-12, "regressor of one state")
assert panda.mass_matrix(*one[:2], p).shape == (7, 7) and panda.drives(*one)[2].shape == (7, 7)
close(panda.forward_dynamics(*one[:2], np.ascontiguousarray(expected[:, 3]), p), one[2], 1e-9, "accelerations of one state")
weightless = panda.inverse_dynamics(one[0], np.zeros(7), np.zeros(7), p, geometry={"g": 0.0})
assert np.abs(weightless).max() == 0.0


# What is wrong is said.
def refused(kind, says, call):
    try:
        call()
    except kind as error:
        assert says in str(error), f"{error} instead of {says}"
        return
    raise AssertionError(f"nobody says {says}")


broken = q.copy()
broken[2, 5] = math.nan
refused(ValueError, "at sample 5: `q3` is NaN, infinite or too large to compute with", lambda: panda.regressor(broken, qd, qdd))
refused(ValueError, "qd has shape [7, 39]; expected [7, 40]", lambda: panda.regressor(q, qd[:, 1:].copy(), qdd))
refused(ValueError, "numpy.ascontiguousarray(q)", lambda: panda.regressor(table[:, :7].T, qd, qdd))
refused(ValueError, "numpy.ascontiguousarray(qd)", lambda: panda.regressor(q, np.asfortranarray(qd), qdd))
refused(ValueError, "at sample 5: `q3` is no number", lambda: panda.mass_matrix(broken, qd, p))
refused(ValueError, "forces has shape [6, 40]; expected [7, 40]", lambda: panda.forward_dynamics(q, qd, expected[:6].copy(), p))
refused(ValueError, "p has 42 numbers", lambda: panda.inverse_dynamics(q, qd, qdd, p[1:]))
refused(KeyError, "no `m8`", lambda: panda.base_parameters({"m8": 1.0}))

try:
    import pinocchio as pin
except ImportError:
    print("agrees with the table; this Python has no pinocchio")
    sys.exit(0)

model = pin.Model()
model.gravity = pin.Motion(np.array([0, 0, -9.81]), np.zeros(3))
parent = 0
dh = [(0, 0, 0.333), (0, -1, 0), (0, 1, 0.316), (0.0825, 1, 0), (-0.0825, -1, 0.384), (0, 1, 0), (0.088, 1, 0)]
for k, (a, quarter, d) in enumerate(dh, 1):
    turn = pin.AngleAxis(quarter * math.pi / 2, np.eye(3)[0]).toRotationMatrix()
    placement = pin.SE3(turn, np.array([a, 0, 0]) + turn @ np.array([0, 0, d]))
    parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"q{k}")
    order = ["M", "MX", "MY", "MZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ"]
    body = pin.Inertia.FromDynamicParameters(np.array([parameters[f"{e}{k}"] for e in order]))
    model.appendBodyToJoint(parent, body, pin.SE3.Identity())
data = model.createData()
rng = np.random.default_rng(1)
q, qd, qdd = rng.uniform(-2, 2, (3, 7, 500))
expected = np.array([pin.rnea(model, data, q[:, i], qd[:, i], qdd[:, i]) for i in range(500)]).T
close(panda.inverse_dynamics(q, qd, qdd, p), expected, 1e-12, "Pinocchio's torques")
mass = np.array([np.triu(m) + np.triu(m, 1).T for m in (pin.crba(model, data, q[:, i]).copy() for i in range(500))])
close(panda.mass_matrix(q, qd, p).transpose(2, 0, 1), mass, 1e-12, "Pinocchio's mass matrices")
print(f"agrees with the table and with Pinocchio {pin.__version__}")
