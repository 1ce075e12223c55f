"""Recordings as tables of other packages are the same as from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modelmill
from modelmill import ModelmillError

from .conftest import MODELS, RECORDINGS

RUN = RECORDINGS / "spidermill-mbs" / "plain-check.csv"


@pytest.fixture(scope="module")
def m() -> modelmill.Model:
    return modelmill.load(MODELS / "spidermill.toml")


@pytest.fixture(scope="module")
def numbers() -> dict[str, np.ndarray]:
    read = np.genfromtxt(RUN, delimiter=",", names=True)
    return {name: read[name] for name in read.dtype.names}


class Stream:
    """Speaks nothing but the Arrow C data interface."""

    def __init__(self, table: Any) -> None:
        self._table = table

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
        return self._table.__arrow_c_stream__(requested_schema)


def forms(numbers: dict[str, np.ndarray]) -> dict[str, Any]:
    pd = pytest.importorskip("pandas")
    pl = pytest.importorskip("polars")
    pa = pytest.importorskip("pyarrow")
    records = np.rec.fromarrays(list(numbers.values()), names=list(numbers))
    frame = pd.DataFrame(numbers)
    return {
        "dict": numbers,
        "lists": {name: list(values) for name, values in numbers.items()},
        "structured": records,
        "pandas": frame,
        "pandas with an index": frame.set_index("t"),
        "pandas with texts beside": frame.assign(comment="none"),
        "pandas of arrow": frame.convert_dtypes(dtype_backend="pyarrow"),
        "polars": pl.DataFrame(numbers),
        "lazy polars": pl.DataFrame(numbers).lazy(),
        "arrow": pa.table(numbers),
        "a batch": pa.table(numbers).to_batches()[0],
        "a stream": Stream(pa.table(numbers)),
    }


def test_all_tables_have_the_figures_of_the_file(m: modelmill.Model, numbers: dict[str, np.ndarray]) -> None:
    of_file = m.compare(RUN)
    for name, table in forms(numbers).items():
        found = m.compare(table)
        assert (found.nrms, found.channels) == (of_file.nrms, of_file.channels), name


def test_times_become_seconds(m: modelmill.Model, numbers: dict[str, np.ndarray]) -> None:
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame(numbers)
    expected = m.compare(RUN, cutoff_hz=20, source="positions").nrms
    assert expected is not None
    spans = pd.to_timedelta(numbers["t"], unit="s")
    for time in (spans, pd.Timestamp("2026-03-01") + spans):
        found = m.compare(frame.assign(t=time), cutoff_hz=20, source="positions").nrms
        assert found is not None and abs(found - expected) < 1e-6 * expected


def test_columns_may_be_called_otherwise(m: modelmill.Model, numbers: dict[str, np.ndarray]) -> None:
    other = dict(numbers)
    other["angle"] = np.degrees(other.pop("theta1"))
    other["left"] = other.pop("spindle_left")
    with pytest.raises(ModelmillError, match="theta1"):
        m.compare(other)
    found = m.compare(other, columns={"theta1": "angle [deg]", "spindle_left": "left"})
    nrms = m.compare(numbers).nrms
    assert nrms is not None and found.nrms == pytest.approx(nrms, rel=1e-9)


def test_faults_have_their_place_and_a_remedy(m: modelmill.Model, numbers: dict[str, np.ndarray]) -> None:
    missing = {name: values for name, values in numbers.items() if name not in ("theta2", "spindle_right")}
    with pytest.raises(ModelmillError) as told:
        m.identify(missing)
    says = str(told.value)
    assert "`theta2`" in says
    assert "--" not in says and "columns={" in says
    assert told.value.diagnostics[0]["severity"] == "error"

    hole = {name: values.copy() for name, values in numbers.items()}
    hole["theta1"][9] = np.nan
    with pytest.raises(ModelmillError, match="row 10"):
        m.compare(hole)
    assert "`skip_bad_samples`" in str(pytest.raises(ModelmillError, m.compare, hole).value)
    assert m.compare(hole, skip_bad_samples=True).nrms is not None

    for table, says in [
        ({**numbers, "theta1": numbers["theta1"][:-1]}, "one for each sample"),
        (np.zeros((5, 3)), "dict"),
        (3, "int is no recording"),
        ({"comment": ["a", "b"]}, "no column of numbers"),
        ("nowhere.csv", "nowhere.csv"),
        ({"t": np.zeros((3, 2))}, "one number for each sample"),
    ]:
        with pytest.raises(ModelmillError) as told:
            m.compare(table)
        assert says in str(told.value), told.value


def test_options_that_make_no_sense_are_told(m: modelmill.Model) -> None:
    for options, says in [
        ({"cutoff_hz": -1.0}, "cutoff_hz=-1"),
        ({"order": 99}, "order=99"),
        ({"cutoff_hz": "fast"}, "a frequency"),
        ({"trim": (1, 2, 3)}, "a number of samples"),
        ({"decimate": 1.5}, "an integer"),
        ({"smoothing": "boxcar"}, "savitzky_golay"),
        ({"source": "files"}, "positions"),
        ({"between": (3.0, 1.0)}, "between"),
        ({"columns": {"theta9": "x"}}, "theta9"),
    ]:
        with pytest.raises(ModelmillError) as told:
            m.compare(RUN, **options)
        assert says in str(told.value), told.value
    with pytest.raises(TypeError, match="cutoff"):
        m.compare(RUN, cutoff=3)  # type: ignore[call-arg]


def test_a_recording_is_read_once_and_again_for_another_model(m: modelmill.Model) -> None:
    read = m.recording(RUN, cutoff_hz=25)
    assert read.q.shape == (len(read.t), 2) == read.qdd.shape
    direct = m.compare(RUN, cutoff_hz=25).to_dict()
    assert m.compare(read).to_dict() == direct
    better = m.with_effect("viscous_friction", "spindle_left", Fv=0.0)
    assert better.compare(read).to_dict() == better.compare(RUN, cutoff_hz=25).to_dict()
    with pytest.raises(ModelmillError, match="prepared already"):
        m.compare(read, cutoff_hz=3)


def test_what_a_file_holds(tmp_path: Path) -> None:
    found = modelmill.recordings(RUN).to_dict()
    assert "theta1" in str(found)
