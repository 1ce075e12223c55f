"""Compares speeds on the same data: `modelmill-fleet identify`, `modelmill identify` on one file, and numpy with pandas.

    cargo build --profile dist -p modelmill-fleet-program -p modelmill-cli
    python fleet/speed.py                        # in an environment with numpy, pandas and pyarrow

A fleet of five-bars is simulated in a temporary folder. All programs run on one core, one after the other, in several rounds. The
least processor time of each counts, so that other work of the computer has little effect.

The numpy program is written by hand for this mechanism: read with pandas, low-pass and derivatives by FFT, loop closure by formula,
columns of four links and of friction through the same low-pass as the forces, decimation, least squares by normal equations.
`modelmill-fleet identify` does the same for any model. It also checks clocks, delays of encoders and dead sensors, and adds the
columns of possible changes. At the end the friction values of numpy and of the fleet are compared.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[threads] = "1"

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
COLUMNS = ["t", "q1", "q3", "motor_left", "motor_right"]
L0, L1, L2, L3, L4, G = 0.5, 0.45, 0.6, 0.45, 0.6, 9.81


def smooth(x: np.ndarray, dt: float, cutoff: float, derivatives: int = 0) -> np.ndarray:
    """Signals and their derivatives after a zero-phase low-pass; the line from the first to the last sample is kept."""
    n = x.shape[-1]
    first, last = x[..., :1], x[..., -1:]
    line = first + (last - first) * np.arange(n) / (n - 1)
    # Continue the signal with its point reflection, so that value and slope are continuous at the ends.
    rest = x - line
    spectrum = np.fft.rfft(np.concatenate([rest, -rest[..., ::-1]], axis=-1))
    w = 2 * np.pi * np.fft.rfftfreq(2 * n, dt)
    spectrum /= 1 + (w / (2 * np.pi * cutoff)) ** 8
    parts = [np.fft.irfft(spectrum * (1j * w) ** k if k else spectrum, 2 * n)[..., :n] for k in range(derivatives + 1)]
    parts[0] += line
    if derivatives:
        parts[1] += (last - first) / ((n - 1) * dt)
    return np.stack(parts)


def turned(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The unit vector at an angle, and the one a quarter turn ahead."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c, s]), np.stack([-s, c])


def solve(a: np.ndarray, b: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solves a x + b y = right for x and y, with vectors in the plane."""
    d = a[0] * b[1] - a[1] * b[0]
    return (right[0] * b[1] - right[1] * b[0]) / d, (a[0] * right[1] - a[1] * right[0]) / d


def columns(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """The columns of the least-squares problem, drives x columns x samples: ZZ, MX, MY, M of four links, then Coulomb and viscous
    friction of both motors."""
    (e1, n1), (e3, n3) = turned(q[0]), turned(q[1])
    a, b = L1 * e1, L3 * e3
    b[0] += L0
    # The tip: above the line between both elbows.
    between = b - a
    distance = np.hypot(*between)
    along = (distance**2 + L2**2 - L4**2) / (2 * distance)
    above = np.sqrt(L2**2 - along**2)
    unit = between / distance
    tip = a + along * unit + above * np.stack([-unit[1], unit[0]])
    e2, e4 = (tip - a) / L2, (tip - b) / L4
    n2, n4 = np.stack([-e2[1], e2[0]]), np.stack([-e4[1], e4[0]])
    # Rates of the distal links per rate of each motor, then their total rates and accelerations.
    by = [solve(L2 * n2, -L4 * n4, right) for right in (-L1 * n1, L3 * n3)]
    w2, w4 = (by[0][k] * qd[0] + by[1][k] * qd[1] for k in range(2))
    centripetal = L1 * e1 * qd[0] ** 2 - L3 * e3 * qd[1] ** 2 + L2 * e2 * w2**2 - L4 * e4 * w4**2
    right = -L1 * n1 * qdd[0] + L3 * n3 * qdd[1] + centripetal
    acceleration2, acceleration4 = solve(L2 * n2, -L4 * n4, right)
    zero, one = np.zeros_like(q[0]), np.ones_like(q[0])
    still = np.zeros((2, len(zero)))
    # For each link: direction, perpendicular, rate, acceleration, and acceleration of its joint; then for each motor the link's rate
    # and the velocity of its joint.
    links = [
        (e1, n1, qd[0], qdd[0], still, (one, zero), (still, still)),
        (e2, n2, w2, acceleration2, L1 * (n1 * qdd[0] - e1 * qd[0] ** 2), (by[0][0], by[1][0]), (L1 * n1, still)),
        (e3, n3, qd[1], qdd[1], still, (zero, one), (still, still)),
        (e4, n4, w4, acceleration4, L3 * (n3 * qdd[1] - e3 * qd[1] ** 2), (by[0][1], by[1][1]), (still, L3 * n3)),
    ]
    h = np.zeros((2, 20, len(zero)))
    for k, (e, n, w, alpha, joint, rates, velocities) in enumerate(links):
        felt = joint + np.array([[0.0], [G]])
        for d in range(2):
            rate, velocity = rates[d], velocities[d]
            h[d, 4 * k] = rate * alpha
            for which, (m, across) in enumerate(((e, n), (n, -e))):
                moment = m[0] * felt[1] - m[1] * felt[0]
                force = alpha * across - w**2 * m
                h[d, 4 * k + 1 + which] = rate * moment + (velocity * force).sum(0)
            h[d, 4 * k + 3] = (velocity * felt).sum(0)
    for d in range(2):
        h[d, 16 + d] = np.sign(qd[d])
        h[d, 18 + d] = qd[d]
    return h


def by_hand(files: list[Path], cutoff: float, every: int) -> np.ndarray:
    """Parameters from all recordings together, with numpy and pandas."""
    gram, right = np.zeros((20, 20)), np.zeros(20)
    for file in files:
        table = pd.read_parquet(file, columns=COLUMNS)
        t = table["t"].to_numpy()
        dt = (t[-1] - t[0]) / (len(t) - 1)
        q = np.stack([smooth(table[name].to_numpy(np.float64), dt, cutoff, 2) for name in ("q1", "q3")])
        # Columns and forces go through the same low-pass, because friction is not smooth.
        h = smooth(columns(q[:, 0], q[:, 1], q[:, 2]), dt, cutoff)[0][:, :, ::every]
        for d, name in enumerate(("motor_left", "motor_right")):
            tau = smooth(table[name].to_numpy(np.float64), dt, cutoff)[0, ::every]
            gram += h[d] @ h[d].T
            right += h[d] @ tau
    scale = np.sqrt(np.diag(gram)) + (np.diag(gram) == 0)
    found = np.linalg.lstsq(gram / np.outer(scale, scale), right / scale, rcond=1e-10)[0]
    return found / scale


def read(files: list[Path]) -> None:
    """Only reads the recordings, for the time that this takes."""
    for file in files:
        pd.read_parquet(file, columns=COLUMNS)


def run(command: list[object]) -> str:
    """Runs a program and returns its output; ends with its messages if it fails."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{command[0]} failed:\n{done.stderr}")
    return done.stdout


def spent(work: Callable[[], object]) -> float:
    """The processor time of a function, with that of all programs that it starts, s."""

    def now() -> float:
        return sum(sum(resource.getrusage(whose)[:2]) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))

    before = now()
    work()
    return now() - before


def main() -> None:
    about = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    about.add_argument("--programs", type=Path, default=Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "dist")
    about.add_argument("--robots", type=int, default=3, help="each on 10 days with two recordings of 60 s at 250 Hz")
    about.add_argument("--rounds", type=int, default=3)
    about.add_argument("--seed", type=int, default=1)
    asked = about.parse_args()
    fleet, modelmill = (asked.programs / name for name in ("modelmill-fleet", "modelmill"))
    cores = os.cpu_count()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        size = ["--per-day", 2, "--seconds", 60, "--rate", 250, "--bad", 0, "--seed", asked.seed]
        run([fleet, "make", folder / "fleet", "--robots", asked.robots, "--days", 10, *size])
        # One recording as long as all the others together.
        long = 60 * 20 * asked.robots
        size = ["--per-day", 1, "--seconds", long, "--rate", 250, "--bad", 0, "--seed", asked.seed]
        run([fleet, "make", folder / "long", "--robots", 1, "--days", 6, *size])
        model, recordings = folder / "fleet" / "model.toml", folder / "fleet" / "recordings"
        files = sorted(recordings.rglob("*.parquet"))
        samples = sum(len(pd.read_parquet(file, columns=["t"])) for file in files)
        long_file = min((folder / "long" / "recordings").rglob("*.parquet"))
        plan = folder / "plan.json"
        run([fleet, "plan", model, *files[:8], "--out", plan])
        settled = json.loads(plan.read_text())["preparation"]
        cutoff, every = settled["cutoff_hz"], settled["decimate"]
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
        found: dict[str, np.ndarray] = {}
        rounds = iter(range(10**6))

        def summed() -> None:
            run([fleet, "identify", model, recordings, "--plan", plan, "--out", folder / f"out-{next(rounds)}"])

        def hand() -> None:
            found["by hand"] = by_hand(files, cutoff, every)

        each = len(pd.read_parquet(files[0], columns=["t"]))
        sides: list[tuple[str, int, Callable[[], object]]] = [
            (f"`modelmill-fleet identify`, {len(files)} recordings", samples, summed),
            ("`modelmill identify`, one of these recordings", each, lambda: run([modelmill, "identify", model, "--data", files[0]])),
            ("`modelmill identify`, one recording as long as all", samples, lambda: run([modelmill, "identify", model, "--data", long_file])),
            ("numpy and pandas, written by hand for this mechanism", samples, hand),
            ("pandas, reading only", samples, lambda: read(files)),
        ]
        best = [min(times) for times in zip(*[[spent(work) for _, _, work in sides] for _ in range(asked.rounds)])]
        print(f"{len(files)} recordings, {samples} samples, seed {asked.seed}; one core, best of {asked.rounds} rounds; ", end="")
        print(f"cut-off {cutoff:.3g} Hz, decimation {every}\n")
        print("| | samples per second | processor time, s |\n|---|---|---|")
        for (says, n, _), time_spent in zip(sides, best):
            print(f"| {says} | {n / time_spent:.2e} | {time_spent:.2f} |")
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, range(cores or 1))
        begin = time.perf_counter()
        summed()
        took = time.perf_counter() - begin
        print(f"\nall {cores} cores, wall-clock time: {samples / took:.2e} samples per second")
        same(found["by hand"], folder / "out-0" / "results.json")


def same(by_numpy: np.ndarray, results: Path) -> None:
    """Checks that numpy and the fleet give the same friction."""
    told = json.loads(results.read_text())
    names = [one["expression"] for one in told["parameters"]]
    for name, at in (("Fc_left", 16), ("Fc_right", 17), ("Fv_left", 18), ("Fv_right", 19)):
        values = [day["values"][names.index(name)] for robot in told["robots"] for day in robot["days"]]
        mean = sum(values) / len(values)
        if abs(by_numpy[at] - mean) > 0.02 * abs(mean):
            sys.exit(f"{name}: {by_numpy[at]:.4f} with numpy, {mean:.4f} with modelmill-fleet")
        print(f"{name}: {by_numpy[at]:.4f} with numpy, {mean:.4f} with modelmill-fleet")


if __name__ == "__main__":
    main()
