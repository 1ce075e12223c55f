#!/usr/bin/env python3
"""How often `modelmill diagnose` is right about arms, recordings and faults that it has never seen.

    python3 lab/numpy-plant/unseen.py --program target/release/modelmill [--seed 1] [--count N] [--only KIND,...] [--jobs 2] [--keep DIR]

Each case draws an arm of two to six joints (arm.py, which shares no code with modelmill), a motion (Fourier series or moves
from point to point), two recordings (a fitted one and a validation run) with noise of forces and encoders, and one truth
from the list KINDS: an effect that the model file lacks, a fault of the recordings, or nothing. Case k has kind k of the
list, again and again; without --count each kind comes once. It needs numpy. Marks:

right      the truth is named with its size and at its place, or nothing is claimed where nothing is wrong
invisible  nothing is claimed, and no error above the noise is left (free base parameters may represent a wrong length)
honest     nothing false is claimed, and the answer states that something is unexplained, unknown, or cannot be fitted
silent     the answer is content, and an error above the noise is left or a fault is not named
false      a wrong effect, place or fault is claimed with a probability above one half
"""

import argparse
import collections
import concurrent.futures
import dataclasses
import gzip
import json
import pathlib
import subprocess
import tempfile

import numpy as np

import arm as plant

# Every sensor has these: to name them is no claim.
HARMLESS = {"coloured_noise", "quantised_force", "outliers", "time_jitter", "load_noise", "encoder_steps"}
VALUE_TOLERANCE, VALUE_DEVIATIONS = 0.15, 4.0


@dataclasses.dataclass
class Truth:
    """What a truthful answer names: one of the kinds at one of the places (`None`: anywhere)."""

    kinds: tuple = ()
    at: tuple | None = None
    value: float | None = None
    partly: tuple = ()  # kinds that describe a part of it: not false, and not right
    says: str = ""
    interval: tuple | None = None  # of an event in the fitted recording, s


@dataclasses.dataclass
class Case:
    """A plant and its recordings, which an entry of KINDS changes."""

    random: np.random.Generator
    arm: plant.Arm
    rate: float
    seconds: float
    moves: bool  # from point to point
    noise: float  # of forces, as a share of the rms of each drive
    truth: Truth = dataclasses.field(default_factory=Truth)
    unknown: list = dataclasses.field(default_factory=list)
    lengths: np.ndarray | None = None  # of the model file
    model_arm: plant.Arm | None = None
    options: list = dataclasses.field(default_factory=list)
    payload: list = dataclasses.field(default_factory=lambda: [None, None])  # of each run: function of time
    stand: float = 0.0  # time at standstill at the start, s
    still: tuple = ()  # joints that do not move
    rates: bool = False  # whether rates are recorded
    before: list = dataclasses.field(default_factory=list)  # changes of forces of the plant, (run, motion, torque)
    after: list = dataclasses.field(default_factory=list)  # changes of the recorded table, (run, table of columns)

    def joint(self, least=0.15):
        """A joint whose force is not small."""
        size = plant.force_scale(self.arm, np.random.default_rng(0))
        return int(self.random.choice(np.flatnonzero(size >= least * size.max())))

    def size(self, j):
        """The typical force of a drive, rms."""
        return plant.force_scale(self.arm, np.random.default_rng(0))[j]

    def places(self, j):
        return (self.arm.coordinates[j], self.arm.drives[j])


def motion(case, run):
    """Times and motion of a run."""
    t = np.arange(0, case.seconds, 1 / case.rate)
    n = case.arm.joints
    # After a standstill time runs slowly at first, along the polynomial 3 s^2 - 2 s^3.
    s = np.clip((t - case.stand) / 1.0, 0, 1) if case.stand else np.ones_like(t)
    pace, change = 3 * s**2 - 2 * s**3, 6 * s - 6 * s**2
    clock = s**3 - s**4 / 2 + np.clip(t - case.stand - 1, 0, None) if case.stand else t
    if case.moves:
        q, qd, qdd = plant.point_to_point(case.random, n, clock)
    else:
        q, qd, qdd = plant.fourier(case.random, n, clock, case.seconds / (2 if case.seconds > 12 else 1))
    for i in case.still:
        q[i], qd[i], qdd[i] = q[i, 0], 0, 0
    return t, q, qd * pace, qdd * pace**2 + qd * change


def record(case, run):
    """The columns of a run: a table by name."""
    arm, random = case.arm, case.random
    t, q, qd, qdd = motion(case, run)
    payload = case.payload[run]
    load = None if payload is None else (payload[0](t), payload[1])
    rigid = plant.rigid_forces(arm, q, qd, qdd, load)
    sign = plant.friction_sign(random, qd)
    force = rigid + arm.rotor[:, None] * qdd + arm.viscous[:, None] * qd + arm.coulomb[:, None] * sign + arm.offset[:, None]
    state = dict(t=t, q=q.copy(), qd=qd, qdd=qdd, sign=sign, rigid=rigid)
    for change in case.before:
        change(run, state, force)
    rms = np.sqrt((force**2).mean(axis=1, keepdims=True))
    force = force + case.noise * rms * random.normal(size=force.shape)
    table = {"t": t}
    step = 2 * np.pi / 2**19
    for name, values in zip(arm.coordinates, state["q"]):
        table[name] = np.round((values + 4e-6 * random.normal(size=len(t))) / step) * step
    if case.rates:
        for name, values in zip(arm.coordinates, qd):
            table[name + "_d"] = values + 2e-4 * random.normal(size=len(t))
    table.update(zip(arm.drives, force))
    for change in case.after:
        table = change(run, table)
    return table


# The list of truths. An entry changes the case and sets its truth.


def nothing(case):
    case.truth.says = "nothing"


def effect(kind, low, high, shape, partly=(), known=None, sign=True):
    """An effect with a force of some share of the drive's: `shape` gives the force per unit of the parameter."""

    def enter(case):
        j = case.joint()
        if known is not None and known(case.arm)[j]:
            # The plant has it already; the model file forgets it.
            case.unknown.append((kind, j))
            value = known(case.arm)[j]
        else:
            value = case.size(j) * case.random.uniform(low, high)
            value *= 1 if sign else case.random.choice([-1, 1])

            def add(run, state, force):
                force[j] += value * shape(j, state)

            case.before.append(add)
        case.truth = Truth((kind,), case.places(j), value, partly, f"{kind} {value:.4g} at {case.arm.drives[j]}")

    return enter


def stribeck(j, s):
    return s["sign"][j] * np.exp(-((s["qd"][j] / 0.15) ** 2))


def directional_coulomb(case):
    """Dry friction that differs between the directions by some share."""
    j = case.joint()
    more = case.size(j) * case.random.uniform(0.04, 0.1)

    def add(run, state, force):
        force[j] += more * np.where(state["sign"][j] > 0, 1.0, 0.0)

    # A constant and dry friction of equal size in both directions are the same force.
    kinds = ("directional_coulomb_friction", "force_offset")
    case.truth = Truth(kinds, case.places(j), None, (), f"dry friction {more:.4g} larger in one direction at {case.arm.drives[j]}")
    case.before.append(add)


def elastic(case):
    j = case.joint()
    compliance = case.random.uniform(4e-3, 15e-3) / (3 * case.size(j))

    def add(run, state, force):
        # The encoder sits on the motor.
        state["q"][j] += compliance * state["rigid"][j]

    case.before.append(add)
    case.truth = Truth(("drive_compliance",), case.places(j), compliance, (), f"elastic drive {compliance:.3g} rad/(N m) at {case.arm.drives[j]}")


def backlash(case):
    j = case.joint()
    play = case.random.uniform(3e-3, 10e-3)

    def add(run, state, force):
        state["q"][j] += play / 2 * np.tanh(state["rigid"][j] / (0.01 * case.size(j)))

    case.before.append(add)
    case.truth = Truth(("backlash",), case.places(j), play, ("drive_compliance",), f"play {play:.3g} rad at {case.arm.drives[j]}")


def payload(case, runs, when):
    mass = case.arm.mass[-1] * case.random.uniform(0.2, 0.8)
    at = np.array([case.random.uniform(0.1, 0.25), *case.random.uniform(-0.05, 0.05, 2)])
    for run in runs:
        case.payload[run] = (lambda t: mass * (t >= when * t[-1]), at)
    kinds = ("payload_change", "payload", "different_runs")
    case.truth = Truth(kinds, None, None, ("point_mass",), f"payload {mass:.3g} kg from {when:.2f} of runs {runs}")


def payload_between(case):
    payload(case, [1], 0.0)


def payload_halfway(case):
    payload(case, [0, 1], case.random.uniform(0.35, 0.65))


def payload_halfway_once(case):
    payload(case, [0], case.random.uniform(0.35, 0.65))


def column_fault(kinds, partly=(), runs=(0, 1), harmless=False):
    """A fault of the recorded force of one drive."""

    def enter(change):
        def prepare(case):
            j = case.joint()
            # Drawn once, so that both runs have the same fault.
            x = case.random.uniform(size=4)
            name = case.arm.drives[j]

            def apply(run, table):
                if run in runs:
                    table[name] = change(case, x, table["t"], table[name].copy(), case.size(j))
                return table

            case.after.append(apply)
            case.truth = Truth(kinds, case.places(j), None, partly, f"{change.__name__} at {name}, runs {runs}")

        prepare.__name__ = change.__name__
        return prepare

    return enter


def span(t, x, share=1.0):
    """Where a time lies after 30 to 70 % of the run."""
    return t[0] + (0.3 + 0.4 * x) * share * (t[-1] - t[0])


def dead(case, x, t, f, size):
    return np.where(t >= span(t, x[0]), 0.0, f)


def dead_noisy(case, x, t, f, size):
    return np.where(t >= span(t, x[0]), 0.002 * size * case.random.normal(size=len(t)), f)


def dead_for_a_time(case, x, t, f, size):
    return np.where(abs(t - span(t, x[0])) < 0.5 + 2 * x[1], 0.0, f)


def gain(case, x, t, f, size):
    return f * (1 + (0.05 + 0.2 * x[0]) * np.sign(x[1] - 0.5))


def gain_step(case, x, t, f, size):
    return np.where(t >= span(t, x[0]), f * (1 + (0.08 + 0.15 * x[1]) * np.sign(x[2] - 0.5)), f)


def offset_step(case, x, t, f, size):
    return np.where(t >= span(t, x[0]), f + size * (0.08 + 0.2 * x[1]) * np.sign(x[2] - 0.5), f)


def drift(case, x, t, f, size):
    return f + size * (0.08 + 0.2 * x[0]) * np.sign(x[1] - 0.5) * t / t[-1]


def frozen(case, x, t, f, size):
    start = int(len(t) * (0.3 + 0.4 * x[0]))
    f[start : start + int(case.rate * (0.8 + 1.5 * x[1]))] = f[start]
    return f


def saturated(case, x, t, f, size):
    limit = np.quantile(abs(f), 0.8 + 0.12 * x[0])
    return np.clip(f, -limit, limit)


def force_sign(case, x, t, f, size):
    return -f


def newton_millimetres(case, x, t, f, size):
    return 1000 * f


def hum(case, x, t, f, size):
    frequency = 4 + 0.35 * case.rate * x[0] ** 2
    return f + size * (0.05 + 0.15 * x[1]) * np.sin(2 * np.pi * frequency * t + 6 * x[2])


def outliers(case, x, t, f, size):
    hit = case.random.random(len(t)) < 0.004
    return f + hit * size * case.random.normal(size=len(t)) * 3


def push(standing):
    """A push of 5 to 100 % of the drive's force in the fitted run."""

    def enter(case):
        case.moves = case.moves and not standing
        case.stand = 5.0 if standing else 0.0
        j = case.joint()
        height = case.size(j) * 0.05 * 20 ** case.random.random() * case.random.choice([-1, 1])
        begin = 1.0 + 2.0 * case.random.random() if standing else 4 + (case.seconds - 8) * case.random.random()
        length = case.random.uniform(0.25, 0.8)

        def add(run, state, force):
            if run == 0:
                s = np.clip((state["t"] - begin) / length, 0, 1)
                force[j] -= height * np.sin(np.pi * s) ** 2 * 1.5

        case.before.append(add)
        kinds = ("contact_event", "push", "collision")
        says = f"push {height / case.size(j):.2f} of {case.arm.drives[j]} at {begin:.2f} s for {length:.2f} s"
        case.truth = Truth(kinds, None, None, (), says, (begin, begin + length))

    return enter


def contact(case):
    """A soft stop near the largest angle of a joint, in both runs."""
    j = case.joint()

    def add(run, state, force):
        limit = np.quantile(state["q"][j], 0.96)
        reach = max(state["q"][j].max() - limit, 1e-3)
        force[j] += case.size(j) * np.clip(state["q"][j] - limit, 0, None) / reach

    case.before.append(add)
    kinds = ("contact_event", "push", "collision", "cable_torque")
    case.truth = Truth(kinds, None, None, (), f"stop at {case.arm.coordinates[j]}")


def warm_up(case):
    j = case.joint()
    share = case.random.uniform(0.3, 0.6)

    def add(run, state, force):
        force[j] -= share * case.arm.viscous[j] * state["qd"][j] * (1 - np.exp(-state["t"] / 6))

    case.before.append(add)
    case.truth = Truth(("friction_drift", "fading_friction"), case.places(j), None, (), f"viscous friction falls by {share:.2f} at {case.arm.drives[j]}")


def columns(case, change, truth):
    case.after.append(lambda run, table: change(table))
    case.truth = truth


def coordinate_sign(case):
    j = case.joint()
    name = case.arm.coordinates[j]
    columns(case, lambda x: {**x, name: -x[name]}, Truth(("wrong_sign",), case.places(j), None, (), f"sign of {name}"))


def degrees_one(case):
    j = case.joint()
    name = case.arm.coordinates[j]
    columns(case, lambda x: {**x, name: np.degrees(x[name])}, Truth(("units",), case.places(j), None, (), f"{name} in degrees"))


def degrees_all(case):
    def change(x):
        return {name: np.degrees(v) if name in case.arm.coordinates else v for name, v in x.items()}

    columns(case, change, Truth(("units",), None, None, (), "all angles in degrees"))


def exchanged(names_of):
    def enter(case):
        names = names_of(case.arm)
        j, k = sorted(case.random.choice(case.arm.joints, 2, replace=False))
        a, b = names[j], names[k]
        places = case.places(j) + case.places(k)
        columns(case, lambda x: {**x, a: x[b], b: x[a]}, Truth(("exchanged_columns",), places, None, (), f"{a} and {b} exchanged"))

    return enter


def clock_slow(case):
    columns(case, lambda x: {**x, "t": 0.97 * x["t"]}, Truth(("time_base",), None, None, (), "clock 3 % slow"))


def clock_slow_once(case):
    def change(run, x):
        return {**x, "t": 0.97 * x["t"]} if run == 1 else x

    case.after.append(change)
    case.truth = Truth(("time_base", "different_runs"), None, None, (), "clock 3 % slow in the validation run")


def milliseconds(case):
    columns(case, lambda x: {**x, "t": 1000 * x["t"]}, Truth(("time_base", "units"), None, None, (), "time in ms"))


def delayed(case):
    late = case.random.uniform(4e-3, 8e-3)

    def change(x):
        return {name: np.interp(x["t"] - late, x["t"], v) if name in case.arm.drives else v for name, v in x.items()}

    columns(case, change, Truth(("time_delay", "force_lag"), None, late, (), f"forces {1000 * late:.1f} ms late"))


def low_pass(x, t, tau):
    """A first-order low-pass of a signal that is linear between its samples: no time is lost by the sampling."""
    step = t[1] - t[0]
    keep, mean = np.exp(-step / tau), tau / step * (1 - np.exp(-step / tau))
    y = np.empty_like(x)
    y[0] = x[0]
    for k in range(1, len(x)):
        y[k] = keep * y[k - 1] + (mean - keep) * x[k - 1] + (1 - mean) * x[k]
    return y


def lagging(case):
    tau = case.random.uniform(4e-3, 10e-3)

    def change(x):
        return {name: low_pass(v, x["t"], tau) if name in case.arm.drives else v for name, v in x.items()}

    columns(case, change, Truth(("force_lag", "time_delay"), None, tau, (), f"forces low-passed with {1000 * tau:.1f} ms"))


def rates_filtered(case):
    case.rates = True

    def change(x):
        return {name: low_pass(v, x["t"], 0.027) if name.endswith("_d") else v for name, v in x.items()}

    columns(case, change, Truth(("late_rates", "filtered_rates", "time_base"), None, None, (), "rates low-passed with 27 ms"))


def rates_recorded(case):
    case.rates = True
    case.truth.says = "nothing; rates are recorded"


def gaps(case):
    def change(x):
        keep = case.random.random(len(x["t"])) > 0.002
        for start in case.random.integers(0, len(keep), 3):
            keep[start : start + int(0.3 * case.rate)] = False
        return {name: v[keep] for name, v in x.items()}

    columns(case, change, Truth(says="nothing; samples are lost"))


def low_excitation(case):
    forget_friction(case)
    moving = int(np.flatnonzero([place in case.truth.at for place in case.arm.drives])[0])
    case.still = tuple(k for k in range(case.arm.joints) if k != moving)
    case.truth.says += "; only this joint moves"


def forget_friction(case):
    j = case.joint()
    case.unknown.append(("coulomb_friction", j))
    alike = ("directional_coulomb_friction", "dahl_friction", "stribeck_friction")
    case.truth = Truth(("coulomb_friction",), case.places(j), case.arm.coulomb[j], alike, f"dry friction at {case.arm.drives[j]}")


def short(case):
    forget_friction(case)
    case.seconds, case.moves = 2.5, False
    case.truth.says += "; runs of 2.5 s"


def friction_of_all(case):
    n = case.arm.joints
    case.unknown += [(kind, j) for kind in ("coulomb_friction", "viscous_friction") for j in range(n)]
    places = tuple(case.arm.coordinates + case.arm.drives)
    case.truth = Truth(("coulomb_friction", "viscous_friction"), places, None, ("directional_coulomb_friction", "directional_viscous_friction"), "all friction")


def tilt(case):
    angle = np.radians(case.random.uniform(1.5, 6))
    case.model_arm = dataclasses.replace(case.arm)
    down = case.arm.gravity / np.linalg.norm(case.arm.gravity)
    side = np.cross(down, case.random.normal(size=3))
    case.arm.gravity = plant.GRAVITY * (np.cos(angle) * down + np.sin(angle) * side / np.linalg.norm(side))
    case.truth = Truth(("gravity_tilt", "gravity_direction"), None, None, (), f"base tilted by {np.degrees(angle):.2f} deg")


def side_mount(case):
    case.model_arm = dataclasses.replace(case.arm)
    case.arm.gravity = plant.GRAVITY * np.array([1.0, 0, 0])
    case.truth = Truth(("gravity_direction",), None, None, ("gravity_tilt",), "gravity along x")


def wrong_length(case):
    k = int(case.random.choice(np.flatnonzero(case.arm.a))) if case.arm.a.any() else 0
    case.lengths = case.arm.a.copy()
    error = case.random.choice([-1, 1]) * case.random.uniform(0.03, 0.08)
    case.lengths[k] *= 1 + error
    case.truth = Truth(("constant_error",), (f"a{k}",), None, (), f"a{k} is {100 * error:.1f} % too long")


def wrong_mass(case):
    j = int(case.random.integers(case.arm.joints))
    case.model_arm = dataclasses.replace(case.arm)
    share = case.random.uniform(0.1, 0.3)
    case.model_arm.mass = case.arm.mass.copy()
    case.model_arm.moment, case.model_arm.inertia = case.arm.moment.copy(), case.arm.inertia.copy()
    for values in (case.model_arm.mass, case.model_arm.moment, case.model_arm.inertia):
        values[j] *= 1 - share
    case.options = ["--held"]
    kinds = ("payload", "point_mass", "untied_part", "lumped_mass_placement")
    # About a fixed axis the inertia of a link is that of its drive.
    kinds += ("drive_inertia",) if j == 0 else ()
    case.truth = Truth(kinds, None, None, (), f"mass of link {j + 1} is {100 * share:.0f} % too small, values are fixed")


def encoder_zero(case):
    j = case.joint()
    error = case.random.choice([-1, 1]) * case.random.uniform(0.02, 0.06)
    name = case.arm.coordinates[j]
    case.after.append(lambda run, x: {**x, name: x[name] + error})
    # A turn of the base about the first axis is the same.
    alike = ("gravity_tilt",) if j == 0 else ()
    case.truth = Truth(("encoder_zero",), case.places(j) + ("base",), error, alike, f"zero of {name} off by {error:.3f} rad")


def wraps(case):
    j = case.joint()
    name = case.arm.coordinates[j]

    def change(x):
        turned = x[name] - x[name].mean() + np.pi
        return {**x, name: x[name] - 2 * np.pi * (turned > np.pi)}

    columns(case, change, Truth(("wrapped",), case.places(j), None, (), f"{name} jumps by a full turn"))


def load_friction(case):
    """Friction proportional to the load, with a coefficient without unit."""
    j = case.joint()
    value = case.random.uniform(0.05, 0.15)

    def add(run, state, force):
        force[j] += value * abs(state["rigid"][j]) * state["sign"][j]

    case.before.append(add)
    case.truth = Truth(("load_friction",), case.places(j), value, ("stribeck_load_friction",), f"load friction {value:.3f} at {case.arm.drives[j]}")


LIKE_COULOMB = ("directional_coulomb_friction", "dahl_friction", "stribeck_friction")
KINDS = {
    "nothing": nothing,
    "viscous_friction": effect("viscous_friction", 0.05, 0.15, lambda j, s: s["qd"][j], partly=("directional_viscous_friction",), known=lambda arm: arm.viscous),
    "coulomb_friction": effect("coulomb_friction", 0.05, 0.2, lambda j, s: s["sign"][j], partly=LIKE_COULOMB, known=lambda arm: arm.coulomb),
    "stribeck_friction": effect("stribeck_friction", 0.05, 0.15, stribeck, partly=("dahl_friction",)),
    "quadratic_friction": effect("quadratic_friction", 0.05, 0.15, lambda j, s: s["qd"][j] * abs(s["qd"][j])),
    "load_friction": load_friction,
    "directional_coulomb": directional_coulomb,
    "friction_of_all": friction_of_all,
    "spring": effect("spring", 0.1, 0.4, lambda j, s: s["q"][j] - 0.2, partly=("cable_torque",)),
    "force_offset": effect("force_offset", 0.08, 0.3, lambda j, s: 1.0, known=lambda arm: arm.offset, sign=False),
    "drive_inertia": effect("drive_inertia", 0.03, 0.1, lambda j, s: s["qdd"][j], known=lambda arm: arm.rotor),
    "elastic": elastic,
    "backlash": backlash,
    "payload_between": payload_between,
    "payload_halfway": payload_halfway,
    "payload_halfway_once": payload_halfway_once,
    "gain": column_fault(("drive_gain",))(gain),
    "gain_step": column_fault(("gain_change",), ("drive_gain",))(gain_step),
    "offset_step": column_fault(("offset_step",), ("force_offset", "offset_drift"))(offset_step),
    "dead_both": column_fault(("dead_channel",))(dead),
    "dead_once": column_fault(("dead_channel",), runs=(0,))(dead),
    "dead_check": column_fault(("dead_channel",), runs=(1,))(dead),
    "dead_noisy": column_fault(("dead_channel",))(dead_noisy),
    "dead_for_a_time": column_fault(("dead_channel",))(dead_for_a_time),
    "frozen": column_fault(("frozen_force",))(frozen),
    "frozen_once": column_fault(("frozen_force",), runs=(1,))(frozen),
    "saturated": column_fault(("saturation",))(saturated),
    "force_sign": column_fault(("wrong_sign",))(force_sign),
    "newton_millimetres": column_fault(("units",))(newton_millimetres),
    "coordinate_sign": coordinate_sign,
    "exchanged_forces": exchanged(lambda arm: arm.drives),
    "exchanged_coordinates": exchanged(lambda arm: arm.coordinates),
    "degrees_one": degrees_one,
    "degrees_all": degrees_all,
    "milliseconds": milliseconds,
    "clock_slow": clock_slow,
    "clock_slow_once": clock_slow_once,
    "delayed": delayed,
    "lagging": lagging,
    "hum": column_fault(("periodic_in_time", "hum"))(hum),
    "outliers": column_fault(("outliers",))(outliers),
    "drift": column_fault(("offset_drift",))(drift),
    "warm_up": warm_up,
    "push_moving": push(False),
    "push_standing": push(True),
    "contact": contact,
    "rates_filtered": rates_filtered,
    "rates_recorded": rates_recorded,
    "gaps": gaps,
    "low_excitation": low_excitation,
    "short": short,
    "tilt": tilt,
    "side_mount": side_mount,
    "wrong_length": wrong_length,
    "wrong_mass": wrong_mass,
    "encoder_zero": encoder_zero,
    "wraps": wraps,
}


def draw_case(seed, number):
    """The case of a number: its kind, and what it is."""
    kind = list(KINDS)[number % len(KINDS)]
    random = np.random.default_rng([seed, number])
    case = Case(
        random,
        plant.draw_arm(random),
        rate=float(random.choice([125, 200, 250, 400])),
        seconds=float(random.choice([14, 20])),
        moves=bool(random.random() < 0.4),
        noise=float(random.uniform(0.003, 0.02)),
    )
    KINDS[kind](case)
    return kind, case


def write_case(folder, case):
    """Writes the model file and both recordings; gives the arguments of the program."""
    folder.mkdir(parents=True, exist_ok=True)
    model = folder / "model.toml"
    model.write_text(plant.model_text(case.model_arm or case.arm, case.unknown, case.lengths))
    # The columns of one recording in four have other names than the model.
    foreign = case.random.random() < 0.25
    arguments = [model]
    for run, option in enumerate(["--data", "--check"]):
        table = record(case, run)
        names = [f"ch{k}" if foreign and name != "t" and not name.endswith("_d") else name for k, name in enumerate(table)]
        if run == 0:
            maps = [f"{name}={column}" for name, column in zip(table, names) if name != column]
        path = folder / f"run{run}.csv.gz"
        with gzip.open(path, "wt", compresslevel=1) as file:
            np.savetxt(file, np.column_stack(list(table.values())), delimiter=",", header=",".join(names), comments="", fmt="%.9g")
        arguments += [option, path]
    for one in maps:
        arguments += ["--map", one]
    return [str(one) for one in arguments + case.options]


def is_of(truth, claim, kinds):
    """Whether a claim has one of the kinds at a place and a time of the truth."""
    if truth.interval and claim.get("interval"):
        # A push begins and ends with little force.
        begin, end = claim["interval"]
        inside = truth.interval[0] - 0.1 < begin and end < truth.interval[1] + 0.1
        if not inside or any("run1" in one for one in claim["recordings"]):
            return False
    return claim["kind"] in kinds and (truth.at is None or all(place in truth.at for place in claim["at"]))


def has_value(truth, claim):
    """Whether an estimate of a claim is the true value; true if there is none to compare."""
    if truth.value is None or not claim.get("estimates"):
        return True
    value = abs(truth.value)
    return any(
        abs(abs(one["value"]) - value) < max(VALUE_TOLERANCE * value, VALUE_DEVIATIONS * (one["std"] or 0))
        for one in claim["estimates"]
    )


def judge(case, answer):
    """The mark of an answer, and its false claims."""
    truth = case.truth
    found, wrong = False, []
    claims = [(one, one["probability"]) for one in answer["effects"]] + [(one, 1.0) for one in answer["disturbances"]]
    for claim, probability in claims:
        ways = [claim, *claim.get("indistinguishable_from", [])]
        named = [way for way in ways if is_of(truth, way, truth.kinds)]
        found |= any(way is not claim or has_value(truth, claim) for way in named)
        partly = any(is_of(truth, way, truth.kinds + truth.partly) for way in ways)
        if not (partly or claim["kind"] in HARMLESS) and probability > 0.5:
            when = " to ".join(f"{t:.2f}" for t in claim.get("interval") or [])
            wrong.append(f"{claim['kind']} {','.join(claim['at'])} ({probability:.2f}) {when}".strip())
    for one in answer.get("geometry_alternatives", []):
        names = {error["constant"] or error["point"] for error in one["errors"]}
        found |= "constant_error" in truth.kinds and truth.at is not None and names == set(truth.at)
    if wrong:
        return "false", wrong
    if found or (not truth.kinds and answer["verdict"] == "adequate"):
        return "right", wrong
    if answer["verdict"] == "unexplained" or answer["unexplained"] or answer["follows_time"] or answer["unresolved"]:
        return "honest", wrong
    last = answer["steps"][-1]["check"]
    # Noise is a share of the force of each drive, and so of all.
    if last is not None and last < 1.1 * case.noise and not answer["effects"]:
        return "invisible", wrong
    return "silent", wrong


def run_case(program, seed, number, folder):
    """Kind, truth, mark and answer of a case."""
    kind, case = draw_case(seed, number)
    arguments = write_case(folder, case)
    done = subprocess.run([program, "diagnose", *arguments, "--json"], capture_output=True, text=True)
    (folder / "command.txt").write_text(" ".join([program, "diagnose", *arguments]) + "\n")
    says = f"{case.arm.joints} joints, {'moves' if case.moves else 'Fourier'}, noise {100 * case.noise:.1f} %, {case.truth.says}"
    if done.returncode:
        # A refusal with a reason claims nothing.
        mark = "honest" if done.returncode in (1, 2) and done.stderr.strip() and "panicked" not in done.stderr else "failed"
        return kind, says, mark, "refused: " + done.stderr.strip().splitlines()[-1][:200]
    answer = json.loads(done.stdout)
    (folder / "answer.json").write_text(done.stdout)
    mark, wrong = judge(case, answer)
    claims = [f"{one['kind']} {','.join(one['at'])}" for one in answer["effects"]]
    claims += [f"[{one['kind']} {','.join(one['at'])}]" for one in answer["disturbances"] if one["kind"] not in HARMLESS]
    error = answer["steps"][-1]["check"]
    said = f"{answer['verdict']} {100 * (error or 0):.2f} %: {'; '.join(claims)}" + (f" | FALSE: {'; '.join(wrong)}" if wrong else "")
    return kind, says, mark, said


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=len(KINDS))
    parser.add_argument("--only", help="kinds, with commas")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", help="folder for models, recordings and answers")
    options = parser.parse_args()
    only = set(options.only.split(",")) if options.only else set(KINDS)
    if only - set(KINDS):
        parser.error(f"unknown kinds: {', '.join(sorted(only - set(KINDS)))}")
    names = list(KINDS)
    numbers = [k for k in range(options.count) if names[k % len(names)] in only]
    scores = collections.Counter()
    with tempfile.TemporaryDirectory() as temporary, concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        folder = pathlib.Path(options.keep or temporary)
        run = lambda k: run_case(options.program, options.seed, k, folder / f"{k:03}-{names[k % len(names)]}")
        for number, (kind, says, mark, said) in zip(numbers, pool.map(run, numbers)):
            scores[mark] += 1
            print(f"{number:3} {mark:9} {kind:22} {says} | {said}", flush=True)
    n = max(scores.total(), 1)
    print(", ".join(f"{mark} {count}" for mark, count in scores.most_common()) + f" of {n}")
    good = scores["right"] + scores["invisible"]
    print(f"right {100 * good / n:.0f} %, right or honest {100 * (good + scores['honest']) / n:.0f} %, false {100 * scores['false'] / n:.1f} %")


if __name__ == "__main__":
    main()
