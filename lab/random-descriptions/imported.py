"""Imports a description with modelmill and evaluates the result by its C99 source.

`import_description` gives the model's text, the remarks and the fault. `EmittedModel` compiles the source and evaluates forces and
passive coordinates at any state. Needs a C compiler.
"""

import ctypes
import math
import re
import subprocess
import tomllib
from pathlib import Path

import numpy as np


def run(program, *arguments):
    """Runs modelmill; returns exit status and standard error."""
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=300)
    return done.returncode, done.stderr


def import_description(program, path, options=()):
    """Imports a description into a model file next to it. Returns the file (none if refused) and the messages."""
    out = Path(path).with_suffix(".toml")
    out.unlink(missing_ok=True)
    status, said = run(program, "import", path, "--out", out, *options)
    return (out if status == 0 and out.exists() else None), said


class EmittedModel:
    """The C99 source of a model file, compiled."""

    def __init__(self, program, model):
        folder = Path(model).with_suffix(".c99")
        status, said = run(program, "generate", model, "--language", "c99", "--out", folder)
        if status:
            raise ValueError(said)
        self.said = said
        header = next(folder.glob("*.h"))
        name, text = header.stem, header.read_text()
        library = folder / "model.so"
        subprocess.run(
            ["cc", "-O0", "-shared", "-fPIC", str(folder / f"{name}.c"), "-o", str(library), "-lm"],
            check=True, capture_output=True,
        )
        self.library = ctypes.CDLL(str(library))
        upper = name.upper()

        def names(kind):
            found = re.findall(rf"^#define {upper}_{kind}_(\w+) (\d+)$", text, re.M)
            # Words of C have an underscore in front, and their own underscores are written as codes.
            plain = [(one.removeprefix("_").replace("_5f_", "_") if one.startswith("_") else one, k) for one, k in found]
            return [one for one, _ in sorted(plain, key=lambda pair: int(pair[1]))]

        self.coordinates, self.passive, self.drives = names("COORDINATE"), names("PASSIVE"), names("DRIVE")
        self.name = name
        self.n_base = int(re.search(rf"#define {upper}_N_BASE (\d+)", text)[1])
        self.model = tomllib.loads(Path(model).read_text())
        self.constants = {k: float(v["value"]) for k, v in self.model.get("constants", {}).items()}
        # Memory larger than any of the structs; they contain only numbers.
        self.geometry, self.parameters, self.dynamics = (ctypes.create_string_buffer(1 << 20) for _ in range(3))
        base = (ctypes.c_double * max(self.n_base, 1))()
        self.call("default_geometry", self.geometry)
        self.call("nominal_parameters", self.parameters)
        self.check(self.call("base_parameters", self.geometry, self.parameters, base))
        self.check(self.call("prepare", self.dynamics, self.geometry, base))

    def call(self, function, *arguments):
        return getattr(self.library, f"{self.name}_{function}")(*arguments)

    @staticmethod
    def check(status):
        if status:
            raise ArithmeticError(f"status {status}")

    def vector(self, values):
        return (ctypes.c_double * max(len(values), 1))(*values)

    def forces(self, q, qd, qdd):
        """Forces of the drives."""
        out = self.vector([0.0] * len(self.drives))
        self.check(self.call("inverse_dynamics", self.dynamics, self.vector(q), self.vector(qd), self.vector(qdd), out))
        return np.array(out[: len(self.drives)])

    def passive_motion(self, q, qd, qdd):
        """Passive coordinates, rates and accelerations; three rows."""
        n = len(self.passive)
        out = self.vector([0.0] * (3 * n))
        if n:
            self.check(self.call("passive", self.dynamics, self.vector(q), self.vector(qd), self.vector(qdd), out))
        return np.array(out[: 3 * n]).reshape(3, n)

    def drive_motion(self, q, qd, qdd):
        """Lengths of the drives, their rates and their Jacobian."""
        n, m = len(self.drives), len(self.coordinates)
        out = self.vector([0.0] * (2 * n + n * m))
        self.check(self.call("drives", self.dynamics, self.vector(q), self.vector(qd), self.vector(qdd), out))
        all_ = np.array(out[: 2 * n + n * m])
        return all_[:n], all_[n : 2 * n], all_[2 * n :].reshape(n, m)

    def nominal(self):
        """Nominal values of the independent coordinates."""
        stated = self.model.get("coordinates", {})
        return np.array([float(stated[name].get("nominal", 0.0)) for name in self.coordinates])

    def followers(self):
        """Names of coordinates with `follows`, with their expressions."""
        stated = self.model.get("coordinates", {})
        return {name: entry["follows"] for name, entry in stated.items() if "follows" in entry}

    def evaluate(self, text, values):
        """An expression of the model file; `values` gives the coordinates in it."""
        names = {**self.constants, **values, "pi": math.pi}
        return float(eval(text.strip(), {"__builtins__": {}}, names))

    def coordinate_motion(self, q, qd, qdd):
        """Positions, rates and accelerations of all coordinates by name; those that follow others do so linearly."""
        passive = self.passive_motion(q, qd, qdd)
        levels = []
        for k, own in enumerate((q, qd, qdd)):
            values = dict(zip(self.coordinates, own)) | dict(zip(self.passive, passive[k]))
            zeros = {name: 0.0 for name in values}
            for name, text in self.followers().items():
                constant = self.evaluate(text, zeros) if k else 0.0
                values[name] = self.evaluate(text, values) - constant
            levels.append(values)
        return levels
