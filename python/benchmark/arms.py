"""Arms that another program simulates: is what was done to them told by its name?

    python python/benchmark/arms.py --robots FOLDER [--program modelmill] [--seeds 2] [--only ur5/spring] [--keep DIR]

needs numpy, and the wheels `pin` and `mujoco`. FOLDER has `ur5_urdf/ur5_urdf.urdf`, as the collection example-robot-data has it, and
`iiwa14_mj/iiwa14_mj.xml`, as MuJoCo's menagerie has it, both without meshes.

Pinocchio moves the UR5, MuJoCo the iiwa14. Both have viscous and dry friction, encoders with steps, and torques with noise below 15 Hz
that is half a percent of what each drive has to do. A first run, to which nothing was done, is identified; then one thing is
changed - a load at the flange, a spring, the scale of a torque, a gear that yields, a cable - and a run and a check of it are
diagnosed with the parameters of the first (`diagnose --parameters`). Right is an answer that names this and nothing else; an
answer that names things which the run cannot tell apart is right if the truth is one of them.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: Torques of all states, one row for each.
Dynamics = Callable[[Array, Array, Array], Array]

RATE = 250.0
DURATION = 20.0
#: Corner of the noise of torques, Hz, and its size beside the torque of the drive.
CORNER = 15.0
NOISE = 0.005
#: Radians of an encoder's step at the joint.
STEP = 2 * np.pi / 2**18
HARMONICS = 5


@dataclass
class Load:
    """A body at the flange."""

    mass: float
    centre: Array
    #: About the centre, in the axes of the flange.
    inertia: Array


@dataclass
class Arm:
    """A robot of a file."""

    file: Path
    joints: list[str]
    #: The last link, and what a program may call a body that is fixed to it.
    flange: str
    #: Middle and half width of the motion of each joint, rad.
    middle: Array
    width: Array
    #: The mechanics alone, with a load or without.
    dynamics: Callable[[Load | None], Dynamics]


def ur5(robots: Path) -> Arm:
    file = robots / "ur5_urdf" / "ur5_urdf.urdf"

    def dynamics(load: Load | None) -> Dynamics:
        model = pinocchio.buildModelFromUrdf(str(file))
        if load is not None:
            model.inertias[model.njoints - 1] += pinocchio.Inertia(load.mass, load.centre, load.inertia)
        data = model.createData()
        return lambda q, qd, qdd: np.array([pinocchio.rnea(model, data, *row) for row in zip(q, qd, qdd)])

    names = list(pinocchio.buildModelFromUrdf(str(file)).names)[1:]
    middle = np.array([0.0, -1.4, 0.6, -0.8, 0.3, 0.0])
    return Arm(file, names, "wrist_3_link", middle, np.array([1.6, 0.9, 1.1, 1.3, 1.3, 1.6]), dynamics)


def iiwa(robots: Path) -> Arm:
    file = robots / "iiwa14_mj" / "iiwa14_mj.xml"

    def dynamics(load: Load | None) -> Dynamics:
        spec = mujoco.MjSpec.from_file(str(file))
        if load is not None:
            body = spec.body("link7").add_body(name="load")
            body.mass = load.mass
            body.ipos = load.centre
            body.fullinertia = [load.inertia[i] for i in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
            body.explicitinertial = True
        model = spec.compile()
        data = mujoco.MjData(model)

        def of(q: Array, qd: Array, qdd: Array) -> Array:
            data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
            mujoco.mj_inverse(model, data)
            return data.qfrc_inverse.copy()

        return lambda q, qd, qdd: np.array([of(*row) for row in zip(q, qd, qdd)])

    names = [f"joint{i}" for i in range(1, 8)]
    middle = np.array([0.0, 0.5, 0.2, -0.9, 0.0, 0.6, 0.0])
    return Arm(file, names, "link7", middle, np.array([1.4, 0.9, 1.3, 0.9, 1.4, 1.1, 1.6]), dynamics)


def motion(arm: Arm, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Positions, rates and accelerations of a Fourier series that fills the width of every joint."""
    n = len(arm.joints)
    time = np.arange(round(DURATION * RATE)) / RATE
    orders = np.arange(1, HARMONICS + 1)
    waves = 2 * np.pi * orders / (DURATION / 2)
    a, b = rng.normal(size=(2, n, HARMONICS)) / orders**1.2
    c, s = np.cos(np.outer(waves, time)), np.sin(np.outer(waves, time))
    series = a @ c + b @ s
    middle = (series.max(axis=1) + series.min(axis=1)) / 2
    scale = 2 * arm.width / (series.max(axis=1) - series.min(axis=1))
    q = arm.middle[:, None] + scale[:, None] * (series - middle[:, None])
    qd = scale[:, None] * ((b * waves) @ c - (a * waves) @ s)
    qdd = -scale[:, None] * ((a * waves**2) @ c + (b * waves**2) @ s)
    return q.T, qd.T, qdd.T


def coloured(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Noise of size one below the corner (a low-pass of second order), that has run in."""
    run_in = 500
    keeps = np.exp(-2 * np.pi * CORNER / RATE)
    out = np.zeros((shape[0] + run_in, *shape[1:]))
    white = rng.normal(size=out.shape)
    first = np.zeros(shape[1:])
    for i in range(1, len(out)):
        first = keeps * first + (1 - keeps) * white[i]
        out[i] = keeps * out[i - 1] + (1 - keeps) * first
    out = out[run_in:]
    return out / out.std(axis=0)


@dataclass
class Case:
    """What is done to an arm."""

    #: Kind and place of what must be named; `None` if nothing is done.
    truth: tuple[str, str] | None
    says: str
    load: Load | None = None
    joint: int = 0
    #: A torque over the joint's position.
    passive: Callable[[Array], Array] | None = None
    gain: float = 1.0
    compliance: float = 0.0


def cases(arm: Arm, usual: Array, rng: np.random.Generator) -> dict[str, Case]:
    """One of each sort; sizes go with the torque that each drive usually has to supply."""
    n = len(arm.joints)

    def joint() -> int:
        return int(rng.integers(1, n - 1))

    def either() -> float:
        return float(rng.choice([-1.0, 1.0]))

    mass = rng.uniform(1.0, 3.0)
    centre = np.array([*rng.uniform(-0.05, 0.05, 2), rng.uniform(0.04, 0.12)])
    sizes = rng.uniform(0.03, 0.08, 3)
    inertia = mass * np.diag([sizes[1] ** 2 + sizes[2] ** 2, sizes[0] ** 2 + sizes[2] ** 2, sizes[0] ** 2 + sizes[1] ** 2])
    load = Load(mass, centre, inertia)
    made = {
        "nothing": Case(None, "nothing"),
        "payload": Case(("payload", arm.flange), f"{mass:.2f} kg at the flange", load=load),
    }

    d = joint()
    stiffness = rng.uniform(0.08, 0.2) * usual[d] / arm.width[d]
    rest = arm.middle[d] + rng.uniform(-0.3, 0.3) * arm.width[d]
    made["spring"] = Case(
        ("spring", arm.joints[d]),
        f"a spring of {stiffness:.3g} N m/rad",
        joint=d,
        passive=lambda q, k=stiffness, rest=rest: k * (q - rest),
    )
    d = joint()
    gain = 1.0 + either() * rng.uniform(0.05, 0.12)
    made["gain"] = Case(("drive_gain", arm.joints[d]), f"a torque times {gain:.3f}", joint=d, gain=gain)

    # The joints that carry most: a gear that carries nothing does not yield.
    d = int(rng.choice(np.argsort(usual)[-2:]))
    compliance = rng.uniform(0.004, 0.008) / usual[d]
    made["compliance"] = Case(
        ("drive_compliance", arm.joints[d]),
        f"a gear that yields by {compliance:.2g} rad/(N m)",
        joint=d,
        compliance=compliance,
    )
    for name, curve in (("cable", cubic), ("hose", bent)):
        d = joint()
        says, passive = curve(arm.middle[d], arm.width[d], rng.uniform(0.1, 0.25) * usual[d], rng)
        made[name] = Case(("cable_torque", arm.joints[d]), says, joint=d, passive=passive)
    return made


def cubic(middle: float, width: float, size: float, rng: np.random.Generator) -> tuple[str, Callable[[Array], Array]]:
    """A pull that stiffens towards the ends."""
    share, shift = rng.uniform(0.2, 0.4), rng.uniform(-0.2, 0.2)

    def torque(q: Array) -> Array:
        x = (q - middle) / width - shift
        return size * (share * x + (1 - share) * x**3)

    return f"a cubic of {size:.2g} N m at the ends", torque


def bent(middle: float, width: float, size: float, rng: np.random.Generator) -> tuple[str, Callable[[Array], Array]]:
    """A pull that gives way: steep in the middle, and nearly the same towards either end."""
    steep, shift = rng.uniform(1.5, 2.5), rng.uniform(-0.2, 0.2)
    return f"a tanh of {size:.2g} N m", lambda q: size * np.tanh(steep * ((q - middle) / width - shift))


def record(file: Path, arm: Arm, case: Case, usual: Array, friction: Array, rng: np.random.Generator) -> None:
    """A run of an arm to which something was done, as its controller records it."""
    q, qd, qdd = motion(arm, rng)
    torque = arm.dynamics(case.load)(q, qd, qdd)
    d = case.joint
    if case.passive is not None:
        torque[:, d] += case.passive(q[:, d])
    read = q.copy()
    # The encoder sits on the motor, before the gear that yields.
    read[:, d] += case.compliance * torque[:, d]
    torque += friction[0] * qd + friction[1] * np.sign(qd)
    torque[:, d] *= case.gain
    read = STEP * np.round(read / STEP)
    torque += NOISE * usual * coloured(torque.shape, rng)
    names = ["t", *arm.joints, *(f"{joint}_drive" for joint in arm.joints)]
    time = np.arange(len(q)) / RATE
    np.savetxt(file, np.column_stack([time, read, torque]), delimiter=",", header=",".join(names), comments="", fmt="%.10g")


def ask(program: Path, folder: Path, *words: str) -> str:
    done = subprocess.run([program, *words], cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"modelmill {' '.join(words)}: {done.stderr}")
    return done.stdout


def named(effects: list[dict]) -> str:
    return ", ".join(f"{effect['kind']} ({', '.join(effect['at'])})" for effect in effects) or "-"


def is_right(case: Case, answer: dict) -> bool:
    """Whether an answer names what was done and nothing else; a drive stands for its joint."""

    def placed(effect: dict) -> tuple[str, ...]:
        return (effect["kind"], *(place.removesuffix("_drive") for place in effect["at"]))

    effects = answer["effects"]
    if case.truth is None:
        return answer["verdict"] == "adequate" and not effects
    if answer["verdict"] != "missing_effect" or len(effects) != 1:
        return False
    return any(placed(way) == case.truth for way in (effects[0], *effects[0]["indistinguishable_from"]))


def known(program: Path, folder: Path, arm: Arm, usual: Array, friction: Array, rng: np.random.Generator) -> None:
    """The model file with friction, and its parameters as a run shows them to which nothing was done."""
    model = folder / "model.toml"
    ask(program, folder, "import", str(arm.file.resolve()), "--out", str(model))
    for kind in ("viscous_friction", "coulomb_friction"):
        for joint in arm.joints:
            ask(program, folder, "add", "model.toml", kind, "--at", f"{joint}_drive", "--in-place")
    record(folder / "before.csv", arm, Case(None, "nothing"), usual, friction, rng)
    ask(program, folder, "identify", "model.toml", "--data", "before.csv", "--out", "before.json")


def main() -> None:
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--robots", type=Path, required=True, help="folder with ur5_urdf and iiwa14_mj")
    options.add_argument("--program", type=Path, default=Path("modelmill"))
    options.add_argument("--seeds", type=int, default=2)
    options.add_argument("--first", type=int, default=1, help="the first seed")
    options.add_argument("--only", default="", help="cases whose names hold this, as ur5/spring/1")
    options.add_argument("--keep", type=Path, help="folder in which recordings and answers stay")
    asked = options.parse_args()
    program = asked.program.resolve() if asked.program.is_file() else asked.program

    right = of = 0
    with tempfile.TemporaryDirectory(prefix="modelmill-arms-") as scratch:
        for name, make in (("ur5", ur5), ("iiwa", iiwa)):
            arm = make(asked.robots)
            for seed in range(asked.first, asked.first + asked.seeds):
                rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
                states = motion(arm, rng)
                usual = np.sqrt((arm.dynamics(None)(*states) ** 2).mean(axis=0))
                # A joint that carries nothing has friction and noise too.
                usual = np.maximum(usual, 0.02 * usual.max())
                rates = np.sqrt((states[1] ** 2).mean(axis=0))
                friction = np.array([0.08 * usual / rates, 0.1 * usual]) * rng.uniform(0.7, 1.3, (2, len(usual)))
                planned = cases(arm, usual, rng)
                wanted = {one: case for one, case in planned.items() if asked.only in f"{name}/{one}/{seed}"}
                if not wanted:
                    continue
                folder = (asked.keep or Path(scratch)).resolve() / f"{name}-{seed}"
                folder.mkdir(parents=True, exist_ok=True)
                known(program, folder, arm, usual, friction, np.random.default_rng([seed, zlib.crc32(name.encode()), 1]))
                for one, case in wanted.items():
                    own = np.random.default_rng([seed, zlib.crc32(f"{name}/{one}".encode())])
                    for run in ("fit", "check"):
                        record(folder / f"{one}-{run}.csv", arm, case, usual, friction, own)
                    said = ask(
                        program, folder, "diagnose", "model.toml", "--parameters", "before.json", "--json",
                        "--data", f"{one}-fit.csv", "--check", f"{one}-check.csv",
                    )  # fmt: skip
                    (folder / f"{one}.json").write_text(said, encoding="utf-8")
                    answer = json.loads(said)
                    is_it = is_right(case, answer)
                    right, of = right + is_it, of + 1
                    where = f" at {arm.joints[case.joint]}" if case.load is None and case.truth else ""
                    mark = "right" if is_it else "WRONG"
                    print(f"{mark} {name}/{one}/{seed}: {case.says}{where}: {answer['verdict']}, {named(answer['effects'])}", flush=True)
    print(f"{right} of {of} right")


if __name__ == "__main__":
    main()
