"""Loading, faults with places, interrupts, progress, and how objects show themselves."""

from __future__ import annotations

import inspect
import os
import signal
import threading
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

import modelmill
from modelmill import ModelmillError, _core
from modelmill._model import ReadingOptions

from .conftest import MODELS, RECORDINGS, ROOT

ROD = """
<robot name="rod">
  <link name="base"/>
  <link name="rod">
    <inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.01"/></inertial>
  </link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="10" velocity="3"/></joint>
</robot>
"""


@pytest.fixture(scope="module")
def m() -> modelmill.Model:
    return modelmill.load(MODELS / "spidermill.toml")


def test_a_model_is_a_path_or_a_text() -> None:
    path = MODELS / "spidermill-paper.toml"
    of_path, of_text = modelmill.load(str(path)), modelmill.load(path.read_text(), name=str(path))
    assert of_path.p_min.expressions == of_text.p_min.expressions
    assert of_path.name == of_text.name == "spidermill-paper"
    assert of_path.p_min[0].name == "p1_min" and "m1*dc1" in of_path.p_min[0].expression
    assert of_path.p_min[-1].name == of_path.p_min[1:][-1].name
    assert of_path.coordinates == ["theta1", "theta2"] and of_path.passive == ["gamma1", "gamma2"]
    assert of_path.drives == ["spindle_left", "spindle_right"]


def test_a_robot_is_a_description_too(tmp_path: Path) -> None:
    path = tmp_path / "rod.urdf"
    path.write_text(ROD)
    for source in (path, ROD):
        rod = modelmill.load(source)
        assert rod.coordinates == ["hinge"]
        # A rod that hangs: m g l sin(q) holds it, (I + m l^2) q'' moves it.
        force = rod.inverse_dynamics([0.3], [0.0], [2.0])
        import math

        assert force[0] == pytest.approx(2 * 9.81 * 0.5 * math.sin(0.3) + (0.1 + 2 * 0.25) * 2.0, rel=1e-3)


def test_faults_of_a_file_have_places() -> None:
    with pytest.raises(ModelmillError) as told:
        modelmill.load("schema = 1\nname = 3\n", name="arm.toml")
    assert "arm.toml:2" in str(told.value)
    assert ("error", 2) in [(one["severity"], one["line"]) for one in told.value.diagnostics]
    assert isinstance(told.value, ValueError)
    for source in ("nowhere.toml", str(RECORDINGS / "spidermill-mbs" / "plain-fit.csv")):
        with pytest.raises(ModelmillError, match="model file"):
            modelmill.load(source)


def test_effects_that_make_no_sense_are_told(m: modelmill.Model) -> None:
    for kind, at, settings in [
        ("coulomb_frction", "spindle_left", {}),
        ("coulomb_friction", "spindle", {}),
        ("coulomb_friction", "spindle_left", {"mu": 1.0}),
    ]:
        with pytest.raises(ModelmillError):
            m.with_effect(kind, at, **settings)
    assert any(one["name"] == "coulomb_friction" for one in modelmill.kinds())


@pytest.fixture
def _interrupts() -> Iterator[None]:
    """Interrupts as a terminal has them: programs that a shell starts in the background begin without."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_interrupts")
def test_an_interrupt_stops_work(m: modelmill.Model) -> None:
    arm = modelmill.load(MODELS / "panda.toml")
    limits = {name + end: size for name in arm.coordinates for end, size in (("", (-1.0, 1.0)), ("_d", 2.0), ("_dd", 5.0))}
    threading.Timer(0.7, os.kill, (os.getpid(), signal.SIGINT)).start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        arm.excite(limits=limits, random=1_000_000, starts=100)
    assert time.monotonic() - begun < 20
    # The model goes on working.
    assert len(arm.inverse_dynamics(*[[0.1] * 7] * 3)) == 7
    with pytest.raises(ModelmillError, match="harmonics"):
        arm.excite(limits=limits, harmonics=0)


def test_progress_is_told_and_may_stop_work(m: modelmill.Model) -> None:
    arm = modelmill.load(MODELS / "panda.toml")
    limits = {name + end: size for name in arm.coordinates for end, size in (("", (-1.0, 1.0)), ("_d", 2.0))}
    heard: list[tuple[str, int, int]] = []

    def hear(what: str, done: int, total: int) -> None:
        heard.append((what, done, total))
        if len(heard) > 3:
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        arm.excite(limits=limits, random=1_000_000, progress=hear)
    assert len(heard) == 4 and all(isinstance(what, str) and what for what, _, _ in heard)


def test_other_threads_go_on(m: modelmill.Model) -> None:
    ticks = 0
    stop = threading.Event()

    def count() -> None:
        nonlocal ticks
        while not stop.wait(0.005):
            ticks += 1

    thread = threading.Thread(target=count)
    thread.start()
    m.diagnose(RECORDINGS / "spidermill-mbs" / "plain-fit.csv")
    stop.set()
    thread.join()
    assert ticks > 10


def test_objects_show_themselves(m: modelmill.Model) -> None:
    assert "p1_min" in repr(m.p_min) and "<table>" in m.p_min._repr_html_()
    equations = m.equations()
    assert "p1_min" in str(equations)
    assert equations._repr_html_().startswith("<iframe")
    assert equations._repr_latex_().startswith("$$")
    assert m.picture()._repr_html_().lstrip().startswith("<svg")
    run = RECORDINGS / "spidermill-mbs" / "plain-fit.csv"
    found = m.identify(run)
    assert "<table>" in found._repr_html_() and "p1_min" in repr(found)
    assert list(found.to_pandas()["name"]) == m.p_min.names
    assert list(m.compare(run).to_pandas()["drive"]) == m.drives
    assert "modelmill" in repr(found) or "p1_min" in str(found)
    assert " --" not in str(found)
    assert set(m.generate("c99")) and any("inverse" in text for text in m.generate("c99").values())


def test_warnings_are_warnings_of_the_package() -> None:
    arm = modelmill.load(MODELS / "two_link.toml")
    with pytest.warns(modelmill.ModelmillWarning, match="no nominal value"):
        arm.inverse_dynamics([0, 0], [0, 0], [0, 0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        arm.inverse_dynamics([0, 0], [0, 0], [0, 0], parameters=arm.p_min.values)


def test_what_messages_advise_exists() -> None:
    keywords, methods = _core.advised_names()
    owners = [modelmill, *(one for one in vars(modelmill).values() if inspect.isclass(one))]
    members = [(name, member) for owner in owners for name, member in vars(owner).items()]
    functions = {name: member for name, member in members if inspect.isfunction(member)}
    known = set(ReadingOptions.__annotations__)
    for function in functions.values():
        known.update(inspect.signature(function).parameters)
    assert keywords and not set(keywords) - known
    assert methods and not set(methods) - set(functions)


def test_names_of_users_stay_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "verb `add`.toml"
    path.write_text((MODELS / "two_link.toml").read_text())
    arm = modelmill.load(path)
    assert arm.name == "verb `add`" and arm.check().to_dict()["model"] == "verb `add`"
    with pytest.raises(ModelmillError, match="columns={") as raised:
        arm.compare({"t": [0.0, 1.0], "q1": [0.0, 1.0]})
    assert "option `" not in str(raised.value)


def test_a_typed_program_passes_the_checker(monkeypatch: pytest.MonkeyPatch) -> None:
    mypy = pytest.importorskip("mypy.api")
    here = Path(__file__).parent
    # From where the name of the package is that of no folder.
    monkeypatch.chdir(here)
    for what in (["typed_use.py"], ["-p", "modelmill"]):
        text, faults, status = mypy.run(["--strict", *what])
        assert status == 0, text + faults
