"""Compares two results to 1e-9: `same.py WHAT ONE.csv OTHER.csv`."""

import csv
import sys

what = sys.argv[1]
one, other = (list(csv.reader(open(name))) for name in sys.argv[2:])
assert len(one) > 1, f"{what}: the result is empty"
assert len(other) == len(one), f"{what}: {len(one)} lines, and {len(other)}"
worst = 0.0
for a, b in zip(one, other):
    assert a[:2] == b[:2] and len(a) == len(b), (what, a[:2], b[:2])
    for x, y in zip(a[2:], b[2:]):
        if x != y:
            worst = max(worst, abs(float(x) - float(y)) / max(abs(float(x)), 1e-3))
            assert worst <= 1e-9, (what, a[:2], x, y)
print(f"{what}: {len(one) - 1} groups are the same as in one process, the largest difference is {worst:.1e}")
