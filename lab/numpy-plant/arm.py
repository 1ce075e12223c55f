"""Random arms as plants that share no code with modelmill: recursive Newton-Euler equations on modified DH frames.

The frames are those of J. Craig, Introduction to Robotics, chapter 3; the recursion is that of J. Luh, M. Walker, R. Paul,
"On-line computational scheme for mechanical manipulators", 1980, with first moments and inertias about frame origins, so
that the forces are linear in them. Arrays are `[joint][sample]`, vectors `[3][sample]`.
"""

import dataclasses

import numpy as np

GRAVITY = 9.81
# Families of names for coordinates and drives; `{}` is the number of the joint.
NAMES = [
    ("q{}", "joint{}"),
    ("phi_{}", "M{}"),
    ("axis{}", "torque{}"),
    ("pos_{}", "effort_{}"),
    ("J{}_angle", "J{}_motor"),
    ("alpha{}", "drv{}"),
]


@dataclasses.dataclass
class Arm:
    """An arm; the model file of `model_text` describes it, except for what a case adds."""

    a: np.ndarray  # lengths along x before the joint, m
    alpha: np.ndarray  # angles about x before the joint, rad
    d: np.ndarray  # lengths along z, m
    mass: np.ndarray  # masses, kg
    moment: np.ndarray  # first moments about the frame origin, kg m, [joint][3]
    inertia: np.ndarray  # inertias about the frame origin, kg m^2, [joint][3][3]
    gravity: np.ndarray  # acceleration of gravity in the base frame, m/s^2
    viscous: np.ndarray
    coulomb: np.ndarray
    rotor: np.ndarray  # inertia of the drive at the joint, kg m^2; zero if the model has none
    offset: np.ndarray  # constant force; zero if the model has none
    coordinates: list
    drives: list

    @property
    def joints(self):
        return len(self.a)


def cross(u, v):
    return np.cross(u, v, axis=0)


def body_about_origin(mass, centre, inertia):
    """First moment and inertia about the frame origin of a body with inertia about its centre."""
    return mass * centre, inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))


def draw_arm(random):
    """An arm with two to six revolute joints."""
    n = int(random.integers(2, 7))
    alpha = np.array([0.0] + [float(random.choice([0, np.pi / 2, -np.pi / 2], p=[0.4, 0.3, 0.3])) for _ in range(n - 1)])
    a = np.array([0.0] + [float(random.choice([0.0, random.uniform(0.15, 0.6)], p=[0.3, 0.7])) for _ in range(n - 1)])
    # Two joints on one line of parallel axes would be one joint.
    for k in range(1, n):
        if a[k] == 0 and alpha[k] == 0:
            a[k] = random.uniform(0.15, 0.6)
    d = np.array([0.0] + [float(random.choice([0.0, random.uniform(-0.2, 0.4)])) for _ in range(n - 1)])
    # Gravity acts in the plane of the first links in one arm of two.
    down = np.array([0, 0, -1.0]) if random.random() < 0.6 and np.any(alpha) else np.array([0, -1.0, 0])
    mass = 8.0 * random.uniform(0.4, 1.6, n) * 0.6 ** np.arange(n)
    moment, inertia = np.zeros((n, 3)), np.zeros((n, 3, 3))
    for k in range(n):
        reach = a[k + 1] if k + 1 < n else 0.15
        centre = np.array([reach * random.uniform(0.3, 0.6), *random.uniform(-0.06, 0.06, 2)])
        size = np.array([reach + 0.1, *random.uniform(0.05, 0.15, 2)])
        box = mass[k] / 12 * np.diag(size @ size - size**2)
        axes, _ = np.linalg.qr(random.normal(size=(3, 3)))
        small = axes @ np.diag(0.1 * np.diag(box)) @ axes.T
        moment[k], inertia[k] = body_about_origin(mass[k], centre, box + small)
    knows_rotor, knows_offset = random.random(2) < [0.5, 0.3]
    coordinate, drive = NAMES[random.integers(len(NAMES))]
    numbers = range(1, n + 1) if random.random() < 0.7 else range(n)
    arm = Arm(
        a, alpha, d, mass, moment, inertia, GRAVITY * down,
        viscous=np.zeros(n), coulomb=np.zeros(n), rotor=np.zeros(n), offset=np.zeros(n),
        coordinates=[coordinate.format(k) for k in numbers], drives=[drive.format(k) for k in numbers],
    )  # fmt: skip
    # Friction, rotors and offsets have the size of the forces of each drive.
    size = force_scale(arm, random)
    arm.viscous = size * random.uniform(0.04, 0.15, n)
    arm.coulomb = size * random.uniform(0.05, 0.2, n)
    if knows_rotor:
        arm.rotor = size * random.uniform(0.02, 0.06, n)
    if knows_offset:
        arm.offset = size * random.uniform(-0.1, 0.1, n)
    return arm


def force_scale(arm, random):
    """The rms force of each drive in a typical motion, and a share of the largest: no drive is idle."""
    q, qd, qdd = fourier(random, arm.joints, np.arange(0, 10, 0.05), 10.0)
    rms = np.sqrt((rigid_forces(arm, q, qd, qdd) ** 2).mean(axis=1))
    return np.maximum(rms, 0.02 * rms.max())


def rigid_forces(arm, q, qd, qdd, payload=None):
    """Torques of the rigid bodies, N m. `payload` is a point mass on the last link, kg, with its place, m; the mass may
    be an array over samples."""
    n, samples = q.shape
    zero = np.zeros(samples)
    axis = np.array([zero, zero, zero + 1])
    w, wd = np.zeros((3, samples)), np.zeros((3, samples))
    acceleration = np.repeat(-arm.gravity[:, None], samples, axis=1)
    frames, forces, moments = [], [], []
    for k in range(n):
        ca, sa, ct, st = np.cos(arm.alpha[k]), np.sin(arm.alpha[k]), np.cos(q[k]), np.sin(q[k])
        # Columns of the rotation from this frame to the one before.
        rotation = np.array([[ct, -st, zero], [st * ca, ct * ca, zero - sa], [st * sa, ct * sa, zero + ca]])
        place = np.repeat(np.array([arm.a[k], -sa * arm.d[k], ca * arm.d[k]])[:, None], samples, axis=1)
        into = lambda v: np.einsum("jis,js->is", rotation, v)
        acceleration = into(acceleration + cross(wd, place) + cross(w, cross(w, place)))
        before = into(w)
        wd = into(wd) + cross(before, axis * qd[k]) + axis * qdd[k]
        w = before + axis * qd[k]
        mass, moment, inertia = arm.mass[k] + zero, np.repeat(arm.moment[k][:, None], samples, 1), arm.inertia[k]
        turned = np.einsum("ij,js->is", inertia, wd) + cross(w, np.einsum("ij,js->is", inertia, w))
        if payload is not None and k == n - 1:
            load, at = payload
            at = np.repeat(np.asarray(at)[:, None], samples, 1)
            mass, moment = mass + load, moment + load * at
            # r x (a + wd x r + w x (w x r)) without r x a, which is in the first moment.
            turned = turned + load * cross(at, cross(wd, at) + cross(w, cross(w, at)))
        forces.append(mass * acceleration + cross(wd, moment) + cross(w, cross(w, moment)))
        moments.append(turned + cross(moment, acceleration))
        frames.append((rotation, place))
    torque = np.zeros_like(q)
    force, moment = np.zeros((3, samples)), np.zeros((3, samples))
    for k in reversed(range(n)):
        force, moment = force + forces[k], moment + moments[k]
        torque[k] = moment[2]
        rotation, place = frames[k]
        force, moment = (np.einsum("ijs,js->is", rotation, v) for v in (force, moment))
        moment = moment + cross(place, force)
    return torque


def fourier(random, n, t, period, harmonics=5):
    """A periodic motion of all joints that fills some rad."""
    q, qd, qdd = (np.zeros((n, len(t))) for _ in range(3))
    for i in range(n):
        weights = random.normal(size=(harmonics, 2)) / np.arange(1, harmonics + 1)[:, None] ** 0.7
        weights *= random.uniform(0.6, 1.1) / np.sqrt((weights**2).sum() / 2)
        for k in range(1, harmonics + 1):
            w, (a, b) = 2 * np.pi * k / period, weights[k - 1]
            q[i] += a * np.sin(w * t) + b * np.cos(w * t)
            qd[i] += w * (a * np.cos(w * t) - b * np.sin(w * t))
            qdd[i] -= w * w * (a * np.sin(w * t) + b * np.cos(w * t))
        q[i] += random.uniform(-1.2, 1.2)
    return q, qd, qdd


def point_to_point(random, n, t, dwell=0.25):
    """Moves between random poses (quintic polynomials) with a dwell after each."""
    q, qd, qdd = (np.zeros((n, len(t))) for _ in range(3))
    pose, at = random.uniform(-1.2, 1.2, n), 0.3
    q += pose[:, None]
    while at < t[-1]:
        duration = random.uniform(0.7, 1.4)
        step = random.uniform(-1.4, 1.4, n) - pose
        s = np.clip((t - at) / duration, 0, 1)
        q += step[:, None] * (10 * s**3 - 15 * s**4 + 6 * s**5)
        qd += step[:, None] / duration * (30 * s**2 - 60 * s**3 + 30 * s**4)
        qdd += step[:, None] / duration**2 * (60 * s - 180 * s**2 + 120 * s**3)
        pose, at = pose + step, at + duration + dwell
    # Before the first and after the last sample of a move nothing moves.
    return q, qd, qdd


def friction_sign(random, qd):
    """The sign of each rate; at standstill dry friction takes any value up to its size, one for each stop."""
    sign = np.sign(qd)
    for i, rate in enumerate(qd):
        stands = np.abs(rate) < 1e-9
        stops = np.cumsum(np.diff(stands.astype(int), prepend=0) > 0)
        shares = random.uniform(-1, 1, stops.max() + 1)
        sign[i] = np.where(stands, shares[stops], sign[i])
    return sign


def model_text(arm, unknown=(), lengths=None):
    """The model file. `unknown` are pairs of kind and joint that it lacks; `lengths` replaces `a`."""
    lengths = arm.a if lengths is None else lengths
    n = arm.joints
    down = ["0", "0", "0"]
    down[int(np.argmax(np.abs(arm.gravity)))] = '"-g"'
    lines = ["schema = 1", 'name = "arm"', 'title = "Arm"', f"gravity = [{', '.join(down)}]", "", "[constants]"]
    lines += [f'g = {{ value = {GRAVITY}, unit = "m/s^2" }}']
    for symbol, values in (("a", lengths), ("d", arm.d)):
        lines += [f'{symbol}{k} = {{ value = {x:.6g}, unit = "m" }}' for k, x in enumerate(values) if x]
    lines += ["", "[coordinates]", *(f"{name} = {{ nominal = {0.3 + 0.2 * k:.1f} }}" for k, name in enumerate(arm.coordinates))]
    turns = {0.0: None, np.pi / 2: "pi/2", -np.pi / 2: "-pi/2"}
    for k in range(n):
        terms = [f'a = "a{k}"'] if lengths[k] else []
        terms += [f'd = "d{k}"'] if arm.d[k] else []
        terms += [f'alpha = "{turns[arm.alpha[k]]}"'] if arm.alpha[k] else []
        terms += [f'theta = "{arm.coordinates[k]}"']
        on = "base" if k == 0 else f"link{k}"
        lines += ["", "[[frame]]", f'name = "link{k + 1}"', f'on = "{on}"']
        lines += [f"modified_dh = {{ {', '.join(terms)} }}"]
        j, h = arm.inertia[k], arm.moment[k]
        values = dict(XX=j[0, 0], XY=j[0, 1], XZ=j[0, 2], YY=j[1, 1], YZ=j[1, 2], ZZ=j[2, 2], MX=h[0], MY=h[1], MZ=h[2], M=arm.mass[k])
        lines += ["", "[[part]]", f'on = "link{k + 1}"']
        nominal = ", ".join(f"{symbol} = {x:.10g}" for symbol, x in values.items())
        lines += [f"linear = {{ all = {k + 1}, nominal = {{ {nominal} }} }}"]
    for k in range(n):
        lines += ["", "[[drive]]", f'name = "{arm.drives[k]}"', f'joint = "{arm.coordinates[k]}"']
    known = [("viscous_friction", "Fv", arm.viscous), ("coulomb_friction", "Fc", arm.coulomb)]
    known += [("drive_inertia", "Ia", arm.rotor), ("force_offset", "F0", arm.offset)]
    for kind, symbol, values in known:
        for k in range(n):
            if values[k] and (kind, k) not in unknown:
                lines += ["", "[[effect]]", f'name = "{kind}_{k}"', f'kind = "{kind}"', f'at = "{arm.drives[k]}"']
                lines += [f'parameters = {{ {symbol} = {{ name = "{symbol}_{k}", nominal = {values[k]:.8g} }} }}']
    return "\n".join(lines) + "\n"
