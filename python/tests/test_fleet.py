"""Summaries of a fleet: they add in any order, say the values that made the data, and name recordings that give no answer."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modelmill
from modelmill import ModelmillError, fleet

from .conftest import MODELS

#: An arm of six axes: its plan has thousands of numbers, and what is made must be what is read.
MODEL = MODELS / "puma560.toml"

pytestmark = pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
Table = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def model() -> modelmill.Model:
    return modelmill.load(MODEL)


def recording(model: modelmill.Model, seed: int, factor: float = 1.0, noise: float = 0.0) -> Table:
    """Twenty seconds of a smooth motion with the forces of base parameters that are so many times the nominal ones."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 20.0, 0.01)
    q, qd, qdd = (np.zeros((len(t), model.dof)) for _ in range(3))
    for k in range(model.dof):
        for turns in (1, 2, 3, 5):
            speed, phase, reach = 2 * np.pi * turns / 20.0, rng.uniform(0, 2 * np.pi), 0.6 / turns
            q[:, k] += reach * np.sin(speed * t + phase)
            qd[:, k] += reach * speed * np.cos(speed * t + phase)
            qdd[:, k] -= reach * speed**2 * np.sin(speed * t + phase)
    forces = model.inverse_dynamics(q, qd, qdd, parameters=factor * model.p_min.values)
    forces += noise * rng.normal(size=forces.shape)
    columns = {"t": t}
    for suffix, array in (("", q), ("_d", qd), ("_dd", qdd)):
        columns |= {name + suffix: array[:, k] for k, name in enumerate(model.coordinates)}
    return columns | {name: forces[:, k] for k, name in enumerate(model.drives)}


def written(table: Table, path: Path) -> Path:
    rows = np.stack(list(table.values()), axis=1)
    np.savetxt(path, rows, delimiter=",", header=",".join(table), comments="", fmt="%.17g")
    return path


@pytest.fixture(scope="module")
def plan(model: modelmill.Model, tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("reference")
    return fleet.plan(MODEL, [written(recording(model, seed, noise=0.1), folder / f"{seed}.csv") for seed in (100, 101)])


def values(solved: dict[str, Any]) -> np.ndarray:
    return np.array([one["value"] for one in solved["parameters"]])


def assert_near(plan: str, a: bytes, b: bytes) -> None:
    first, second = fleet.solve(plan, a), fleet.solve(plan, b)
    assert [first[k] for k in ("recordings", "bad")] == [second[k] for k in ("recordings", "bad")]
    assert np.allclose(values(first), values(second), rtol=1e-9, atol=1e-9 * np.abs(values(first)).max())


def test_what_made_the_data_is_found(model: modelmill.Model, plan: str) -> None:
    assert fleet.columns(plan) == ["t", *model.coordinates, *model.drives]
    expected = 1.1 * model.p_min.values
    exact = fleet.solve(plan, fleet.summarise(plan, recording(model, 1, 1.1), "exact"))
    assert [one["name"] for one in exact["parameters"]] == model.p_min.names
    assert [one["unit"] for one in exact["parameters"]] == model.p_min.units
    assert (exact["recordings"], exact["bad"]) == (1, 0)
    assert np.allclose(values(exact), expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    noisy = [fleet.summarise(plan, recording(model, seed, 1.1, noise=0.5), f"noisy {seed}") for seed in range(8)]
    solved = fleet.solve(plan, fleet.merge(noisy))
    assert solved["recordings"] == 8
    deviations = np.array([one["std"] for one in solved["parameters"]])
    off = (values(solved) - expected) / deviations
    assert 0.3 < np.sqrt(np.mean(off**2)) < 2.0 and np.abs(off).max() < 5.0, off


def test_summaries_add_in_any_order_and_in_parts(model: modelmill.Model, plan: str) -> None:
    four = [fleet.summarise(plan, recording(model, seed, 1 + 0.02 * seed, noise=0.2), f"{seed}") for seed in range(4)]
    whole = fleet.merge(four)
    assert fleet.solve(plan, whole)["recordings"] == 4
    for order in permutations(four):
        assert_near(plan, whole, fleet.merge(order))
    a, b = fleet.merge(four[:2]), fleet.merge(four[2:])
    for parts in ([a, b], [b, a], [fleet.merge([four[3], a]), four[2]]):
        assert_near(plan, whole, fleet.merge(parts))
    # Nothing is changed by adding, and one part is itself.
    assert fleet.merge([a]) == a
    assert fleet.merge(four) == whole


def test_a_recording_is_the_same_as_file_table_and_in_any_order(model: modelmill.Model, plan: str, tmp_path: Path) -> None:
    table = recording(model, 7, noise=0.2)
    whole = fleet.summarise(plan, table, "one")
    assert_near(plan, whole, fleet.summarise(plan, written(table, tmp_path / "one.csv"), "one"))
    shuffle = np.random.default_rng(1).permutation(len(table["t"]))
    assert fleet.summarise(plan, {name: column[shuffle] for name, column in table.items()}, "one") == whole
    pandas = pytest.importorskip("pandas")
    assert fleet.summarise(plan, pandas.DataFrame(table), "one") == whole
    arrow = pytest.importorskip("pyarrow")
    assert fleet.summarise(plan, arrow.table({"robot": ["R1"] * len(shuffle), **table}), "one") == whole


def test_columns_are_called_as_the_recordings_call_them(model: modelmill.Model, plan: str, tmp_path: Path) -> None:
    table = recording(model, 7)
    theirs = {("tau_1" if name == model.drives[0] else name): column for name, column in table.items()}
    mapped = fleet.plan(MODEL, [written(theirs, tmp_path / "theirs.csv")], columns={model.drives[0]: "tau_1"})
    solved = fleet.solve(mapped, fleet.summarise(mapped, theirs, "theirs"))
    assert np.allclose(values(solved), model.p_min.values, rtol=0, atol=1e-9 * np.abs(model.p_min.values).max())


def test_what_gives_no_answer_is_named_and_not_raised(model: modelmill.Model, plan: str, tmp_path: Path) -> None:
    good = recording(model, 3)
    first, drive = model.coordinates[0], model.drives[1]
    bad = {
        "missing": {name: column for name, column in good.items() if name != drive},
        "no number": {**good, first: np.where(good["t"] == 5.0, np.nan, good[first])},
        "twice": {**good, "t": np.where(good["t"] == 5.0, 4.99, good["t"])},
        "still": {**good, first: np.full_like(good["t"], 0.2)},
        "no file": tmp_path / "nowhere.csv",
    }
    summaries = [fleet.summarise(plan, good, "good")]
    for name, source in bad.items():
        summary = fleet.summarise(plan, source, name)
        with pytest.raises(ModelmillError, match=name):
            fleet.solve(plan, summary)
        summaries.append(summary)
    solved = fleet.solve(plan, fleet.merge(summaries))
    assert (solved["recordings"], solved["bad"]) == (1, len(bad))
    assert np.allclose(values(solved), values(fleet.solve(plan, summaries[0])), rtol=1e-9)
    told = fleet.robot(plan, "R1", {"monday": fleet.merge(summaries)})["days"][0]
    assert sorted(one["recording"] for one in told["bad"]) == sorted(bad)


def test_days_of_a_robot_and_a_sensor_that_died(model: modelmill.Model, plan: str) -> None:
    drive = model.drives[2]
    days = {}
    for k in range(4):
        table = recording(model, 20 + k, noise=0.2)
        if k >= 2:
            table[drive] = np.full_like(table["t"], table[drive][0])
        days[f"2026-03-0{k + 1}"] = fleet.summarise(plan, table, f"R1/{k}")
    found = fleet.robot(plan, "R1", days)
    assert found["robot"] == "R1"
    assert [one["day"] for one in found["days"]] == list(days)
    assert [(one["sensor"], one["day"], one["days"]) for one in found["dead_sensors"]] == [(drive, "2026-03-03", 2)]
    for (day, summary), told in zip(days.items(), found["days"]):
        assert told["values"] == list(values(fleet.solve(plan, summary))), day


def test_what_does_not_add_is_told(model: modelmill.Model, plan: str, tmp_path: Path) -> None:
    table = recording(model, 5)
    one = fleet.summarise(plan, table, "one")
    other_plan = fleet.plan(MODEL, [written(table, tmp_path / "other.csv")], cutoff_hz=7.0)
    other = fleet.summarise(other_plan, table, "other")
    with pytest.raises(ModelmillError, match="plan"):
        fleet.merge([one, other])
    with pytest.raises(ModelmillError, match="another plan"):
        fleet.solve(plan, other)
    for broken in (b"", one[:-3], one[1:], one[:100] + bytes([one[100] ^ 1]) + one[101:]):
        with pytest.raises(ModelmillError):
            fleet.merge([broken])
    with pytest.raises(ValueError, match="no summaries"):
        fleet.merge([])
    with pytest.raises(ModelmillError, match="not a plan"):
        fleet.columns("{}")
    with pytest.raises(ModelmillError, match="nowhere"):
        fleet.plan(MODEL, [tmp_path / "nowhere.csv"])
