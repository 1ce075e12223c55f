"""Newly drawn mechanisms of the folder `drawn`, compared with independent mechanics as in `overconstrained`.

usage: drawn.py MODELMILL [--name NAME]

The files state poses as a user would guess them; passive coordinates are solved from there.
The exit status is 1 if a verdict is wrong.
"""

import argparse
import collections
import re
import sys
import tempfile
from pathlib import Path

import numpy as np

from mechanics import Mechanism
from overconstrained import judge


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("--name")
    chosen = parser.parse_args()
    folder = Path(tempfile.mkdtemp())
    count = collections.Counter()
    for source in sorted((Path(__file__).parent / "drawn").glob("*.toml")):
        if chosen.name and source.stem != chosen.name:
            continue
        path = folder / source.name
        path.write_text(source.read_text())
        m = Mechanism(source.read_text())
        q = np.array([m.nominal[n] for n in m.active])
        solved = m.solve(q, 0 * q, 0 * q)
        if solved is None:
            count["not closed"] += 1
            print(f"{source.stem}: not closed from {dict(zip(m.passive, m.at_nominal))}", flush=True)
            continue
        # Start both programs at the same assembly.
        text = source.read_text()
        for name, value in zip(m.passive, solved[0][0]):
            text = re.sub(rf"^{name} = {{ nominal = [^,}}]*", f"{name} = {{ nominal = {round(float(value), 3)}", text, flags=re.M)
        path.write_text(text)
        verdict, text = judge(chosen.program, path, np.random.default_rng(3))
        count[verdict] += 1
        print(f"{source.stem}: {verdict}, {text[:1800]}", flush=True)
    print(dict(count))
    sys.exit(1 if count["wrong"] else 0)


if __name__ == "__main__":
    main()
