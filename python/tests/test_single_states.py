"""Functions of single states: the same numbers as for many states, the same errors, and a low cost."""

from __future__ import annotations

import timeit
import warnings
from collections.abc import Callable
from typing import Any

import modelmill
import numpy as np
import pytest
from modelmill import ModelmillError

from .conftest import MODELS


def loaded(name: str) -> modelmill.Model:
    return modelmill.load(MODELS / f"{name}.toml", progress=False)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "inverse_dynamics": lambda m, q, qd, qdd, **more: m.inverse_dynamics(q, qd, qdd, **more),
    "regressor": lambda m, q, qd, qdd: m.regressor(q, qd, qdd),
    "mass_matrix": lambda m, q, qd, qdd, **more: m.mass_matrix(q, **more),
    "bias": lambda m, q, qd, qdd, **more: m.bias(q, qd, **more),
}


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
@pytest.mark.parametrize("name", ["panda", "puma560", "two_link", "spidermill", "four_bar", "emps", "gough_stewart"])
def test_a_single_state_is_a_row_of_many(name: str) -> None:
    m = loaded(name)
    rng = np.random.default_rng(5)
    centre = {"spidermill": [1.62, 1.34], "four_bar": [1.2]}.get(name)
    if centre is None:
        centre = [0.1] * m.dof if not m.passive else [0.0] * m.dof
    spread = 0.02 if m.passive else 1.0
    q = np.array(centre) + rng.uniform(-spread, spread, (5, m.dof))
    qd, qdd = (rng.uniform(-1, 1, q.shape) for _ in range(2))
    values = m.p_min.values * rng.uniform(0.5, 1.5, len(m.p_min))
    for function, call in FUNCTIONS.items():
        more: dict[str, Any] = {} if function == "regressor" else {"parameters": values}
        try:
            many = call(m, q, qd, qdd, **more)
        except ModelmillError:
            continue
        for k in range(len(q)):
            # Twice, with other values in between, because prepared functions are kept.
            for _ in range(2):
                one = call(m, q[k].copy(), qd[k].copy(), qdd[k].copy(), **more)
                assert one.shape == many[k].shape
                assert np.allclose(one, many[k], rtol=1e-12, atol=1e-12 * np.abs(many).max())
                call(m, q[k].copy(), qd[k].copy(), qdd[k].copy())
            # Lists, integers and strided arrays go another way.
            assert np.allclose(call(m, list(q[k]), list(qd[k]), list(qdd[k]), **more), one, rtol=1e-12, atol=1e-12)


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_faults_of_single_states_are_reported() -> None:
    m = loaded("two_link")
    good = np.zeros(2)
    for arrays, says in [
        ((np.array([np.nan, 0.0]), good, good), "q1"),
        ((good, np.array([0.0, np.inf]), good), "q2_d"),
        ((np.zeros(3), good, good), "shape"),
        ((np.array(["a", "b"]), good, good), "real numbers"),
    ]:
        with pytest.raises(ModelmillError, match=says):
            m.inverse_dynamics(*arrays)
    with pytest.raises(ModelmillError, match="one for each of p_min"):
        m.inverse_dynamics(good, good, good, parameters=np.array([1.0]))


def test_missing_values_are_reported_for_single_states_too() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", modelmill.ModelmillWarning)
        m = loaded("two_link").with_effect("viscous_friction", at="joint1")
    zero = np.zeros(2)
    with pytest.warns(modelmill.ModelmillWarning, match="no nominal value"):
        m.inverse_dynamics(zero, zero, zero)


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_a_single_state_costs_little() -> None:
    """At most 20 microseconds in a release build; the bound is that of a build without optimisation on a busy machine."""
    m = loaded("panda")
    q, qd, qdd = (np.random.default_rng(1).uniform(-1, 1, m.dof) for _ in range(3))
    m.inverse_dynamics(q, qd, qdd)
    runs = timeit.repeat(lambda: m.inverse_dynamics(q, qd, qdd), number=50, repeat=20)
    assert min(runs) / 50 < 100e-6
