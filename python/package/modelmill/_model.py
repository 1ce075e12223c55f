"""Models and recordings."""

from __future__ import annotations

import html
import json
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._compiled import Compiled
from ._errors import ModelmillError, ModelmillWarning
from ._figures import force_figure
from ._keywords import with_keywords
from ._options import ESTIMATION, READING, EstimationOptions, PathText, ReadingOptions
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
    Simulation,
    frame,
    number,
    table_html,
    text_html,
)
from ._tables import columns as columns_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure
    from typing_extensions import Unpack

Floats = NDArray[np.float64]
#: Base parameters: nominal values (None), a fit, the path of one, values in the order of ``p_min``, or some values by name.
Values = Union[None, Identification, PathText, Mapping[str, float], ArrayLike]
Progress = Union[Told, bool, None]


class IdentificationOptions(EstimationOptions, ReadingOptions, total=False):
    """Keywords of :meth:`Model.identify`."""


def _reading(options: Mapping[str, Any]) -> dict[str, Any]:
    _refuse_unknown(options, READING)
    columns = options.get("columns") or {}
    if isinstance(columns, (str, os.PathLike)):
        pairs = _core.column_mapping(columns)
    else:
        pairs = [(str(ours), str(theirs)) for ours, theirs in dict(columns).items()]
    return {**options, "columns": pairs}


def _refuse_unknown(options: Mapping[str, Any], *known: Mapping[str, Any]) -> None:
    names = [name for one in known for name in one]
    unknown = [name for name in options if name not in names]
    if unknown:
        raise TypeError(f"unknown keyword {', '.join(unknown)}; the keywords for options are {', '.join(names)}")


def _warn(notes: Remarks, level: int = 3) -> None:
    for severity, says in notes:
        if severity == "warning":
            warnings.warn(says, ModelmillWarning, stacklevel=level)


def _answered(progress: Progress, verb: Callable[[_core._Progress], AnswerT]) -> AnswerT:
    """Runs a method with its progress, issues its warnings, and returns its result."""
    with told(progress) as hears:
        found = verb(hears)
    _warn(found.notes, 4)
    return found


def _successful(read: Recording | ModelmillError) -> Recording:
    if isinstance(read, ModelmillError):
        raise read
    return read


def _are_the_same(some: Sequence[Sequence[Any]], others: Sequence[Sequence[Any]]) -> bool:
    return [[id(one) for one in run] for run in some] == [[id(one) for one in run] for run in others]


def _sources(data: Any) -> list[Any]:
    """Returns the recordings of an argument: none, one, or a list."""
    return [] if data is None else data if isinstance(data, list) else [data]


def _vector(given: ArrayLike | None) -> ArrayLike | None:
    """Returns real numbers as a contiguous vector of floats, and everything else as it is."""
    if given is None:
        return None
    array = np.asarray(given)
    if array.ndim != 1 or array.dtype.kind not in "fiub":
        return given
    return np.ascontiguousarray(array, dtype=np.float64)


def _wrong_shape(name: str, shape: tuple[int, ...], names: list[str]) -> str:
    width = len(names)
    says = f"{name} has shape {shape}; expected ({width},) for one state or (n, {width}) for many: {', '.join(names)}"
    if len(shape) == 2 and shape[0] == width:
        return f"{says}. Here the states are columns: pass {name}.T"
    if width == 1 and len(shape) == 1:
        return f"{says}. For many states of one coordinate pass {name}.reshape(-1, 1)"
    return says


@dataclass(frozen=True)
class BaseParameter:
    """A base parameter: ``expression`` in the parameters of the model file, and nominal ``value`` (None if the file has none)."""

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
        Nominal values; 0 if the file gives none.
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
    """The equations of the model: a page in a notebook, a text as ``str``."""

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
        """LaTeX: a complete document."""
        return self._core.equations("latex")

    @property
    def html(self) -> str:
        """HTML: a self-contained page."""
        return self._core.equations("html")

    def to_dict(self) -> dict[str, Any]:
        """Returns what ``modelmill equations --json`` prints."""
        told: dict[str, Any] = json.loads(self._core.equations("json"))
        return told

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return Page(self.html)._repr_html_()

    def _repr_latex_(self) -> str:
        lines = []
        for name, _, expression, _, _, _ in self._core.base:
            # Notebooks do not support `\verb`, so special characters of LaTeX are escaped one by one.
            left = "p_{" + name.removeprefix("p").removesuffix("_min") + ",\\min}"
            right = "".join("\\" + c if c in "_#%&{}$" else "\\hat{\\ }" if c == "^" else c for c in expression)
            lines.append(f"{left} &= \\texttt{{{right}}}")
        return "$$\\begin{aligned}" + r" \\ ".join(lines) + "\\end{aligned}$$"


@dataclass(frozen=True)
class _Request:
    """A recording that a method needs: a source with options, or a recording that was prepared before."""

    source: Any
    options: Mapping[str, Any]
    name: str
    input: _core._Input
    prepared: Recording | None = None
    left_out: tuple[str, ...] = ()


def _request(source: Any, options: Mapping[str, Any], name: str) -> _Request:
    whole = _reading(options)
    left_out: list[str] = []
    read: Any
    if isinstance(source, (str, os.PathLike)):
        read, name = [source], os.fspath(source)
    elif isinstance(source, tuple) and all(isinstance(one, (str, os.PathLike)) for one in source):
        read, name = list(source), "+".join(os.fspath(one) for one in source)
    else:
        read, left_out = columns_of(source)
    return _Request(source, options, name, (name, read, whole), left_out=tuple(left_out))


class Recording:
    """A recording that was read and prepared for a model, once for several methods.

    It can be pickled and copied. In another process it is prepared again, together with the recordings with which it was
    prepared first: the files must still be there.

    Attributes
    ----------
    name : str
        Name in messages.
    notes : list of (str, str)
        Processing steps and warnings of the audit: severity and text.
    """

    def __init__(self, model: Model, request: _Request, core: _core.Recording, group: _Group, place: tuple[int, int]) -> None:
        self._model, self._core = model, core
        self._source, self._options, self._given_name = request.source, dict(request.options), request.name
        self._group, self._place = group, place
        self.name = core.file
        self.notes = core.notes

    def _motion(self) -> tuple[Floats, list[Floats], list[Floats], list[Floats]]:
        return self._core.prepared()

    @property
    def model(self) -> Model:
        """The model for which the recording was prepared."""
        return self._model

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

    @property
    def forces(self) -> Floats | None:
        """Measured forces of the drives, N or N m; shape (n, drives). None if the recording has no forces.

        NaN where a force was not measured, or was found to be a fault of its sensor.
        """
        measured = self._core.forces()
        return None if measured is None else np.stack(measured, axis=1)

    def calculated(self, parameters: Values = None) -> Floats:
        """Computes the forces of the model at the prepared samples, N or N m; shape (n, drives).

        Parameters
        ----------
        parameters : optional
            Values of the base parameters, as for :meth:`Model.inverse_dynamics`; nominal ones if not given.
        """
        values, _ = self._model._values(parameters)
        return np.stack(_core.forces_along(self._model._core, self._core, values), axis=1)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Recording):
            return NotImplemented
        if self is other:
            return True
        own, others = self._arrays(), other._arrays()
        return (
            (self.name, self._model) == (other.name, other._model)
            and len(own) == len(others)
            and all(np.array_equal(a, b, equal_nan=True) for a, b in zip(own, others))
        )

    def _arrays(self) -> list[Floats]:
        time, q, qd, qdd = self._motion()
        return [time, *q, *qd, *qdd, *(self._core.forces() or [])]

    def __hash__(self) -> int:
        return hash((self.name, self._model))

    def __copy__(self) -> Recording:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Recording:
        # Nothing of a recording changes.
        return self

    def __reduce__(self) -> tuple[Callable[..., Recording], tuple[Any, ...]]:
        return _restored_recording, (self._model, self._group, self._place)

    def __repr__(self) -> str:
        remarks = "".join(f"\n  {severity}: {says}" for severity, says in self.notes)
        return f"recording {self.name}: {len(self.t)} samples{remarks}"


#: Recordings that were prepared together: those of a fit, and its validation runs; each with source, options and name.
_Group = tuple[tuple[tuple[Any, dict[str, Any], str], ...], ...]


def _restored_recording(model: Model, group: _Group, place: tuple[int, int]) -> Recording:
    """Prepares the recordings of a group again, once for all that are restored from it."""
    if model._restored is None or model._restored[0] is not group:
        requests = [[_request(source, options, name) for source, options, name in run] for run in group]
        model._restored = (group, model._prepared(requests[0], requests[1], False))
    return _successful(model._restored[1][place[0]][place[1]])


#: One recording: a path, a tuple of paths of one run, a table, or the result of `Model.recording`.
Source = Any


class Model:
    """A model that was read and derived; :func:`load` makes one.

    Arrays of states have shape ``(dof,)`` for one state or ``(n, dof)`` for many, with any real number type and any memory
    order. Columns have the order of `coordinates`, those of forces the order of `drives`. Values of base parameters are the
    nominal ones of the file, unless ``parameters`` is given: an :class:`Identification`, the path of one, an array in the order
    of `p_min`, or a dict that replaces some of them by name.

    A model can be pickled and copied: it is derived again from its text in another process. Models are equal if their text and
    the values of their base parameters are.
    """

    def __init__(self, core: _core.Model) -> None:
        self._core = core
        # What functions of single states need, read once.
        self._nominal_notes: Remarks | None = None
        self._sizes: dict[str, tuple[int, ...]] = {}
        self._last_fit: tuple[Identification, Floats] | None = None
        # Recordings that were last restored from a pickle.
        self._restored: tuple[_Group, tuple[list[Recording | ModelmillError], list[Recording | ModelmillError]]] | None = None
        self._p_min: BaseParameters | None = None
        self._compiled: dict[str, Compiled] = {}
        # Recordings that were last prepared together: those that were given, and those that came out.
        self._together: tuple[tuple[Any, ...], ...] = ()
        self._together_prepared: tuple[list[Recording | ModelmillError], list[Recording | ModelmillError]] = ([], [])

    # Copies.

    def __reduce__(self) -> tuple[Callable[..., Model], tuple[Any, ...]]:
        path, text, libraries, at_values = _core.model_contents(self._core)
        # Other files are found from the folder of the model file, wherever the other process starts.
        libraries = [os.path.abspath(one) for one in libraries]
        if os.path.isfile(path):
            path = os.path.abspath(path)
        return _restored_model, (path, text, libraries, at_values, self._core.nominal)

    def __copy__(self) -> Model:
        return Model(self._core)

    def __deepcopy__(self, memo: dict[int, Any]) -> Model:
        # The compiled part never changes.
        return Model(self._core)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Model):
            return NotImplemented
        same = self.text == other.text and len(self.p_min) == len(other.p_min)
        return same and bool(np.array_equal(self._core.nominal, other._core.nominal, equal_nan=True))

    def __hash__(self) -> int:
        return hash(self.text)

    # What the model is.

    @property
    def name(self) -> str:
        """Name of the file without folder and ending."""
        return self._core.name

    @property
    def text(self) -> str:
        """The text of the model file, including effects that were added."""
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
        """Names of the passive coordinates (determined by loop closure)."""
        return self._core.passive

    @property
    def drives(self) -> list[str]:
        """Names of the drives: the columns of forces."""
        return self._core.drives

    @property
    def dof(self) -> int:
        """Number of active coordinates."""
        return len(self._core.coordinates)

    @property
    def p_min(self) -> BaseParameters:
        """The base parameters, eq. (16)."""
        if self._p_min is None:
            self._p_min = BaseParameters(self._core)
        return self._p_min

    @property
    def notes(self) -> Remarks:
        """Notes on the model file: severity and text."""
        return self._core.notes

    def equations(self) -> Equations:
        """Returns the derivation: p_g, dependent columns, p_min and the equations."""
        return Equations(self._core)

    def check(self) -> Check:
        """Returns the parts of the model, and its numeric rank next to the exact one."""
        return Check(self._core.check())

    def picture(self, at: Mapping[str, float] | None = None, view: tuple[float, float] | None = None) -> Picture:
        """Draws the mechanism at a pose.

        Parameters
        ----------
        at : dict of str to float, optional
            Coordinates, rad or m; the others stay at the nominal pose.
        view : (float, float), optional
            Direction of view: azimuth and elevation, degrees.
        """
        return Picture(self._core.picture(list((at or {}).items()), view))

    def generate(
        self, language: str = "rust", *, dynamics: bool = False, reactions: bool = False, self_test: bool = False
    ) -> dict[str, str]:
        """Returns code of the model: paths and texts of files. ``language`` is ``"rust"``, ``"c99"``, ``"c"``, ``"python"`` or ``"julia"``."""
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
        """Returns values of the base parameters, and their name in the JSON."""
        if parameters is None:
            _warn(self._core.nominal_notes, 5)
            return self._core.nominal, "nominal"
        if isinstance(parameters, Identification):
            if parameters.signals is not None and parameters.signals.only_ratios:
                fixing = {name for group in parameters.signals.only_ratios for name in group.get("fixed_by", [])}
                raise ModelmillError(
                    "the fit contains only ratios, so that the model has no values from it; give a number for one of "
                    f"{', '.join(sorted(fixing)) or 'its gains'} in the model file, and identify it again"
                )
            of_fit = [(one.name, one.expression) for one in parameters.parameters]
            own = list(zip(self.p_min.names, self.p_min.expressions))
            if of_fit != own:
                raise ModelmillError(
                    "the fit belongs to another model, because its base parameters are different; identify this model"
                )
            return parameters.values, "fit"
        if isinstance(parameters, (str, os.PathLike)):
            path = os.fspath(parameters)
            if path == "nominal":
                return self._values(None)
            values, _, notes = self._core.values_of_fit(path)
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
        """Returns arrays of shape (n, width), and whether the input was a single state of shape (width,)."""
        found: list[Floats | None] = []
        first: tuple[str, tuple[int, ...]] | None = None
        for name, given, names in parts:
            if given is None:
                found.append(None)
                continue
            array = np.asarray(given)
            width = len(names)
            if array.dtype.kind not in "fiub":
                raise ModelmillError(f"{name} has the type {array.dtype}; real numbers are expected")
            if array.ndim not in (1, 2) or array.shape[-1] != width:
                raise ModelmillError(_wrong_shape(name, array.shape, names))
            if first is None:
                first = (name, array.shape[:-1])
            elif array.shape[:-1] != first[1]:
                raise ModelmillError(
                    f"{name} has shape {array.shape} and {first[0]} {(*first[1], len(parts[0][2]))}; give both as many states"
                )
            array = np.atleast_2d(array.astype(np.float64, copy=False))
            if not (array.flags.c_contiguous or array.flags.f_contiguous):
                array = np.ascontiguousarray(array)
            found.append(array)
        return found, first is not None and first[1] == ()

    def _single(
        self,
        function: str,
        q: ArrayLike | None,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
        forces: ArrayLike | None = None,
        parameters: Values = None,
    ) -> Floats | None:
        """Evaluates a function at one state given as vectors, as fast as possible; None for all other input and for faults."""
        if getattr(q, "ndim", 1) != 1:
            return None
        values: Floats | None = None
        if parameters is not None:
            if isinstance(parameters, np.ndarray):
                values = parameters
            elif isinstance(parameters, Identification):
                if self._last_fit is None or self._last_fit[0] is not parameters:
                    self._last_fit = (parameters, self._values(parameters)[0])
                values = self._last_fit[1]
            else:
                return None
        shape = self._sizes.get(function)
        if shape is None:
            n, drives, n_base = self.dof, len(self.drives), len(self.p_min)
            self._sizes = {
                "inverse_dynamics": (drives,),
                "regressor": (drives, n_base),
                "mass_matrix": (n, n),
                "bias": (n,),
            }
            shape = self._sizes[function]
        size = shape[0] if len(shape) == 1 else shape[0] * shape[1]
        found = _core.at_single(self._core, function, size, q, qd, qdd, forces, values)
        if found is None:
            # Lists and other types of numbers.
            q, qd, qdd, forces = [_vector(one) for one in (q, qd, qdd, forces)]
            found = _core.at_single(self._core, function, size, q, qd, qdd, forces, values)
            if found is None:
                return None
        if parameters is None and function != "regressor":
            if self._nominal_notes is None:
                self._nominal_notes = self._core.nominal_notes
            if self._nominal_notes:
                _warn(self._nominal_notes, 4)
        return found if len(shape) == 1 else found.reshape(shape)

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
        """Computes the forces of the drives, tau = H_min p_min.

        Parameters
        ----------
        q, qd, qdd : array_like, shape (dof,) or (n, dof)
            Positions (rad or m), rates and accelerations of the coordinates.
        parameters : optional
            Values of the base parameters; nominal ones if not given.
        load : array_like, shape (drives,) or (n, drives), optional
            Load of each drive, N or N m, for effects that depend on it.

        Returns
        -------
        numpy.ndarray, shape (drives,) or (n, drives)
            N or N m.
        """
        found = self._single("inverse_dynamics", q, qd, qdd, load, parameters)
        return self._at("inverse_dynamics", q, qd, qdd, load, parameters) if found is None else found

    def regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, load: ArrayLike | None = None) -> Floats:
        """Computes H_min of eq. (4): forces are ``regressor @ p_min``.

        Parameters
        ----------
        q, qd, qdd, load
            As for :meth:`inverse_dynamics`.

        Returns
        -------
        numpy.ndarray, shape (drives, n_base) or (n, drives, n_base)
        """
        found = self._single("regressor", q, qd, qdd, load)
        return self._at("regressor", q, qd, qdd, load, self._core.nominal) if found is None else found

    def mass_matrix(self, q: ArrayLike, *, parameters: Values = None) -> Floats:
        """Computes the mass matrix M of ``J' f = M q'' + b``.

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
        found = self._single("mass_matrix", q, parameters=parameters)
        return self._at("mass_matrix", q, parameters=parameters) if found is None else found

    def bias(
        self, q: ArrayLike, qd: ArrayLike, *, parameters: Values = None, load: ArrayLike | None = None
    ) -> Floats:
        """Computes b of ``J' f = M q'' + b``: generalised forces due to velocity, gravity and effects.

        Parameters
        ----------
        q, qd, parameters, load
            As for :meth:`inverse_dynamics`.

        Returns
        -------
        numpy.ndarray, shape (dof,) or (n, dof)
            N or N m.
        """
        found = self._single("bias", q, qd, None, load, parameters)
        return self._at("bias", q, qd, None, load, parameters) if found is None else found

    def forward_dynamics(self, q: ArrayLike, qd: ArrayLike, forces: ArrayLike, *, parameters: Values = None) -> Floats:
        """Computes the accelerations of the coordinates for given forces of the drives.

        Parameters
        ----------
        q, qd : array_like, shape (dof,) or (n, dof)
            Positions, rad or m, and rates, rad/s or m/s.
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
        """Compiles functions of this model with the C compiler of the machine, for many states at once.

        Results differ from those without compilation by some units in the last place. Forward dynamics, and mechanisms whose
        loops need Newton's method, are not compiled.

        Parameters
        ----------
        *functions : str
            ``"inverse_dynamics"``, ``"regressor"``, ``"mass_matrix"``, ``"bias"``, ``"reactions"``; the first two if none is named.
        """
        for function in functions or ("inverse_dynamics", "regressor"):
            self._compiled[function] = Compiled(*self._core.vectors_c(function))

    @property
    def reaction_names(self) -> list[str]:
        """Names of the columns of :meth:`reactions`, such as ``elbow.Fx``; no statically indeterminate ones."""
        return self._core.reaction_names()[0]

    def reactions(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, load: ArrayLike | None = None) -> Floats:
        """Computes reactions in joints and at cuts of loops, for the parameters of the model file.

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

    @with_keywords((READING, ReadingOptions))
    def recording(
        self, data: Source, *, name: str | None = None, progress: Progress = None, **reading: Unpack[ReadingOptions]
    ) -> Recording:
        """Reads and prepares a recording, for use in several methods.

        Parameters
        ----------
        data
            A path (CSV, Parquet, MATLAB, HDF5, MCAP, ROS bags), a tuple of paths that are joined on time, or a table: a dict of
            arrays, a table of pandas or polars, anything with ``__arrow_c_stream__``. It needs ``t`` (s), one column for each
            coordinate (rad or m) and one for each drive (N or N m); ``columns`` gives other names and units.
        name : str, optional
            Name of a table in messages.
        **reading
            See :class:`ReadingOptions`.
        """
        [read], _ = self._prepared([self._request(data, reading, name or "recording")], [], progress)
        found = _successful(read)
        _warn(found.notes)
        return found

    @with_keywords((READING, ReadingOptions))
    def prepare_recordings(
        self,
        data: Sequence[Source],
        *,
        check: Sequence[Source] = (),
        progress: Progress = None,
        **reading: Unpack[ReadingOptions],
    ) -> tuple[list[Recording], list[Recording]]:
        """Reads recordings of one machine and prepares them together, for use in several methods.

        Cut-off, smoothing and decimation are chosen for those of the fit together, and are the same for the validation runs;
        drives stick below the same rate in all. Methods that get several recordings do the same.

        Parameters
        ----------
        data, check
            Recordings for a fit, and validation runs, as :meth:`recording` takes them.
        **reading
            See :class:`ReadingOptions`.

        Returns
        -------
        (list of Recording, list of Recording)
            Those for the fit, and those for its validation.
        """
        found = self._all_recordings((list(data), "data"), (list(check), "check"), reading, progress)
        for one in (*found[0], *found[1]):
            _warn(one.notes)
        return found

    def _request(
        self, source: Any, reading: Mapping[str, Any], name: str, unprepared: Mapping[str, Any] | None = None
    ) -> _Request:
        """Returns a source with its options; those of `unprepared` are for recordings that are read now."""
        if not isinstance(source, Recording):
            return _request(source, {**reading, **(unprepared or {})}, name)
        if source._model is not self:
            # Another model may need other columns and other filters.
            return _request(source._source, {**source._options, **reading, **(unprepared or {})}, source._given_name)
        if reading:
            raise ModelmillError(f"{source.name} is prepared already; give {', '.join(reading)} to recording() instead")
        return _Request(source._source, source._options, source._given_name, source._core, source)

    def _prepared(
        self, fit: list[_Request], check: list[_Request], progress: Progress
    ) -> tuple[list[Recording | ModelmillError], list[Recording | ModelmillError]]:
        """Returns the recordings of a fit and of its validation, prepared together, or why there is none."""
        given = tuple(tuple(one.prepared for one in run) for run in (fit, check))
        flat = [one for run in given for one in run]
        if not flat:
            return [], []
        if len(flat) == 1 and flat[0] is not None:
            return [one for one in given[0] if one], [one for one in given[1] if one]
        # Several methods often get the same recordings.
        if None not in flat and _are_the_same(given, self._together):
            return list(self._together_prepared[0]), list(self._together_prepared[1])
        with told(progress) as hears:
            answers = self._core.prepare_together([[one.input for one in run] for run in (fit, check)], hears)
        found: list[list[Recording | ModelmillError]] = [[], []]
        group: _Group = tuple(tuple((one.source, dict(one.options), one.name) for one in run) for run in (fit, check))
        for place, (requests, run, own) in enumerate(zip((fit, check), answers, found)):
            for k, (request, (core, error)) in enumerate(zip(requests, run)):
                if core is not None:
                    own.append(Recording(self, request, core, group, (place, k)))
                elif isinstance(error, ModelmillError):
                    if request.left_out and hasattr(error, "add_note"):
                        error.add_note(f"Columns without numbers were left out: {', '.join(request.left_out)}")
                    own.append(error)
                elif error is not None:
                    raise error
        prepared = (found[0], found[1])
        self._together = (tuple(found[0]), tuple(found[1])) if None in flat else given
        self._together_prepared = prepared
        return list(prepared[0]), list(prepared[1])

    def _all_recordings(
        self,
        fit: tuple[Any, str],
        check: tuple[Any, str],
        reading: Mapping[str, Any],
        progress: Progress,
        unprepared: Mapping[str, Any] | None = None,
    ) -> tuple[list[Recording], list[Recording]]:
        """Returns all recordings of a fit and of its validation, prepared together; raises the first error."""
        requests: list[list[_Request]] = []
        for data, what in (fit, check):
            sources = _sources(data)
            names = [what if len(sources) == 1 else f"{what} {k + 1}" for k in range(len(sources))]
            requests.append([self._request(source, reading, name, unprepared) for source, name in zip(sources, names)])
        first, second = self._prepared(requests[0], requests[1], progress)
        return [_successful(one) for one in first], [_successful(one) for one in second]

    def _recordings(
        self,
        data: Any,
        check: Any,
        reading: Mapping[str, Any],
        progress: Progress,
        what: str = "data",
        unprepared: Mapping[str, Any] | None = None,
    ) -> tuple[list[_core.Recording], list[_core.Recording]]:
        first, second = self._all_recordings((data, what), (check, "check"), reading, progress, unprepared)
        return [one._core for one in first], [one._core for one in second]

    @with_keywords((READING, ReadingOptions))
    def plot(
        self,
        data: Source,
        *,
        parameters: Values = None,
        drives: Sequence[str] | None = None,
        progress: Progress = None,
        **reading: Unpack[ReadingOptions],
    ) -> Figure:
        """Draws the measured force of each drive, that of the model, and the residual, over time; needs matplotlib.

        Parameters
        ----------
        data
            A recording as :meth:`recording` takes it.
        parameters : optional
            Values of the base parameters, such as the result of :meth:`identify`; nominal ones if not given.
        drives : list of str, optional
            Drives to draw; default: all.
        progress, **reading
            As for :meth:`compare`.

        Returns
        -------
        matplotlib.figure.Figure
        """
        if isinstance(data, list):
            raise ModelmillError("plot() draws one recording: pass one of the list")
        if isinstance(data, Recording) and data.model is self and not reading:
            run = data
        else:
            [run], _ = self._all_recordings((data, "recording"), (None, "check"), reading, progress)
        names = self.drives
        chosen = names if drives is None else [drives] if isinstance(drives, str) else list(drives)
        for name in chosen:
            if name not in names:
                raise ModelmillError(f"there is no drive `{name}`; there are {', '.join(names)}")
        values, what = self._values(parameters)
        return force_figure(run, self, [names.index(name) for name in chosen], values, what)

    @with_keywords((READING, ReadingOptions))
    def compare(
        self,
        data: Source,
        *,
        parameters: Values = None,
        forward: bool = False,
        progress: Progress = None,
        **reading: Unpack[ReadingOptions],
    ) -> Comparison:
        """Compares the model with recordings: size of the error, and where it occurs.

        Parameters
        ----------
        data
            A recording as :meth:`recording` takes it, or a list of them.
        parameters : optional
            Values of the base parameters; nominal ones if not given.
        forward : bool
            Also simulate the model forward in time from recorded states, and compare positions over horizons of 0.1 s, 1 s and
            the whole run.
        progress : callable or bool, optional
            Called as ``progress(what, done, total)``; False is silent.
        **reading
            See :class:`ReadingOptions`.
        """
        values, name = self._values(parameters)
        model = self._with_gains(parameters)
        read, _ = model._recordings(data, None, reading, progress)
        compared = _answered(progress, lambda hears: model._core.compare(read, values, name, hears))
        if not forward:
            return Comparison(compared)
        return Comparison(
            compared, _answered(progress, lambda hears: _core.compare_forward(model._core, read, values, hears))
        )

    @with_keywords((READING, ReadingOptions))
    def simulate(
        self, data: Source, *, parameters: Values = None, progress: Progress = None, **reading: Unpack[ReadingOptions]
    ) -> Simulation:
        """Simulates the model forward in time from the first state of a recording.

        The motion follows from the recorded forces. Without force columns it follows from the commands or other signals of
        the actuators of the model file; to use these for a recording with forces, leave its force columns out.

        Parameters
        ----------
        data
            A recording as :meth:`recording` takes it, without gaps in time.
        parameters : optional
            Values of the base parameters, and of gains if they are a fit; nominal ones if not given.
        progress, **reading
            As for :meth:`compare`.
        """
        values, _ = self._values(parameters)
        model = self._with_gains(parameters)
        read, _ = model._recordings(data, None, reading, progress)
        if len(read) != 1:
            raise ModelmillError("simulate() needs one recording: pass one of the list")
        return Simulation(
            _answered(progress, lambda hears: _core.simulate_motion(model._core, read[0], values, hears))
        )

    @with_keywords((ESTIMATION, EstimationOptions), (READING, ReadingOptions))
    def identify(
        self,
        data: Source,
        *,
        check: Source = None,
        instruments: Source = None,
        instrument_period: float | None = None,
        progress: Progress = None,
        **options: Unpack[IdentificationOptions],
    ) -> Identification:
        """Identifies base parameters from recordings by least squares.

        If the model has actuators and the recordings have their signals (commands, currents, voltages), these replace forces:
        base parameters, gains and delays are estimated by instrumental variables, and :attr:`Identification.signals` has the
        gains and delays. The options of estimators are then refused.

        Parameters
        ----------
        data, check
            Recordings for the fit, and validation runs, which the fit does not use.
        instruments, instrument_period : optional
            Instrumental variables: recordings of the reference motion, or the states one period (s) later.
        progress, **options
            As for :meth:`compare`; ``standstill`` concerns the equations of the fit only, and not the figures of the validation.
        """
        _refuse_unknown(options, ESTIMATION, READING)
        estimation = {name: one for name, one in options.items() if name in ESTIMATION}
        reading = {name: one for name, one in options.items() if name in READING}
        signals = self._identified_signals(data, check, reading, list(estimation), instruments is not None, progress)
        if signals is not None:
            return signals
        # A bound of the user belongs to the estimator, which applies it to the equations of the fit only.
        standstill = reading.get("standstill")
        others = {name: one for name, one in reading.items() if name != "standstill"}
        unbound = {} if standstill is None else {"standstill": 0.0}
        read, checked = self._recordings(data, check, others, progress, unprepared=unbound)
        recorded, _ = self._recordings(instruments, None, others, progress, "instruments", unbound)
        bound = {"standstill": standstill}
        found = _answered(
            progress,
            lambda hears: self._core.identify(read, checked, estimation, bound, recorded, instrument_period, hears),
        )
        return Identification(found, self)

    def _identified_signals(
        self,
        data: Source,
        check: Source,
        reading: Mapping[str, Any],
        unused: list[str],
        has_instruments: bool,
        progress: Progress,
    ) -> Identification | None:
        """Returns the fit of the signals of actuators, or None if forces are to be used."""
        if not self._core.has_actuators:
            return None
        runs = []
        for sources, what in ((_sources(data), "data"), (_sources(check), "check")):
            names = [what if len(sources) == 1 else f"{what} {k + 1}" for k in range(len(sources))]
            requests = [
                _request(one._source, {**one._options, **reading}, one._given_name)
                if isinstance(one, Recording)
                else _request(one, reading, name)
                for one, name in zip(sources, names)
            ]
            # Sources, because recordings that were prepared for forces have other derivatives.
            runs.append([(one.name, one.input[1], one.input[2]) for one in requests if isinstance(one.input, tuple)])
        given = [*unused, *(["instruments"] if has_instruments else [])]
        with told(progress) as hears:
            found = _core.identify_signals(self._core, runs, given, hears)
        if found is None:
            return None
        _warn(found.notes, 4)
        return Identification(found, self)

    def _with_gains(self, parameters: Values) -> Model:
        """Returns the model with the gains of a fit; itself without any."""
        is_path = isinstance(parameters, (str, os.PathLike)) and os.fspath(parameters) != "nominal"
        if isinstance(parameters, Identification):
            has_gains = parameters.signals is not None and bool(parameters.signals.gains)
        else:
            has_gains = is_path and self._core.values_of_fit(os.fspath(parameters))[1]  # type: ignore[arg-type]
        if not has_gains:
            return self
        model, _ = _core.with_fit(self._core, *_fit(parameters))  # type: ignore[arg-type]
        return Model(model)

    @with_keywords((READING, ReadingOptions))
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
        """Finds the physical effects that the model lacks.

        Parameters
        ----------
        data
            Recordings in which effects are searched.
        check : optional
            Validation runs: an effect is accepted only if it lowers the error there. Without any, ``data`` is split into blocks
            (cross-validation).
        held : bool
            Fix all parameters at their nominal values, so that wrong nominal values are detected too.
        parameters : optional
            Values to use instead of the nominal ones; they are fixed.
        progress, **reading
            As for :meth:`compare`.
        """
        model = self if parameters is None else self.with_fit(parameters)
        read, checked = model._recordings(data, check, reading, progress)
        found = _answered(progress, lambda hears: model._core.diagnose(read, checked, held, hears))
        return Diagnosis(found, None if found.model is None else Model(found.model))

    def report(self, data: Source, **options: Any) -> Page:
        """Returns the diagnosis as one page, inline in a notebook; arguments as for :meth:`diagnose`."""
        return self.diagnose(data, **options).report()

    @with_keywords((READING, ReadingOptions))
    def runs(
        self,
        data: Sequence[Source],
        *,
        per_run: Sequence[str] = (),
        loads: Sequence[str] = (),
        progress: Progress = None,
        **reading: Unpack[ReadingOptions],
    ) -> Runs:
        """Finds what changed between recordings of one machine.

        Parameters
        ----------
        data : list
            Two recordings or more; the first is the reference. Recordings that cannot be read are named and left out; only the
            first must be readable.
        per_run : list of str
            Quantities with a separate value for each run, in one fit of all runs: ``"payload@flange"``, ``"friction"``, or the
            name of a base parameter.
        loads : list of str
            Runs with a known load: ``"loaded.csv=2.8@flange"``.
        progress, **reading
            As for :meth:`compare`.
        """
        if isinstance(data, (str, os.PathLike)) or not isinstance(data, Sequence):
            raise ModelmillError("runs() compares several recordings with the first: pass a list of recordings")
        requests = [self._request(source, reading, f"run {k + 1}") for k, source in enumerate(data)]
        found, _ = self._prepared(requests, [], progress)
        read: list[_core.Recording] = []
        unread: list[tuple[int, str, str]] = []
        for k, (request, one) in enumerate(zip(requests, found)):
            if isinstance(one, Recording):
                read.append(one._core)
            elif k == 0:
                raise one
            else:
                unread.append((k, request.name, str(one)))
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
        columns: Mapping[str, str] | PathText | None = None,
        progress: Progress = None,
    ) -> Excitation:
        """Plans the periodic motion that determines base parameters best, or distinguishes effects best.

        Parameters
        ----------
        limits : dict or list of str
            Limits that add to those of the model file or replace them: ``{"q1": (-1, 1), "q1_d": 2, "motor": 1500}``.
        harmonics : int
            Number of harmonics of the Fourier series of each coordinate.
        period : float
            Period of the motion, s.
        criterion : {"condition", "log_det"}
            What is minimised: the condition number, or the volume of the uncertainty.
        random, starts, seed : int
            Number of random trajectories tried first, number of them from which the search starts, and the seed.
        rate : float
            Samples per second, Hz.
        separate, apart_from, beside, noise
            ``separate`` is the effect to be distinguished, such as ``"coulomb_friction@motor:Fc=25.9"``; ``apart_from`` the
            effects it could be confused with; ``beside`` effects present in both cases; ``noise`` the standard deviation of the
            force noise, N or N m.
        data, columns : optional
            Recordings to compare with, and the names of their columns.
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
        read, _ = model._recordings(data, None, {"columns": columns} if columns else {}, progress)
        return Excitation(_answered(progress, lambda hears: model._core.excite(options, read, hears)), self.coordinates)

    # Other models of the same mechanism.

    def with_effect(
        self,
        kind: str,
        at: str | Sequence[str] | None = None,
        *,
        at_each: str | Sequence[str] | None = None,
        without: str | Sequence[str] = (),
        **settings: float | str,
    ) -> Model:
        """Returns the model with an effect added to its file.

        Parameters
        ----------
        kind : str
            For example ``"coulomb_friction"``; :func:`kinds` lists all kinds.
        at : str or list of str
            Where it acts: a drive, a coordinate, a point, ``"base"``. Several places share the parameters.
        at_each : str or list of str, optional
            Places with parameters of their own, instead of ``at``; ``"drives"`` stands for all drives.
        without : str or list of str
            Parameters of the kind that the effect does not have, such as ``"Fv"`` of a coil spring.
        **settings
            Symbols of the kind, each with a value (SI), or with the name for its parameter.
        """
        values = [(name, float(one)) for name, one in settings.items() if not isinstance(one, str)]
        names = [(name, one) for name, one in settings.items() if isinstance(one, str)]
        if (at is None) == (at_each is None):
            raise ModelmillError("with_effect() needs the places of the effect: give either at or at_each")
        given = at if at is not None else at_each
        places = [given] if isinstance(given, str) else list(given or ())
        lacking = [without] if isinstance(without, str) else list(without)
        return Model(self._core.with_effect(kind, places, at is None, lacking, values, names))

    def with_fit(self, parameters: Values) -> Model:
        """Returns the model with other values of its base parameters, and of gains if they are a fit of signals."""
        return Model(self._with_gains(parameters)._core.with_values(self._values(parameters)[0]))

    def adopt(self, fit: Identification | PathText) -> Model:
        """Returns the model with a fit in its file, instead of nominal values; ``save`` writes the file.

        Parameters
        ----------
        fit
            The result of :meth:`identify`, or the path of its file. A fit with ``physical=True`` is stored as values of physical
            parameters; any other fit as values of base parameters, which do not determine single bodies.
        """
        model, notes = self._core.adopt(*_fit(fit))
        _warn(notes)
        return Model(model)

    # Further methods.

    def interpret(self, fit: Identification | PathText, unknown: Sequence[str]) -> Interpretation:
        """Solves identified base parameters for physical ones, with the others fixed at nominal values: all real solutions.

        Parameters
        ----------
        fit
            The result of :meth:`identify`, or the path of its file.
        unknown : list of str
            Names of the parameters to solve for.
        """
        if isinstance(unknown, str):
            raise ModelmillError(f"unknown={unknown!r}: pass a list of names, as in unknown=[{unknown!r}]")
        found = self._core.interpret(*_fit(fit), list(unknown))
        _warn(found.notes)
        return Interpretation(found)

    @with_keywords((READING, ReadingOptions))
    def diff(
        self, variant: Model, data: Source = None, *, progress: Progress = None, **reading: Unpack[ReadingOptions]
    ) -> Difference:
        """Shows what a variant changes; along recordings also forces, power and work of each drive, limits, and errors.

        Parameters
        ----------
        variant : Model
            The model to compare with.
        data : optional
            A recording, or a list of them; motion without forces is sufficient. Give paths or tables, because both models read
            them.
        progress, **reading
            As for :meth:`compare`.
        """
        read, again = (model._recordings(data, None, reading, progress)[0] for model in (self, variant))
        return Difference(_answered(progress, lambda hears: self._core.diff(variant._core, read, again, hears)))

    def export(self, format: str = "urdf", *, parameters: Identification | PathText | None = None) -> str:
        """Returns the model as a robot description; a warning lists what the format cannot express.

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
    """Returns the text of a fit and its name in messages, or no text and the path of its file."""
    if isinstance(fit, Identification):
        return json.dumps(fit.to_dict()), "fit"
    if isinstance(fit, (str, os.PathLike)):
        return None, os.fspath(fit)
    raise ModelmillError(f"a {type(fit).__name__} is no fit; give the result of identify(), or the path of its file")


class Picture:
    """A picture (SVG); a notebook shows it.

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


def _restored_model(path: str, text: str, libraries: Sequence[str], at_values: bool, values: Floats) -> Model:
    """Derives a model from the contents of another one."""
    core = _core.load_text(path, text, libraries, at_values, None)
    if not np.array_equal(core.nominal, values, equal_nan=True):
        core = core.with_values(values)
    return Model(core)


def load(
    source: PathText,
    *,
    name: str | None = None,
    libraries: Sequence[PathText] = (),
    at_values: bool = False,
    floating: bool = False,
    round_angles: bool = False,
    known_bodies: bool = False,
    closures: PathText | None = None,
    pose: Mapping[str, float] | None = None,
    locked: Mapping[str, float] | None = None,
    joints: Sequence[str] | None = None,
    progress: Progress = None,
) -> Model:
    """Reads a model file (TOML) or a robot description (URDF, MJCF, SDF) and derives it.

    Parameters
    ----------
    source : path or str
        Path of the file, or its text if it has several lines.
    name : str, optional
        Name of a text in messages.
    libraries : list of paths
        Libraries with additional kinds of effects.
    at_values : bool
        Derive only for the values of the file: fewer base parameters if the geometry is special.
    floating, round_angles, known_bodies, closures, pose, locked, joints
        Only for robot descriptions: whether the base of a URDF is free; whether angles near right ones are rounded; whether
        masses and inertias are known numbers and not parameters; a file of
        loop closures; joint values that choose the assembly mode; joints that are fixed at a value; the only joints that move.

    Returns
    -------
    Model

    Raises
    ------
    ModelmillError
        With all faults of the file, each with its place.
    """
    text = os.fspath(source)
    is_text = "\n" in text or text.lstrip().startswith("<")
    if not is_text and not os.path.isfile(text):
        raise ModelmillError(
            f"there is no file {text}; give the path of a model file (TOML) or of a robot description (URDF, MJCF, SDF), "
            "or the text of one"
        )
    is_robot = text.lstrip().startswith("<") if is_text else Path(text).suffix.lower() in (".urdf", ".xml", ".mjcf", ".sdf")
    with told(progress) as hears:
        if is_robot:
            stem = name or ("robot" if is_text else text)
            described, notes = _core.import_text(
                stem,
                text if is_text else None,
                floating,
                round_angles,
                known_bodies,
                closures,
                list((pose or {}).items()),
                list((locked or {}).items()),
                None if joints is None else list(joints),
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
    """Returns the content of a log, table by table or topic by topic."""
    return Result(_core.contents(path))


def kinds(libraries: Sequence[PathText] = ()) -> list[dict[str, Any]]:
    """Returns the kinds of effects, as ``modelmill effects --json`` prints them."""
    told: list[dict[str, Any]] = json.loads(_core.kinds(libraries))["kinds"]
    return told
