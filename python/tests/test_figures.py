"""Forces of a recording, and the figure that compares them with the model."""

from __future__ import annotations

import inspect
import sys
import warnings

import modelmill
import numpy as np
import pytest
from modelmill import ModelmillError

from .conftest import MODELS, RECORDINGS

RUN = RECORDINGS / "spidermill-mbs" / "plain-check.csv"


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_measured_and_calculated_forces_have_the_error_of_compare() -> None:
    m = modelmill.load(MODELS / "spidermill.toml", progress=False)
    run = m.recording(RUN, progress=False)
    measured, calculated = run.forces, run.calculated()
    assert measured is not None and measured.shape == calculated.shape == (len(run.t), len(m.drives))
    assert np.allclose(calculated, m.inverse_dynamics(run.q, run.qd, run.qdd), rtol=1e-9, atol=1e-9 * np.abs(calculated).max())
    compared = m.compare(run, progress=False)
    for k, drive in enumerate(m.drives):
        figures = compared.channels[drive]
        error = np.linalg.norm(measured[:, k] - calculated[:, k]) / np.linalg.norm(measured[:, k])
        if run._core.segment_lengths() == [figures.get("samples", len(run.t))]:
            assert error == pytest.approx(figures["nrms"], rel=1e-6)
    fit = m.identify(run, progress=False)
    better = np.nanmean((measured - run.calculated(fit)) ** 2)
    assert better < np.nanmean((measured - calculated) ** 2)


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_a_recording_without_forces_has_none() -> None:
    m = modelmill.load(MODELS / "two_link.toml", progress=False)
    t = np.linspace(0, 2, 401)
    q = {"t": t, "q1": np.sin(3 * t), "q2": np.cos(2 * t)}
    run = m.recording(q, progress=False)
    assert run.forces is None and run.calculated().shape == (len(run.t), 2)
    pytest.importorskip("matplotlib")
    with pytest.raises(ModelmillError, match="no forces"):
        m.plot(run)


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_plot_draws_measured_model_and_residual(monkeypatch: pytest.MonkeyPatch) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    m = modelmill.load(MODELS / "spidermill.toml", progress=False)
    run = m.recording(RUN, progress=False)
    figure = m.plot(run)
    assert len(figure.axes) == 2 * len(m.drives)
    forces, residual = figure.axes[:2]
    measured, model = (line.get_ydata() for line in forces.lines[:2])
    assert np.allclose(np.asarray(residual.lines[0].get_ydata()), measured - model, equal_nan=True)
    assert len(m.plot(RUN, drives=["spindle_right"], parameters=m.p_min.values, progress=False).axes) == 2
    with pytest.raises(ModelmillError, match="no drive"):
        m.plot(run, drives=["left"])
    matplotlib.pyplot.close("all")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ModelmillError, match="pip install matplotlib"):
        m.plot(run)


def test_help_shows_real_keywords() -> None:
    for method in (modelmill.Model.identify, modelmill.Model.plot, modelmill.Model.recording, modelmill.Model.runs):
        signature = inspect.signature(method)
        assert "reading" not in signature.parameters
        assert signature.parameters["cutoff_hz"].kind is inspect.Parameter.KEYWORD_ONLY
        assert signature.parameters["trim"].default is None
        assert "standstill" in (method.__doc__ or "")
    identify = inspect.signature(modelmill.Model.identify).parameters
    assert list(identify)[:3] == ["self", "data", "check"]
    assert (identify["weights"].default, identify["robust"].default, identify["physical"].default) == ("auto", None, False)
    assert "options" not in identify


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_values_of_options_are_checked() -> None:
    m = modelmill.load(MODELS / "spidermill.toml", progress=False)
    for options, says in (
        ({"cutoff_hz": "fast"}, "cutoff_hz='fast': expected a frequency"),
        ({"cutoff_hz": 0}, "cutoff_hz=0: expected a frequency"),
        ({"order": 2.5}, "order=2.5: expected an order"),
        ({"order": 0}, "order=0: expected an order"),
        ({"decimate": 0}, "decimate=0: expected an integer"),
        ({"trim": (1, 2, 3)}, "trim=.*: expected a number of samples"),
        ({"between": (3, 1)}, "between=.*: expected two times"),
        ({"smoothing": "none"}, "smoothing='none': expected one of auto, butterworth"),
        ({"standstill": 1}, "standstill=1: expected a number between 0 and 1"),
        ({"weights": "some"}, "weights='some': expected one of auto"),
        ({"prior": 0.2, "physical": True}, "physical and prior exclude each other"),
        # Booleans are no numbers, except where a flag of the program may be given without a value.
        ({"prior": True}, "prior=True: expected a positive number"),
        ({"prior": False}, "prior=False: expected a positive number"),
        ({"cutoff_hz": np.True_}, "cutoff_hz=.*True.*: expected a frequency"),
        ({"order": True}, "order=True: expected an order"),
        ({"trim": True}, "trim=True: expected a number of samples"),
        ({"trim": (True, 5)}, "trim=.*: expected a number of samples"),
        ({"between": (False, 3)}, "between=.*: expected two times"),
        ({"standstill": False}, "standstill=False: expected a number between 0 and 1"),
        ({"robust": True, "cutoff_hz": True}, "cutoff_hz=True: expected a frequency"),
    ):
        with pytest.raises(ModelmillError, match=says):
            m.identify(RUN, progress=False, **options)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="unknown keyword cut; .*cutoff_hz"):
        m.identify(RUN, cut=3, progress=False)  # type: ignore[call-arg]
    # None and False stand for no value, and a single number of samples for both ends.
    same = [
        m.identify(RUN, progress=False, robust=None, physical=False, trim=trim, cutoff_hz=np.float32(20), order=np.int64(4))
        for trim in (50, (50, 50))
    ]
    assert np.array_equal(same[0].values, same[1].values)
    # True stands for the bound of `--robust` without a value, and False for no bound.
    plain, absent, implied, usual, one = (
        m.identify(RUN, progress=False, cutoff_hz=20, **bound)  # type: ignore[arg-type]
        for bound in ({}, {"robust": False}, {"robust": True}, {"robust": 1.345}, {"robust": 1})
    )
    assert np.array_equal(plain.values, absent.values)
    assert np.array_equal(implied.values, usual.values)
    assert not np.array_equal(implied.values, one.values)


ARM = """<robot name="arm"><link name="base"><inertial><mass value="3"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="l1"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>
<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="fixed" type="fixed"><parent link="world"/><child link="base"/></joint>
<joint name="elbow" type="revolute"><parent link="base"/><child link="l1"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="100" velocity="2"/></joint></robot>"""


def test_no_warning_without_a_reason() -> None:
    """All of this is what a description and a log usually are, so that `-W error` does not stop."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        m = modelmill.load(ARM, progress=False)
        assert all(value is not None for value in (one.value for one in m.p_min))
        zero = np.zeros(1)
        m.inverse_dynamics(zero, zero, zero)
        t = np.linspace(0, 20, 4001)
        q = np.sin(2 * t)[:, None] + 0.4 * np.sin(5 * t)[:, None]
        qd = 2 * np.cos(2 * t)[:, None] + 2 * np.cos(5 * t)[:, None]
        qdd = -4 * np.sin(2 * t)[:, None] - 10 * np.sin(5 * t)[:, None]
        forces = m.inverse_dynamics(q, qd, qdd)
        # Columns that name the joint need no mapping.
        table = {"time": t, "q_elbow": q[:, 0], "qd_elbow": qd[:, 0], "qdd_elbow": qdd[:, 0], "tau_elbow": forces[:, 0]}
        run = m.recording(table, progress=False)
        nrms = m.compare(run, progress=False).nrms
        assert nrms is not None and nrms < 1e-9
        m.identify(run, progress=False)
        m.check()
