"""The SpiderMill as a plant that shares no code with modelmill: point masses on closed-form kinematics.

Each rigid body of the planar M structure is replaced by three point masses on its axis, which have its mass, centre and
moment of inertia (eq. (1) of the paper, J. Wittenburg, Dynamics of Systems of Rigid Bodies, 1977). Forces follow from
d'Alembert's principle. Jacobians are complex-step derivatives, so that no derivative is written by hand.
"""

import numpy as np

STEP = 1e-30  # complex step: exact to rounding
DIFFERENCE = 1e-6  # step of the derivative of a Jacobian along the motion, s


class Geometry:
    """Lengths in m; coordinates that the model file writes as zero have names of their own."""

    def __init__(self):
        self.d1, self.d3, self.b, self.dA, self.Bx, self.By = 1.13, 1.03, 0.90, 0.45, -0.75, 0.05
        # Zeros of the model file: y of the contact points on the cranks, and of the couplers' ends.
        self.A_left, self.A_right, self.R3m, self.R3m_right = 0.0, 0.0, 0.0, 0.0


# Table 1 of the paper, column MSC.ADAMS.
MASSES = dict(m1=50.9597, m2=7.9538, m3=14.5773, m4=12.4560, dc1=0.565, dc3=0.515, Ic12=6.3195, Ic32=1.6173)
GRAVITY = 9.81


def _turned(direction, along, across):
    """A vector with these components along a direction and across it (counterclockwise)."""
    x, y = direction
    return np.array([along * x - across * y, along * y + across * x])


def _points(q, geometry):
    """Directions and origins: cranks, elbows, directions of the couplers."""
    g = geometry
    left, right = (np.array([np.cos(a), np.sin(a)]) for a in q)
    zero = np.zeros_like(q[0])
    base = np.array([g.b + zero, zero])
    elbows = g.d1 * left, base + g.d1 * right
    # Both couplers meet below the line through the elbows: intersection of two circles.
    radius = [np.hypot(g.d3, g.R3m), np.hypot(g.d3, g.R3m_right)]
    apart = elbows[1] - elbows[0]
    square = apart[0] ** 2 + apart[1] ** 2
    along = 0.5 * (1 + (radius[0] ** 2 - radius[1] ** 2) / square)
    across = -np.sqrt(radius[0] ** 2 / square - along**2)
    platform = elbows[0] + _turned(apart, along, across)
    couplers = []
    for elbow, offset in zip(elbows, (g.R3m, g.R3m_right)):
        # The end of a coupler is at (d3, offset) of its frame.
        to = (platform - elbow) / (g.d3**2 + offset**2)
        couplers.append(_turned(to, g.d3, -offset))
    return left, right, base, elbows, couplers, platform


def _bodies(q, geometry, masses):
    """Point masses: pairs of mass and place."""
    left, right, base, elbows, couplers, platform = _points(q, geometry)
    found = []

    def body(origin, direction, mass, centre, inertia):
        arm = 0.3
        side = inertia / (2 * arm**2)
        for at, share in ((centre - arm, side), (centre, mass - 2 * side), (centre + arm, side)):
            found.append((share, origin + at * direction))

    m = masses
    body(0 * base, left, m["m1"], m["dc1"], m["Ic12"])
    body(base, right, m["m1"], m["dc1"], m["Ic12"])
    body(elbows[0], couplers[0], m["m3"], m["dc3"], m["Ic32"])
    body(elbows[1], couplers[1], m["m3"], m["dc3"], m["Ic32"])
    found += [(m["m2"], elbows[0]), (m["m2"], elbows[1]), (m["m4"], platform)]
    return found


def _lengths(q, geometry):
    """Lengths of both drives."""
    g = geometry
    left, right, base, *_ = _points(q, geometry)
    zero = np.zeros_like(q[0])
    contacts = _turned(left, g.dA, g.A_left), base + _turned(right, g.dA, g.A_right)
    pivots = np.array([g.Bx + zero, g.By + zero]), np.array([g.b - g.Bx + zero, g.By + zero])
    return np.array([np.sqrt(((c - p) ** 2).sum(axis=0)) for c, p in zip(contacts, pivots)])


def _jacobian(function, q):
    """Derivatives by both coordinates, along a new last axis but one."""
    columns = []
    for k in range(2):
        moved = q.astype(complex)
        moved[k] += 1j * STEP
        columns.append(np.imag(function(moved)) / STEP)
    return np.array(columns)


def _second(function, q, rate):
    """The derivative of the Jacobian along the motion, times the rates."""
    ahead, back = (_jacobian(function, q + s * DIFFERENCE * rate) for s in (1, -1))
    change = (ahead - back) / (2 * DIFFERENCE)
    return sum(change[k] * rate[k] for k in range(2))


def drive_motion(q, qd, qdd, geometry):
    """Length, rate and acceleration of each drive."""
    lengths = lambda q: _lengths(q, geometry)
    jacobian = _jacobian(lengths, q)
    rate = sum(jacobian[k] * qd[k] for k in range(2))
    return lengths(q), rate, sum(jacobian[k] * qdd[k] for k in range(2)) + _second(lengths, q, qd)


def forces(q, qd, qdd, geometry=None, masses=None):
    """Forces of both drives, N, positive if they push; arrays `[coordinate][sample]`."""
    geometry, masses = geometry or Geometry(), masses or MASSES
    moments = np.zeros_like(q)
    for k in range(len(_bodies(q, geometry, masses))):
        place = lambda q, k=k: _bodies(q, geometry, masses)[k][1]
        mass = _bodies(q, geometry, masses)[k][0]
        jacobian = _jacobian(place, q)
        acceleration = sum(jacobian[i] * qdd[i] for i in range(2)) + _second(place, q, qd)
        acceleration[1] += GRAVITY
        for i in range(2):
            moments[i] += mass * (jacobian[i] * acceleration).sum(axis=0)
    # Each drive acts on both coordinates by its lever arms.
    arms = _jacobian(lambda q: _lengths(q, geometry), q)
    matrix = np.moveaxis(arms, 2, 0)
    return np.linalg.solve(matrix, moments.T[:, :, None])[:, :, 0].T


def motion(random, seconds=7.0, rate=250, harmonics=5):
    """A periodic motion within the limits of the model file: times, positions, rates, accelerations."""
    t = np.arange(0, seconds, 1 / rate)
    omega = 2 * np.pi / seconds
    while True:
        q, qd, qdd = (np.zeros((2, len(t))) for _ in range(3))
        for i, middle in enumerate((1.80, 1.341593)):
            q[i] += middle
            for k in range(1, harmonics + 1):
                a, b = random.normal(size=2) * 0.16 / k
                w = k * omega
                q[i] += a * np.sin(w * t) + b * np.cos(w * t)
                qd[i] += w * (a * np.cos(w * t) - b * np.sin(w * t))
                qdd[i] -= w * w * (a * np.sin(w * t) + b * np.cos(w * t))
        is_wide = all(np.ptp(x) > 0.35 for x in q)
        within = all(abs(x - m).max() < 0.29 for x, m in zip(q, (1.80, 1.341593)))
        if is_wide and within and abs(qd).max() < 1.2 and abs(qdd).max() < 4.0:
            return t, q, qd, qdd
