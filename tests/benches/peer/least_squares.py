"""Least squares from states in memory with numpy: the peer of `cargo bench --bench estimation`.

Called with a folder that holds `regressor.py` (the model's straight-line program, vectorised over states) and the raw
doubles q, qd, qdd and measured, column after column. Prints the seconds of processor time of the fastest of three rounds
and the parameters. Blocks of states stay in the cache; their rows are folded into the triangle by LAPACK's QR, so that
memory does not grow with the samples, as in the tool.
"""

import sys
import time

import numpy as np

BLOCK = 2048


def main(folder):
    sys.path.insert(0, folder)
    from regressor import regressor

    read = lambda name: np.fromfile(f"{folder}/{name}", dtype="<f8")
    measured = read("measured")
    samples = read_samples(folder)
    q, qd, qdd = (read(name).reshape(-1, samples) for name in ("q", "qd", "qdd"))
    measured = measured.reshape(-1, samples)
    best, values = None, None
    for _ in range(3):
        start = time.process_time()
        values = solve(regressor, q, qd, qdd, measured)
        taken = time.process_time() - start
        best = taken if best is None else min(best, taken)
    print(best, *values)


def read_samples(folder):
    with open(f"{folder}/samples") as file:
        return int(file.read())


def solve(regressor, q, qd, qdd, measured):
    drives, samples = measured.shape
    triangle = None
    for start in range(0, samples, BLOCK):
        part = slice(start, min(start + BLOCK, samples))
        entries = regressor(q[:, part], qd[:, part], qdd[:, part])
        n = len(entries) // drives
        size = part.stop - part.start
        rows = np.empty((drives * size, n + 1))
        for drive in range(drives):
            for column in range(n):
                rows[drive * size : (drive + 1) * size, column] = entries[drive * n + column]
            rows[drive * size : (drive + 1) * size, n] = measured[drive, part]
        stacked = rows if triangle is None else np.vstack([triangle, rows])
        triangle = np.linalg.qr(stacked, mode="r")
    return np.linalg.solve(triangle[:n, :n], triangle[:n, n])


main(sys.argv[1])
