"""Functions of states: laws of mechanics over random states, shapes, types, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import modelmill
from modelmill import ModelmillError

from .conftest import MODELS

ARMS = ["panda", "puma560", "scara", "two_link"]


def states(model: modelmill.Model, n: int, seed: int = 1) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.uniform(-1, 1, (n, model.dof)) for _ in range(3)]


def loaded(name: str) -> modelmill.Model:
    return modelmill.load(MODELS / f"{name}.toml")


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
@pytest.mark.parametrize("name", ARMS)
def test_forces_are_regressor_times_base_parameters(name: str) -> None:
    m = loaded(name)
    q, qd, qdd = states(m, 50)
    p = np.random.default_rng(2).normal(size=len(m.p_min))
    forces = m.inverse_dynamics(q, qd, qdd, parameters=p)
    assert forces.shape == (50, len(m.drives))
    assert np.allclose(forces, m.regressor(q, qd, qdd) @ p, rtol=1e-11, atol=1e-11 * np.abs(forces).max())


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
@pytest.mark.parametrize("name", ARMS)
def test_the_equation_of_motion_holds_both_ways(name: str) -> None:
    m = loaded(name)
    q, qd, qdd = states(m, 20)
    forces = m.inverse_dynamics(q, qd, qdd)
    mass = m.mass_matrix(q)
    assert np.allclose(mass, mass.transpose(0, 2, 1), atol=1e-10 * np.abs(mass).max())
    made = np.einsum("nij,nj->ni", mass, qdd) + m.bias(q, qd)
    assert np.allclose(made, forces, atol=1e-10 * np.abs(forces).max())
    found = m.forward_dynamics(q, qd, forces)
    assert np.allclose(found, qdd, atol=1e-7)


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_work_of_many_states_is_that_of_each() -> None:
    """Blocks, chunks and cores make no difference."""
    m = loaded("two_link")
    q, qd, qdd = states(m, 10_000)
    whole = m.inverse_dynamics(q, qd, qdd)
    for k in (0, 63, 64, 4095, 4096, 9_999):
        one = m.inverse_dynamics(q[k], qd[k], qdd[k])
        assert one.shape == (2,)
        assert np.array_equal(one, whole[k])


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_types_and_orders_of_memory_make_no_difference() -> None:
    m = loaded("puma560")
    q, qd, qdd = states(m, 100)
    forces = m.inverse_dynamics(q, qd, qdd)
    for form in (
        np.asfortranarray,
        lambda a: np.repeat(a, 2, axis=0)[::2],
        lambda a: a[::-1][::-1],
        lambda a: np.ascontiguousarray(a.T).T,
        lambda a: a.astype(">f8"),
        lambda a: a.tolist(),
    ):
        assert np.array_equal(m.inverse_dynamics(form(q), form(qd), form(qdd)), forces)
    single = [a.astype(np.float32) for a in (q, qd, qdd)]
    exact = m.inverse_dynamics(*[a.astype(np.float64) for a in single])
    assert np.array_equal(m.inverse_dynamics(*single), exact)
    whole = [np.ones((3, m.dof), dtype=t) for t in (np.int8, np.uint32, np.float16)]
    assert np.array_equal(m.inverse_dynamics(*whole), m.inverse_dynamics(*[a.astype(float) for a in whole]))


def test_reactions_of_a_loop_close_it() -> None:
    m = loaded("four_bar")
    names = m.reaction_names
    found = m.reactions(*[np.full(1, x) for x in (1.2, 0.3, -0.2)])
    assert found.shape == (len(names),)
    assert np.isfinite(found).all()


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
@pytest.mark.parametrize(
    ("shape", "says"),
    [
        ((7, 100), "pass q.T"),
        ((100, 6), "(n, 7)"),
        ((6,), "(7,)"),
        ((2, 3, 7), "(n, 7)"),
        ((), "(7,)"),
    ],
)
def test_wrong_shapes_are_told(shape: tuple[int, ...], says: str) -> None:
    m = loaded("panda")
    with pytest.raises(ModelmillError) as told:
        m.inverse_dynamics(np.zeros(shape), np.zeros(shape), np.zeros(shape))
    assert says in str(told.value), told.value


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_what_is_no_state_is_told() -> None:
    m = loaded("two_link")
    good = np.zeros((3, 2))
    bad = good.copy()
    bad[1, 0] = np.nan
    for arrays, says in [
        ((bad, good, good), "at sample 1 `q1` is no finite number"),
        ((good, good[:2], good), "as many states"),
        ((good, good.astype(complex), good), "real numbers"),
        ((good, [["a", "b"]] * 3, good), "real numbers"),
    ]:
        with pytest.raises(ModelmillError, match="."):
            m.inverse_dynamics(*arrays)
        try:
            m.inverse_dynamics(*arrays)
        except ModelmillError as error:
            assert says in str(error), error
    with pytest.raises(ModelmillError, match="one for each of p_min"):
        m.inverse_dynamics(good, good, good, parameters=[1.0])
    with pytest.raises(ModelmillError, match="there is no base parameter"):
        m.inverse_dynamics(good, good, good, parameters={"mass": 1.0})
    late = np.zeros((9000, 2))
    late[8999, 1] = np.inf
    with pytest.raises(ModelmillError, match="sample 8999 `q2`"):
        m.inverse_dynamics(late, np.zeros_like(late), np.zeros_like(late))


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
def test_no_states_are_no_fault() -> None:
    m = loaded("two_link")
    empty = np.zeros((0, 2))
    assert m.inverse_dynamics(empty, empty, empty).shape == (0, 2)
    assert m.regressor(empty, empty, empty).shape == (0, 2, len(m.p_min))


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
@pytest.mark.parametrize("name", ["panda", "puma560", "two_link", "spidermill", "four_bar", "emps"])
def test_compiled_functions_are_the_evaluators(name: str) -> None:
    import shutil

    if not any(shutil.which(compiler) for compiler in ("cc", "gcc", "clang")):
        pytest.skip("there is no C compiler")
    plain, fast = loaded(name), loaded(name)
    rng = np.random.default_rng(3)
    # Poses that loops reach.
    centre = {"spidermill": [1.62, 1.34], "four_bar": [1.2]}.get(name, [0.0] * plain.dof)
    spread = 1.0 if len(plain.passive) == 0 else 0.02
    q = np.array(centre) + rng.uniform(-spread, spread, (1003, plain.dof))
    qd, qdd = (rng.uniform(-1, 1, q.shape) for _ in range(2))
    fast.compile("inverse_dynamics", "regressor", "mass_matrix", "bias")
    with pytest.raises(ModelmillError, match="forward dynamics"):
        fast.compile("forward_dynamics")
    for call in (
        lambda m, q, qd, qdd: m.inverse_dynamics(q, qd, qdd),
        lambda m, q, qd, qdd: m.regressor(q, qd, qdd),
        lambda m, q, qd, qdd: m.mass_matrix(q),
        lambda m, q, qd, qdd: m.bias(q, qd),
    ):
        for form in (np.ascontiguousarray, np.asfortranarray):
            states_ = [form(a) for a in (q, qd, qdd)]
            expected, found = call(plain, *states_), call(fast, *states_)
            assert found.shape == expected.shape
            assert np.allclose(found, expected, rtol=1e-11, atol=1e-12 * np.abs(expected).max())
    # Angles of many turns and faults are left to the evaluator.
    if spread == 1.0 and plain.dof > 1:
        far = q.copy()
        far[500] = 3e5
        assert np.array_equal(fast.inverse_dynamics(far, qd, qdd), plain.inverse_dynamics(far, qd, qdd))
        far[700, 0] = np.nan
        with pytest.raises(ModelmillError, match="sample 700"):
            fast.inverse_dynamics(far, qd, qdd)


@pytest.mark.filterwarnings("ignore::modelmill.ModelmillWarning")
@pytest.mark.parametrize("narrower", ["", "-mno-avx512f", "-mno-avx"])
def test_compiled_functions_take_any_number_of_states(narrower: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In vectors of 512, 256 and 128 bits, with lines that are full and such that are not."""
    import platform
    import shutil

    compiler = next((one for one in ("cc", "gcc", "clang") if shutil.which(one)), None)
    if compiler is None:
        pytest.skip("there is no C compiler")
    if narrower and platform.machine() not in ("x86_64", "AMD64"):
        pytest.skip(f"{narrower} is for another processor")
    monkeypatch.setenv("CC", f"{compiler} {narrower}")
    for name in ("panda", "two_link", "emps"):
        plain, fast = loaded(name), loaded(name)
        fast.compile("inverse_dynamics", "regressor")
        for n in (0, 1, 3, 4, 7, 8, 9, 63, 64, 65, 300):
            given = states(plain, n, seed=n)
            for form in (np.ascontiguousarray, np.asfortranarray):
                arrays = [form(a) for a in given]
                for call in ("inverse_dynamics", "regressor"):
                    expected, found = (getattr(m, call)(*arrays) for m in (plain, fast))
                    assert found.shape == expected.shape
                    assert np.allclose(found, expected, rtol=1e-11, atol=1e-12 * np.abs(expected).max(initial=0.0))
        late = states(plain, 65)
        late[2][64, -1] = np.nan
        with pytest.raises(ModelmillError, match="sample 64"):
            fast.inverse_dynamics(*late)
