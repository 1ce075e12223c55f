#!/usr/bin/env python3
"""How well `modelmill` identifies and diagnoses servo arms that MuJoCo simulates, from logs without forces.

    python3 lab/servo-plant/mujoco_servo.py --program target/release/modelmill [--machine ur5|six_servos|five_bar]
        [--seeds 20] [--first 1] [--task identify|diagnose] [--kinds none,dead_band,...] [--keep DIR]

MuJoCo integrates the motion; it shares no code with modelmill. The actuators are those of `<position kp kv>`, with
joints that have `armature`, `damping` and `frictionloss`. Logs have commands and positions only: encoders of 12 bits,
200 Hz, commands that act 12 ms late. Commands are continuous in time, so that 12 ms is the complete delay. The machines
are an arm with the sizes of a UR5, an arm of six small servos with the sizes of an SO-101, and a five-bar linkage whose
loop is an equality constraint. It needs numpy and mujoco.

Task `identify`: the bodies are known numbers; gains, friction, armature and delays are not. A value is right if it is
within 5 % or two standard deviations of the true one. Each seed has its own motion, gains and friction. The last line
has the share of right values by kind of value, and the seeds in which all are right.

Task `diagnose`: the bodies have the true values as nominal values, gains are known, and delays are not. Each seed hides
one item of HIDDEN, or nothing. Marks are those of `hidden.py`.
"""

import argparse
import collections
import json
import pathlib
import subprocess
import tempfile

import mujoco
import numpy as np

from hidden import mark_claims

RATE, STEP, DELAY, TIME = 200, 5e-4, 0.012, 25.0
ENCODER = 2 * np.pi / 4096
HIDDEN = ["none", "dead_band", "saturation", "coulomb_friction", "quadratic_friction", "stribeck_friction", "payload"]


class Joint:
    """A joint with its body: the pose of its frame on the parent, its axis, and mass, centre and inertia of the body."""

    def __init__(self, parent, xyz, rpy, axis, mass, centre, inertia, start, servo=None):
        self.parent, self.xyz, self.rpy, self.axis = parent, xyz, rpy, axis
        # The inertia is about the centre, diagonal in the frame of the joint.
        self.mass, self.centre, self.inertia, self.start = mass, centre, inertia, start
        # kp, kd, armature, damping, frictionloss; None for a joint without a servo.
        self.servo = servo


UR5 = [
    Joint(-1, (0, 0, 0.089), (0, 0, 0), "z", 3.8, (0, -0.02, -0.02), (0.011, 0.011, 0.0085), 0.0, (8000, 400, 0.6, 8, 6)),
    Joint(0, (0, 0.136, 0), (0, np.pi / 2, 0), "y", 8.5, (0, 0, 0.26), (0.24, 0.24, 0.016), -0.6, (8000, 400, 0.7, 9, 7)),
    Joint(1, (0, -0.12, 0.425), (0, 0, 0), "y", 2.5, (0, 0, 0.21), (0.05, 0.05, 0.005), 1.1, (5000, 250, 0.5, 6, 4)),
    Joint(2, (0, 0, 0.392), (0, np.pi / 2, 0), "y", 1.3, (0, 0.03, 0.01), (0.003, 0.002, 0.003), 0.3, (1500, 60, 0.12, 2, 1.5)),
    Joint(3, (0, 0.093, 0), (0, 0, 0), "z", 1.2, (0, 0.01, 0.04), (0.003, 0.003, 0.002), 0.4, (1000, 40, 0.10, 1.5, 1.2)),
    Joint(4, (0, 0, 0.095), (0, 0, 0), "y", 0.6, (0.03, 0.05, 0), (0.001, 0.0005, 0.001), 0.2, (500, 20, 0.08, 1.0, 0.8)),
]
SIX_SERVOS = [
    Joint(-1, (0, 0, 0.06), (0, 0, 0), "z", 0.10, (0.01, 0, 0.03), (8e-5, 8e-5, 6e-5), 0.0, (18, 0.9, 0.028, 0.4, 0.06)),
    Joint(0, (0.03, 0, 0.055), (0, 0, 0), "y", 0.11, (0.01, 0, 0.06), (2e-4, 2e-4, 6e-5), -0.5, (18, 0.9, 0.028, 0.4, 0.06)),
    Joint(1, (0.02, 0, 0.113), (0, 0, 0), "y", 0.10, (0.06, 0, 0), (6e-5, 2e-4, 2e-4), 0.6, (18, 0.9, 0.028, 0.4, 0.06)),
    Joint(2, (0.135, 0, 0), (0, 0, 0), "y", 0.08, (0.03, 0, 0), (4e-5, 5e-5, 5e-5), 0.3, (18, 0.9, 0.028, 0.4, 0.06)),
    Joint(3, (0.06, 0, 0), (0, 0, 0), "x", 0.09, (0.03, 0.004, 0), (3e-5, 6e-5, 6e-5), 0.2, (18, 0.9, 0.028, 0.4, 0.06)),
    Joint(4, (0.03, 0.02, 0), (0, 0, 0), "z", 0.03, (0.04, 0.01, 0), (8e-6, 3e-5, 3e-5), 0.3, (18, 0.9, 0.028, 0.4, 0.06)),
]
# The loop joins the tips of the second and the fourth link; links are along x.
FIVE_BAR = [
    Joint(-1, (0, 0, 0), (0, 0, 0), "z", 2.0, (0.22, 0.005, 0), (0.01, 0.04, 0.04), 2.2, (900, 25, 0.15, 2.0, 1.5)),
    Joint(0, (0.45, 0, 0), (0, 0, 0), "z", 1.1, (0.30, 0.005, 0), (0.005, 0.03, 0.03), None),
    Joint(-1, (0.5, 0, 0), (0, 0, 0), "z", 2.1, (0.22, -0.005, 0), (0.01, 0.045, 0.045), 0.9415926, (900, 25, 0.15, 2.0, 1.5)),
    Joint(2, (0.45, 0, 0), (0, 0, 0), "z", 1.2, (0.30, 0.003, 0), (0.005, 0.032, 0.032), None),
]
MACHINES = {"ur5": UR5, "six_servos": SIX_SERVOS, "five_bar": FIVE_BAR}
GRAVITY = {"ur5": (0, 0, -9.81), "six_servos": (0, 0, -9.81), "five_bar": (0, -9.81, 0)}
DISTAL = 0.6
AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
LETTERS = ["kp", "kd", "Ia", "Fv", "Fc"]


def numbers(values):
    return " ".join(f"{value:.12g}" for value in values)


def matrix(rpy):
    """The rotation of fixed axes x, y, z."""
    (sr, cr), (sp, cp), (sy, cy) = [(np.sin(angle), np.cos(angle)) for angle in rpy]
    about_z, about_y = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]), np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return about_z @ about_y @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])


def five_bar_start():
    """Relative angles of the distal links at which their tips meet above the proximal links."""
    first, second = [np.array([x + 0.45 * np.cos(q), 0.45 * np.sin(q)]) for x, q in [(0, FIVE_BAR[0].start), (0.5, FIVE_BAR[2].start)]]
    middle, half = (first + second) / 2, (second - first) / 2
    tip = middle + np.array([-half[1], half[0]]) / np.linalg.norm(half) * np.sqrt(DISTAL**2 - half @ half)
    angle = lambda v: np.arctan2(v[1], v[0])
    return angle(tip - first) - FIVE_BAR[0].start, angle(tip - second) - FIVE_BAR[2].start


def starts(machine):
    joints = MACHINES[machine]
    passive = iter(five_bar_start() if machine == "five_bar" else ())
    return [joint.start if joint.servo else next(passive) for joint in joints]


def mjcf(machine, servos, payload):
    """The machine for MuJoCo; a payload is a point mass at the centre of the last body with a servo chain."""
    joints = MACHINES[machine]

    def body(k):
        joint, text = joints[k], ""
        inner = "".join(body(j) for j in range(len(joints)) if joints[j].parent == k)
        rotation = np.empty(4)
        mujoco.mju_mat2Quat(rotation, matrix(joint.rpy).flatten())
        servo = servos.get(k)
        friction = f'armature="{servo["Ia"]:.12g}" damping="{servo["Fv"]:.12g}" frictionloss="{servo["Fc"]:.12g}"' if servo else ""
        text += f'<body name="b{k}" pos="{numbers(joint.xyz)}" quat="{numbers(rotation)}">'
        text += f'<joint name="q{k + 1}" axis="{numbers(AXES[joint.axis])}" {friction}/>'
        text += f'<inertial pos="{numbers(joint.centre)}" mass="{joint.mass:.12g}" diaginertia="{numbers(joint.inertia)}"/>'
        if payload and k == load_body(machine):
            # A point has no inertia; MuJoCo needs a positive one.
            text += f'<body pos="{numbers(load_place(machine))}"><inertial pos="0 0 0" mass="{payload:.12g}" diaginertia="1e-9 1e-9 1e-9"/></body>'
        if machine == "five_bar" and k in (1, 3):
            text += f'<site name="tip{k}" pos="{DISTAL} 0 0"/>'
        return text + inner + "</body>"

    bodies = "".join(body(k) for k in range(len(joints)) if joints[k].parent < 0)
    actuators = "".join(f'<position joint="q{k + 1}" kp="{servo["kp"]:.12g}" kv="{servo["kd"]:.12g}"/>' for k, servo in servos.items())
    loop = '<equality><connect site1="tip1" site2="tip3" solref="0.002 1" solimp="0.99 0.999 0.001"/></equality>' if machine == "five_bar" else ""
    return (
        f'<mujoco><compiler angle="radian" inertiafromgeom="false"/><option timestep="{STEP}" gravity="{numbers(GRAVITY[machine])}" integrator="implicitfast"/>'
        f"<worldbody>{bodies}</worldbody>{loop}<actuator>{actuators}</actuator></mujoco>"
    )


def load_body(machine):
    return 1 if machine == "five_bar" else len(MACHINES[machine]) - 1


def load_place(machine):
    return (DISTAL, 0, 0) if machine == "five_bar" else MACHINES[machine][-1].centre


def toml(machine, servos, case, task):
    """The model file. For `identify` gains are parameters and bodies numbers; for `diagnose` gains are numbers."""
    joints = MACHINES[machine]
    # A base axis-angle of the same gravity.
    lines = ["schema = 1", f'name = "{machine}"', f"gravity = {list(GRAVITY[machine])}".replace("-9.81", '"-g"'), "[constants]", 'g = { value = 9.81, unit = "m/s^2" }']
    if task == "identify":
        lines.append("[parameters]")
        lines += [f'{key}{k + 1} = {{ unit = "{unit}" }}' for k in servos for key, unit in (("kp", "N m"), ("kd", "N m s"))]
    lines.append("[coordinates]")
    for k, (joint, start) in enumerate(zip(joints, starts(machine))):
        lines.append(f"q{k + 1} = {{ nominal = {start:.9g}{'' if joint.servo else ', passive = true'} }}")
    for k, joint in enumerate(joints):
        parent = "base" if joint.parent < 0 else f"b{joint.parent}"
        rpy = [f'"{round(angle / np.pi * 2)}*pi/2"' for angle in joint.rpy]
        lines += ["[[frame]]", f'name = "b{k}"', f'on = "{parent}"']
        lines.append(f'transform = {{ xyz = [{", ".join(exact(x) for x in joint.xyz)}], rpy = [{", ".join(rpy)}] }}')
        lines.append(f'joint = {{ revolute = "q{k + 1}", axis = "{joint.axis}" }}')
        lines += ["[[part]]", f'on = "b{k}"']
        values = moments(joint)
        if task == "identify":
            lines.append("linear = { " + ", ".join(f'{key} = "{value:.12g}"' for key, value in values.items() if value) + " }")
        else:
            nominal = ", ".join(f"{key} = {value:.12g}" for key, value in values.items())
            lines.append(f'linear = {{ all = "_{k + 1}", nominal = {{ {nominal} }} }}')
    if machine == "five_bar":
        for k in (1, 3):
            lines += ["[[point]]", f'name = "tip{k}"', f'on = "b{k}"', f'at = ["{DISTAL}", 0, 0]']
        lines += ["[[loop]]", 'name = "closure"', 'joins = ["tip1", "tip3"]']
    for k, servo in servos.items():
        lines += ["[[drive]]", f'name = "m{k + 1}"', f'joint = "q{k + 1}"']
    for k, servo in servos.items():
        for kind, key in [("viscous_friction", "Fv"), ("coulomb_friction", "Fc"), ("drive_inertia", "Ia")]:
            if (case["hidden"], case["drive"], kind) == ("coulomb_friction", k, kind):
                continue
            lines += ["[[effect]]", f'kind = "{kind}"', f'at = "m{k + 1}"']
            if task == "diagnose":
                lines.append(f"parameters = {{ {key} = {{ nominal = {servo[key]:.9g} }} }}")
        lines += ["[[actuator]]", f'drive = "m{k + 1}"', 'kind = "position_servo"']
        gains = {key: f"{key}{k + 1}" if task == "identify" else f"{servo[key]:.9g}" for key in ("kp", "kd")}
        lines += [f'{key} = "{value}"' for key, value in gains.items()]
    return "\n".join(lines) + "\n"


def exact(value):
    return f'"{value:.9g}"'


def moments(joint):
    """Mass, first moments and inertia about the origin of the frame."""
    centre, mass = np.array(joint.centre), joint.mass
    inertia = np.diag(joint.inertia) + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    values = {"M": mass, **dict(zip(["MX", "MY", "MZ"], mass * centre))}
    for i, j, key in [(0, 0, "XX"), (0, 1, "XY"), (0, 2, "XZ"), (1, 1, "YY"), (1, 2, "YZ"), (2, 2, "ZZ")]:
        values[key] = inertia[i, j]
    return values


def draw_servos(machine, random):
    """Gains and friction of each joint, up to 20 % from those of the table."""
    draw = lambda values: {key: value * random.uniform(0.8, 1.2) for key, value in zip(LETTERS, values)}
    return {k: draw(joint.servo) for k, joint in enumerate(MACHINES[machine]) if joint.servo}


def simulate(machine, servos, case, random):
    """A log: commands and positions of the driven joints."""
    model = mujoco.MjModel.from_xml_string(mjcf(machine, servos, case["size"] if case["hidden"] == "payload" else 0.0))
    data = mujoco.MjData(model)
    driven = list(servos)
    amplitude = random.uniform(0.05, 0.3, (5, len(driven))) / np.arange(1, 6)[:, None] ** 0.5
    amplitude *= 0.4 if machine == "five_bar" else 1.0
    frequency = np.array([0.15, 0.37, 0.71, 1.3, 2.1])[:, None] * random.uniform(0.9, 1.1, (5, len(driven)))
    phase = random.uniform(0, 2 * np.pi, (5, len(driven)))
    centre = np.array([MACHINES[machine][k].start for k in driven])
    # The motion begins at standstill at the nominal pose.
    ramp = lambda t: min(max(t, 0.0) / 1.0, 1.0) ** 2 * (3 - 2 * min(max(t, 0.0) / 1.0, 1.0))
    command = lambda t: centre + ramp(t) * (amplitude * np.sin(2 * np.pi * frequency * t + phase)).sum(0)
    data.qpos[:] = starts(machine)
    every = round(1 / RATE / STEP)
    own = lambda kind: np.array([case["size"] if (case["hidden"], case["drive"]) == (kind, k) else 0.0 for k in driven])
    band, square, stribeck = own("dead_band"), own("quadratic_friction"), own("stribeck_friction")
    limit = np.where(own("saturation") > 0, own("saturation"), np.inf)
    kp, kd = [np.array([servos[k][key] for k in driven]) for key in ("kp", "kd")]
    log, largest = [], np.zeros(len(driven))
    for step in range(int((TIME + 1.0) / STEP)):
        t = step * STEP
        if step % every == 0 and t >= 1.0:
            log.append(np.concatenate([[t - 1.0], np.round(data.qpos[driven] / ENCODER) * ENCODER, command(t)]))
        position, rate = data.qpos[driven], data.qvel[driven]
        error = command(t - DELAY) - position
        error = np.sign(error) * np.maximum(np.abs(error) - band, 0)
        wanted = kp * error - kd * rate
        largest = np.maximum(largest, np.abs(wanted) * (t >= 1.0))
        # The servo of MuJoCo subtracts the damping itself.
        data.ctrl[:] = position + (np.clip(wanted, -limit, limit) + kd * rate) / kp
        data.qfrc_applied[driven] = -square * rate * np.abs(rate) - stribeck * np.tanh(rate / 0.01) * np.exp(-((rate / 0.15) ** 2))
        mujoco.mj_step(model, data)
    return np.array(log), dict(zip(driven, largest))


def draw_case(machine, servos, hidden, random):
    """One hidden item with its drive and size; sizes are shares of the forces of the drive."""
    drive = int(random.choice(list(servos)))
    servo = servos[drive]
    if hidden == "saturation":
        _, largest = simulate(machine, servos, {"hidden": "none", "drive": None, "size": 0.0}, np.random.default_rng(7))
        size = random.uniform(0.5, 0.65) * largest[drive]
    else:
        dry = servo["Fc"]
        size = {
            "none": 0.0,
            # A band whose force is one to two times the dry friction, or three to six steps of the encoder.
            "dead_band": max(random.uniform(1, 2) * dry / servo["kp"], random.uniform(3, 6) * ENCODER),
            "coulomb_friction": dry,
            "quadratic_friction": random.uniform(0.5, 1.0) * (servo["Fv"] + dry),
            "stribeck_friction": random.uniform(0.6, 1.2) * dry,
            "payload": random.uniform(0.15, 0.3) * sum(joint.mass for joint in MACHINES[machine][-3:]),
        }[hidden]
    return {"hidden": hidden, "drive": drive, "size": size}


def write_case(folder, machine, servos, case, task, random):
    (folder / "servo.toml").write_text(toml(machine, servos, case, task))
    header = ["t"] + [f"q{k + 1}" for k in servos] + [f"m{k + 1}_command" for k in servos]
    for name in ("fit", "check"):
        log, _ = simulate(machine, servos, case, random)
        np.savetxt(folder / f"{name}.csv", log, delimiter=",", header=",".join(header), comments="", fmt="%.9g")


def judge_identification(answer, servos):
    """For each value: its kind, the error in standard deviations and as a share, and whether it is right."""
    true = {f"{key}_m{k + 1}": servo[key] for k, servo in servos.items() for key in ("Ia", "Fv", "Fc")}
    true |= {f"{key}{k + 1}": servo[key] for k, servo in servos.items() for key in ("kp", "kd")}
    rows = []
    for one in answer["parameters"]:
        if one["status"] == "known":
            continue
        value = eval(one["expression"].replace("^", "**"), {}, dict(true))
        kind = next((key for key in ("kp", "kd", "Ia", "Fc") if key in one["expression"]), one["expression"])
        rows.append((kind, one["expression"], value, one["value"], one["std"] if one["status"] == "identified" else None))
    rows += [("delay", f"delay of {one['drive']}", DELAY, one["value"], one["std"]) for one in answer["delays"]]
    judge = lambda true, value, std: std is not None and abs(value - true) <= max(0.05 * abs(true), 2 * std)
    return [(kind, name, true, value, std, judge(true, value, std)) for kind, name, true, value, std in rows]


def run(program, folder, task, case):
    command = [program, task, "servo.toml", "--data", "fit.csv", "--check", "check.csv", "--json"]
    if case["hidden"] == "payload":
        command.append("--held")
    answer = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if answer.returncode != 0:
        return None, answer.stderr.strip().splitlines()[-3:]
    (folder / f"{task}.json").write_text(answer.stdout)
    return json.loads(answer.stdout), None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    parser.add_argument("--machine", default="six_servos", choices=list(MACHINES))
    parser.add_argument("--task", default="identify", choices=["identify", "diagnose"])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--kinds", default=",".join(HIDDEN))
    parser.add_argument("--keep")
    parser.add_argument("--write-only", action="store_true", help="write the cases, and run nothing")
    given = parser.parse_args()
    program = str(pathlib.Path(given.program).absolute())
    kinds = given.kinds.split(",")
    counts, values, complete = collections.Counter(), collections.defaultdict(list), 0
    with tempfile.TemporaryDirectory() as temporary:
        for seed in range(given.first, given.first + given.seeds):
            random = np.random.default_rng(seed)
            servos = draw_servos(given.machine, random)
            hidden = "none" if given.task == "identify" else kinds[seed % len(kinds)]
            case = draw_case(given.machine, servos, hidden, random)
            folder = pathlib.Path(given.keep or temporary) / f"{given.machine}-{given.task}-{seed}"
            folder.mkdir(parents=True, exist_ok=True)
            write_case(folder, given.machine, servos, case, given.task, random)
            (folder / "truth.json").write_text(json.dumps({"servos": servos, "case": case, "delay": DELAY}))
            if given.write_only:
                continue
            answer, fault = run(program, folder, given.task, case)
            if answer is None:
                counts["refused"] += 1
                print(f"{seed:3} refused  {hidden}: {fault}", flush=True)
            elif given.task == "identify":
                rows = judge_identification(answer, servos)
                wrong = [row for row in rows if not row[-1]]
                complete += not wrong
                for kind, *_, is_right in rows:
                    values[kind].append(is_right)
                says = ", ".join(f"{name} {value:.4g} +- {std if std is None else f'{std:.2g}'} (true {true:.4g})" for _, name, true, value, std, _ in wrong)
                print(f"{seed:3} {len(rows) - len(wrong)} of {len(rows)} right; wrong: {says or 'none'}", flush=True)
            else:
                name = f"m{case['drive'] + 1}"
                verdict, found = mark_claims(answer, hidden, name)
                counts[verdict] += 1
                print(f"{seed:3} {verdict:8} {hidden} of {name}, {case['size']:.3g}: {sorted(found)}", flush=True)
    if given.task == "identify":
        print("; ".join(f"{kind} {sum(right)} of {len(right)}" for kind, right in values.items()))
        print(f"all values right in {complete} of {given.seeds} seeds, {counts['refused']} refused")
    else:
        print(", ".join(f"{n} {verdict}" for verdict, n in sorted(counts.items())))


if __name__ == "__main__":
    main()
