"""Recordings of many machines of one kind as small summaries that add: the parts of a job for Spark, Dask, Ray or a loop.

A recording becomes a summary of some kB, summaries add in any order, and parameters follow from their sum.

>>> from modelmill import fleet
>>> plan = fleet.plan("arm.toml", ["R1/monday.parquet", "R2/monday.parquet"])   # doctest: +SKIP
>>> one = fleet.summarise(plan, table, "R3/tuesday")                            # doctest: +SKIP
>>> fleet.solve(plan, fleet.merge([one, other]))["parameters"][0]               # doctest: +SKIP

A plan is a JSON text: send it to every worker, which derives its model once. Samples of a recording may be in any order; they
must all be in one call of :func:`summarise`, so group by recording first.
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
    """How every recording is summed up, as JSON: settled from reference recordings of sound machines.

    The first of them decides how all are prepared where ``cutoff_hz``, Hz, is not given; ``columns`` has our names with what the
    recordings call them.
    """
    mapped = list((columns or {}).items())
    return fleet_plan(fspath(model), [fspath(one) for one in reference], mapped, cutoff_hz, decimate, skip_bad_samples)


@lru_cache(maxsize=8)
def _ground(plan: str) -> FleetGround:
    return FleetGround(plan)


def columns(plan: str) -> list[str]:
    """Names of the columns that a recording needs: time, coordinates, then drives."""
    return list(_ground(plan).columns)


def summarise(plan: str, table: Any, recording: str) -> bytes:
    """The summary of one recording: a path, or a table with the columns that :func:`columns` names, in SI units.

    A recording that gives no answer is a summary that says so, and no exception.
    """
    ground = _ground(plan)
    if isinstance(table, (str, PathLike)):
        return ground.summarise_file(recording, fspath(table))
    named, _ = _columns(table)
    return ground.summarise(recording, named)


def merge(summaries: Iterable[bytes]) -> bytes:
    """The summary of all recordings of some summaries, which are of one plan."""
    merged = fleet_merge([bytes(one) for one in summaries])
    if merged is None:
        raise ValueError("there are no summaries to add; give one or more")
    return merged


def solve(plan: str, summary: bytes) -> dict[str, Any]:
    """Base parameters with deviations: ``parameters`` with ``name``, ``value``, ``std`` and ``unit``, and ``recordings``, ``bad``."""
    solved: dict[str, Any] = json.loads(_ground(plan).solve(bytes(summary)))
    return solved


def robot(plan: str, name: str, days: Mapping[str, bytes]) -> dict[str, Any]:
    """One robot over its days, which are in order of time: parameters, ``since`` when something changed, ``dead_sensors``."""
    found: dict[str, Any] = json.loads(_ground(plan).robot(name, [(day, bytes(one)) for day, one in days.items()]))
    return found
