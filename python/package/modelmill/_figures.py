"""Figures of recordings, drawn by matplotlib if it is installed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import ModelmillError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ._model import Model, Recording

Floats = NDArray[np.float64]


def force_figure(run: Recording, model: Model, drives: Sequence[int], values: Floats, what: str) -> Figure:
    """Draws measured force, force of the model, and residual of some drives over time."""
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ModelmillError("plot() needs matplotlib: pip install matplotlib") from None
    measured = run.forces
    if measured is None:
        raise ModelmillError(f"{run.name} has no forces, so there is nothing to compare the model with")
    calculated = np.stack(_core.forces_along(model._core, run._core, values), axis=1)
    lengths = run._core.segment_lengths()
    time = _with_gaps(run.t, lengths)
    panels: Any
    figure, panels = pyplot.subplots(
        2 * len(drives),
        1,
        sharex=True,
        squeeze=False,
        height_ratios=[2, 1] * len(drives),
        figsize=(9.0, 1.2 + 2.8 * len(drives)),
        layout="constrained",
    )
    units = _core.drive_units(model._core)
    labels = {"nominal": "model, nominal values", "fit": "model, identified values"}
    for k, drive in enumerate(drives):
        forces, residual = panels[2 * k, 0], panels[2 * k + 1, 0]
        own, theirs = measured[:, drive], calculated[:, drive]
        forces.plot(time, _with_gaps(own, lengths), linewidth=0.8, color="0.45", label="measured")
        forces.plot(time, _with_gaps(theirs, lengths), linewidth=0.8, color="C0", label=labels.get(what, "model"))
        residual.plot(time, _with_gaps(own - theirs, lengths), linewidth=0.6, color="C3", label="measured - model")
        residual.axhline(0.0, linewidth=0.5, color="0.7")
        error = float(np.sqrt(np.nanmean((own - theirs) ** 2))) if np.isfinite(own).any() else float("nan")
        forces.set_title(f"{model.drives[drive]}: rms of the residual {error:.3g} {units[drive]}", loc="left", fontsize="medium")
        forces.set_ylabel(units[drive])
        residual.set_ylabel(f"residual, {units[drive]}")
        forces.legend(loc="upper right", fontsize="small")
    panels[-1, 0].set_xlabel("time, s")
    figure.suptitle(run.name)
    return figure


def _with_gaps(values: Floats, lengths: Sequence[int]) -> Floats:
    """Returns values with NaN between segments, so that no line is drawn over a gap in time."""
    parts = np.split(values, np.cumsum(lengths)[:-1]) if len(lengths) > 1 else [values]
    gaps = [np.append(part, np.nan) for part in parts]
    return np.concatenate(gaps) if gaps else values
