#!/usr/bin/env python3
"""How often `modelmill diagnose` names what a plant has and the model file has not: wrong zeros, wrong constants, effects.

    python3 lab/numpy-plant/hidden.py --program target/release/modelmill [--count 60] [--seed 1] [--held] [--keep DIR]

The plant (robot.py) shares no code with modelmill. Each case is drawn from the seed: a fitted recording and a validation
run, with noise of 0.3 % of the force. It needs numpy. Marks:

right      all that is hidden is claimed, or named as alternative of what is claimed, and nothing else is claimed
invisible  nothing is claimed, and the free base parameters represent what is hidden: less than 5 % above the noise remains
honest     nothing false is claimed, but not all is named
false      something is claimed that is not hidden, and what is hidden is not named as its alternative
"""

import argparse
import collections
import json
import pathlib
import subprocess
import tempfile

import numpy as np

import robot

MODEL = pathlib.Path(__file__).resolve().parents[2] / "model-spec/models/spidermill.toml"
DRIVES = ["spindle_left", "spindle_right"]
NOISE = 0.003
ZEROS = ["A_left", "A_right", "R3m", "R3m_right"]
CONSTANTS = ["d1", "d3", "b", "dA", "Bx", "By"]
# Ranges of sizes, in SI units.
EFFECTS = {
    "viscous_friction": (30, 120),
    "coulomb_friction": (8, 30),
    "quadratic_friction": (60, 200),
    "drive_inertia": (5, 20),
    "spring": (150, 500),
    "force_offset": (5, 20),
}
CLASSES = ["zero", "constant", "effect", "two"]


def effect_force(kind, size, length, rate, acceleration):
    """The force that the drive needs in addition."""
    return {
        "viscous_friction": size * rate,
        "coulomb_friction": size * np.sign(rate),
        "quadratic_friction": size * rate * abs(rate),
        "drive_inertia": size * acceleration,
        "spring": size * (length - length.mean()),
        "force_offset": size + 0 * rate,
    }[kind]


def draw_item(random, kind):
    """One hidden item: its class, name, place and size."""
    sign = random.choice([-1, 1])
    if kind == "zero":
        return ("zero", str(random.choice(ZEROS)), sign * random.uniform(0.008, 0.025))
    if kind == "constant":
        return ("constant", str(random.choice(CONSTANTS)), sign * random.uniform(0.01, 0.03))
    name = str(random.choice(list(EFFECTS)))
    return ("effect", name, random.uniform(*EFFECTS[name]), int(random.integers(2)))


def draw_case(seed, number):
    """Class and items of a case."""
    random = np.random.default_rng([seed, number])
    name = CLASSES[number % len(CLASSES)]
    kinds = [name] if name != "two" else list(random.choice(CLASSES[:3], size=2))
    items = [draw_item(random, kind) for kind in kinds]
    while len(items) == 2 and items[0][1] == items[1][1]:
        items[1] = draw_item(random, kinds[1])
    return name, items, random


def record(path, items, random):
    """Writes one recording with the items and noise."""
    geometry = robot.Geometry()
    for item in items:
        if item[0] != "effect":
            setattr(geometry, item[1], getattr(geometry, item[1]) + item[2])
    t, q, qd, qdd = robot.motion(random)
    force = robot.forces(q, qd, qdd, geometry)
    drives = robot.drive_motion(q, qd, qdd, geometry)
    for item in items:
        if item[0] == "effect":
            d = item[3]
            force[d] += effect_force(item[1], item[2], *(x[d] for x in drives))
    rms = np.sqrt((force**2).mean(axis=1, keepdims=True))
    force = force + NOISE * rms * random.normal(size=force.shape)
    names = ["t", "theta1", "theta2", "theta1_d", "theta2_d", "theta1_dd", "theta2_dd", *DRIVES]
    table = np.column_stack([t, *q, *qd, *qdd, *force])
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.10g")


def named(effect):
    """The name of an item as claims have it."""
    if effect[0] == "zero":
        return ("zero", effect[1])
    if effect[0] == "constant":
        return ("constant", effect[1])
    return (effect[1], DRIVES[effect[3]])


def claims(effects):
    """Claimed names, each with its alternatives."""
    found = []
    for one in effects:
        pairs = [(one["kind"], one["at"])] + [(o["kind"], o["at"]) for o in one["indistinguishable_from"]]
        alternatives = set()
        for kind, at in pairs:
            if kind == "constant_error":
                # A zero has the name of its point and axis.
                names = [("zero", place[5:]) if place.startswith("y of ") else ("constant", place) for place in at]
                alternatives.add(frozenset(names))
            else:
                alternatives.add(frozenset((kind, place) for place in at))
        found.append(alternatives)
    return found


def judge(answer, items):
    """The mark of an answer."""
    truth = {named(item) for item in items}
    claimed = claims(answer["effects"])
    own = {name for one in answer["effects"] for name in claims([{**one, "indistinguishable_from": []}])[0]}
    own = set().union(*own) if own else set()
    if own == truth:
        return "right"
    # One claim after the other may be replaced by an alternative.
    covered = set()
    for alternatives in claimed:
        fitting = [a for a in alternatives if a <= truth]
        if fitting:
            covered |= max(fitting, key=len)
    # Errors of the geometry that are named stand for all claims together, if none of the wrong ones is thought likely.
    def is_wrong(one):
        return not any(a <= truth for a in claims([{**one, "indistinguishable_from": []}])[0])

    likely = any(one["probability"] > 0.5 and is_wrong(one) for one in answer["effects"])
    for one in answer.get("geometry_alternatives", []):
        errors = set()
        for error in one["errors"]:
            errors.add(("zero", error["point"]) if error["point"] else ("constant", error["constant"]))
        if errors == truth:
            return "false" if likely else "right"
    if any(not any(a <= truth for a in alternatives) for alternatives in claimed):
        return "false"
    if covered == truth:
        return "right"
    last = answer["steps"][-1]["check"]
    if not own and last is not None and last < 1.05 * NOISE:
        return "invisible"
    return "honest"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--held", action="store_true", help="fix the base parameters at their nominal values")
    parser.add_argument("--keep", help="folder for recordings and answers")
    parser.add_argument("--only", choices=CLASSES)
    options = parser.parse_args()
    scores = {name: collections.Counter() for name in CLASSES}
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(options.keep or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for number in range(options.count):
            name, items, random = draw_case(options.seed, number)
            if options.only and name != options.only:
                continue
            files = [folder / f"{number}-{which}.csv" for which in ("fit", "check")]
            for file in files:
                record(file, items, random)
            command = [options.program, "diagnose", MODEL, "--data", files[0], "--check", files[1], "--json"]
            command += ["--held"] if options.held else []
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                mark, says = "failed", done.stderr.strip()
            else:
                answer = json.loads(done.stdout)
                (folder / f"{number}.json").write_text(done.stdout)
                mark = judge(answer, items)
                says = answer["verdict"] + ": " + "; ".join(
                    f"{one['kind']} at {','.join(one['at'])}" for one in answer["effects"]
                )
            scores[name][mark] += 1
            hidden = " + ".join(f"{item[1]} {item[2]:.4g}" + (f" at {DRIVES[item[3]]}" if len(item) > 3 else "") for item in items)
            print(f"{number:3} {name:9} {mark:10} hidden: {hidden} | {says}", flush=True)
    total = sum(scores.values(), collections.Counter())
    n = max(total.total(), 1)
    for name, score in [*scores.items(), ("all", total)]:
        print(f"{name:9} " + ", ".join(f"{mark} {count}" for mark, count in score.most_common()))
    correct = total["right"] + total["invisible"]
    print(f"right or invisible {100 * correct / n:.0f} %, false claims {100 * total['false'] / n:.1f} % of {n} cases")


if __name__ == "__main__":
    main()
