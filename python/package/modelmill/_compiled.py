"""Functions of states, compiled by a C compiler if one is installed."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ._errors import ModelmillError

Floats = NDArray[np.float64]

# Number of states per core from which several cores are used; below that, threads cost more than they save.
_MANY = 20_000


class Compiled:
    """A compiled function of states: arrays of shape (n, dof) in, numbers of all states out."""

    def __init__(self, source: str, shape: Sequence[int]) -> None:
        self.shape = shape
        self._width = int(np.prod(shape))
        with tempfile.TemporaryDirectory(prefix="modelmill-") as folder:
            self._library = ctypes.CDLL(str(_built(source, Path(folder))))
        self._run = self._library.run
        self._run.restype = ctypes.c_int

    def __call__(self, arrays: Sequence[Floats | None], values: Floats) -> Floats | None:
        """Returns the numbers of all states, or None if the evaluator must process the states one by one."""
        first = arrays[0]
        assert first is not None
        n = len(first)
        out = np.empty((n, self._width))
        base = np.ascontiguousarray(values, dtype=np.float64)
        cores = min(_cores(), max(1, n // _MANY))
        ends = np.linspace(0, n, cores + 1, dtype=int)
        parts = list(zip(ends[:-1], ends[1:]))

        def run(part: tuple[int, int]) -> int:
            start, end = part
            return int(self._part([None if a is None else a[start:end] for a in arrays], base, out[start:end]))

        if cores == 1:
            failed = run(parts[0])
        else:
            with ThreadPoolExecutor(cores) as pool:
                failed = any(pool.map(run, parts))
        return None if failed else out.reshape(-1)

    def _part(self, arrays: Sequence[Floats | None], base: Floats, out: Floats) -> int:
        pointers = (ctypes.c_void_p * 4)(*[None if a is None else a.ctypes.data for a in arrays])
        strides = [(0, 0) if a is None else (a.strides[0] // 8, a.strides[1] // 8) for a in arrays]
        by_state = (ctypes.c_long * 4)(*[one[0] for one in strides])
        by_column = (ctypes.c_long * 4)(*[one[1] for one in strides])
        data = ctypes.c_void_p
        found: int = self._run(
            ctypes.c_long(len(out)), pointers, by_state, by_column, data(base.ctypes.data), data(out.ctypes.data)
        )
        return found


def _cores() -> int:
    """Returns the number of cores that this process may use."""
    of_process = getattr(os, "sched_getaffinity", None)
    return (os.cpu_count() or 1) if of_process is None else len(of_process(0))


def _built(source: str, folder: Path) -> Path:
    compiler = os.environ.get("CC") or next((name for name in ("cc", "gcc", "clang") if shutil.which(name)), None)
    if compiler is None or os.name == "nt":
        raise ModelmillError(
            "compile() needs GCC or Clang, and none was found. The functions work without it, but slower. "
            "Install a C compiler, or set CC"
        )
    path, library = folder / "model.c", folder / "model.so"
    path.write_text(source, encoding="utf-8")
    # `-w`: warnings about the calling convention of wide vectors do not apply to inlined functions.
    flags = ["-O2", "-march=native", "-fPIC", "-shared", "-fno-math-errno", "-fno-trapping-math", "-w"]
    # With these flags GCC orders the long program better for the processor (10 % faster); Clang does this by default.
    # The second try is for compilers that refuse the flags.
    for more in (["-fschedule-insns", "-fsched-pressure"], []):
        command = [*compiler.split(), *flags, *more, str(path), "-o", str(library), "-lm"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as error:
            raise ModelmillError(f"the C compiler {compiler} cannot be run: {error}") from None
        if done.returncode == 0:
            return library
    raise ModelmillError(f"the C compiler {compiler} failed: {done.stderr.strip()[:2000]}")
