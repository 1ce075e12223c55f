#!/usr/bin/env python3
"""Makes recordings/servo-arm: logs of a small servo arm without forces, simulated by MuJoCo.

    python3 lab/servo-plant/servo_arm.py
    python3 lab/servo-plant/servo_arm.py --replay better.xml    # rms errors in degrees along check.csv, without writing logs

The machine has the bodies and gains of recordings/servo-arm/servo_arm.xml. TRUE lists what differs: the description has no
dry friction, another damping and rotor inertia, and no delay. The log has commands and positions, as encoders of 14 bits
read them, at 100 Hz. Its first column is the time in s. It needs numpy and mujoco.
"""

import pathlib
import re
import sys

import mujoco
import numpy as np

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "recordings" / "servo-arm"
TRUE = {
    "shoulder": {"damping": 0.12, "armature": 0.022, "frictionloss": 0.15},
    "elbow": {"damping": 0.06, "armature": 0.014, "frictionloss": 0.09},
}
DELAY = 0.012
STEP, EVERY, DURATION = 2.5e-4, 40, 20.0
ENCODER = 2 * np.pi / 2**14


def machine() -> mujoco.MjModel:
    text = (FOLDER / "servo_arm.xml").read_text()
    text = text.replace("<option ", f'<option timestep="{STEP}" integrator="implicitfast" ')
    for joint, values in TRUE.items():
        own = " ".join(f'{key}="{value}"' for key, value in values.items())
        text = re.sub(rf'(<joint name="{joint}"[^>]*?) damping="[^"]*" armature="[^"]*"/>', rf"\1 {own}/>", text)
    return mujoco.MjModel.from_xml_string(text)


def command(t: float, phases: np.ndarray) -> np.ndarray:
    amplitudes, rates = np.array([0.55, 0.3, 0.12]), np.array([0.31, 0.83, 1.9])
    return np.array([np.sum(amplitudes * np.sin(2 * np.pi * rates * (1 + 0.13 * k) * t + phases[k])) for k in range(2)])


def log(seed: int) -> np.ndarray:
    model = machine()
    data = mujoco.MjData(model)
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, (2, 3))
    data.qpos[:] = command(0.0, phases)
    rows = []
    for k in range(int(DURATION / STEP)):
        t = k * STEP
        if k % EVERY == 0:
            rows.append([t, *(ENCODER * np.round(data.qpos / ENCODER)), *command(t, phases)])
        data.ctrl[:] = command(t - DELAY, phases)
        mujoco.mj_step(model, data)
    return np.array(rows)


def replay(path: str) -> np.ndarray:
    """Rms errors of shoulder and elbow, rad, of a description under the interpolated commands of check.csv."""
    recorded = np.loadtxt(FOLDER / "check.csv", delimiter=",", skiprows=1)
    time, q, commands = recorded[:, 0], recorded[:, 1:3], recorded[:, 3:]
    model = mujoco.MjModel.from_xml_path(path)
    model.opt.timestep, model.opt.integrator = 5e-4, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # The commands are delayed here, so that the delay is no multiple of the step.
    delays = model.actuator_delay.copy()
    model.actuator_delay[:] = 0
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q[0], (q[1] - q[0]) / (time[1] - time[0])
    errors = []
    for k, t in enumerate(time):
        errors.append(data.qpos - q[k])
        for i in range(20):
            now = t + i * model.opt.timestep
            data.ctrl[:] = [np.interp(now - delay, time, commands[:, j]) for j, delay in enumerate(delays)]
            mujoco.mj_step(model, data)
    return np.sqrt(np.mean(np.square(errors), axis=0))


if "--replay" in sys.argv:
    for path in sys.argv[sys.argv.index("--replay") + 1 :]:
        print(path, np.degrees(replay(path)).round(4))
else:
    for name, seed in [("fit", 1), ("check", 2)]:
        header = "t,shoulder,elbow,shoulder_servo,elbow_servo"
        formats = ["%.2f"] + ["%.6f"] * 4
        np.savetxt(FOLDER / f"{name}.csv", log(seed), fmt=formats, delimiter=",", header=header, comments="")
