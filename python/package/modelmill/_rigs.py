"""Rigs, numeric models of complete machines: recordings without hardware, and reduction to planar models."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from . import _core
from ._errors import ModelmillError
from ._model import Model, Progress, _warn, load
from ._options import PathText
from ._progress import told
from ._results import Excitation, Result, Simulation
from ._tables import columns as columns_of


class Reduction(Result):
    """The model that a reduction made, and the size of every approximation.

    Attributes
    ----------
    text : str
        The model file.
    """

    def __init__(self, found: _core.Result, text: str) -> None:
        super().__init__(found)
        self.text = text

    @property
    def model(self) -> Model:
        """The reduced model, derived."""
        return load(self.text, name=f"{self._object['rig']}.toml")


def simulate(
    rig: PathText,
    trajectory: Any,
    *,
    columns: Mapping[str, str] | None = None,
    seed: int | None = None,
    progress: Progress = None,
) -> Simulation:
    """Moves a rig along a trajectory and records its sensors.

    Parameters
    ----------
    rig : path
        A rig file (TOML).
    trajectory
        The motion: a path, the result of :meth:`Model.excite`, or a table. It has ``t`` (s) and the coordinates of the rig (rad
        or m), and their rates (``_d``) and accelerations (``_dd``) if these are known.
    columns : dict of str to str, optional
        Names that the rig needs, each with the name of the column in the trajectory.
    seed : int, optional
        Seed of the sensor noise; default: that of the rig file.
    progress : callable or bool, optional
        Called as ``progress(what, done, total)``; False is silent.
    """
    renamed = [(str(ours), str(theirs)) for ours, theirs in (columns or {}).items()]
    with tempfile.TemporaryDirectory() as folder:
        if isinstance(trajectory, (str, os.PathLike)):
            path = os.fspath(trajectory)
        else:
            path = os.path.join(folder, "trajectory.csv")
            if isinstance(trajectory, Excitation):
                trajectory.to_csv(path)
            else:
                _write(trajectory, path)
        with told(progress) as hears:
            made = _core.simulate(rig, path, renamed, seed, hears)
    _warn(made.notes)
    return Simulation(made)


def _write(table: Any, path: str) -> None:
    """Writes a trajectory as CSV, with all digits."""
    found, left_out = columns_of(table)
    _warn([("warning", f"column `{name}` contains no numbers and is left out") for name in left_out])
    for name, _ in found:
        if any(sign in name for sign in ',"\n'):
            raise ModelmillError(f"the column name {name!r} contains a comma, a quote or a new line; rename it")
    if len({len(values) for _, values in found}) > 1:
        raise ModelmillError("the columns of the trajectory have different lengths; give one number per sample in each")
    head = ",".join(name for name, _ in found)
    np.savetxt(path, np.stack([values for _, values in found], axis=1), fmt="%.17g", delimiter=",", header=head, comments="")


def reduce(
    rig: PathText, plan: PathText | None = None, *, tolerance: float = 0.0, progress: Progress = None
) -> Reduction:
    """Reduces a rig to a planar model, and reports the size of every approximation.

    Parameters
    ----------
    rig : path
        A rig file (TOML).
    plan : path, optional
        A file that defines which bodies become which parts; default: every body becomes a separate part.
    tolerance : float, optional
        Accept joints that do not close exactly, with gaps up to this length in m. The loops are then closed as well as
        possible, and the report says how much this changes the forces.
    progress : callable or bool, optional
        As for :func:`simulate`.
    """
    with told(progress) as hears:
        found, text = _core.reduce(rig, plan, tolerance, hears)
    return Reduction(found, text)
