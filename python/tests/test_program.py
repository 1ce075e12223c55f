"""Every verb says what the program says: its JSON, numbers to 1e-12."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import modelmill

from .conftest import RECORDINGS, ROOT

MODEL = "model-spec/models/spidermill.toml"
PAPER = "model-spec/models/spidermill-paper.toml"
RUNS = "recordings/spidermill-mbs"
DAYS = "recordings/spidermill-days"

#: Texts that tell how to ask for something, in the words of a notebook or of a command line.
SPELLED = {"says", "next", "separate_by", "separate_command"}


def same(ours: Any, program: Any, place: str = "") -> None:
    """Holds two objects of JSON against each other."""
    key = place.rsplit(".", 1)[-1]
    if isinstance(program, dict):
        assert isinstance(ours, dict) and list(ours) == list(program), place
        for name in program:
            same(ours[name], program[name], f"{place}.{name}")
    elif isinstance(program, list):
        assert isinstance(ours, list) and len(ours) == len(program), place
        for k, (a, b) in enumerate(zip(ours, program)):
            same(a, b, f"{place}[{k}]")
    elif isinstance(program, float):
        assert math.isclose(ours, program, rel_tol=1e-12, abs_tol=1e-300), (place, ours, program)
    elif key in SPELLED and isinstance(program, str):
        assert isinstance(ours, str), place
    else:
        assert ours == program, (place, ours, program)


Program = Callable[..., Any]


@pytest.fixture(scope="module")
def m() -> modelmill.Model:
    return modelmill.load(ROOT / MODEL)


def test_equations_and_check(program: Program) -> None:
    for path in (PAPER, "model-spec/models/scara.toml"):
        model = modelmill.load(path)
        same(model.equations().to_dict(), program("equations", path, "--json"))
        same(model.check().to_dict(), program("check", path, "--json"))
        told = program("equations", path, "--json")["base"]
        assert model.p_min.names == [one["name"] for one in told]
        assert model.p_min.expressions == [one["expression"] for one in told]


def test_compare(program: Program, m: modelmill.Model) -> None:
    run = f"{RUNS}/plain-check.csv"
    found = m.compare(run)
    same(found.to_dict(), program("compare", MODEL, "--data", run, "--json"))
    assert found.nrms == found.to_dict()["nrms"]
    assert set(found.channels) == {"spindle_left", "spindle_right"}
    options = ["--cutoff", "20", "--between", "1,6", "--trim", "5,7", "--derivatives", "positions"]
    options += ["--smoothing", "savitzky-golay", "--decimate", "2", "--band", "8"]
    found = m.compare(
        run, cutoff_hz=20, between=(1, 6), trim=(5, 7), source="positions", smoothing="savitzky_golay", decimate=2, band_hz=8
    )
    same(found.to_dict(), program("compare", MODEL, "--data", run, "--json", *options))


@pytest.mark.parametrize(
    ("options", "flags"),
    [
        ({}, []),
        ({"weights": "channels", "robust": 1.345}, ["--weights", "channels", "--robust"]),
        ({"prior": 0.2}, ["--prior", "0.2"]),
        ({"physical": True}, ["--physical"]),
        ({"essential": True, "standstill": 0.01}, ["--essential", "--standstill", "0.01"]),
    ],
)
def test_identify(program: Program, m: modelmill.Model, options: dict[str, Any], flags: list[str]) -> None:
    fit, check = f"{RUNS}/plain-fit.csv", f"{RUNS}/plain-check.csv"
    found = m.identify(fit, check=check, **options)
    told = program("identify", MODEL, "--data", fit, "--check", check, "--json", *flags)
    same(found.to_dict(), told)
    assert [one.value for one in found.parameters] == [one["value"] for one in told["parameters"]]
    assert np.array_equal(found.values, [one["value"] for one in told["parameters"]])


def test_a_fit_takes_the_place_of_nominal_values(program: Program, m: modelmill.Model, tmp_path: Any) -> None:
    fit, check = f"{RUNS}/plain-fit.csv", f"{RUNS}/plain-check.csv"
    identified = m.identify(fit)
    path = tmp_path / "fit.json"
    identified.save(path)
    told = program("compare", MODEL, "--data", check, "--parameters", str(path), "--json")
    same(m.compare(check, parameters=path).to_dict(), told)
    by_value = m.compare(check, parameters=identified).to_dict()
    by_model = identified.model.compare(check).to_dict()
    # What is left of the forces here is rounding, which a last digit of a parameter changes.
    for found in (by_value, by_model):
        assert found["nrms"] == pytest.approx(told["nrms"], rel=1e-6)


def test_diagnose_and_what_follows_from_it(program: Program, m: modelmill.Model) -> None:
    fit, check = f"{RUNS}/with-rods-fit.csv", f"{RUNS}/with-rods-check.csv"
    found = m.diagnose(fit, check=check)
    same(found.to_dict(), program("diagnose", MODEL, "--data", fit, "--check", check, "--json"))
    assert found.verdict == "missing_effect"
    assert [effect.kind for effect in found.effects] == ["rod_inertia"]
    assert found.model is not None and "rod_inertia" in found.model.text
    before, after = (model.identify(fit, check=check).check for model in (m, found.model))
    assert before is not None and after is not None
    assert before.nrms is not None and after.nrms is not None and after.nrms < 0.5 * before.nrms
    page = found.report()
    assert page.html.startswith("<!") and "</html>" in page.html
    assert "--data" not in str(found) and "modelmill " not in str(found)


def test_runs(program: Program) -> None:
    path = f"{DAYS}/spidermill-friction.toml"
    model = modelmill.load(path)
    days = [f"{DAYS}/{name}.csv" for name in ("monday", "tuesday", "with-load")]
    found = model.runs(days)
    same(found.to_dict(), program("runs", path, "--data", *days, "--json"))
    assert found.changes
    assert "</html>" in found.report().html


def test_runs_that_cannot_be_read_are_named(program: Program, tmp_path: Any) -> None:
    path = f"{DAYS}/spidermill-friction.toml"
    days = [f"{DAYS}/monday.csv", "nowhere.csv", f"{DAYS}/tuesday.csv"]
    found = modelmill.load(path).runs(days)
    same(found.to_dict(), program("runs", path, "--data", *days, "--json"))
    assert [one["file"] for one in found.unread] == ["nowhere.csv"]


def test_interpret(program: Program, tmp_path: Any) -> None:
    model = modelmill.load(PAPER)
    path = tmp_path / "fit.json"
    fit = model.identify(f"{RUNS}/plain-fit.csv")
    fit.save(path)
    names = ["m2", "m4", "dc3", "Ic12", "Ic32"]
    told = program("interpret", PAPER, "--fit", str(path), "--unknown", ",".join(names), "--json")
    for given in (fit, path):
        found = model.interpret(given, names)
        same(found.to_dict(), told)
    assert len(found.solutions) == 2 and found.identifiable
    assert len(found.to_pandas()) == 10
    with pytest.raises(modelmill.ModelmillError, match="list of names"):
        model.interpret(fit, "m2")


def test_adopt(program: Program, m: modelmill.Model, tmp_path: Any) -> None:
    path, out = tmp_path / "fit.json", tmp_path / "adopted.toml"
    fit = m.identify(f"{RUNS}/with-rods-fit.csv")
    fit.save(path)
    program("adopt", MODEL, str(path), "--out", str(out), "--json")
    assert m.adopt(path).text == out.read_text()
    assert np.allclose(m.adopt(fit).p_min.values, fit.values, rtol=1e-12)
    with pytest.raises(modelmill.ModelmillError, match="no fit"):
        m.adopt(3.0)  # type: ignore[arg-type]


def test_diff(program: Program, m: modelmill.Model) -> None:
    run = f"{RUNS}/plain-check.csv"
    paper = modelmill.load(PAPER)
    same(m.diff(paper).to_dict(), program("diff", MODEL, PAPER, "--json"))
    found = m.diff(paper, run)
    same(found.to_dict(), program("diff", MODEL, PAPER, "--data", run, "--json"))
    assert found.along is not None and found.base


def test_export(program: Program, tmp_path: Any) -> None:
    for path, format, ending in (("panda", "urdf", "urdf"), ("five_bar", "mjcf", "xml")):
        model, out = f"model-spec/models/{path}.toml", tmp_path / f"{path}.{ending}"
        program("export", model, "--out", str(out))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", modelmill.ModelmillWarning)
            assert modelmill.load(model).export(format) == out.read_text()
    with pytest.raises(modelmill.ModelmillError, match="urdf, mjcf"):
        modelmill.load(PAPER).export("sdf")


def test_simulate_and_reduce(program: Program, tmp_path: Any) -> None:
    rig, plan = "model-spec/rigs/spidermill-full.toml", "model-spec/rigs/spidermill-plan.toml"
    motion, out, reduced = f"{RUNS}/plain-fit.csv", tmp_path / "run.csv", tmp_path / "reduced.toml"
    found = modelmill.simulate(rig, motion, seed=3)
    told = program("simulate", rig, "--trajectory", motion, "--seed", "3", "--out", str(out), "--json")
    del told["out"]
    same(found.to_dict(), told)
    found.to_csv(tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_text() == out.read_text()
    again = modelmill.simulate(rig, np.genfromtxt(motion, delimiter=",", names=True), seed=3)
    drive = "spindle_left"
    assert np.array_equal(again.columns[drive], found.columns[drive])
    told = program("reduce", rig, "--plan", plan, "--out", str(reduced), "--json")
    del told["out"]
    made = modelmill.reduce(rig, plan)
    same(made.to_dict(), told)
    assert made.text == reduced.read_text()
    nrms = made.model.compare(found.columns).nrms
    assert nrms is not None and nrms < 0.1


def test_excite(program: Program, tmp_path: Any) -> None:
    path = "model-spec/models/two_link.toml"
    limits = {"q1": (-1.0, 1.0), "q1_d": 2.0, "q2": (-1.5, 1.5), "q2_d": 3.0}
    found = modelmill.load(path).excite(limits=limits, harmonics=3, period=5, random=20, starts=1, rate=100)
    out = tmp_path / "motion.csv"
    flags = ["--limits", "q1=-1:1,q1_d=2,q2=-1.5:1.5,q2_d=3", "--harmonics", "3", "--period", "5", "--random", "20"]
    told = program("excite", path, *flags, "--starts", "1", "--rate", "100", "--out", str(out), "--json")
    same(found.to_dict(), told)
    written = np.genfromtxt(out, delimiter=",", names=True)
    assert np.allclose(found.t, written["t"], atol=1e-12)
    assert np.allclose(found.q[:, 1], written["q2"], atol=1e-9)
    assert np.abs(found.q[:, 0]).max() <= 1.0 + 1e-9


def test_an_effect_that_is_added(program: Program, m: modelmill.Model, tmp_path: Any) -> None:
    better = m.with_effect("coulomb_friction", ["spindle_left", "spindle_right"], Fc=25.0)
    path = tmp_path / "better.toml"
    program("add", MODEL, "coulomb_friction", "--at", "spindle_left,spindle_right", "--set", "Fc=25.0", "--out", str(path), "--json")
    assert better.text == path.read_text()
    same(better.equations().to_dict()["base"], program("equations", str(path), "--json")["base"])


def test_states_along_a_recording_have_the_programs_forces(m: modelmill.Model, tmp_path: Any) -> None:
    """`evaluate` of the program beside `inverse_dynamics` at prepared states."""
    import subprocess

    from .conftest import ROOT

    run = RECORDINGS / "spidermill-mbs" / "plain-check.csv"
    out = tmp_path / "forces.csv"
    binary = ROOT / "target" / "debug" / "modelmill"
    if not binary.is_file():
        pytest.skip("the program is not built")
    subprocess.run([binary, "evaluate", MODEL, "--data", str(run), "--cutoff", "20", "--out", str(out)], check=True, cwd=ROOT)
    written = np.genfromtxt(out, delimiter=",", names=True)
    read = m.recording(run, cutoff_hz=20)
    forces = m.inverse_dynamics(read.q, read.qd, read.qdd)
    for k, name in enumerate(m.drives):
        assert np.allclose(forces[:, k], written[name], rtol=1e-9, atol=1e-6)


def made(path: Any, fastest: float, noise: float, seed: int) -> str:
    """Writes a recording of an axis that follows sines up to a frequency, rad/s; positions have a noise, m."""
    draws = np.random.default_rng(seed)
    t = 0.002 * np.arange(5000)
    x, v, a = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for k in range(1, 6):
        # The frequencies have no common period: a periodic motion has its own smoothing.
        size, w, phase = 0.05 / k, fastest * (k / 5) ** 1.1, 6.3 * draws.uniform()
        x += size * np.sin(w * t + phase)
        v += size * w * np.cos(w * t + phase)
        a -= size * w * w * np.sin(w * t + phase)
    force = 95 * a + 200 * v + 25 * np.sign(v) + 0.5 * draws.standard_normal(len(t))
    x = x + noise * draws.standard_normal(len(t))
    np.savetxt(path, np.stack([t, x, force], axis=1), delimiter=",", header="t,x,motor", comments="", fmt="%.12g")
    return str(path)


@pytest.fixture(scope="module")
def axis(tmp_path_factory: pytest.TempPathFactory) -> tuple[modelmill.Model, list[str]]:
    """The model of an axis, and three recordings that are smoothed differently by themselves."""
    folder = tmp_path_factory.mktemp("axis")
    files = [
        made(folder / "slow.csv", 4.0, 2e-5, 1),
        made(folder / "fast.csv", 12.0, 2e-6, 2),
        made(folder / "check.csv", 25.0, 2e-6, 3),
    ]
    return modelmill.load(ROOT / AXIS), files


AXIS = "model-spec/models/emps.toml"
COLUMNS = {"t": "t", "x": "x", "motor": "motor"}
MAPS = ["--map", "t=t", "--map", "x=x", "--map", "motor=motor"]


def test_recordings_are_prepared_together(program: Program, axis: tuple[modelmill.Model, list[str]]) -> None:
    m, (slow, fast, check) = axis
    told = program("identify", AXIS, "--data", slow, fast, "--check", check, "--json", *MAPS)
    same(m.identify([slow, fast], check=check, columns=COLUMNS).to_dict(), told)
    # Also recordings that were prepared one by one before, and those that were prepared together.
    one_by_one = [m.recording(path, columns=COLUMNS) for path in (slow, fast, check)]
    assert len({len(one.t) for one in one_by_one}) > 1, "the recordings do not differ enough for this test"
    same(m.identify(one_by_one[:2], check=one_by_one[2]).to_dict(), told)
    fit, checked = m.prepare_recordings([slow, fast], check=[check], columns=COLUMNS)
    assert len({len(one.t) for one in fit}) == 1
    same(m.identify(fit, check=checked).to_dict(), told)
    # Tables are no exception, except for their names.
    tables = [np.genfromtxt(path, delimiter=",", names=True) for path in (slow, fast, check)]
    dicts = [{name: table[name] for name in table.dtype.names} for table in tables]
    of_tables = m.identify(dicts[:2], check=dicts[2], columns=COLUMNS).to_dict()
    assert [one["value"] for one in of_tables["parameters"]] == [one["value"] for one in told["parameters"]]
    same(m.compare([slow, fast], columns=COLUMNS).to_dict(), program("compare", AXIS, "--data", slow, fast, "--json", *MAPS))
    same(m.runs([slow, fast], columns=COLUMNS).to_dict(), program("runs", AXIS, "--data", slow, fast, "--json", *MAPS))


@pytest.mark.parametrize("part", [0.0, 0.02])
def test_standstill_of_the_reading(program: Program, axis: tuple[modelmill.Model, list[str]], part: float) -> None:
    m, (slow, fast, _) = axis
    flags = ["--data", slow, fast, "--json", "--standstill", str(part), *MAPS]
    for ours, command in ((m.compare, "compare"), (m.identify, "identify")):
        found = ours([slow, fast], standstill=part, columns=COLUMNS)
        same(found.to_dict(), program(command, AXIS, *flags))
    with pytest.raises(modelmill.ModelmillError, match="between 0 and 1"):
        m.compare(slow, standstill=1.5, columns=COLUMNS)
