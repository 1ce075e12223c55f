"""Models and recordings."""

from __future__ import annotations

import html
import json
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Union, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._compiled import Compiled
from ._errors import ModelmillError, ModelmillWarning
from ._progress import Told, told
from ._results import (
    AnswerT,
    Check,
    Comparison,
    Diagnosis,
    Difference,
    Excitation,
    Identification,
    Interpretation,
    Page,
    Remarks,
    Result,
    Runs,
    frame,
    number,
    table_html,
    text_html,
)
from ._tables import columns as columns_of

if TYPE_CHECKING:
    import pandas as pd
    from typing_extensions import Unpack

Floats = NDArray[np.float64]
PathText = Union[str, "os.PathLike[str]"]
#: Base parameters: nominal values (None), a fit, the path of one, values in the order of ``p_min``, or some values by name.
Values = Union[None, Identification, PathText, Mapping[str, float], ArrayLike]
Progress = Union[Told, bool, None]


class ReadingOptions(TypedDict, total=False):
    """How a recording is read and its states are prepared; keywords of every method that takes recordings.

    Attributes
    ----------
    columns : dict of str to str
        Our names with what the recording calls them, or with a sum of its columns, in other units perhaps:
        ``{"q6": "(pos6 - pos5)/32 - 90 [deg]"}``. Ours are ``t``, a coordinate, a coordinate with ``_d`` or ``_dd``, a drive, and
        a drive with ``_var`` for the variance of its force.
    cutoff_hz : float
        Cut-off of the low-pass on positions, Hz; chosen by what is left of the forces on held-out time if not given.
    order : int
        Order of the low-pass, which runs forwards and backwards; 4 if not given.
    trim : int or (int, int)
        Samples dropped at the start and at the end.
    decimate : int
        Keep every n-th sample, after a low-pass on forces and regressor alike.
    source : {"recorded", "positions"}
        Whether recorded rates and accelerations are taken, or all are made from positions.
    smoothing : {"auto", "butterworth", "savitzky_golay", "fourier"}
        How positions are smoothed and differentiated.
    period : float
        Period of the motion, s, for a Fourier series.
    band_hz : float
        Up to which frequency forces are compared beside the raw figures, Hz.
    skip_bad_samples : bool
        Leave out samples with NaN instead of refusing the recording.
    leave_out_events : bool
        Leave out forces of contacts and pushes.
    between : (float, float)
        Read only the samples between these times, s.
    """

    columns: Mapping[str, str]
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


_READING: dict[str, Any] = {
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
}


def _reading(options: Mapping[str, Any]) -> dict[str, Any]:
    unknown = [name for name in options if name not in _READING]
    if unknown:
        raise TypeError(f"unknown keyword {', '.join(unknown)}; how a recording is read is said by {', '.join(_READING)}")
    whole = {**_READING, **options}
    whole["columns"] = [(str(ours), str(theirs)) for ours, theirs in dict(whole["columns"] or {}).items()]
    trim = whole["trim"]
    whole["trim"] = None if trim is None else trim if isinstance(trim, (tuple, list)) else (trim, trim)
    for names, expected, of in _TYPES:
        for name in names:
            try:
                whole[name] = None if whole[name] is None else of(whole[name])
            except (TypeError, ValueError):
                raise ModelmillError(f"{name}={whole[name]!r}: expected {expected}") from None
    return whole


def _pair(of: Callable[[Any], Any]) -> Callable[[Any], Any]:
    def both(values: Any) -> Any:
        first, second = values
        return of(first), of(second)

    return both


_TYPES: list[tuple[tuple[str, ...], str, Callable[[Any], Any]]] = [
    (("cutoff_hz", "period", "band_hz"), "a number", float),
    (("order", "decimate"), "a whole number", index),
    (("trim",), "a number of samples, or two of them", _pair(index)),
    (("between",), "two times in s", _pair(float)),
]


def _warn(notes: Remarks, level: int = 3) -> None:
    for severity, says in notes:
        if severity == "warning":
            warnings.warn(says, ModelmillWarning, stacklevel=level)


def _answered(progress: Progress, verb: Callable[[_core._Progress], AnswerT]) -> AnswerT:
    """What a verb that tells its progress finds, once its warnings are given."""
    with told(progress) as hears:
        found = verb(hears)
    _warn(found.notes, 4)
    return found


def _wrong_shape(name: str, shape: tuple[int, ...], names: list[str]) -> str:
    width = len(names)
    says = f"{name} has shape {shape}; expected ({width},) for one state or (n, {width}) for many: {', '.join(names)}"
    if len(shape) == 2 and shape[0] == width:
        return f"{says}. Here states stand in columns: pass {name}.T"
    if width == 1 and len(shape) == 1:
        return f"{says}. For many states of one coordinate pass {name}.reshape(-1, 1)"
    return says


@dataclass(frozen=True)
class BaseParameter:
    """A base parameter: ``expression`` in the parameters of the model file, nominal ``value`` (None if the file gives none)."""

    name: str
    expression: str
    value: float | None
    unit: str


class BaseParameters(Sequence[BaseParameter]):
    """The base parameters of a model, eq. (16); prints as a table.

    Attributes
    ----------
    names, expressions, units : list of str
    values : numpy.ndarray, shape (n_base,)
        Nominal values; 0 where the file gives none.
    """

    def __init__(self, core: _core.Model) -> None:
        base = core.base
        self.names = [one[0] for one in base]
        self.expressions = [one[2] for one in base]
        self.units = [one[3] for one in base]
        self.values: Floats = core.nominal
        self._given = [one[5] for one in base]

    def __len__(self) -> int:
        return len(self.names)

    @overload
    def __getitem__(self, k: int) -> BaseParameter: ...
    @overload
    def __getitem__(self, k: slice) -> list[BaseParameter]: ...
    def __getitem__(self, k: int | slice) -> BaseParameter | list[BaseParameter]:
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(len(self)))]
        value = float(self.values[k]) if self._given[k] else None
        return BaseParameter(self.names[k], self.expressions[k], value, self.units[k])

    def __iter__(self) -> Iterator[BaseParameter]:
        return (self[k] for k in range(len(self)))

    def to_pandas(self) -> pd.DataFrame:
        """A row for each base parameter."""
        return frame(vars(one) for one in self)

    def __repr__(self) -> str:
        rows = [(one.name, number(one.value), one.unit, one.expression) for one in self]
        widths = [max((len(row[k]) for row in rows), default=0) for k in range(3)]
        return "\n".join("  ".join([*(row[k].ljust(widths[k]) for k in range(3)), row[3]]).rstrip() for row in rows)

    def _repr_html_(self) -> str:
        rows = [(one.name, one.expression, number(one.value), one.unit) for one in self]
        return table_html(("", "expression", "value", "unit"), rows)


class Equations:
    """The reduced model for people: in a notebook the page of equations, as ``str`` its text."""

    def __init__(self, core: _core.Model) -> None:
        self._core = core

    @property
    def text(self) -> str:
        """Plain text."""
        return self._core.equations("text")

    @property
    def markdown(self) -> str:
        """Markdown."""
        return self._core.equations("markdown")

    @property
    def latex(self) -> str:
        """LaTeX: a document of its own."""
        return self._core.equations("latex")

    @property
    def html(self) -> str:
        """A page of its own."""
        return self._core.equations("html")

    def to_dict(self) -> dict[str, Any]:
        """The same as ``modelmill equations --json`` prints it."""
        told: dict[str, Any] = json.loads(self._core.equations("json"))
        return told

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return Page(self.html)._repr_html_()

    def _repr_latex_(self) -> str:
        lines = []
        for name, _, expression, _, _, _ in self._core.base:
            # `\verb` is no part of what notebooks know; a text of LaTeX needs these marks in front of its special characters.
            left = "p_{" + name.removeprefix("p").removesuffix("_min") + ",\\min}"
            right = "".join("\\" + c if c in "_#%&{}$" else "\\hat{\\ }" if c == "^" else c for c in expression)
            lines.append(f"{left} &= \\texttt{{{right}}}")
        return "$$\\begin{aligned}" + r" \\ ".join(lines) + "\\end{aligned}$$"


class Recording:
    """A recording that was read and prepared for a model, once for several verbs.

    Attributes
    ----------
    name : str
        What messages call it.
    notes : list of (str, str)
        What was done and what looks odd: severity and text.
    """

    def __init__(self, model: Model, source: Any, options: Mapping[str, Any], progress: Progress, name: str | None) -> None:
        self._source, self._options, self._model = source, dict(options), model
        whole = _reading(options)
        left_out: list[str] = []
        read: Any
        if isinstance(source, (str, os.PathLike)):
            read, name = [source], os.fspath(source)
        elif isinstance(source, tuple) and all(isinstance(one, (str, os.PathLike)) for one in source):
            read, name = list(source), "+".join(os.fspath(one) for one in source)
        else:
            read, left_out = columns_of(source)
            name = name or "recording"
        self._given_name = name
        with told(progress) as hears:
            try:
                self._core = model._core.recording(name, read, whole, hears)
            except ModelmillError as error:
                if left_out and hasattr(error, "add_note"):
                    error.add_note(f"Columns that hold no numbers were left out: {', '.join(left_out)}")
                raise
        self.name = self._core.file
        self.notes = self._core.notes

    def _motion(self) -> tuple[Floats, list[Floats], list[Floats], list[Floats]]:
        return self._core.prepared()

    @property
    def t(self) -> Floats:
        """Times of the prepared samples, s; shape (n,)."""
        return self._motion()[0]

    @property
    def q(self) -> Floats:
        """Prepared positions, rad or m; shape (n, dof)."""
        return np.stack(self._motion()[1], axis=1)

    @property
    def qd(self) -> Floats:
        """Prepared rates, rad/s or m/s; shape (n, dof)."""
        return np.stack(self._motion()[2], axis=1)

    @property
    def qdd(self) -> Floats:
        """Prepared accelerations, rad/s^2 or m/s^2; shape (n, dof)."""
        return np.stack(self._motion()[3], axis=1)

    def __repr__(self) -> str:
        remarks = "".join(f"\n  {severity}: {says}" for severity, says in self.notes)
        return f"recording {self.name}: {len(self.t)} samples{remarks}"


#: What a method takes as one recording: a path, a tuple of paths of one run, a table, or what `Model.recording` returned.
Source = Any


class Model:
    """A model that was read and derived; :func:`load` makes one.

    Arrays of states have shape ``(dof,)`` for one state or ``(n, dof)`` for many, of any type of real numbers and in any order of
    memory; columns stand in the order of `coordinates`, those of forces in the order of `drives`. Values of base parameters are the
    file's nominal ones unless ``parameters`` says otherwise: an :class:`Identification`, the path of one, an array in the order of
    `p_min`, or a dict that replaces some by name.
    """

    def __init__(self, core: _core.Model) -> None:
        self._core = core
        self._p_min: BaseParameters | None = None
        self._compiled: dict[str, Compiled] = {}

    # What the model is.

    @property
    def name(self) -> str:
        """The file's name without folder and ending."""
        return self._core.name

    @property
    def text(self) -> str:
        """The text of the model file, with effects that were added."""
        return self._core.text

    def save(self, path: PathText) -> None:
        """Writes the text of the model file."""
        Path(path).write_text(self.text, encoding="utf-8")

    @property
    def coordinates(self) -> list[str]:
        """Names of the active coordinates: the columns of ``q``."""
        return self._core.coordinates

    @property
    def passive(self) -> list[str]:
        """Names of the passive coordinates, which loops settle."""
        return self._core.passive

    @property
    def drives(self) -> list[str]:
        """Names of the drives: the columns of forces."""
        return self._core.drives

    @property
    def dof(self) -> int:
        """How many active coordinates there are."""
        return len(self._core.coordinates)

    @property
    def p_min(self) -> BaseParameters:
        """The base parameters, eq. (16)."""
        if self._p_min is None:
            self._p_min = BaseParameters(self._core)
        return self._p_min

    @property
    def notes(self) -> Remarks:
        """Remarks on the model file: severity and text."""
        return self._core.notes

    def equations(self) -> Equations:
        """p_g, dependences, p_min and programs, for people."""
        return Equations(self._core)

    def check(self) -> Check:
        """What the model consists of, and its numeric rank beside the exact one."""
        return Check(self._core.check())

    def picture(self, at: Mapping[str, float] | None = None, view: tuple[float, float] | None = None) -> Picture:
        """The mechanism at a pose.

        Parameters
        ----------
        at : dict of str to float, optional
            Coordinates, rad or m; the others stay at the nominal pose.
        view : (float, float), optional
            Direction from which it is seen: turn and rise, degrees.
        """
        return Picture(self._core.picture(list((at or {}).items()), view))

    def generate(
        self, language: str = "rust", *, dynamics: bool = False, reactions: bool = False, self_test: bool = False
    ) -> dict[str, str]:
        """Code of the model: paths and texts of files. ``language`` is ``"rust"``, ``"c99"``, ``"c"`` or ``"python"``."""
        return dict(self._core.generate(language, dynamics, reactions, self_test))

    def __repr__(self) -> str:
        return (
            f"model {self.name}: coordinates {', '.join(self.coordinates)}; drives {', '.join(self.drives)}; "
            f"{len(self.p_min)} base parameters"
        )

    def _repr_html_(self) -> str:
        title = html.escape(self._core.title or self.name)
        return f"<b>{title}</b>{text_html(repr(self))}{self.p_min._repr_html_()}"

    # Functions of states.

    def _values(self, parameters: Values) -> tuple[Floats, str]:
        """Values of the base parameters, and what the JSON calls them."""
        if parameters is None:
            _warn(self._core.nominal_notes, 5)
            return self._core.nominal, "nominal"
        if isinstance(parameters, Identification):
            of_fit = [(one.name, one.expression) for one in parameters.parameters]
            own = list(zip(self.p_min.names, self.p_min.expressions))
            if of_fit != own:
                raise ModelmillError(
                    "the fit is of another model: its base parameters are not those of this one; identify this model"
                )
            return parameters.values, "fit"
        if isinstance(parameters, (str, os.PathLike)):
            path = os.fspath(parameters)
            if path == "nominal":
                return self._values(None)
            values, notes = self._core.values_of_fit(path)
            _warn(notes, 4)
            return np.array(values), path
        if isinstance(parameters, Mapping):
            values_by_name = self._core.nominal
            for name, value in parameters.items():
                if name not in self.p_min.names:
                    raise ModelmillError(f"there is no base parameter `{name}`; there are {', '.join(self.p_min.names)}")
                values_by_name[self.p_min.names.index(name)] = value
            return values_by_name, "given"
        array = np.asarray(parameters, dtype=np.float64)
        if array.shape != (len(self.p_min),):
            raise ModelmillError(
                f"parameters have shape {array.shape}; expected ({len(self.p_min)},), one for each of p_min"
            )
        return array, "given"

    def _states(self, parts: Sequence[tuple[str, ArrayLike | None, list[str]]]) -> tuple[list[Floats | None], bool]:
        """Arrays of shape (n, width), and whether there is a single state without an axis of its own."""
        found: list[Floats | None] = []
        first: tuple[str, tuple[int, ...]] | None = None
        for name, given, names in parts:
            if given is None:
                found.append(None)
                continue
            array = np.asarray(given)
            width = len(names)
            if array.dtype.kind not in "fiub":
                raise ModelmillError(f"{name} holds {array.dtype}; real numbers are expected")
            if array.ndim not in (1, 2) or array.shape[-1] != width:
                raise ModelmillError(_wrong_shape(name, array.shape, names))
            if first is None:
                first = (name, array.shape[:-1])
            elif array.shape[:-1] != first[1]:
                raise ModelmillError(
                    f"{name} has shape {array.shape} and {first[0]} {(*first[1], len(parts[0][2]))}; both need as many states"
                )
            array = np.atleast_2d(array.astype(np.float64, copy=False))
            if not (array.flags.c_contiguous or array.flags.f_contiguous):
                array = np.ascontiguousarray(array)
            found.append(array)
        return found, first is not None and first[1] == ()

    def _at(
        self,
        function: str,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
        forces: ArrayLike | None = None,
        parameters: Values = None,
        forces_name: str = "load",
    ) -> Floats:
        own, drives = self._core.coordinates, self._core.drives
        arrays, single = self._states(
            [("q", q, own), ("qd", qd, own), ("qdd", qdd, own), (forces_name, forces, drives)]
        )
        values = self._core.nominal if function == "reactions" else self._values(parameters)[0]
        positions = arrays[0]
        assert positions is not None
        compiled = self._compiled.get(function)
        flat: Floats | None = None
        if compiled is not None:
            shape = list(compiled.shape)
            flat = compiled(arrays, np.asarray(values))
        if flat is None:
            flat, shape = self._core.at(function, positions, arrays[1], arrays[2], arrays[3], values)
        of_one = tuple(shape) if function in ("regressor", "mass_matrix") else (shape[0],)
        return flat.reshape(of_one if single else (len(positions), *of_one))

    def inverse_dynamics(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, parameters: Values = None, load: ArrayLike | None = None
    ) -> Floats:
        """Forces of the drives, tau = H_min p_min.

        Parameters
        ----------
        q, qd, qdd : array_like, shape (dof,) or (n, dof)
            Positions (rad or m), rates and accelerations of the coordinates.
        parameters : optional
            Values of the base parameters; nominal ones if not given.
        load : array_like, shape (drives,) or (n, drives), optional
            Forces that the drives carry, N or N m, for effects that depend on the load.

        Returns
        -------
        numpy.ndarray, shape (drives,) or (n, drives)
            N or N m.
        """
        return self._at("inverse_dynamics", q, qd, qdd, load, parameters)

    def regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, load: ArrayLike | None = None) -> Floats:
        """H_min of eq. (4): forces are ``regressor @ p_min``.

        Parameters
        ----------
        q, qd, qdd, load
            As for :meth:`inverse_dynamics`.

        Returns
        -------
        numpy.ndarray, shape (drives, n_base) or (n, drives, n_base)
        """
        return self._at("regressor", q, qd, qdd, load, self._core.nominal)

    def mass_matrix(self, q: ArrayLike, *, parameters: Values = None) -> Floats:
        """M of ``J' f = M q'' + b``.

        Parameters
        ----------
        q : array_like, shape (dof,) or (n, dof)
            Positions, rad or m.
        parameters : optional
            Values of the base parameters; nominal ones if not given.

        Returns
        -------
        numpy.ndarray, shape (dof, dof) or (n, dof, dof)
        """
        return self._at("mass_matrix", q, parameters=parameters)

    def bias(
        self, q: ArrayLike, qd: ArrayLike, *, parameters: Values = None, load: ArrayLike | None = None
    ) -> Floats:
        """b of ``J' f = M q'' + b``: generalised forces that rates, weight and effects ask for.

        Parameters
        ----------
        q, qd, parameters, load
            As for :meth:`inverse_dynamics`.

        Returns
        -------
        numpy.ndarray, shape (dof,) or (n, dof)
            N or N m.
        """
        return self._at("bias", q, qd, None, load, parameters)

    def forward_dynamics(self, q: ArrayLike, qd: ArrayLike, forces: ArrayLike, *, parameters: Values = None) -> Floats:
        """Accelerations of the coordinates under given forces of the drives.

        Parameters
        ----------
        q, qd : array_like, shape (dof,) or (n, dof)
            Positions and rates, rad or m and seconds.
        forces : array_like, shape (drives,) or (n, drives)
            N or N m.
        parameters : optional
            Values of the base parameters; nominal ones if not given.

        Returns
        -------
        numpy.ndarray, shape (dof,) or (n, dof)
            rad/s^2 or m/s^2.
        """
        return self._at("forward_dynamics", q, qd, None, forces, parameters, "forces")

    def compile(self, *functions: str) -> None:
        """Compiles functions of states for this model by the C compiler of the machine, for many states at once.

        They give the same numbers as before to some units of the last place. Forward dynamics, and mechanisms whose loops are
        followed by Newton's method, are not compiled.

        Parameters
        ----------
        *functions : str
            ``"inverse_dynamics"``, ``"regressor"``, ``"mass_matrix"``, ``"bias"``, ``"reactions"``; the first two if none is named.
        """
        for function in functions or ("inverse_dynamics", "regressor"):
            self._compiled[function] = Compiled(*self._core.vectors_c(function))

    @property
    def reaction_names(self) -> list[str]:
        """Names of the columns of :meth:`reactions`, such as ``elbow.Fx``: what equations of motion determine."""
        return self._core.reaction_names()[0]

    def reactions(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, load: ArrayLike | None = None) -> Floats:
        """What joints and the cuts of loops transmit, for the parameters of the model file.

        Parameters
        ----------
        q, qd, qdd, load
            As for :meth:`inverse_dynamics`.

        Returns
        -------
        numpy.ndarray, shape (components,) or (n, components)
            N or N m, in the order of `reaction_names`.
        """
        return self._at("reactions", q, qd, qdd, load)

    # Recordings.

    def recording(
        self, data: Source, *, name: str | None = None, progress: Progress = None, **reading: Unpack[ReadingOptions]
    ) -> Recording:
        """Reads and prepares a recording, for use in several verbs.

        Parameters
        ----------
        data
            A path (CSV, Parquet, MATLAB, HDF5, MCAP, rosbag2), a tuple of paths that are joined on time, or a table: a dict of arrays,
            a table of pandas or polars, anything with ``__arrow_c_stream__``. It needs ``t`` (s), one column for each coordinate and
            one for each drive; ``columns`` says what they are called.
        name : str, optional
            What messages call a table.
        **reading
            See :class:`ReadingOptions`.
        """
        read = Recording(self, data, reading, progress, name)
        _warn(read.notes)
        return read

    def _recordings(self, data: Any, reading: Mapping[str, Any], progress: Progress, what: str) -> list[_core.Recorded]:
        sources = [] if data is None else data if isinstance(data, list) else [data]
        read: list[_core.Recorded] = []
        for k, source in enumerate(sources):
            name = what if len(sources) == 1 else f"{what} {k + 1}"
            read.append(self._read(source, reading, progress, name)._core)
        return read

    def _read(self, source: Any, reading: Mapping[str, Any], progress: Progress, name: str) -> Recording:
        if isinstance(source, Recording):
            if source._model is self:
                if reading:
                    raise ModelmillError(
                        f"{source.name} is prepared already; give {', '.join(reading)} where recording() reads it"
                    )
                return source
            # Another model may need other columns and other filters.
            options = {**source._options, **reading}
            return Recording(self, source._source, options, progress, source._given_name)
        return Recording(self, source, reading, progress, name)

    def compare(
        self, data: Source, *, parameters: Values = None, progress: Progress = None, **reading: Unpack[ReadingOptions]
    ) -> Comparison:
        """Holds the model against recordings: how far it is off, and where.

        Parameters
        ----------
        data
            A recording as :meth:`recording` takes it, or a list of them.
        parameters : optional
            Values of the base parameters; nominal ones if not given.
        progress : callable or bool, optional
            Called as ``progress(what, done, total)``; False is silent.
        **reading
            See :class:`ReadingOptions`.
        """
        values, name = self._values(parameters)
        read = self._recordings(data, reading, progress, "data")
        return Comparison(_answered(progress, lambda hears: self._core.compare(read, values, name, hears)))

    def identify(
        self,
        data: Source,
        *,
        check: Source = None,
        weights: str = "auto",
        robust: float | None = None,
        prior: float | None = None,
        physical: bool = False,
        essential: bool = False,
        standstill: float | None = None,
        instruments: Source = None,
        instrument_period: float | None = None,
        progress: Progress = None,
        **reading: Unpack[ReadingOptions],
    ) -> Identification:
        """Base parameters from recordings.

        Parameters
        ----------
        data, check
            Recordings of the fit, and such that it does not see.
        weights : {"auto", "none", "channels", "variance"}
            What each equation counts.
        robust : float, optional
            Huber's bound in standard deviations; 1.345 is usual.
        prior : float, optional
            Nominal values as soft constraints, with this relative standard deviation.
        physical : bool
            Only parameters that bodies can have.
        essential : bool
            Leave out base parameters that the recordings do not support.
        standstill : float, optional
            Leave out equations while a drive is slower than this part of its fastest.
        instruments, instrument_period : optional
            Instrumental variables: recordings of the motion that was asked for, or states one period (s) later.
        progress, **reading
            As for :meth:`compare`.
        """
        read, checked = (self._recordings(all, reading, progress, name) for all, name in ((data, "data"), (check, "check")))
        recorded = self._recordings(instruments, reading, progress, "instruments")
        options = {
            "weights": weights,
            "robust": robust,
            "prior": prior,
            "physical": physical,
            "essential": essential,
            "standstill": standstill,
        }
        found = _answered(progress, lambda hears: self._core.identify(read, checked, options, recorded, instrument_period, hears))
        return Identification(found, self)

    def diagnose(
        self,
        data: Source,
        *,
        check: Source = None,
        held: bool = False,
        parameters: Values = None,
        progress: Progress = None,
        **reading: Unpack[ReadingOptions],
    ) -> Diagnosis:
        """Which physical effect the model lacks.

        Parameters
        ----------
        data
            Recordings to find it in.
        check : optional
            Recordings that decide what is believed; without any, blocks of ``data`` take turns.
        held : bool
            Hold all parameters, so that what is wrong with them shows too.
        parameters : optional
            What takes the place of the nominal values.
        progress, **reading
            As for :meth:`compare`.
        """
        model = self if parameters is None else self.with_fit(parameters)
        read, checked = (model._recordings(all, reading, progress, name) for all, name in ((data, "data"), (check, "check")))
        found = _answered(progress, lambda hears: model._core.diagnose(read, checked, held, hears))
        return Diagnosis(found, None if found.model is None else Model(found.model))

    def report(self, data: Source, **options: Any) -> Page:
        """What the model lacks as one page, inline in a notebook; takes what :meth:`diagnose` takes."""
        return self.diagnose(data, **options).report()

    def runs(
        self,
        data: Sequence[Source],
        *,
        per_run: Sequence[str] = (),
        loads: Sequence[str] = (),
        progress: Progress = None,
        **reading: Unpack[ReadingOptions],
    ) -> Runs:
        """What changed between recordings of one machine.

        Parameters
        ----------
        data : list
            Two recordings or more; the first is how things were. Those that cannot be read are named, but the first.
        per_run : list of str
            What is each run's own in one fit of all: ``"payload@flange"``, ``"friction"``, a base parameter by its name.
        loads : list of str
            Runs with a known load: ``"loaded.csv=2.8@flange"``.
        progress, **reading
            As for :meth:`compare`.
        """
        if isinstance(data, (str, os.PathLike)) or not isinstance(data, Sequence):
            raise ModelmillError("runs() holds several recordings against the first: pass a list of them")
        read: list[_core.Recorded] = []
        unread: list[tuple[int, str, str]] = []
        for k, source in enumerate(data):
            try:
                read.append(self._read(source, reading, progress, f"run {k + 1}")._core)
            except ModelmillError as error:
                if k == 0:
                    raise
                unread.append((k, os.fspath(source) if isinstance(source, (str, os.PathLike)) else f"run {k + 1}", str(error)))
        return Runs(_answered(progress, lambda hears: self._core.runs(read, unread, list(per_run), list(loads), hears)))

    def excite(
        self,
        *,
        limits: Mapping[str, float | tuple[float, float]] | Sequence[str] = (),
        harmonics: int = 7,
        period: float = 7.29,
        criterion: str = "condition",
        random: int = 1000,
        starts: int = 4,
        seed: int = 1,
        rate: float = 500.0,
        parameters: Values = None,
        separate: str | None = None,
        apart_from: Sequence[str] = (),
        beside: Sequence[str] = (),
        noise: float | None = None,
        data: Source = None,
        columns: Mapping[str, str] | None = None,
        progress: Progress = None,
    ) -> Excitation:
        """The periodic motion that tells base parameters, or effects, apart best.

        Parameters
        ----------
        limits : dict or list of str
            Beside those of the model file, or in their place: ``{"q1": (-1, 1), "q1_d": 2, "motor": 1500}``.
        harmonics : int
            Of the Fourier series of each coordinate.
        period : float
            s.
        criterion : {"condition", "log_det"}
            What is made small.
        random, starts, seed : int
            Random trajectories that are tried first, how many of them the search starts from, and the seed.
        rate : float
            Samples per second.
        separate, apart_from, beside, noise
            Make the effect ``"coulomb_friction@motor:Fc=25.9"`` differ most from those of ``apart_from``, with those of ``beside`` in
            either case; ``noise`` is the standard deviation in the forces, N or N m.
        data, columns : optional
            Recordings to compare with, and what they call our columns.
        """
        model = self if parameters is None else self.with_fit(parameters)
        if isinstance(limits, Mapping):
            limits = [
                f"{name}={value[0]!r}:{value[1]!r}" if isinstance(value, (tuple, list)) else f"{name}={value!r}"
                for name, value in limits.items()
            ]
        options = {
            "harmonics": harmonics,
            "period": float(period),
            "limits": list(limits),
            "criterion": criterion,
            "random": random,
            "starts": starts,
            "seed": seed,
            "rate": float(rate),
            "separate": separate,
            "apart_from": list(apart_from),
            "beside": list(beside),
            "noise": noise,
        }
        read = model._recordings(data, {"columns": columns} if columns else {}, progress, "data")
        return Excitation(_answered(progress, lambda hears: model._core.excite(options, read, hears)), self.coordinates)

    # Other models of the same mechanism.

    def with_effect(self, kind: str, at: str | Sequence[str], **settings: float | str) -> Model:
        """The model with an effect added to its file.

        Parameters
        ----------
        kind : str
            Such as ``"coulomb_friction"``; :func:`kinds` lists them.
        at : str or list of str
            Where it acts: a drive, a coordinate, a point, ``"base"``.
        **settings
            By the symbols of the kind: a value (SI), or the name that a parameter is to have.
        """
        values = [(name, float(one)) for name, one in settings.items() if not isinstance(one, str)]
        names = [(name, one) for name, one in settings.items() if isinstance(one, str)]
        places = [at] if isinstance(at, str) else list(at)
        return Model(self._core.with_effect(kind, places, values, names))

    def with_fit(self, parameters: Values) -> Model:
        """The model with other values of its base parameters, such as those of an :class:`Identification`."""
        return Model(self._core.with_values(self._values(parameters)[0]))

    def adopt(self, fit: Identification | PathText) -> Model:
        """The model with a fit written into its file, in the place of nominal values; ``save`` keeps it.

        Parameters
        ----------
        fit
            What :meth:`identify` found, or the path of a file that it was saved to. A fit with ``physical=True`` becomes values of
            parameters, which bodies can have; any other one values of base parameters, which say nothing of single bodies.
        """
        model, notes = self._core.adopt(*_fit(fit))
        _warn(notes)
        return Model(model)

    # What else can be asked of a model.

    def interpret(self, fit: Identification | PathText, unknown: Sequence[str]) -> Interpretation:
        """Physical parameters from identified base parameters, the others held at their nominal values: all real solutions.

        Parameters
        ----------
        fit
            What :meth:`identify` found, or the path of a file that it was saved to.
        unknown : list of str
            Names of the parameters that are solved for.
        """
        if isinstance(unknown, str):
            raise ModelmillError(f"unknown={unknown!r}: pass a list of names, as in unknown=[{unknown!r}]")
        found = self._core.interpret(*_fit(fit), list(unknown))
        _warn(found.notes)
        return Interpretation(found)

    def diff(
        self, variant: Model, data: Source = None, *, progress: Progress = None, **reading: Unpack[ReadingOptions]
    ) -> Difference:
        """What a variant changes; along recordings, what it costs: forces, power and work of each drive, limits, error.

        Parameters
        ----------
        variant : Model
            What this model is held beside.
        data : optional
            A recording, or a list of them; motions alone will do. It is a path or a table, since both models read it.
        progress, **reading
            As for :meth:`compare`.
        """
        sources = [] if data is None else data if isinstance(data, list) else [data]
        read, again = (model._recordings(sources, reading, progress, "data") for model in (self, variant))
        return Difference(_answered(progress, lambda hears: self._core.diff(variant._core, read, again, hears)))

    def export(self, format: str = "urdf", *, parameters: Identification | PathText | None = None) -> str:
        """The model as a robot description of other programs; what the format cannot say is warned of.

        Parameters
        ----------
        format : {"urdf", "mjcf"}
            Loops and drives between two points need MJCF.
        parameters : optional
            A fit made with ``physical=True``, or the path of one; nominal values if not given.
        """
        text, notes = self._core.export(format, *((None, None) if parameters is None else _fit(parameters)))
        _warn(notes)
        return text


def _fit(fit: Identification | PathText) -> tuple[str | None, str]:
    """The text of a fit with what messages call it, or no text and the path of its file."""
    if isinstance(fit, Identification):
        return json.dumps(fit.to_dict()), "fit"
    if isinstance(fit, (str, os.PathLike)):
        return None, os.fspath(fit)
    raise ModelmillError(f"a {type(fit).__name__} is no fit; expected is what identify() found, or the path of its file")


class Picture:
    """A picture; a notebook shows it.

    Attributes
    ----------
    svg : str
    """

    def __init__(self, svg: str) -> None:
        self.svg = svg

    def save(self, path: PathText) -> None:
        """Writes the picture to a file (SVG)."""
        Path(path).write_text(self.svg, encoding="utf-8")

    def _repr_html_(self) -> str:
        return self.svg


def load(
    source: PathText,
    *,
    name: str | None = None,
    libraries: Sequence[PathText] = (),
    at_values: bool = False,
    floating: bool = False,
    round_angles: bool = False,
    closures: PathText | None = None,
    pose: Mapping[str, float] | None = None,
    progress: Progress = None,
) -> Model:
    """Reads a model file (TOML) or a robot description (URDF, MJCF, SDF) and derives it.

    Parameters
    ----------
    source : path or str
        Path of the file; a text of several lines is the file itself.
    name : str, optional
        What messages call a text.
    libraries : list of paths
        Further kinds of effects.
    at_values : bool
        Derive for the file's values alone: fewer base parameters where geometry is special.
    floating, round_angles, closures, pose
        Of robot descriptions: whether the base of a URDF floats; whether angles near right ones are taken for these; a file of
        closures; the assembly that is meant, by joints.

    Returns
    -------
    Model

    Raises
    ------
    ModelmillError
        With every finding about the file, each with its place.
    """
    text = os.fspath(source)
    is_text = "\n" in text or text.lstrip().startswith("<")
    if not is_text and not os.path.isfile(text):
        raise ModelmillError(
            f"there is no file {text}; the path of a model file (TOML) or of a robot description (URDF, MJCF, SDF) is expected, "
            "or the text of one"
        )
    is_robot = text.lstrip().startswith("<") if is_text else Path(text).suffix.lower() in (".urdf", ".xml", ".mjcf", ".sdf")
    with told(progress) as hears:
        if is_robot:
            stem = name or ("robot" if is_text else text)
            described, notes = _core.import_text(
                stem, text if is_text else None, floating, round_angles, closures, list((pose or {}).items())
            )
            _warn(notes)
            core = _core.load_text(str(Path(stem).with_suffix(".toml")), described, libraries, at_values, hears)
        elif is_text:
            core = _core.load_text(name or "model.toml", text, libraries, at_values, hears)
        else:
            core = _core.load(text, libraries, at_values, hears)
    _warn(core.notes)
    return Model(core)


def recordings(path: PathText) -> Result:
    """What a log holds, table by table or topic by topic, before a model reads it."""
    return Result(_core.contents(path))


def kinds(libraries: Sequence[PathText] = ()) -> list[dict[str, Any]]:
    """The kinds of effects that a model may have, as ``modelmill effects --json`` prints them."""
    told: list[dict[str, Any]] = json.loads(_core.kinds(libraries))["kinds"]
    return told
