#!/usr/bin/env python3
"""How often `modelmill diagnose` names what a servo arm has and its model file has not, from logs without forces.

    python3 lab/servo-plant/hidden.py --program target/release/modelmill [--count 24] [--seed 1] [--keep DIR]

The plant is a vertical arm with two links and position servos: encoders of 12 bits, 200 Hz, commands that act 12 ms
late, viscous and dry friction. It shares no code with modelmill. The model file has the arm, both kinds of friction and
the servos with their gains, but not the delay. Each case hides one item of HIDDEN, or nothing. It needs numpy. Marks:

right    what is hidden is claimed, and nothing else; or nothing is hidden and nothing is claimed
silent   something is hidden, and nothing is claimed
partly   what is hidden is claimed, with something else
false    something is claimed that is not hidden, and what is hidden is not claimed
"""

import argparse
import collections
import json
import pathlib
import subprocess
import tempfile

import numpy as np

GRAVITY = 9.81
LENGTH = 0.3
# Mass (kg), centre (m), inertia about the centre (kg m^2) of both links.
LINKS = [(2.0, 0.15, 0.02), (1.2, 0.12, 0.008)]
KP, KD = np.array([80.0, 40.0]), np.array([1.5, 0.5])
VISCOUS, COULOMB = np.array([0.15, 0.08]), np.array([0.5, 0.25])
DELAY = 0.012
RATE, STEP, TIME = 200, 2e-4, 25.0
ENCODER = 2 * np.pi / 4096
HIDDEN = ["none", "quadratic_friction", "spring", "force_offset", "dead_band", "saturation", "coulomb_friction", "stribeck_friction"]
MODEL = """schema = 1
name = "servo_arm"
gravity = ["0", "-g", "0"]
[constants]
g = { value = 9.81, unit = "m/s^2" }
L = { value = 0.3, unit = "m" }
[parameters]
XX1 = { unit = "kg m^2" }
mc1 = { unit = "kg m" }
m2 = { unit = "kg" }
mc2 = { unit = "kg m" }
I2 = { unit = "kg m^2" }
[coordinates]
q1 = { nominal = 0.3 }
q2 = { nominal = 0.5 }
[[frame]]
name = "upper"
on = "base"
joint = { revolute = "q1", axis = "z" }
[[frame]]
name = "lower"
on = "upper"
at = ["L", "0", "0"]
joint = { revolute = "q2", axis = "z" }
[[part]]
on = "upper"
linear = { ZZ = "XX1", MX = "mc1" }
[[part]]
on = "lower"
linear = { M = "m2", MX = "mc2", ZZ = "I2" }
[[drive]]
name = "shoulder"
joint = "q1"
[[drive]]
name = "elbow"
joint = "q2"
[[effect]]
kind = "viscous_friction"
at = "shoulder"
[[effect]]
kind = "viscous_friction"
at = "elbow"
%s
[[actuator]]
drive = "shoulder"
kind = "position_servo"
kp = "80"
kd = "1.5"
[[actuator]]
drive = "elbow"
kind = "position_servo"
kp = "40"
kd = "0.5"
"""
DRY = """[[effect]]
kind = "coulomb_friction"
at = "%s"
"""


class Commands:
    """Sums of five sines for each case and drive."""

    def __init__(self, random, cases):
        shape = (5, 2, cases)
        self.amplitude = random.uniform(0.05, 0.3, shape) / np.arange(1, 6)[:, None, None] ** 0.5
        self.frequency = np.array([0.15, 0.37, 0.71, 1.3, 2.1])[:, None, None] * random.uniform(0.9, 1.1, shape)
        self.phase = random.uniform(0, 2 * np.pi, shape)
        self.centre = np.array([[-0.6], [0.9]]) * np.ones((2, cases))

    def at(self, t):
        return self.centre + (self.amplitude * np.sin(2 * np.pi * self.frequency * t + self.phase)).sum(0)


def simulate(random, cases):
    """Logs of all cases at once, [sample, drive, case]: commands and positions."""
    n = len(cases)
    commands = Commands(random, n)
    size = {kind: np.array([[case["size"] if (case["hidden"], case["drive"]) == (kind, d) else 0.0 for case in cases] for d in (0, 1)]) for kind in HIDDEN}
    limit = np.where(size["saturation"] > 0, size["saturation"], np.inf)
    (m1, c1, i1), (m2, c2, i2) = LINKS
    q, v = commands.at(0.0), np.zeros((2, n))
    every = round(1 / RATE / STEP)
    log_command, log_position = [], []
    for k in range(int(TIME / STEP)):
        t = k * STEP
        if k % every == 0:
            log_command.append(commands.at(t))
            log_position.append(np.round(q / ENCODER) * ENCODER)
        error = commands.at(t - DELAY) - q
        error = np.sign(error) * np.maximum(np.abs(error) - size["dead_band"], 0)
        force = np.clip(KP[:, None] * error - KD[:, None] * v, -limit, limit)
        direction = np.tanh(v / 0.006)
        friction = VISCOUS[:, None] * v + COULOMB[:, None] * direction
        friction += size["quadratic_friction"] * v * np.abs(v) + size["spring"] * q + size["force_offset"]
        friction += size["stribeck_friction"] * direction * np.exp(-((v / 0.15) ** 2))
        cos, sin = np.cos(q[1]), np.sin(q[1])
        a = i1 + m1 * c1**2 + m2 * LENGTH**2 + i2 + m2 * c2**2 + 2 * m2 * LENGTH * c2 * cos
        b = i2 + m2 * c2**2 + m2 * LENGTH * c2 * cos
        d = i2 + m2 * c2**2
        lower = m2 * GRAVITY * c2 * np.cos(q[0] + q[1])
        gravity = np.array([(m1 * c1 + m2 * LENGTH) * GRAVITY * np.cos(q[0]) + lower, lower])
        h = m2 * LENGTH * c2 * sin
        coriolis = np.array([-h * (2 * v[0] * v[1] + v[1] ** 2), h * v[0] ** 2])
        x, y = force - friction - gravity - coriolis
        determinant = a * d - b * b
        v = v + STEP * np.array([(d * x - b * y) / determinant, (a * y - b * x) / determinant])
        q = q + STEP * v
    return np.array(log_command), np.array(log_position)


def draw_case(random, hidden):
    """One hidden item with its drive and size."""
    drive = int(random.integers(2))
    ranges = {
        "none": (0, 0),
        "quadratic_friction": (0.15, 0.4),
        "spring": (1.0, 3.0),
        "force_offset": (0.3, 0.8),
        "dead_band": (0.004, 0.012),
        # The largest force without a limit is some 13 to 22 N m and 4 to 7 N m.
        "saturation": [(11.0, 14.0), (3.5, 4.2)][drive],
        "coulomb_friction": (0, 0),
        "stribeck_friction": (0.15, 0.4),
    }
    return {"hidden": hidden, "drive": drive, "size": random.uniform(*ranges[hidden])}


def write_case(folder, case, fit, check, column):
    """The model file and both logs of a case."""
    lacks = case["drive"] if case["hidden"] == "coulomb_friction" else None
    dry = "".join(DRY % name for k, name in enumerate(["shoulder", "elbow"]) if k != lacks)
    (folder / "arm.toml").write_text(MODEL % dry)
    for name, (command, position) in [("fit", fit), ("check", check)]:
        t = np.arange(len(command)) / RATE
        table = np.column_stack([t, position[:, :, column], command[:, :, column]])
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="t,q1,q2,shoulder_command,elbow_command", comments="", fmt="%.9g")


def claims(answer):
    """What a diagnosis claims: kinds with their places."""
    found = {(one["kind"], *one["at"]) for one in answer["effects"]}
    return found | {(one["kind"], *one["at"]) for one in answer["disturbances"] if one["kind"].startswith("servo_")}


def mark(case, found):
    name = ["shoulder", "elbow"][case["drive"]]
    kind = case["hidden"]
    wanted = {"dead_band": "servo_dead_band", "saturation": "servo_saturation"}.get(kind, kind)
    if kind == "none":
        return "false" if found else "right"
    if not found:
        return "silent"
    if (wanted, name) in found:
        return "right" if len(found) == 1 else "partly"
    return "false"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep")
    given = parser.parse_args()
    random = np.random.default_rng(given.seed)
    cases = [draw_case(random, HIDDEN[k % len(HIDDEN)]) for k in range(given.count)]
    runs = [simulate(random, cases) for _ in range(2)]
    counts = collections.Counter()
    with tempfile.TemporaryDirectory() as temporary:
        for k, case in enumerate(cases):
            folder = pathlib.Path(given.keep or temporary) / f"case{k}"
            folder.mkdir(parents=True, exist_ok=True)
            write_case(folder, case, *runs, k)
            command = [given.program, "diagnose", "arm.toml", "--data", "fit.csv", "--check", "check.csv", "--json"]
            answer = subprocess.run(command, cwd=folder, capture_output=True, text=True)
            if answer.returncode != 0:
                verdict, found = "refused", answer.stderr.strip().splitlines()[-1:]
            else:
                found = claims(json.loads(answer.stdout))
                verdict = mark(case, found)
                (folder / "answer.json").write_text(answer.stdout)
            counts[verdict] += 1
            name = ["shoulder", "elbow"][case["drive"]]
            print(f"{k:3} {verdict:8} {case['hidden']} of {name}, {case['size']:.3g}: {sorted(found)}", flush=True)
    print(", ".join(f"{n} {verdict}" for verdict, n in sorted(counts.items())))


if __name__ == "__main__":
    main()
