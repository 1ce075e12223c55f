#!/usr/bin/env python3
"""Whether `modelmill diagnose` names faults that are planted into recordings of real machines.

    python3 lab/measured/planted.py --program target/release/modelmill [--data ../shared/data] [--only MACHINE,...]
        [--faults KIND,...] [--seed 1] [--keep DIR]

Noise, friction and all that the model lacks are those of the machine; the fault is known. The first run of a machine has
no fault, and what it claims is not counted in the others. It needs numpy and the recordings. Marks:

right      the fault is named at its place; a push with its times
honest     nothing new is claimed, and the answer states that something is unexplained
silent     nothing new is claimed, and the answer does not change
false      something else is claimed that the run without a fault does not claim
"""

import argparse
import collections
import functools
import json
import pathlib
import re
import shutil
import subprocess
import tempfile

import numpy as np

HERE = pathlib.Path(__file__).resolve().parents[2]
MODELS = HERE / "model-spec/models"
# Every sensor has these: to name them is no claim.
HARMLESS = {"coloured_noise", "quantised_force", "outliers", "time_jitter", "load_noise", "encoder_steps", "periodic_in_time"}


def tiago_model(data, folder):
    text = (data / "machines/tiago/tiago.toml").read_text()
    columns = (data / "machines/tiago/columns.toml").read_text()
    (folder / "tiago.toml").write_text(f"{text}\n[recording.columns]\n{columns}")
    return folder / "tiago.toml"


def panda_model(data, folder):
    shutil.copy(MODELS / "panda.toml", folder)
    shutil.copy(data / "panda/panda-friction.toml", folder)
    return folder / "panda-friction.toml"


def joints(pattern, count):
    return [pattern.format(k) for k in range(1, count + 1)]


# Model, recordings of the fit, validation run, columns of forces.
MACHINES = {
    "panda": (panda_model, ["panda/fit.csv"], "panda/check.csv", joints("joint{}", 7)),
    "tiago": (
        tiago_model,
        ["machines/tiago/fit.csv"],
        "machines/tiago/check.csv",
        joints("e_arm{}", 4),
    ),
    "double-pendulum": (
        "machines/double-pendulum/dp_A_full.toml",
        [f"machines/double-pendulum/trajectory_0{k}.csv" for k in range(4)],
        "machines/double-pendulum/trajectory_04.csv",
        joints("tau_meas{}", 2),
    ),
    "cloos": (MODELS / "cloos.toml", ["cloos-qrc350/traj_A.csv"], "cloos-qrc350/traj_C.csv", joints("tau{}_Nm", 6)),
    "kuka": (
        "kuka-kr300/kuka_full.toml",
        ["kuka-kr300/kuka_A.csv", "kuka-kr300/kuka_B.csv"],
        "kuka-kr300/kuka_C.csv",
        joints("taum{}", 6),
    ),
    "emps": (MODELS / "emps.toml", ["emps/emps_train.csv"], "emps/emps_pulses.csv", ["force_N"]),
}


def read_table(path):
    with open(path) as file:
        names = file.readline().strip().split(",")
    return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1).T))


def write_table(path, table):
    np.savetxt(path, np.column_stack(list(table.values())), delimiter=",", header=",".join(table), comments="", fmt="%.10g")


def drive_of(model, column):
    """The name of the model for a column of the recording."""
    mapping = model.read_text().partition("[recording.columns]")[2]
    found = re.search(rf'^(\w+) = "[^"]*\b{re.escape(column)}\b[^"]*"', mapping, re.M)
    return found[1] if found else column


# A fault changes the tables, those of the fit first, and returns the kinds that name it, its places and its times. `weigh`
# computes the forces of a load along the recordings.


def no_fault(random, tables, columns, time, weigh):
    return ()


def wrong_sign(random, tables, columns, time, weigh):
    column = strong(random, tables, columns)
    for table in tables:
        table[column] = -table[column]
    return {"wrong_sign"}, column, None


def exchanged(random, tables, columns, time, weigh):
    if len(columns) < 2:
        return None
    a, b = (str(name) for name in random.choice(columns, 2, replace=False))
    for table in tables:
        table[a], table[b] = table[b], table[a]
    return {"exchanged_columns"}, a, None


def strong(random, tables, columns):
    """A column whose force is not small."""
    sizes = np.array([np.sqrt(np.mean(tables[0][name] ** 2)) for name in columns])
    return str(random.choice(np.array(columns)[sizes >= 0.2 * sizes.max()]))


def push(share):
    def plant(random, tables, columns, time, weigh):
        column = strong(random, tables, columns)
        t, force = tables[0][time], tables[0][column]
        length = random.uniform(0.3, 0.8)
        begin = t[0] + random.uniform(0.2, 0.8) * (t[-1] - t[0] - length)
        s = np.clip((t - begin) / length, 0, 1)
        size = share * np.sqrt(np.mean((force - force.mean()) ** 2)) * random.choice([-1, 1])
        tables[0][column] = force + 1.5 * size * np.sin(np.pi * s) ** 2
        return {"contact_event"}, None, (begin, begin + length)

    return plant


def step(random, tables, columns, time, weigh):
    column = strong(random, tables, columns)
    for table in tables[:1]:
        t, force = table[time], table[column]
        size = random.uniform(0.3, 0.5) * np.sqrt(np.mean((force - force.mean()) ** 2))
        table[column] = force + size * (t > t[0] + random.uniform(0.3, 0.7) * (t[-1] - t[0]))
    return {"offset_step", "payload_change", "gain_change"}, column, None


def gain(random, tables, columns, time, weigh):
    column = strong(random, tables, columns)
    for table in tables[1:]:
        table[column] = 1.2 * table[column]
    return {"drive_gain", "different_runs"}, column, None


def dead(random, tables, columns, time, weigh):
    column = strong(random, tables, columns)
    table = tables[0]
    table[column] = np.where(table[time] > 0.5 * (table[time][0] + table[time][-1]), 0.0, table[column])
    return {"dead_channel"}, column, None


def late(random, tables, columns, time, weigh):
    """Forces come 15 ms later."""
    for table in tables:
        for column in columns:
            table[column] = np.interp(table[time] - 0.015, table[time], table[column])
    return {"time_delay", "force_lag"}, None, None


def load(is_taken_up):
    """A load on the last link: in all recordings but the first, or from a time of the first on."""

    def plant(random, tables, columns, time, weigh):
        forces = weigh()
        if forces is None:
            return None
        sizes = [np.sqrt(sum(np.mean(table[name] ** 2) for name in columns)) for table in (tables[0], forces[0])]
        factor = random.uniform(0.15, 0.3) * sizes[0] / sizes[1]
        begin = random.uniform(0.35, 0.65)
        interval = None
        for k, (table, weight) in enumerate(zip(tables, forces)):
            # The forces of the load end some samples after the begin and before the end of the recording.
            inside = (table[time] >= weight["t"][0]) & (table[time] <= weight["t"][-1])
            for name in table:
                table[name] = table[name][inside]
            t = table[time]
            begins = t[0] + begin * (t[-1] - t[0]) if is_taken_up else t[0]
            if k > 0 if is_taken_up else k == 0:
                continue
            if is_taken_up:
                interval = (begins, t[-1])
            for name in columns:
                table[name] = table[name] + factor * (t >= begins) * np.interp(t, weight["t"], weight[name])
        return {"payload_change"}, None, interval

    return plant


FAULTS = {
    "none": no_fault,
    "sign": wrong_sign,
    "exchanged": exchanged,
    "push-10": push(0.1),
    "push-30": push(0.3),
    "push-100": push(1.0),
    "step": step,
    "gain": gain,
    "dead": dead,
    "late": late,
    "load": load(False),
    "pick-up": load(True),
}

# A load of 1 kg on the last link of a machine whose forces are columns of its recordings.
LOAD = """
[[part]]
name = "planted_load"
on = "{link}"
mass = 1.0
centre = [0.03, 0.02, 0.05]
inertia = {{ xx = 0.003, yy = 0.003, zz = 0.003 }}
"""


def load_forces(program, model, paths, columns, folder):
    """The forces of a load along recordings, by the name of the column; `None` if columns are no forces of drives."""
    text = model.read_text()
    links = re.findall(r'\[\[frame\]\]\s*name = "(\w+)"', text)
    drives = [drive_of(model, name) for name in columns]
    maps = [re.search(rf'^{name} = "(.*)"', text.partition("[recording.columns]")[2], re.M) for name in drives]
    if not links or any(one and not re.fullmatch(r"\w+", one[1]) for one in maps):
        return None
    head, _, mapping = text.partition("[recording.columns]")
    loaded = folder / f"loaded-{model.name}"
    loaded.write_text(head + LOAD.format(link=links[-1]) + (f"\n[recording.columns]{mapping}" if mapping else ""))
    if not (folder / model.name).exists():
        shutil.copy(model, folder)
    forces = []
    for path in paths:
        each = []
        for one in (loaded, model):
            out = folder / "forces.csv"
            subprocess.run([program, "evaluate", one, "--data", path, "--out", out], check=True, capture_output=True)
            each.append(read_table(out))
        with_load, without = each
        forces.append({"t": with_load["t"]} | {c: with_load[d] - without[d] for c, d in zip(columns, drives)})
    return forces


def claims_of(answer):
    found = [(one["kind"], tuple(one["at"]), one.get("interval"), one) for one in answer["effects"] if one["probability"] > 0.5]
    found += [
        (one["kind"], tuple(one["at"]), one.get("interval"), one)
        for one in answer["disturbances"]
        if one["kind"] not in HARMLESS
    ]
    return found


def mark_of(answer, baseline, truth, model):
    known = {(kind, at) for kind, at, *_ in claims_of(baseline)}
    claims = claims_of(answer)
    if not truth:
        return "", claims
    kinds, column, interval = truth
    place = column and drive_of(model, column)

    def names_it(claim):
        kind, at, when, one = claim
        kinds_of = {kind} | {other["kind"] for other in one.get("indistinguishable_from", [])}
        # A push begins and ends with little force.
        # A load that is taken up is there to the end.
        lasts = kind == "payload_change" and interval and when and abs(interval[0] - when[0]) < 0.2
        in_time = not interval or lasts or (when and interval[0] - 0.1 < when[0] and when[1] < interval[1] + 0.1)
        return bool(kinds & kinds_of) and (place is None or place in at or not at) and in_time

    others = [claim for claim in claims if not names_it(claim) and claim[:2] not in known]
    if others:
        return "false", others
    if any(names_it(claim) for claim in claims):
        return "right", claims
    worse = (answer["steps"][-1]["check"] or 0) > 1.02 * (baseline["steps"][-1]["check"] or 0)
    is_open = answer["verdict"] == "unexplained" or answer["unresolved"]
    return "honest" if is_open and worse else "silent", claims


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    parser.add_argument("--data", type=pathlib.Path, default=HERE / "../shared/data")
    parser.add_argument("--only", help="machines, with commas")
    parser.add_argument("--faults", help="faults, with commas")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=pathlib.Path, help="folder for recordings and answers")
    options = parser.parse_args()
    machines = options.only.split(",") if options.only else list(MACHINES)
    faults = ["none"] + [one for one in (options.faults.split(",") if options.faults else FAULTS) if one != "none"]
    scores = collections.Counter()
    with tempfile.TemporaryDirectory() as temporary:
        for machine in machines:
            folder = (options.keep or pathlib.Path(temporary)) / machine
            folder.mkdir(parents=True, exist_ok=True)
            model, fit, check, forces = MACHINES[machine]
            model = model(options.data, folder) if callable(model) else pathlib.Path(options.data, model)
            paths = [options.data / name for name in [*fit, check]]
            if not all(path.is_file() for path in paths):
                print(f"{machine}: skipped, there are no recordings in {options.data}")
                continue
            plain = [read_table(path) for path in paths]
            time = next(iter(plain[0]))
            baseline = None
            for fault in faults:
                number = sum(ord(letter) for letter in machine + fault)
                random = np.random.default_rng([options.seed, number])
                tables = [dict(table) for table in plain]
                weigh = functools.partial(load_forces, options.program, model, paths, forces, folder)
                truth = FAULTS[fault](random, tables, forces, time, weigh)
                if truth is None:
                    continue
                arguments = []
                for k, table in enumerate(tables):
                    path = folder / f"{fault}-{k}.csv"
                    write_table(path, table)
                    arguments += ["--check" if k == len(tables) - 1 else "--data", str(path)]
                command = [options.program, "diagnose", str(model), *arguments, "--json"]
                done = subprocess.run(command, capture_output=True, text=True)
                says = "" if not truth else f"{truth[1] or ''} {' to '.join(f'{t:.2f}' for t in truth[2] or [])}".strip()
                if done.returncode:
                    mark, said = "honest", "refused: " + done.stderr.strip()[-200:]
                else:
                    answer = json.loads(done.stdout)
                    (folder / f"{fault}.json").write_text(done.stdout)
                    if fault == "none":
                        baseline = answer
                    mark, claims = mark_of(answer, baseline, truth, model)
                    said = f"{answer['verdict']} {100 * (answer['steps'][-1]['check'] or 0):.2f} %: "
                    said += "; ".join(
                        f"{kind} {','.join(at)} {' to '.join(f'{t:.2f}' for t in when or [])}".strip() for kind, at, when, _ in claims
                    )
                if baseline is None:
                    print(f"{machine}: skipped, its recordings without a fault are refused")
                    break
                if fault == "none":
                    mark = "as it is"
                else:
                    scores[mark] += 1
                print(f"{machine:16} {fault:10} {mark:7} {says} | {said}", flush=True)
    n = max(scores.total(), 1)
    print(", ".join(f"{mark} {count}" for mark, count in scores.most_common()) + f" of {n}")


if __name__ == "__main__":
    main()
