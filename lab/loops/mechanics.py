"""An independent reader and mechanics of model files: numbers only, nothing of modelmill's.

Positions and their first two derivatives with respect to time are computed together (`Jet`); passive coordinates follow by Newton's
method from all closures; forces are those of d'Alembert's principle with the ten linear parameters of each body. Read are frames
(`transform`, `modified_dh`, joints), coordinates (`passive`, `follows`), points, loops (`joins`, `welds`), parts, lumped masses, and
drives of joints and between two points. Numbers are doubles or have sixty digits (`precision`).
"""

import tomllib

import numpy as np

from precision import DOUBLE, as_doubles, as_numbers, elementwise


class Jet:
    """A value, vector or matrix with its first and second derivative with respect to time.

    Axes in front are for several motions at once.
    """

    __array_priority__ = 1000

    def __init__(self, a, b=None, c=None):
        self.a = as_numbers(a)
        self.b = np.zeros(self.a.shape) if b is None else as_numbers(b)
        self.c = np.zeros(self.a.shape) if c is None else as_numbers(c)

    @staticmethod
    def of(x):
        return x if isinstance(x, Jet) else Jet(x)

    def __add__(self, o):
        o = Jet.of(o)
        return Jet(self.a + o.a, self.b + o.b, self.c + o.c)

    __radd__ = __add__

    def __neg__(self):
        return Jet(-self.a, -self.b, -self.c)

    def __pos__(self):
        return self

    def __sub__(self, o):
        return self + (-Jet.of(o))

    def __rsub__(self, o):
        return Jet.of(o) - self

    def product(self, o, times):
        o = Jet.of(o)
        return Jet(times(self.a, o.a), times(self.b, o.a) + times(self.a, o.b),
                   times(self.c, o.a) + 2 * times(self.b, o.b) + times(self.a, o.c))

    def __mul__(self, o):
        return self.product(o, np.multiply)

    def __rmul__(self, o):
        return Jet.of(o) * self

    def __matmul__(self, o):
        return self.product(o, np.matmul)

    def turned(self, vector):
        """A rotation times a vector."""
        return self.product(vector, lambda m, v: (m @ v[..., None])[..., 0])

    def __rmatmul__(self, o):
        return Jet.of(o) @ self

    def apply(self, f, d, dd):
        return Jet(f, d * self.b, dd * self.b**2 + d * self.c)

    def __truediv__(self, o):
        o = Jet.of(o)
        return self * o.apply(1 / o.a, -1 / o.a**2, 2 / o.a**3)

    def __rtruediv__(self, o):
        return Jet.of(o) / self

    def __pow__(self, n):
        return self.apply(self.a**n, n * self.a ** (n - 1), n * (n - 1) * self.a ** (n - 2) if n not in (0, 1) else 0.0)

    @property
    def T(self):
        return Jet(*(np.swapaxes(x, -1, -2) for x in (self.a, self.b, self.c)))

    def __getitem__(self, k):
        return Jet(self.a[k], self.b[k], self.c[k])


def elementary(f, d, dd):
    return lambda x: x.apply(f(x.a), d(x.a), dd(x.a)) if isinstance(x, Jet) else f(x)


SIN, COS, SQRT, EXP, TANH = map(elementwise, ("sin", "cos", "sqrt", "exp", "tanh"))
sin = elementary(SIN, COS, lambda x: -SIN(x))
cos = elementary(COS, lambda x: -SIN(x), lambda x: -COS(x))
sqrt = elementary(SQRT, lambda x: 0.5 / SQRT(x), lambda x: -0.25 / (x * SQRT(x)))
exp = elementary(EXP, EXP, EXP)
tanh = elementary(TANH, lambda x: 1 - TANH(x) ** 2, lambda x: -2 * TANH(x) * (1 - TANH(x) ** 2))
FUNCTIONS = {"sin": sin, "cos": cos, "sqrt": sqrt, "exp": exp, "tanh": tanh, "__builtins__": {}}


def turn(axis, angle):
    """Rotation about x, y or z by a jet."""
    c, s = cos(Jet.of(angle)), sin(Jet.of(angle))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrices = []
    for order, (cc, ss) in enumerate(((c.a, s.a), (c.b, s.b), (c.c, s.c))):
        m = np.zeros(np.shape(cc) + (3, 3), dtype=cc.dtype)
        m[..., i, i] = m[..., j, j] = cc
        m[..., j, i], m[..., i, j] = ss, -ss
        if order == 0:
            m[..., 3 - i - j, 3 - i - j] = 1.0
        matrices.append(m)
    return Jet(*matrices)


def stack(values):
    """A vector of jets."""
    values = [Jet.of(v) for v in values]
    return Jet(*(np.stack(np.broadcast_arrays(*(getattr(v, x) for v in values)), axis=-1) for x in "abc"))


KEYS = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")


class Polynomial:
    """A polynomial in the parameters of a file, with the values of constants as numbers."""

    def __init__(self, terms):
        self.terms = {m: c for m, c in terms.items() if c != 0.0}

    @staticmethod
    def of(x):
        return x if isinstance(x, Polynomial) else Polynomial({(): x})

    def __add__(self, o):
        out = dict(self.terms)
        for m, c in Polynomial.of(o).terms.items():
            out[m] = out.get(m, 0.0) + c
        return Polynomial(out)

    __radd__ = __add__

    def __neg__(self):
        return Polynomial({m: -c for m, c in self.terms.items()})

    def __sub__(self, o):
        return self + (-Polynomial.of(o))

    def __rsub__(self, o):
        return -self + o

    def __mul__(self, o):
        out = {}
        for m, c in self.terms.items():
            for n, d in Polynomial.of(o).terms.items():
                powers = dict(m)
                for name, e in n:
                    powers[name] = powers.get(name, 0) + e
                key = tuple(sorted(powers.items()))
                out[key] = out.get(key, 0.0) + c * d
        return Polynomial(out)

    __rmul__ = __mul__

    def __truediv__(self, o):
        return self * (1.0 / o)

    def __pow__(self, n):
        out = Polynomial({(): 1.0})
        for _ in range(int(n)):
            out = out * self
        return out


def vee(m):
    return np.stack([m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], axis=-1) / 2


class Mechanism:
    """A model file. `relations` are expressions that define constants and replace their decimals in the file."""

    def __init__(self, text, precision=DOUBLE, relations={}):
        self.precision = precision
        self.file = tomllib.loads(text, parse_float=precision.read)
        f = self.file
        self.constants = {**FUNCTIONS, "pi": precision.pi, "number": precision.read}
        for name, entry in f.get("constants", {}).items():
            self.constants[name] = self.plain(relations.get(name, entry["value"] if isinstance(entry, dict) else entry))
        coordinates = f["coordinates"]
        self.follows = {n: e["follows"] for n, e in coordinates.items() if "follows" in e}
        self.passive = [n for n, e in coordinates.items() if e.get("passive")]
        self.active = [n for n in coordinates if n not in self.follows and n not in self.passive]
        self.nominal = {n: self.plain(e.get("nominal", 0.0)) for n, e in coordinates.items() if n not in self.follows}
        self.points = {p["name"]: p for p in f.get("point", [])}
        self.gravity = np.array([self.plain(g) for g in f.get("gravity", [0, 0, 0])])
        if len(self.gravity) == 2:
            self.gravity = np.r_[self.gravity, 0.0]
        self.at_nominal = np.array([self.nominal[n] for n in self.passive])

    def plain(self, x):
        return self.precision.read(eval(self.precision.expression(x), dict(self.constants)) if isinstance(x, str) else x)

    def value(self, x, values):
        if isinstance(x, str):
            return Jet.of(eval(self.precision.expression(x), {**self.constants, **values}))
        return Jet(self.precision.read(x))

    def poses(self, values):
        """Rotation and position of all frames, from jets of the coordinates."""
        values = dict(values)
        for _ in range(len(self.follows)):
            for name, text in self.follows.items():
                try:
                    values[name] = self.value(text, values)
                except NameError:
                    pass
        out = {"base": (Jet(np.eye(3)), Jet(np.zeros(3)))}
        waiting = list(self.file["frame"])
        while waiting:
            entry = waiting.pop(0)
            if entry["on"] not in out:
                waiting.append(entry)
                continue
            r, p = out[entry["on"]]
            if "transform" in entry:
                t = entry["transform"]
                at = list(t.get("xyz", [])) + [0.0] * (3 - len(t.get("xyz", [])))
                p = p + r.turned(stack([self.value(x, values) for x in at]))
                for axis, angle in zip("zyx", reversed(t.get("rpy", [0, 0, 0]))):
                    r = r @ turn(axis, self.value(angle, values))
            if "modified_dh" in entry:
                t = {k: self.value(x, values) for k, x in entry["modified_dh"].items()}
                p = p + r.turned(stack([t.get("a", 0.0), 0.0, 0.0]))
                r = r @ turn("x", t.get("alpha", 0.0))
                p = p + r.turned(stack([0.0, 0.0, t.get("d", 0.0)]))
                r = r @ turn("z", t.get("theta", 0.0))
            joint = entry.get("joint", {})
            axis = joint.get("axis", "z")
            sign = -1.0 if axis.startswith("-") else 1.0
            axis = axis.lstrip("-")
            if "revolute" in joint:
                r = r @ turn(axis, sign * self.value(joint["revolute"], values))
            elif "prismatic" in joint:
                step = [0.0, 0.0, 0.0]
                step["xyz".index(axis)] = sign * self.value(joint["prismatic"], values)
                p = p + r.turned(stack(step))
            elif "spherical" in joint:
                for letter, name in zip(joint.get("axes", "zyx"), joint["spherical"]):
                    r = r @ turn(letter, self.value(name, values))
            elif "universal" in joint:
                for letter, name in zip(joint.get("axes", "xy"), joint["universal"]):
                    r = r @ turn(letter, self.value(name, values))
            elif "cylindrical" in joint:
                names = joint["cylindrical"]
                step = [0.0, 0.0, 0.0]
                step["xyz".index(axis)] = self.value(names[1], values)
                p = p + r.turned(stack(step))
                r = r @ turn(axis, self.value(names[0], values))
            elif "planar" in joint:
                names = joint["planar"]
                p = p + r.turned(stack([self.value(names[0], values), self.value(names[1], values), 0.0]))
                r = r @ turn("z", self.value(names[2], values))
            elif "free" in joint:
                names = joint["free"]
                if len(names) != 6:
                    raise ValueError("quaternions are not read here")
                p = p + r.turned(stack([self.value(n, values) for n in names[:3]]))
                for letter, name in zip(joint.get("axes", "zyx"), names[3:]):
                    r = r @ turn(letter, self.value(name, values))
            elif joint:
                raise ValueError(f"joint {joint}")
            out[entry["name"]] = (r, p)
        return out

    def point(self, name, poses):
        entry = self.points[name]
        r, p = poses[entry["on"]]
        at = list(entry["at"]) + [0.0] * (3 - len(entry["at"]))
        return p + r.turned(stack([self.value(x, {}) for x in at]))

    def closure(self, poses):
        """Residuals of all loops."""
        rows = []
        for loop in self.file.get("loop", []):
            if "joins" in loop:
                one, other = (self.point(n, poses) for n in loop["joins"])
                rows.append(one - other)
            elif "welds" in loop:
                (r, p), (s, q) = (poses[n] for n in loop["welds"])
                rows.append(r.T.turned(p - q))
                e = r.T @ s
                # All entries: the skew part alone vanishes at half a turn as well.
                rows.append(Jet(*((x - offset).reshape(x.shape[:-2] + (9,)) for x, offset in ((e.a, np.eye(3)), (e.b, 0.0), (e.c, 0.0)))))
            else:
                raise ValueError(f"loop {loop}")
        # A loop may not depend on what differs between the motions.
        shape = np.broadcast_shapes(*(getattr(r, x).shape[:-1] for r in rows for x in "abc")) if rows else ()
        spread = lambda x: np.broadcast_to(x, shape + x.shape[-1:])  # noqa: E731
        return Jet(*(np.concatenate([spread(getattr(r, x)) for r in rows], axis=-1) if rows else np.zeros(0) for x in "abc"))

    def values(self, *motions):
        """Jets of all coordinates, from values, rates and accelerations of the independent ones and of the passive ones."""
        out = {}
        for names, motion in zip((self.active, self.passive), (motions[:3], motions[3])):
            rows = [self.precision.array(x).T for x in motion]
            out.update((n, Jet(*np.broadcast_arrays(*(row[k] for row in rows)))) for k, n in enumerate(names))
        return out

    def solve(self, q, qd, qdd, start=None):
        """Passive coordinates with their rates and accelerations, and the Jacobian of their rates; None if loops stay open."""
        n, m = len(self.active), len(self.passive)
        x = self.precision.array(self.at_nominal if start is None else start)
        zero, zeros = np.zeros(m), np.zeros(n)
        if not self.file.get("loop"):
            return np.zeros((3, 0)), np.zeros((0, n))

        def residual(qd, qdd, xd, xdd):
            return self.closure(self.poses(self.values(q, qd, qdd, (x, xd, xdd))))

        def jacobian():
            return residual(zeros, zeros, np.eye(m), np.zeros((m, m))).b.T.reshape(-1, m)
        largest = np.inf
        for k in range(30):
            r = residual(zeros, zeros, zero, zero).a
            if largest > 1e-6:
                # Small steps do not change the Jacobian.
                phi = as_doubles(jacobian())
            step = np.linalg.lstsq(phi, as_doubles(-r), rcond=1e-9)[0]
            largest = np.abs(step).max()
            x = x + step * min(1.0, 0.5 / max(largest, 1e-30))
            if largest < self.precision.step or k > 12 and np.abs(r).max() > 0.1:
                break
        if np.abs(residual(zeros, zeros, zero, zero).a).max() > self.precision.residual:
            return None
        phi = jacobian()
        self.conditions = np.linalg.svd(as_doubles(phi), compute_uv=False)
        ofs = self.least_squares(phi, -residual(np.eye(n), np.zeros((n, n)), np.zeros((n, m)), np.zeros((n, m))).b.reshape(n, -1).T)
        xd = ofs @ qd
        xdd = self.least_squares(phi, -residual(qd, qdd, xd, zero).c)
        return np.array([x, xd, xdd]), ofs

    def least_squares(self, phi, right):
        """Solution of redundant equations: by the pseudo-inverse in double precision, corrected with all digits."""
        inverse = np.linalg.pinv(as_doubles(phi), rcond=1e-9)
        x = inverse @ right
        for _ in range(self.precision.n_corrections):
            x = x + inverse @ (right - phi @ x)
        return x

    def follow(self, q, n_steps=4):
        """Passive coordinates at `q`, followed from the nominal pose; none if the way is not passable."""
        first = np.array([self.nominal[n] for n in self.active])
        zero, passive = np.zeros(len(first)), None
        for k in range(n_steps + 1):
            solved = self.solve(first + (q - first) * k / n_steps, zero, zero, passive)
            if solved is None or (passive is not None and np.abs(solved[0][0] - passive).max(initial=0.0) > 0.6):
                return None
            passive = solved[0][0]
        return passive

    def bodies(self):
        """Frame of each part and lumped mass, and its ten linear parameters as polynomials in the parameters of the file."""
        if hasattr(self, "known_bodies"):
            return self.known_bodies
        symbols = {n: Polynomial({((n, 1),): 1.0}) for n in self.file.get("parameters", {})}
        self.nominal_parameters = {n: self.precision.read(e.get("nominal", 0.0)) for n, e in self.file.get("parameters", {}).items()}

        def read(x):
            if isinstance(x, str):
                x = eval(self.precision.expression(x), {**self.constants, **symbols})
            return x if isinstance(x, Polynomial) else Polynomial({(): self.precision.read(x)})
        zero = Polynomial({})
        out = []
        for part in self.file.get("part", []):
            if "linear" in part:
                linear = dict(part["linear"])
                nominal = linear.pop("nominal", {})
                suffix = linear.pop("all", linear.pop("planar", None))
                keys = KEYS if "all" in part["linear"] else ("ZZ", "MX", "MY", "M") if "planar" in part["linear"] else ()
                ten = [zero] * 10
                for key in keys:
                    self.nominal_parameters[key + suffix] = self.precision.read(nominal.get(key, 0.0))
                    ten[KEYS.index(key)] = Polynomial({((key + suffix, 1),): 1.0})
                for key, x in linear.items():
                    ten[KEYS.index(key)] = read(x)
            else:
                ten = self.ten(read(part.get("mass", 0)), [read(x) for x in part.get("centre", [0, 0, 0])], {k: read(x) for k, x in part.get("inertia", {}).items()})
            out.append((part["on"], ten))
        for mass in self.file.get("lumped_mass", []):
            at = mass["at"]
            on = mass.get("on")
            if isinstance(at, str):
                on, at = self.points[at]["on"], self.points[at]["at"]
            out.append((on, self.ten(read(mass["mass"]), [read(x) for x in at], {})))
        self.known_bodies = out
        return out

    @staticmethod
    def ten(mass, centre, inertia):
        centre = list(centre) + [Polynomial({})] * (3 - len(centre))
        x, y, z = centre
        about = {"xx": y * y + z * z, "yy": x * x + z * z, "zz": x * x + y * y, "xy": -(x * y), "xz": -(x * z), "yz": -(y * z)}
        ten = [inertia.get(k.lower(), Polynomial({})) + mass * about[k.lower()] for k in KEYS[:6]]
        return ten + [mass * x, mass * y, mass * z, mass]

    def columns(self):
        """Products of parameters, and for each the entries of the ten parameters of all bodies."""
        bodies = self.bodies()
        found = {}
        for b, (_, ten) in enumerate(bodies):
            for k, polynomial in enumerate(ten):
                for monomial, factor in polynomial.terms.items():
                    found.setdefault(monomial, self.precision.array(np.zeros(10 * len(bodies))))[10 * b + k] += factor
        return found

    def parameter_values(self):
        """The value of each product."""
        self.bodies()
        return np.array([np.prod([self.nominal_parameters[n] ** e for n, e in monomial]) if monomial else 1.0 for monomial in self.columns()])

    def regressor(self, q, qd, qdd, start=None):
        """Forces along the independent coordinates: one row each, one column per product of parameters. None if the loops stay
        open."""
        solved = self.solve(q, qd, qdd, start)
        if solved is None:
            return None
        passive, by_rate = solved
        poses = self.poses(self.values(q, qd, qdd, passive))
        n = len(q)
        zeros = np.zeros((n, len(self.passive)))
        units = self.poses(self.values(q, np.eye(n), np.zeros((n, n)), (passive[0], by_rate.T, zeros)))
        blocks = []
        for frame, _ in self.bodies():
            r, p = poses[frame]
            # In the axes of the body.
            w = vee(r.a.T @ r.b)
            alpha = vee(r.a.T @ r.c)
            a = r.a.T @ (p.c - self.gravity)
            force, moment = [], []
            for unit in np.eye(10):
                i = np.array([[unit[0], unit[1], unit[2]], [unit[1], unit[3], unit[4]], [unit[2], unit[4], unit[5]]])
                c, m = unit[6:9], unit[9]
                force.append(m * a + np.cross(alpha, c) + np.cross(w, np.cross(w, c)))
                moment.append(np.cross(c, a) + i @ alpha + np.cross(w, i @ w))
            r1, p1 = units[frame]
            velocity = np.broadcast_to(p1.b, (n, 3)) @ r.a
            rotation = np.broadcast_to(vee(r.a.T @ r1.b), (n, 3))
            blocks.append(velocity @ np.array(force).T + rotation @ np.array(moment).T)
        # From ten columns of each body to one column of each product of parameters.
        return np.concatenate(blocks, axis=1) @ np.array(list(self.columns().values())).T

    def drive_rows(self, q, qd, start=None):
        """Rates of the drives for one unit of each independent rate."""
        n = len(q)
        passive, by_rate = self.solve(q, qd, 0 * qd, start)
        out = []
        for drive in self.file["drive"]:
            row = []
            for k in range(n):
                unit = np.eye(n)[k]
                values = self.values(q, unit, 0 * unit, (passive[0], by_rate @ unit, 0 * (by_rate @ unit)))
                if "joint" in drive:
                    extended = dict(values)
                    for name, text in self.follows.items():
                        extended[name] = self.value(text, extended)
                    row.append(float(self.value(drive["joint"], extended).b))
                else:
                    poses = self.poses(values)
                    d = self.point(drive["linear"]["to"], poses) - self.point(drive["linear"]["from"], poses)
                    row.append(float(d.a @ d.b / SQRT(d.a @ d.a)))
            out.append(row)
        return np.array(out)
