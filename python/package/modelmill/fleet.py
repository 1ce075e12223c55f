"""Additive summaries of recordings of many machines of one kind: the parts of a job for Spark, Dask, Ray or a loop.

A recording becomes a summary of some kB. Summaries are added in any order, and parameters are computed from their sum.

>>> from modelmill import fleet
>>> plan = fleet.plan("arm.toml", ["R1/monday.parquet", "R2/monday.parquet"])   # doctest: +SKIP
>>> one = fleet.summarise(plan, table, "R3/tuesday")                            # doctest: +SKIP
>>> fleet.solve(plan, fleet.merge([one, other]))["parameters"][0]               # doctest: +SKIP

A plan is a JSON text: send it to every worker, which derives its model once. Samples of a recording may be in any order, but
all of them must be in one call of :func:`summarise`, so group by recording first.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from os import PathLike, fspath
from typing import Any

from ._core import FleetGround, fleet_merge, fleet_plan
from ._tables import columns as _columns

__all__ = ["columns", "merge", "plan", "robot", "solve", "summarise"]


def plan(
    model: str | PathLike[str],
    reference: Sequence[str | PathLike[str]],
    *,
    columns: Mapping[str, str] | None = None,
    cutoff_hz: float | None = None,
    decimate: int = 1,
    skip_bad_samples: bool = False,
) -> str:
    """Makes the plan that defines how every recording is summarised, as JSON.

    Parameters
    ----------
    model : path
        The model file.
    reference : list of paths
        Recordings of machines without faults. The first one decides how all are prepared, if ``cutoff_hz`` is not given.
    columns : dict of str to str, optional
        Names that the model needs, each with the name of the column in the recordings.
    cutoff_hz : float, optional
        Cut-off of the low-pass on positions, Hz.
    decimate : int
        Keep every n-th sample, after a low-pass.
    skip_bad_samples : bool
        Leave out samples with NaN instead of refusing the recording.
    """
    mapped = list((columns or {}).items())
    return fleet_plan(fspath(model), [fspath(one) for one in reference], mapped, cutoff_hz, decimate, skip_bad_samples)


@lru_cache(maxsize=8)
def _ground(plan: str) -> FleetGround:
    return FleetGround(plan)


def columns(plan: str) -> list[str]:
    """Returns the names of the columns that a recording needs: time, coordinates, then drives."""
    return list(_ground(plan).columns)


def summarise(plan: str, table: Any, recording: str) -> bytes:
    """Returns the summary of one recording: a path, or a table with the columns of :func:`columns`, in SI units.

    A recording that cannot be used gives a summary that contains the reason; no exception is raised.
    """
    ground = _ground(plan)
    if isinstance(table, (str, PathLike)):
        return ground.summarise_file(recording, fspath(table))
    named, _ = _columns(table)
    return ground.summarise(recording, named)


def merge(summaries: Iterable[bytes]) -> bytes:
    """Adds summaries, which must be of one plan."""
    merged = fleet_merge([bytes(one) for one in summaries])
    if merged is None:
        raise ValueError("there are no summaries to add; give one or more")
    return merged


def solve(plan: str, summary: bytes) -> dict[str, Any]:
    """Returns base parameters with standard deviations.

    The dict has ``parameters`` (each with ``name``, ``value``, ``std`` and ``unit``), ``recordings`` and ``bad``.
    """
    solved: dict[str, Any] = json.loads(_ground(plan).solve(bytes(summary)))
    return solved


def robot(plan: str, name: str, days: Mapping[str, bytes]) -> dict[str, Any]:
    """Evaluates one robot over its days, which must be in order of time.

    The dict has the parameters, ``since`` (the day of a change, if there is one) and ``dead_sensors``.
    """
    found: dict[str, Any] = json.loads(_ground(plan).robot(name, [(day, bytes(one)) for day, one in days.items()]))
    return found
