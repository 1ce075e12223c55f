"""Keywords of methods, with their defaults. Written from the declarations in modelmill/src/options; do not edit.

`UPDATE_OPTIONS=1 cargo test -p modelmill --test all options` writes this file.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, TypedDict, Union

PathText = Union[str, "os.PathLike[str]"]


class ReadingOptions(TypedDict, total=False):
    """How a recording is read and its states are prepared; keywords of every method that takes recordings.

    Attributes
    ----------
    columns : dict of str to str, or path
        Column of the recording for a name of the model, e.g. ``{"theta1": "pos_left"}``, or a sum of columns with a
        unit if it is not SI: ``{"q6": "(pos6 - pos5)/32 - 90 [deg]"}``. Names of the model are ``t``, a coordinate, a
        coordinate with ``_d`` or ``_dd``, a drive, and a drive with ``_var`` for the variance of its force. Or the path
        of a file with the table ``[recording.columns]``.
    cutoff_hz : float
        Cut-off of the low-pass on positions, Hz. Default: chosen by cross-validation on the forces; without forces,
        from the positions.
    order : int
        Order of the Butterworth low-pass, which runs forwards and backwards [default: 4].
    trim : int or (int, int)
        Samples dropped at the start and at the end, after derivatives are computed; a single number applies to both
        ends.
    decimate : int
        Keep every n-th sample, after an anti-aliasing low-pass on forces and regressor. Default: n is chosen together
        with the cut-off, and all samples are kept if cutoff_hz or smoothing is given; 1 is the same as the default.
    source : {"recorded", "positions"}
        Source of rates and accelerations. "recorded": Recorded columns if the file has them; the others are computed
        from positions. "positions": All computed from positions, even if the file has columns for them.
    smoothing : {"auto", "butterworth", "savitzky_golay", "fourier"}
        How positions are smoothed and differentiated. "auto": A Fourier series if the run is periodic and only noise
        remains as residual, unless cutoff_hz is given; otherwise a Butterworth low-pass. "butterworth": A Butterworth
        low-pass, forwards and backwards, then central differences. "savitzky_golay": Polynomials of degree 4 over
        windows that match the cut-off. "fourier": A Fourier series up to the cut-off, for periodic motions.
    period : float
        Period of the motion, s; selects ``smoothing="fourier"``. Determined from the positions if not given.
    band_hz : float
        Frequency up to which measured and model force are also compared, Hz, in addition to the unfiltered figures.
        Default: the cut-off, or the highest frequency of the motion.
    skip_bad_samples : bool
        Leave out samples with NaN, infinite or empty fields instead of refusing the recording.
    leave_out_events : bool
        Leave out the forces of contacts and pushes: intervals in which no parameters explain the forces.
    between : (float, float)
        Read only the samples between these times, s.
    rate : float
        Sampling rate of recordings without a column of times, Hz.
    standstill : float
        Leave out a force while its drive is slower than this fraction of its maximum speed, where static friction is
        unknown; 0.01 is usual, and 0 leaves out none. Default: where the forces show that the drive sticks.
    """

    columns: Mapping[str, str] | PathText
    cutoff_hz: float | None
    order: int | None
    trim: int | tuple[int, int] | None
    decimate: int
    source: str
    smoothing: str
    period: float | None
    band_hz: float | None
    skip_bad_samples: bool
    leave_out_events: bool
    between: tuple[float, float] | None
    rate: float | None
    standstill: float | None


#: Defaults of :class:`ReadingOptions`.
READING: dict[str, Any] = {
    "columns": {},
    "cutoff_hz": None,
    "order": None,
    "trim": None,
    "decimate": 1,
    "source": "recorded",
    "smoothing": "auto",
    "period": None,
    "band_hz": None,
    "skip_bad_samples": False,
    "leave_out_events": False,
    "between": None,
    "rate": None,
    "standstill": None,
}


class EstimationOptions(TypedDict, total=False):
    """How parameters are estimated; keywords of `identify`.

    Attributes
    ----------
    weights : {"auto", "none", "channels", "variance"}
        How equations are weighted. "auto": ``channels`` if the drives have different units or if cut-off and decimation
        are chosen automatically, else ``none``. "none": Equal weights. "channels": Equations of each drive divided by
        the standard deviation of its residuals, iterated. "variance": Each equation divided by the standard deviation
        of its force, from the columns ``DRIVE_var``.
    robust : float
        Huber's robust estimate: residuals beyond this many standard deviations (estimated from their median) get a
        lower weight; 1.345 is usual.
    prior : float
        Nominal values as soft constraints, with this relative standard deviation of each product of parameters.
    physical : bool
        Allow only physically possible parameters (positive definite pseudo-inertias); what the recordings do not
        determine is as near to the nominal values as possible. Also returns every physical parameter.
    essential : bool
        Remove base parameters that the recordings do not support, one by one, as long as the residual does not rise
        significantly (Wald test).
    """

    weights: str
    robust: float | None
    prior: float | None
    physical: bool
    essential: bool


#: Defaults of :class:`EstimationOptions`.
ESTIMATION: dict[str, Any] = {
    "weights": "auto",
    "robust": None,
    "prior": None,
    "physical": False,
    "essential": False,
}
