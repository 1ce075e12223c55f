"""Converts tables of other packages to columns of numbers: dicts, pandas, polars, arrow, structured arrays of numpy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._errors import ModelmillError

Column = tuple[str, NDArray[np.float64]]


def columns(table: Any) -> tuple[list[Column], list[str]]:
    """Returns the columns of numbers with their names, and the names of columns without numbers.

    Time differences become seconds; dates become seconds since the first one. Missing values become NaN.
    """
    found: list[Column] = []
    left_out: list[str] = []
    for name, values in _named(table):
        numbers = _numbers(values)
        if numbers is None:
            left_out.append(name)
        elif numbers.ndim != 1:
            raise ModelmillError(f"column `{name}` has shape {numbers.shape}; a column needs one number for each sample: (n,)")
        else:
            found.append((name, np.ascontiguousarray(numbers)))
    if not found:
        raise ModelmillError("the table has no column of numbers; give a column `t` and one for each coordinate and drive")
    return found, left_out


def _named(table: Any) -> Iterable[tuple[str, Any]]:
    """Returns the columns with their names, as the package of the table stores them."""
    if isinstance(table, Mapping):
        return [(str(name), values) for name, values in table.items()]
    if isinstance(table, np.ndarray):
        if table.dtype.names is None:
            raise ModelmillError(
                "an array has no names for its columns; pass a dict, as in {'t': t, 'q1': q[:, 0], 'motor1': tau[:, 0]}"
            )
        return [(name, table[name]) for name in table.dtype.names]
    if hasattr(table, "collect") and hasattr(table, "lazy"):  # polars.LazyFrame
        table = table.collect()
    if hasattr(table, "get_columns"):  # polars.DataFrame
        return [(series.name, series.to_numpy()) for series in table.get_columns()]
    if hasattr(table, "iloc") and hasattr(table, "columns"):  # pandas.DataFrame
        return _of_pandas(table)
    if hasattr(table, "__arrow_c_stream__") or hasattr(table, "__arrow_c_array__"):
        return _of_arrow(table)
    raise ModelmillError(
        f"a {type(table).__name__} is no recording; give a path, a dict of arrays, or a table of pandas, polars or arrow"
    )


def _of_pandas(table: Any) -> list[tuple[str, Any]]:
    """Returns the columns of a pandas table; an index with a name, such as `t`, counts as a column."""
    named = [(str(name), table.iloc[:, k]) for k, name in enumerate(table.columns)]
    index = table.index
    if isinstance(index.name, str) and index.name not in [name for name, _ in named]:
        named.insert(0, (index.name, index.to_series()))
    return [(name, _of_series(series)) for name, series in named]


def _of_series(series: Any) -> Any:
    """Returns a pandas series as an array; missing values of nullable types become NaN."""
    try:
        if series.dtype.kind in "fiub":
            return series.to_numpy(dtype=np.float64, na_value=np.nan)
    except (TypeError, ValueError, AttributeError):
        pass
    return series.to_numpy()


def _of_arrow(table: Any) -> list[tuple[str, Any]]:
    """Reads a table by the Arrow C data interface, with pyarrow or polars."""
    try:
        import pyarrow as pa  # type: ignore[import-untyped, unused-ignore]
    except ImportError:
        try:
            import polars as pl
        except ImportError:
            raise ModelmillError(
                f"reading a {type(table).__name__} by the Arrow C data interface needs pyarrow or polars: pip install pyarrow"
            ) from None
        return [(series.name, series.to_numpy()) for series in pl.DataFrame(table).get_columns()]
    if hasattr(table, "__arrow_c_stream__"):
        read = pa.RecordBatchReader.from_stream(table).read_all()
    else:
        read = pa.Table.from_batches([pa.record_batch(table)])
    return [(name, read.column(k).to_numpy()) for k, name in enumerate(read.column_names)]


def _numbers(values: Any) -> NDArray[np.float64] | None:
    """Returns the values as floats, or None if they are no numbers."""
    if np.ma.isMaskedArray(values):
        filled: NDArray[np.float64] = np.where(np.ma.getmaskarray(values), np.nan, np.ma.getdata(values)).astype(np.float64)
        return filled
    array = np.asarray(values)
    if array.dtype.kind == "m":
        return array / np.timedelta64(1, "s")
    if array.dtype.kind == "M":
        return (array - array[0]) / np.timedelta64(1, "s") if array.size else np.zeros(0)
    if array.dtype.kind in "fiub":
        return array.astype(np.float64, copy=False)
    if array.dtype.kind == "O":
        try:
            return np.array([np.nan if value is None else float(value) for value in array.ravel()]).reshape(array.shape)
        except (TypeError, ValueError):
            return None
    return None
