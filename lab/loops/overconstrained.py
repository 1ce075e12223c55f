"""Forty-five overconstrained loops from a seed, moved by revolute and prismatic drives, compared with independent mechanics.

usage: overconstrained.py MODELMILL [--seeds N] [--family NAME] [--keep FOLDER]

For each: the number of base parameters against the rank of a regressor computed by `mechanics`, and forces of emitted C99 against its
forces, and its loops must close. The exit status is 1 if a verdict is wrong or refused.
"""

import argparse
import collections
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from mechanics import Mechanism
from precision import SIXTY_DIGITS, as_doubles
from rank import DROPPED, KEPT, random_positions, rank_of, states_near_nominal

sys.path.insert(0, str(Path(__file__).parent.parent / "random-descriptions"))
from imported import EmittedModel  # noqa: E402


# Of independent coordinates, relative to their nominal values.
SPREAD = 0.5


class ModelFile:
    """A model file, written entry by entry."""

    def __init__(self, name, rng):
        self.name, self.rng = name, rng
        self.constants, self.coordinates, self.rest = {"g": (9.81, "m/s^2")}, {}, []
        # Expressions of constants that must satisfy a relation exactly.
        self.relations = {}

    def constant(self, name, value, unit="m"):
        self.constants[name] = (float(value), unit)
        return name

    def length(self, name, low=0.2, high=0.6):
        return self.constant(name, round(self.rng.uniform(low, high), 3))

    def relation(self, name, expression):
        """A length that other constants determine: the file has its 17 digits, the independent mechanics all digits."""
        self.relations[name] = expression
        values = {n: value for n, (value, _) in self.constants.items()}
        return self.constant(name, eval(expression, {"sin": math.sin, "sqrt": math.sqrt}, values))

    def coordinate(self, name, nominal=0.0, passive=True):
        self.coordinates[name] = [nominal, passive]
        return name

    def frame(self, name, on, xyz=None, rpy=None, joint=None, dh=None):
        text = f'\n[[frame]]\nname = "{name}"\non = "{on}"\n'
        quote = lambda x: f'"{x}"' if isinstance(x, str) else repr(x)
        if xyz or rpy:
            parts = []
            if xyz:
                parts.append(f"xyz = [{', '.join(map(quote, xyz))}]")
            if rpy:
                parts.append(f"rpy = [{', '.join(map(quote, rpy))}]")
            text += f"transform = {{ {', '.join(parts)} }}\n"
        if dh:
            text += "modified_dh = { " + ", ".join(f"{k} = {quote(v)}" for k, v in dh.items()) + " }\n"
        if joint:
            text += f"joint = {{ {joint} }}\n"
        self.rest.append(text)
        return name

    def point(self, name, on, at):
        self.rest.append(f'\n[[point]]\nname = "{name}"\non = "{on}"\nat = [{", ".join(repr(x) if not isinstance(x, str) else chr(34) + x + chr(34) for x in at)}]\n')
        return name

    def joins(self, name, one, other):
        self.rest.append(f'\n[[loop]]\nname = "{name}"\njoins = ["{one}", "{other}"]\n')

    def welds(self, name, one, other):
        self.rest.append(f'\n[[loop]]\nname = "{name}"\nwelds = ["{one}", "{other}"]\n')

    def hinge_by_points(self, name, ends, axis="y", width=0.1):
        """A hinge: two points on its axis coincide. `ends` are two pairs of frame and point."""
        for side in (1, -1):
            names = []
            for k, (frame, at) in enumerate(ends):
                shifted = list(at)
                i = "xyz".index(axis)
                shifted[i] = side * width
                names.append(self.point(f"{name}_{'pm'[side < 0]}{k}", frame, shifted))
            self.joins(f"{name}_{'pm'[side < 0]}", *names)

    def part(self, frame):
        rng = self.rng
        mass, centre = rng.uniform(0.5, 3), rng.uniform(-0.1, 0.2, 3)
        spread = rng.normal(size=(3, 3)) * 0.1
        second = mass * (spread @ spread.T + np.outer(centre, centre) + 0.002 * np.eye(3))
        i = np.trace(second) * np.eye(3) - second
        v = dict(XX=i[0, 0], XY=i[0, 1], XZ=i[0, 2], YY=i[1, 1], YZ=i[1, 2], ZZ=i[2, 2], MX=mass * centre[0], MY=mass * centre[1], MZ=mass * centre[2], M=mass)
        self.rest.append(f'\n[[part]]\non = "{frame}"\nlinear = {{ all = "_{frame}", nominal = {{ {", ".join(f"{k} = {round(x, 6)}" for k, x in v.items())} }} }}\n')

    def drive(self, coordinate):
        self.rest.append(f'\n[[drive]]\nname = "d_{coordinate}"\njoint = "{coordinate}"\n')

    def push(self, on, at, base_at, moved):
        """A piston from the ground to a point of a body, whose slide moves the mechanism in place of the coordinate `moved`."""
        self.coordinates[moved][1] = True
        self.coordinate("pz"), self.coordinate("py"), self.coordinate("s", 0.75, False)
        self.frame("swing", "base", xyz=list(base_at), joint='revolute = "pz"')
        self.frame("tilt", "swing", joint='revolute = "py", axis = "y"')
        self.frame("rod", "tilt", joint='prismatic = "s", axis = "x"')
        self.part("tilt"), self.part("rod")
        self.joins("piston", self.point("rod_end", "rod", [0, 0, 0]), self.point("rod_at", on, at))
        self.drive("s")

    def text(self, nominal=None):
        nominal = nominal or {}
        out = f'schema = 1\nname = "{self.name}"\ngravity = [0, 0, "-g"]\n\n[constants]\n'
        for name, (value, unit) in self.constants.items():
            out += f'{name} = {{ value = {value!r}, unit = "{unit}" }}\n'
        out += "\n[coordinates]\n"
        for name, (value, passive) in self.coordinates.items():
            out += f'{name} = {{ nominal = {float(nominal.get(name, value))!r}{", passive = true" if passive else ""} }}\n'
        return out + "".join(self.rest)


def chain(f, links, moved_first=True, closure="weld"):
    """A closed chain of hinges: `links` are (a, alpha, d) of each, from the joint before to the next one."""
    n = len(links)
    on = "base"
    for k in range(n if closure == "weld" else n - 1):
        q = f.coordinate(f"q{k + 1}", 0.0, k > 0)
        dh = {"theta": q}
        if k > 0:
            a, alpha, d = links[k - 1]
            dh = {"a": a, "alpha": alpha, "d": d, "theta": q}
        on = f.frame(f"l{k + 1}", on, dh={key: v for key, v in dh.items() if v != 0})
        f.part(on)
    if closure == "weld":
        a, alpha, d = links[-1]
        f.frame("end", on, dh={key: v for key, v in {"a": a, "alpha": alpha, "d": d}.items() if v != 0})
        # The last link carries the base: its frame coincides with it.
        f.welds("ring", "end", "base")
    else:
        a, alpha, d = links[-2]
        f.frame("last", on, dh={key: v for key, v in {"a": a, "alpha": alpha, "d": d}.items() if v != 0})
        a, alpha, d = links[-1]
        # The last hinge, seen from the base: the inverse of the last link.
        f.frame("back", "base", joint=None, rpy=[f"-{alpha}" if isinstance(alpha, str) else -alpha, 0, 0])
        f.frame("foot", "back", xyz=[f"-{a}" if isinstance(a, str) else -a, 0, f"-{d}" if isinstance(d, str) else -d])
        f.hinge_by_points("ring", [("last", [0, 0, 0]), ("foot", [0, 0, 0])], axis="z")


def sarrus(f, slide):
    legs = f.rng.integers(2, 4)
    turns = [0.0, round(f.rng.uniform(1.0, 2.0), 2), round(f.rng.uniform(3.5, 4.5), 2)][:legs]
    f.length("R", 0.28, 0.33), f.length("rp", 0.22, 0.27), f.length("l1", 0.28, 0.34), f.length("l2", 0.28, 0.34)
    f.coordinate("z", 0.42, not slide)
    for k, turn in enumerate(turns):
        f.coordinate(f"u{k}", 0.7, not (k == 0 and not slide)), f.coordinate(f"v{k}", -1.6)
        f.frame(f"si{k}", "base", rpy=[0, 0, f.constant(f"psi{k}", turn, "rad") if turn else 0])
        f.frame(f"lo{k}", f"si{k}", xyz=["R", 0, 0], joint=f'revolute = "u{k}", axis = "y"')
        f.frame(f"up{k}", f"lo{k}", xyz=[0, 0, "l1"], joint=f'revolute = "v{k}", axis = "y"')
        f.part(f"lo{k}"), f.part(f"up{k}")
    for n in ("x", "y", "ya", "pt", "rl"):
        f.coordinate(n)
    f.frame("pl", "base", joint='free = ["x", "y", "z", "ya", "pt", "rl"], axes = "zyx"')
    f.part("pl")
    for k, turn in enumerate(turns):
        f.frame(f"ps{k}", "pl", rpy=[0, 0, f"psi{k}" if turn else 0])
        f.hinge_by_points(f"h{k}", [(f"up{k}", [0, 0, "l2"]), (f"ps{k}", ["rp", 0, 0])])
    f.drive("z" if slide else "u0")


def bennett_links(f, a="a", b="b", alpha="alpha", beta="beta"):
    rng = f.rng
    f.constant(alpha, round(rng.uniform(0.5, 1.0), 3), "rad"), f.constant(beta, round(rng.uniform(1.1, 1.5), 3), "rad")
    f.length(a, 0.3, 0.5)
    f.relation(b, f"{a} * sin({beta}) / sin({alpha})")


def bennett(f, slide):
    bennett_links(f)
    chain(f, [("a", "alpha", 0), ("b", "beta", 0), ("a", "alpha", 0), ("b", "beta", 0)], closure=f.rng.choice(["weld", "points"]))
    f.coordinates["q1"][0] = 0.9
    if slide:
        f.push("l1", [0.15, 0.05, 0.05], [0.3, -0.5, -0.3], "q1")
    else:
        f.drive("q1")


def goldberg(f, slide):
    rng = f.rng
    f.constant("alpha", round(rng.uniform(0.5, 0.8), 3), "rad"), f.constant("beta", round(rng.uniform(0.9, 1.2), 3), "rad"), f.constant("gamma", round(rng.uniform(0.6, 0.85), 3), "rad")
    f.length("a", 0.3, 0.5)
    for n, angle in (("b", "beta"), ("c", "gamma")):
        f.relation(n, f"a * sin({angle}) / sin(alpha)")
    chain(f, [("b + c", "beta + gamma", 0), ("a", "alpha", 0), ("c", "gamma", 0), ("b", "beta", 0), ("a", "alpha", 0)])
    f.coordinates["q1"][0] = 0.8
    if slide:
        f.push("l1", [0.15, 0.05, 0.05], [0.3, -0.5, -0.3], "q1")
    else:
        f.drive("q1")


def bricard(f, slide):
    rng = f.rng
    if rng.random() < 0.5:
        # Trihedral.
        v = [round(rng.uniform(0.25, 0.4), 3) for _ in range(5)]
        if v[0] ** 2 + v[2] ** 2 + v[4] ** 2 < v[1] ** 2 + v[3] ** 2 + 0.01:
            v = [0.4, 0.3, 0.38, 0.35, 0.33]
        for k, x in enumerate(v):
            f.constant(f"a{k + 1}", x)
        f.relation("a6", "sqrt(a1**2 + a3**2 + a5**2 - a2**2 - a4**2)")
        links = [(f"a{k + 1}", "pi/2" if k % 2 == 0 else "-pi/2", 0) for k in range(6)]
    else:
        # Line-symmetric.
        for k in range(3):
            f.length(f"a{k + 1}", 0.25, 0.45), f.constant(f"al{k + 1}", round(rng.uniform(0.6, 1.4), 3), "rad"), f.length(f"d{k + 1}", 0.05, 0.15)
        links = [(f"a{k % 3 + 1}", f"al{k % 3 + 1}", f"d{k % 3 + 1}") for k in range(6)]
    chain(f, links)
    f.coordinates["q1"][0] = 1.2
    if slide:
        f.push("l1", [0.15, 0.05, 0.05], [0.3, -0.5, -0.3], "q1")
    else:
        f.drive("q1")


def tripteron(f, slide):
    f.length("l1", 0.4, 0.5), f.length("l2", 0.4, 0.5), f.length("h", 0.05, 0.1)
    for n in ("x", "y", "z", "ya", "pt", "rl"):
        f.coordinate(n, {"x": 0.1, "y": 0.05, "z": 0.08}.get(n, 0.0))
    # Axes of the legs: z of each side is x, y and z of the base.
    sides = [["0", "pi/2", "0"], ["-pi/2", "0", "0"], ["0", "0", "0"]]
    for k, side in enumerate(sides):
        f.coordinate(f"s{k}", 0.1, not slide), f.coordinate(f"u{k}", 0.6, slide), f.coordinate(f"v{k}", -1.3), f.coordinate(f"w{k}", 0.7)
        f.frame(f"si{k}", "base", rpy=side)
        f.frame(f"car{k}", f"si{k}", xyz=[-0.45, -0.4, 0], joint=f'prismatic = "s{k}"')
        f.frame(f"lo{k}", f"car{k}", joint=f'revolute = "u{k}"')
        f.frame(f"up{k}", f"lo{k}", xyz=["l1", 0, 0], joint=f'revolute = "v{k}"')
        f.part(f"car{k}"), f.part(f"lo{k}"), f.part(f"up{k}")
        f.drive(f"s{k}" if slide else f"u{k}")
    f.frame("pl", "base", joint='free = ["x", "y", "z", "ya", "pt", "rl"], axes = "zyx"')
    f.part("pl")
    for k, side in enumerate(sides):
        del f.coordinates[f"w{k}"]
        f.frame(f"ps{k}", "pl", rpy=side)
        f.hinge_by_points(f"h{k}", [(f"up{k}", ["l2", 0, 0]), (f"ps{k}", ["h", 0, 0])], axis="z")


def exechon(f, slide):
    """Two legs of universal, prismatic and revolute joints in one plane, and one of spherical, prismatic and revolute joints."""
    rng = f.rng
    f.length("B", 0.3, 0.4), f.length("b", 0.1, 0.16), f.length("C", 0.35, 0.45), f.length("c", 0.12, 0.2)
    # A symmetric pose, from which Newton's method starts.
    lean = math.asin((f.constants["B"][0] - f.constants["b"][0]) / 0.9)
    for n, nominal in {"a1": 0.0, "b1": lean, "c1": -lean, "a3": 0.0, "b3": -lean, "c3": lean, "sa": 0.0, "sb": -0.25, "sc": 0.0}.items():
        f.coordinate(n, nominal, slide or n not in ("a1", "b1", "b3"))
    for k in (1, 2, 3):
        f.coordinate(f"l{k}", 0.9, not slide)
    for k, side in ((1, ""), (3, "-")):
        f.frame(f"u{k}", "base", xyz=[0, f"{side}B", 0], joint=f'universal = ["a{k}", "b{k}"], axes = "yx"')
        f.frame(f"p{k}", f"u{k}", joint=f'prismatic = "l{k}"')
    f.frame("pl", "p1", joint='revolute = "c1", axis = "x"')
    f.frame("s2", "base", xyz=["C", 0, 0], joint='spherical = ["sa", "sb", "sc"], axes = "xyz"')
    f.frame("p2", "s2", joint='prismatic = "l2"')
    for frame in ("u1", "p1", "pl", "u3", "p3", "s2", "p2"):
        f.part(frame)
    closure = rng.choice(["weld", "points", "point"])
    if closure == "weld":
        f.frame("end", "p3", joint='revolute = "c3", axis = "x"')
        f.frame("at", "pl", xyz=[0, "-2*b", 0])
        f.welds("plane", "end", "at")
    else:
        del f.coordinates["c3"]
        if closure == "points":
            f.hinge_by_points("plane", [("p3", [0, 0, 0]), ("pl", [0, "-2*b", 0])], axis="x")
        else:
            f.joins("plane", f.point("plane0", "p3", [0, 0, 0]), f.point("plane1", "pl", [0, "-2*b", 0]))
    f.frame("arm", "pl", xyz=["c", "-b", 0])
    f.hinge_by_points("side", [("p2", [0, 0, 0]), ("arm", [0, 0, 0])])
    for n in ("l1", "l2", "l3") if slide else ("a1", "b1", "b3"):
        f.drive(n)


def planar_ring(f, lengths, slide, closure, moved="q1"):
    """A four-bar linkage about z with the ground along x."""
    ground, crank, coupler, rocker = lengths
    f.coordinate("q1", 0.9, False), f.coordinate("q2", -0.7), f.coordinate("q3", 1.9 if closure != "weld" else 1.9)
    f.frame("crank", "base", joint='revolute = "q1"')
    f.frame("coupler", "crank", xyz=[crank, 0, 0], joint='revolute = "q2"')
    f.part("crank"), f.part("coupler")
    f.frame("stand", "base", xyz=[ground, 0, 0])
    if closure == "weld":
        f.frame("rocker", "coupler", xyz=[coupler, 0, 0], joint='revolute = "q3"')
        f.coordinate("q4", 0.5)
        f.frame("foot", "rocker", xyz=[rocker, 0, 0], joint='revolute = "q4"')
        f.welds("ring", "foot", "stand")
    elif closure == "points_on_foot":
        f.frame("rocker", "coupler", xyz=[coupler, 0, 0], joint='revolute = "q3"')
        f.hinge_by_points("ring", [("rocker", [rocker, 0, 0]), ("stand", [0, 0, 0])], axis="z")
    else:
        f.frame("rocker", "stand", joint='revolute = "q3"')
        f.hinge_by_points("ring", [("rocker", [rocker, 0, 0]), ("coupler", [coupler, 0, 0])], axis="z")
    f.part("rocker")
    if slide:
        f.push("crank", [0.15, 0.05, 0.05], [0.3, -0.5, -0.3], moved)
    else:
        f.drive(moved)


def kite(f, slide):
    f.length("long", 0.45, 0.6), f.length("short", 0.25, 0.32)
    planar_ring(f, ["long", "long", "short", "short"] if f.rng.random() < 0.5 else ["long", "short", "short", "long"], slide,
                f.rng.choice(["weld", "points", "points_on_foot"]))


def welded_four_bar(f, slide):
    f.length("ground", 0.5, 0.55), f.length("crank_l", 0.2, 0.25), f.length("coupler_l", 0.45, 0.5), f.length("rocker_l", 0.4, 0.45)
    planar_ring(f, ["ground", "crank_l", "coupler_l", "rocker_l"], slide, "weld")


def three_cranks(f, slide):
    """A beam on three parallel cranks, one too many."""
    f.length("r", 0.2, 0.3), f.length("e1", 0.2, 0.3), f.length("e2", 0.45, 0.6)
    f.coordinate("q1", 0.9, False), f.coordinate("q2", -0.9), f.coordinate("q3", 0.9), f.coordinate("q4", 0.9)
    f.frame("c1", "base", joint='revolute = "q1"')
    f.frame("beam", "c1", xyz=["r", 0, 0], joint='revolute = "q2"')
    f.frame("c2", "base", xyz=["e1", 0.05, 0], joint='revolute = "q3"')
    f.frame("c3", "base", xyz=["e2", 0, 0], joint='revolute = "q4"')
    for n in ("c1", "beam", "c2", "c3"):
        f.part(n)
    by_points = f.rng.random() < 0.5
    for k, (c, e, y) in enumerate((("c2", "e1", 0.05), ("c3", "e2", 0))):
        if by_points:
            f.hinge_by_points(f"h{k}", [(c, ["r", 0, 0]), ("beam", [e, y, 0])], axis="z")
        else:
            f.joins(f"h{k}", f.point(f"a{k}", c, ["r", 0, 0]), f.point(f"b{k}", "beam", [e, y, 0]))
    if slide:
        f.push("c1", [0.15, 0.05, 0.05], [0.3, -0.5, -0.3], "q1")
    else:
        f.drive("q1")


FAMILIES = {f.__name__: f for f in (sarrus, bennett, goldberg, bricard, tripteron, exechon, kite, welded_four_bar, three_cranks)}


def closed(f, rng):
    """The file with nominal values at which the loops close and have their usual freedom; none if none is found."""
    base = {n: v for n, (v, _) in f.coordinates.items()}
    for attempt in range(12):
        trial = dict(base)
        for n, (value, passive) in f.coordinates.items():
            if passive and attempt:
                # Farther from the first guess with every attempt.
                trial[n] = value + rng.uniform(-1, 1) * min(0.3 * attempt, 3.0) * (1.0 if n[0] in "uvqwp" else 0.1)
        m = Mechanism(f.text(trial))
        q = np.array([trial[n] for n in m.active])
        solved = m.solve(q, 0 * q, 0 * q)
        if solved is None or np.abs(solved[0][0]).max() > 7:
            continue
        # As many freedoms as independent coordinates, also nearby.
        smallest = [m.conditions[m.conditions > 1e-7].min()]
        rank = (m.conditions > 1e-7).sum()
        near = m.solve(q + 0.05, 0 * q, 0 * q, solved[0][0])
        if near is None or rank != len(m.passive) or smallest[0] < 0.02 or np.abs(near[0][0] - solved[0][0]).max() > 1.0:
            continue
        trial.update(zip(m.passive, solved[0][0]))
        return f.text(trial)
    return None


def check(program, path):
    done = subprocess.run([program, "check", str(path), "--json", "--time-limit", "200"], capture_output=True, text=True)
    if done.returncode:
        return None, done.stderr or done.stdout[:2000]
    return json.loads(done.stdout), done.stderr


def judge(program, path, rng, relations={}):
    """The verdict on modelmill's answer (right, wrong, refused), and the numbers that it rests on."""
    start = time.time()
    answer, said = check(program, path)
    took = time.time() - start
    if answer is None or not answer.get("valid"):
        return "refused", f"{took:.1f} s: {said.strip() or answer}"
    n_base = answer["base_parameters"]
    text = f"{n_base} base parameters ({answer['reduction']['name']}, {took:.1f} s)"
    try:
        start, file = time.process_time(), path.read_text()
        rough, exact = Mechanism(file), Mechanism(file, SIXTY_DIGITS, relations)
        rank, last, beyond, n_states = rank_of(rough, exact, rng, SPREAD, n_base + 12)
        text += f", rank {rank} (pivots {last:.1e} and {beyond:.1e}, {n_states} states, {time.process_time() - start:.1f} s of CPU)"
        model = EmittedModel(program, path)
        worst, count = force_difference(rough, exact, model, rng)
        gap, n_closed = largest_gap(rough, model, rng)
        text += f", forces to {worst:.1e} ({count['compared']} states), loops to {gap:.1e} ({n_closed} states)"
    except Exception as fault:  # noqa: BLE001
        return "wrong", f"{text}, fault: {fault!r}"
    faults = {
        f"the rank has no step from above {KEPT} to below {DROPPED}": last < KEPT,
        "the number of base parameters is not the rank": n_base != rank,
        "forces differ": worst > 1e-9,
        "emitted code leaves loops open": gap > 1e-9,
        f"emitted code refuses {count['refused']} states": count["refused"],
        f"emitted code takes another assembly at {count['other assembly']} states": count["other assembly"],
        "no state is compared": not count["compared"],
    }
    wrong = [name for name, is_so in faults.items() if is_so]
    return ("wrong" if wrong else "right"), f"{text}{': ' * bool(wrong)}{', '.join(wrong)}"


def emitted_passive(m, model, q):
    """Passive coordinates of emitted C99, in the order of the file."""
    passive = dict(zip(model.passive, model.passive_motion(q, 0 * q, 0 * q)[0]))
    return np.array([passive[n] for n in m.passive])


def force_difference(rough, exact, model, rng):
    """The largest difference of the forces of emitted C99, relative to the largest force, and a count of states."""
    values, worst, count = exact.parameter_values(), 0.0, collections.Counter()
    for q, start in states_near_nominal(rough, rng, SPREAD, 8):
        qd, qdd = rng.uniform(-1, 1, len(q)), rng.uniform(-1, 1, len(q))
        expected = as_doubles(exact.regressor(q, qd, qdd, start) @ values)
        try:
            forces = exact.drive_rows(q, qd, start).T @ model.forces(q, qd, qdd)
            passive = emitted_passive(rough, model, q)
        except ArithmeticError:
            count["refused"] += 1
            continue
        # Other passive coordinates that close the loops as well.
        is_other = np.abs(passive - start).max(initial=0.0) > 1e-6 and gaps(rough, [q], [passive]).max() < 1e-9
        count["other assembly" if is_other else "compared"] += 1
        if not is_other:
            worst = max(worst, np.abs(forces - expected).max() / max(1.0, np.abs(expected).max()))
    return worst, count


def gaps(m, q, passive):
    """The largest gap of all loops, for each pose."""
    q, passive = np.array(q), np.array(passive)
    poses = m.poses(m.values(q, 0 * q, 0 * q, (passive, 0 * passive, 0 * passive)))
    return np.abs(m.closure(poses).a).max(axis=-1, initial=0.0)


def largest_gap(m, model, rng, n_states=1000):
    """The largest gap of all loops at passive coordinates of emitted C99, and the number of states that it does not refuse."""
    closed = []
    for q in random_positions(m, rng, SPREAD, n_states):
        try:
            closed.append((q, emitted_passive(m, model, q)))
        except ArithmeticError:
            pass
    return (gaps(m, *zip(*closed)).max() if closed else 0.0), len(closed)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--family")
    parser.add_argument("--keep")
    chosen = parser.parse_args()
    folder = Path(chosen.keep or tempfile.mkdtemp())
    folder.mkdir(exist_ok=True, parents=True)
    count = collections.Counter()
    for name, family in FAMILIES.items():
        if chosen.family and name != chosen.family:
            continue
        for seed in range(chosen.first, chosen.first + chosen.seeds):
            rng = np.random.default_rng([seed, len(name), ord(name[0])])
            slide = seed % 2 == 0
            # Dimensions for which no closed pose is found are drawn again.
            for _ in range(15):
                f = ModelFile(f"{name}_{seed}", rng)
                family(f, slide)
                text = closed(f, rng)
                if text is not None:
                    break
            label = f"{name}-{seed} ({'slide' if slide else 'turn'})"
            if text is None:
                count["not closed"] += 1
                print(f"{label}: not closed", flush=True)
                continue
            path = folder / f"{name}-{seed}.toml"
            path.write_text(text)
            verdict, text = judge(chosen.program, path, rng, f.relations)
            count[verdict] += 1
            print(f"{label}: {verdict}, {text[:1500]}", flush=True)
    print(dict(count))
    sys.exit(1 if count["wrong"] or count["refused"] else 0)


if __name__ == "__main__":
    main()
