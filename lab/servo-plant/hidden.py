#!/usr/bin/env python3
"""How often `modelmill diagnose` names what a servo arm has and its model file has not, from logs without forces.

    python3 lab/servo-plant/hidden.py --program target/release/modelmill [--count 24] [--seed 1] [--keep DIR]
        [--kinds none,spring,...] [--servo position_servo|velocity_servo|current]

The plant is a vertical arm with two links and position servos: encoders of 12 bits, 200 Hz, commands that act 12 ms
late, viscous and dry friction. With `--servo velocity_servo` the commands are rates, and with `current` the log has the
forces as noisy currents. It shares no code with modelmill. The model file has the arm, both kinds of friction and the
servos with their gains, but not the delay. Each case hides one item of HIDDEN, or nothing. It needs numpy. Marks:

right    what is hidden is claimed, and nothing else; or nothing is hidden and nothing is claimed
honest   as right, but what is hidden is named as an alternative of a claim that explains the log equally well
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
HIDDEN = ["none", "quadratic_friction", "spring", "force_offset", "dead_band", "saturation", "coulomb_friction", "stribeck_friction", "wrong_gain", "wrong_delay", "payload"]
# The claims that are right for items whose names differ from those of the program.
NAMES = {
    "dead_band": {"servo_dead_band"},
    "saturation": {"servo_saturation"},
    "wrong_gain": {"drive_gain"},
    "wrong_delay": {"signal_delay"},
}
DRIVES = ["shoulder", "elbow"]
VELOCITY_GAIN = np.array([12.0, 4.0])
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
transform = { xyz = ["L", 0, 0] }
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
%s"""
DRY = """[[effect]]
kind = "coulomb_friction"
at = "%s"
"""


ACTUATOR = """[[actuator]]
drive = "%s"
kind = "%s"
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


def simulate(random, cases, servo):
    """Logs of all cases at once, [sample, drive, case]: signals and positions."""
    n = len(cases)
    commands = Commands(random, n)
    size = {kind: np.array([[case["size"] if (case["hidden"], case["drive"]) == (kind, d) else 0.0 for case in cases] for d in (0, 1)]) for kind in HIDDEN}
    limit = np.where(size["saturation"] > 0, size["saturation"], np.inf)
    load = size["payload"].sum(0)
    (m1, c1, i1), (m2, c2, i2) = LINKS
    # The load is a point at the tip of the second link.
    i2, mc2, m2 = i2 + m2 * c2**2 + load * LENGTH**2, m2 * c2 + load * LENGTH, m2 + load
    q, v = commands.at(0.0), np.zeros((2, n))
    every = round(1 / RATE / STEP)
    late = round(DELAY / STEP)
    log_signal, log_position, rates = [], [], []
    wanted = commands.at(-DELAY)
    for k in range(int(TIME / STEP)):
        t = k * STEP
        if servo == "velocity_servo":
            # An outer loop of the user, at the rate of the log: its commands are held between samples.
            if k % every == 0:
                now = commands.at(t)
                rates.append((now - wanted) * RATE + 6.0 * (now - np.round(q / ENCODER) * ENCODER))
                wanted = now
            signal = rates[-1]
            error = rates[max(0, (k - late) // every)] - v
            force = VELOCITY_GAIN[:, None] * error
        else:
            signal = commands.at(t)
            error = commands.at(t - DELAY) - q
            error = np.sign(error) * np.maximum(np.abs(error) - size["dead_band"], 0)
            force = KP[:, None] * error - KD[:, None] * v
        force = np.clip(force, -limit, limit)
        if servo == "current":
            signal = force + random.normal(0, 0.02, force.shape)
        if k % every == 0:
            log_signal.append(signal)
            log_position.append(np.round(q / ENCODER) * ENCODER)
        direction = np.tanh(v / 0.006)
        friction = VISCOUS[:, None] * v + COULOMB[:, None] * direction
        friction += size["quadratic_friction"] * v * np.abs(v) + size["spring"] * q + size["force_offset"]
        friction += size["stribeck_friction"] * direction * np.exp(-((v / 0.15) ** 2))
        cos, sin = np.cos(q[1]), np.sin(q[1])
        a = i1 + m1 * c1**2 + m2 * LENGTH**2 + i2 + 2 * mc2 * LENGTH * cos
        b = i2 + mc2 * LENGTH * cos
        d = i2
        lower = mc2 * GRAVITY * np.cos(q[0] + q[1])
        gravity = np.array([(m1 * c1 + m2 * LENGTH) * GRAVITY * np.cos(q[0]) + lower, lower])
        h = mc2 * LENGTH * sin
        coriolis = np.array([-h * (2 * v[0] * v[1] + v[1] ** 2), h * v[0] ** 2])
        x, y = force - friction - gravity - coriolis
        determinant = a * d - b * b
        v = v + STEP * np.array([(d * x - b * y) / determinant, (a * y - b * x) / determinant])
        q = q + STEP * v
    return np.array(log_signal), np.array(log_position)


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
        "wrong_gain": (0.75, 0.9),
        "wrong_delay": (0, 0),
        "payload": (0.2, 0.5),
    }
    return {"hidden": hidden, "drive": drive, "size": random.uniform(*ranges[hidden])}


def actuators(case, servo):
    """The entries of both servos; a wrong gain is `size` times the true one, and a wrong delay is zero."""
    text = ""
    for d, name in enumerate(DRIVES):
        hides = case["drive"] == d and case["hidden"]
        gains = {
            "position_servo": {"kp": KP[d], "kd": KD[d]},
            "velocity_servo": {"kv": VELOCITY_GAIN[d]},
            "current": {"torque_constant": 1.0},
        }[servo]
        if hides == "wrong_gain":
            gains = {key: value * case["size"] for key, value in gains.items()}
        text += ACTUATOR % (name, servo)
        text += "".join(f'{key} = "{value:.6g}"\n' for key, value in gains.items())
        if case["hidden"] == "wrong_delay":
            text += "delay = 0.0\n"
    return text


def write_case(folder, case, fit, check, column, servo):
    """The model file and both logs of a case."""
    lacks = case["drive"] if case["hidden"] == "coulomb_friction" else None
    dry = "".join(DRY % name for k, name in enumerate(DRIVES) if k != lacks)
    model = MODEL % (dry, actuators(case, servo))
    if case["hidden"] == "payload":
        model = with_nominal_values(model)
    (folder / "arm.toml").write_text(model)
    signal = {"current": "current"}.get(servo, "command")
    for name, (command, position) in [("fit", fit), ("check", check)]:
        t = np.arange(len(command)) / RATE
        table = np.column_stack([t, position[:, :, column], command[:, :, column]])
        header = f"t,q1,q2,shoulder_{signal},elbow_{signal}"
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")


def with_nominal_values(model):
    """The model with the true values of its bodies and friction: without them a load is a part of the estimates."""
    (m1, c1, i1), (m2, c2, i2) = LINKS
    values = {"XX1": i1 + m1 * c1**2, "mc1": m1 * c1, "m2": m2, "mc2": m2 * c2, "I2": i2 + m2 * c2**2}
    for name, value in values.items():
        model = model.replace(f"{name} = {{ unit", f"{name} = {{ nominal = {value:.9g}, unit")
    for d, name in enumerate(DRIVES):
        for kind, key, size in [("viscous_friction", "Fv", VISCOUS), ("coulomb_friction", "Fc", COULOMB)]:
            entry = f'kind = "{kind}"\nat = "{name}"\n'
            model = model.replace(entry, entry + f"parameters = {{ {key} = {{ nominal = {size[d]} }} }}\n")
    return model


def claims(answer):
    """What a diagnosis claims: kinds with their places, each with the claims that it calls indistinguishable."""
    alike = lambda one: tuple((other["kind"], *other["at"]) for other in one["indistinguishable_from"])
    found = {(one["kind"], *one["at"]): alike(one) for one in answer["effects"]}
    of_servos = ("servo_dead_band", "servo_saturation", "signal_delay")
    return found | {(one["kind"], *one["at"]): () for one in answer["disturbances"] if one["kind"] in of_servos}


def mark_claims(answer, kind, name):
    """The mark of a diagnosis if `kind` is hidden at the drive `name`, and its claims."""
    found = claims(answer)
    return mark(kind, name, found), found


def mark(kind, name, found):
    if kind == "none":
        return "false" if found else "right"
    if not found:
        return "silent"
    # The delays of both servos are wrong, a load is on a body, and only the ratio of both gains can be known.
    has_place = kind not in ("wrong_delay", "payload", "wrong_gain")
    is_it = lambda one: one[0] in NAMES.get(kind, {kind}) and (name in one or not has_place)
    is_right = [is_it(one) for one in found]
    is_honest = [is_it(one) or any(is_it(other) for other in found[one]) for one in found]
    return "right" if all(is_right) else "honest" if all(is_honest) else "partly" if any(is_honest) else "false"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", default=",".join(HIDDEN))
    parser.add_argument("--servo", default="position_servo", choices=["position_servo", "velocity_servo", "current"])
    parser.add_argument("--keep")
    given = parser.parse_args()
    random = np.random.default_rng(given.seed)
    kinds = given.kinds.split(",")
    cases = [draw_case(random, kinds[k % len(kinds)]) for k in range(given.count)]
    runs = [simulate(random, cases, given.servo) for _ in range(2)]
    counts = collections.Counter()
    with tempfile.TemporaryDirectory() as temporary:
        for k, case in enumerate(cases):
            folder = pathlib.Path(given.keep or temporary) / f"case{k}"
            folder.mkdir(parents=True, exist_ok=True)
            write_case(folder, case, *runs, k, given.servo)
            command = [given.program, "diagnose", "arm.toml", "--data", "fit.csv", "--check", "check.csv", "--json"]
            if case["hidden"] == "payload":
                command.append("--held")
            answer = subprocess.run(command, cwd=folder, capture_output=True, text=True)
            if answer.returncode != 0:
                verdict, found = "refused", answer.stderr.strip().splitlines()[-1:]
            else:
                verdict, found = mark_claims(json.loads(answer.stdout), case["hidden"], DRIVES[case["drive"]])
                (folder / "answer.json").write_text(answer.stdout)
            counts[verdict] += 1
            print(f"{k:3} {verdict:8} {case['hidden']} of {DRIVES[case['drive']]}, {case['size']:.3g}: {sorted(found)}", flush=True)
    print(", ".join(f"{n} {verdict}" for verdict, n in sorted(counts.items())))


if __name__ == "__main__":
    main()
