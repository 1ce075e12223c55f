"""Models, recordings and results in other processes, and as copies."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
from pathlib import Path

import modelmill
import numpy as np
import pytest

from .conftest import MODELS, RECORDINGS

RUN = RECORDINGS / "spidermill-mbs" / "plain-check.csv"


def error_of(task: tuple[modelmill.Model, modelmill.Recording, modelmill.Identification | None]) -> float:
    """Runs in another process."""
    model, run, fit = task
    found = model.compare(run, parameters=fit, progress=False).nrms
    assert found is not None
    return found


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_models_recordings_and_fits_survive_a_pickle() -> None:
    m = modelmill.load(MODELS / "spidermill.toml", progress=False)
    run, check = m.prepare_recordings([RUN], check=[RUN], progress=False)[0][0], m.recording(RUN, progress=False)
    fit = m.identify(run, progress=False)
    other_m, other_run, other_check, other_fit = pickle.loads(pickle.dumps((m, run, check, fit)))
    assert other_m == m and other_m is not m and hash(other_m) == hash(m)
    assert other_run == run and other_check == check and other_run.model is other_m
    assert other_fit == fit and np.array_equal(other_fit.values, fit.values)
    assert other_fit.model == fit.model and fit.model != m
    assert other_m.compare(other_run, progress=False) == m.compare(run, progress=False)
    # Effects and values that were set after loading are part of a model.
    changed = m.with_effect("coulomb_friction", at="spindle_left", Fc=3.0)
    assert pickle.loads(pickle.dumps(changed)) == changed != m
    table = {"t": run.t, "theta1": run.q[:, 0], "theta2": run.q[:, 1]}
    forces = run.forces
    assert forces is not None
    table.update(zip(m.drives, forces.T))
    tabular = m.recording(table, name="table", progress=False)
    assert pickle.loads(pickle.dumps(tabular)) == tabular != run


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_copies_are_equal_and_share_the_derivation() -> None:
    m = modelmill.load(MODELS / "two_link.toml", progress=False)
    for other in (copy.copy(m), copy.deepcopy(m)):
        assert other == m and other._core is m._core
    assert m != modelmill.load(MODELS / "scara.toml", progress=False)
    assert m != "two_link"
    held = {m: 1}
    assert held[copy.copy(m)] == 1


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_other_processes_compute_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONWARNINGS", "ignore")
    m = modelmill.load(MODELS / "spidermill.toml", progress=False)
    run = m.recording(RUN, progress=False)
    fit = m.identify(run, progress=False)
    tasks = [(m, run, None), (m, run, fit)]
    expected = [error_of(task) for task in tasks]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(error_of, tasks) == expected
    joblib = pytest.importorskip("joblib")
    found = joblib.Parallel(n_jobs=2)(joblib.delayed(error_of)(task) for task in tasks)
    assert found == expected
