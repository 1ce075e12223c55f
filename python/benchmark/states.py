"""Inverse dynamics of a million states: the compiled functions of the package beside the Rust blocks, in one run.

    python python/benchmark/states.py            # in an environment with the package; needs cargo and a C compiler

Both sides have the same states (random, of the Panda), one core and all their numbers in memory: Python in arrays of shape (n, dof),
in C order and in Fortran order, Rust in one slice for each coordinate, which is what `States` of an emitted module takes. The
emitted Rust is compiled by `cargo build --release` with no other flags. They take turns; the best round of each counts, in processor
time where the system tells it.

Python allocates its result at every call. Rust writes to columns that are there already (`kept`), or to such that it allocates in
that round (`new`); ratios are those to `kept`, which is faster. The forces of both sides are held against each other.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import modelmill

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = """[workspace]
[package]
name = "blocks"
version = "0.0.0"
edition = "2024"
[dependencies]
modelmill-runtime = {{ path = "{runtime}", features = ["std"] }}
"""


def built(model: modelmill.Model, folder: Path) -> Path:
    """The program of the Rust side, with the emitted code of a model."""
    source = folder / "src"
    source.mkdir()
    (code,) = model.generate("rust").values()
    (source / "model.rs").write_text(code, encoding="utf-8")
    (source / "main.rs").write_bytes((Path(__file__).parent / "blocks.rs").read_bytes())
    (folder / "Cargo.toml").write_text(MANIFEST.format(runtime=(ROOT / "runtime").as_posix()), encoding="utf-8")
    # The versions that the project is tested with.
    (folder / "Cargo.lock").write_bytes((ROOT / "Cargo.lock").read_bytes())
    subprocess.run(["cargo", "build", "--release", "--quiet", "--target-dir", folder / "target"], cwd=folder, check=True)
    return folder / "target" / "release" / "blocks"


def one_core() -> tuple[str, Callable[[], int]]:
    """Keeps this process and those that it starts on one core where the system can; says so, with the clock of both sides."""
    if not hasattr(os, "sched_setaffinity"):
        return "on as many cores as each side takes, by the clock", time.perf_counter_ns
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    return "one core, processor time", time.process_time_ns


def main() -> None:
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--model", type=Path, default=ROOT / "model-spec" / "models" / "panda.toml")
    options.add_argument("--states", type=int, default=1_000_000)
    options.add_argument("--rounds", type=int, default=20)
    options.add_argument("--most", type=float, help="fail where Python takes more than so many times as long")
    asked = options.parse_args()

    model = modelmill.load(asked.model)
    rng = np.random.default_rng(1)
    rows = [rng.uniform(-1, 1, (asked.states, model.dof)) for _ in range(3)]
    columns = [np.asfortranarray(array) for array in rows]
    base = np.random.default_rng(2).normal(size=len(model.p_min))
    model.compile("inverse_dynamics")

    with tempfile.TemporaryDirectory(prefix="modelmill-states-") as name:
        folder = Path(name)
        program = built(model, folder)
        for file, array in zip(("q", "qd", "qdd", "base"), (*rows, base)):
            array.tofile(folder / file)
        where, now = one_core()
        with subprocess.Popen([program, folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as rust:
            assert rust.stdin is not None and rust.stdout is not None
            assert rust.stdout.readline() == "ready\n"

            def of_rust(what: str) -> float:
                assert rust.stdin is not None and rust.stdout is not None
                print(what, file=rust.stdin, flush=True)
                return int(rust.stdout.readline())

            def of_python(arrays: list[NDArray[np.float64]]) -> float:
                start = now()
                model.inverse_dynamics(*arrays, parameters=base)
                return now() - start

            sides: dict[str, Callable[[], float]] = {
                "Rust blocks, forces kept": lambda: of_rust("kept"),
                "Rust blocks, forces new": lambda: of_rust("new"),
                "Python, rows (n, dof)": lambda: of_python(rows),
                "Python, columns": lambda: of_python(columns),
            }
            best = dict.fromkeys(sides, float("inf"))
            for _ in range(asked.rounds):
                for side, run in sides.items():
                    best[side] = min(best[side], run())
            rust.stdin.close()
            rust.wait()
        expected = np.fromfile(folder / "forces").reshape(asked.states, -1)
    off = 0.0
    for arrays in (rows, columns):
        found = model.inverse_dynamics(*arrays, parameters=base)
        off = max(off, float(np.abs(found - expected).max() / np.abs(expected).max()))

    of_blocks = best["Rust blocks, forces kept"]
    print(f"{model.name}: {asked.states} states, {asked.rounds} rounds in turns, {where}; ns per state")
    counts = model.equations().to_dict()["operations"]["inverse_dynamics"]
    print(f"operations: {', '.join(f'{count} {what}' for what, count in counts.items())}")
    for side, ns in best.items():
        print(f"{side:26} {ns / asked.states:6.1f}  {ns / of_blocks:5.2f}")
    print(f"largest difference of forces: {off:.1e} of the largest force")
    if off > 1e-12:
        sys.exit("the forces of both sides are not the same")
    if asked.most is not None and best["Python, rows (n, dof)"] > asked.most * of_blocks:
        sys.exit(f"Python takes more than {asked.most} times as long as the Rust blocks")


if __name__ == "__main__":
    main()
