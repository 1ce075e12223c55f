"""Logs without forces: fits of signals, their gains, and simulation forward in time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modelmill

from .conftest import ROOT

ARM = ROOT / "recordings" / "servo-arm"
TRUE_KP = 20.0


@pytest.fixture(scope="module")
def arm() -> modelmill.Model:
    """The arm with dry friction, and with an unknown gain whose nominal value is wrong."""
    text = modelmill.load(ARM / "servo_arm.xml", known_bodies=True).text
    assert "kp = 20.0" in text
    text = text.replace("kp = 20.0", 'kp = "kp1"')
    text += '\n[parameters]\nkp1 = { unit = "N m", nominal = 40 }\n'
    for drive in ("shoulder_drive", "elbow_drive"):
        text += f'\n[[effect]]\nkind = "coulomb_friction"\nat = ["{drive}"]\n'
    return modelmill.load(text, name="arm.toml")


@pytest.fixture(scope="module")
def fit(arm: modelmill.Model) -> modelmill.Identification:
    return arm.identify(ARM / "fit.csv", check=ARM / "check.csv")


def test_gains_and_delays_are_those_of_the_machine(arm: modelmill.Model, fit: modelmill.Identification) -> None:
    signals = fit.signals
    assert signals is not None and signals.estimator["kind"] == "instruments"
    [gain] = signals.gains
    assert gain["name"] == "kp1" and abs(gain["value"] / TRUE_KP - 1) < 0.01
    assert all(abs(delay["value"] - 0.012) < 3e-4 for delay in signals.delays)
    assert [one.name for one in fit.parameters] == arm.p_min.names
    assert fit.values.shape == (len(arm.p_min),) and fit.condition_number < 100
    assert fit.check is not None and fit.check.nrms is not None and fit.check.nrms < 0.06


def test_the_gains_of_a_fit_are_used(arm: modelmill.Model, fit: modelmill.Identification, tmp_path: Path) -> None:
    wrong = arm.compare(ARM / "check.csv")
    right = arm.compare(ARM / "check.csv", parameters=fit, forward=True)
    assert wrong.nrms is not None and wrong.nrms > 0.2
    assert right.nrms is not None and right.nrms < 0.03
    assert wrong.forward is None and right.forward is not None
    whole_run = right.forward["horizons"][-1]["coordinates"]
    assert max(one["rms"] for one in whole_run.values()) < 0.2  # degrees
    path = tmp_path / "fit.json"
    fit.save(path)
    from_file = arm.compare(ARM / "check.csv", parameters=path)
    assert from_file.nrms == pytest.approx(right.nrms, rel=1e-9)
    assert arm.with_fit(fit).compare(ARM / "check.csv").nrms == pytest.approx(right.nrms, rel=1e-9)


def test_a_simulation_follows_the_log(arm: modelmill.Model, fit: modelmill.Identification) -> None:
    log = np.genfromtxt(ARM / "check.csv", delimiter=",", names=True)
    motion = arm.simulate(ARM / "check.csv", parameters=fit)
    columns = motion.columns
    assert set(columns) == {"t", "shoulder", "elbow", "shoulder_d", "elbow_d", "shoulder_drive", "elbow_drive"}
    for name in ("shoulder", "elbow"):
        recorded = np.interp(columns["t"], log["t"], log[name])
        assert np.sqrt(np.mean((columns[name] - recorded) ** 2)) < 0.005
    # The simulated forces and motion are a recording in which the model has no error.
    assert arm.compare(columns, parameters=fit).nrms == pytest.approx(0, abs=0.02)


def test_options_without_effect_are_refused(arm: modelmill.Model) -> None:
    with pytest.raises(modelmill.ModelmillError, match="robust cannot be used with actuators"):
        arm.identify(ARM / "fit.csv", robust=True)


def test_forces_are_used_if_the_signals_are_missing(arm: modelmill.Model, fit: modelmill.Identification) -> None:
    columns = arm.simulate(ARM / "check.csv", parameters=fit).columns
    by_forces = arm.identify(columns)
    assert by_forces.signals is None
    for one, other in zip(by_forces.parameters, fit.parameters):
        assert one.std is None or one.value == pytest.approx(other.value, rel=0.1), one
