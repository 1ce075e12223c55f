"""Results of the methods of a model: objects with attributes; ``to_dict()`` is the JSON of the program."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Union

import numpy as np
from numpy.typing import NDArray

from ._errors import ModelmillError

if TYPE_CHECKING:
    import pandas as pd

    from . import _core
    from ._model import Model

    #: Result of the compiled part: JSON, text and notes.
    Answer = Union[_core.Result, _core.Excitation, _core.Simulation]

Remarks = list[tuple[str, str]]
AnswerT = TypeVar("AnswerT", bound="Answer")


def frame(rows: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """Returns rows as a pandas table."""
    try:
        import pandas as pd
    except ImportError:
        raise ModelmillError("to_pandas() needs pandas: pip install pandas") from None
    return pd.DataFrame(list(rows))


def number(value: float | None) -> str:
    """Formats a number with six digits; empty for None."""
    return "" if value is None else f"{value:.6g}"


def table_html(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Returns a table as HTML."""
    head = "".join(f'<th style="text-align:left">{html.escape(text)}</th>' for text in heads)
    body = "".join(
        "<tr>" + "".join(f'<td style="text-align:left">{html.escape(text)}</td>' for text in row) + "</tr>" for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def text_html(text: str) -> str:
    """Returns a text as HTML."""
    return f'<pre style="line-height:1.35">{html.escape(text)}</pre>'


class Result:
    """A result of a method.

    Attributes
    ----------
    notes : list of (str, str)
        Severity (``"info"`` or ``"warning"``) and text.
    """

    def __init__(self, found: Answer) -> None:
        self._object: dict[str, Any] = json.loads(found.json)
        self._text = found.text
        self.notes = found.notes

    def to_dict(self) -> dict[str, Any]:
        """Returns what ``modelmill ... --json`` prints."""
        copy: dict[str, Any] = json.loads(json.dumps(self._object))
        return copy

    def save(self, path: str | Path) -> None:
        """Writes :meth:`to_dict` to a file (JSON)."""
        Path(path).write_text(json.dumps(self._object, indent=2) + "\n", encoding="utf-8")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Result):
            return NotImplemented
        return type(self) is type(other) and self._object == other._object

    def __hash__(self) -> int:
        return hash((type(self), self._text))

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return self._text

    def _repr_html_(self) -> str:
        return text_html(self._text)


class Check(Result):
    """The parts of a model, and its numeric rank next to the exact one."""

    @property
    def summary(self) -> dict[str, Any]:
        """Bodies, joints, loops, drives and parameters, as in :meth:`to_dict`."""
        return self.to_dict()


@dataclass(frozen=True)
class Figures:
    """Error figures.

    Attributes
    ----------
    nrms : float or None
        ``||measured - model|| / ||measured||`` over all drives; None if their units differ.
    channels : dict of str to dict
        ``nrms``, ``mean_relative``, ``max_abs`` and more of each drive.
    """

    nrms: float | None
    channels: dict[str, dict[str, Any]]

    @classmethod
    def of(cls, told: dict[str, Any] | None) -> Figures | None:
        """Reads the figures from an object of the program's JSON."""
        return None if told is None else cls(told.get("nrms"), told.get("channels", {}))


class Page:
    """A self-contained HTML page; a notebook shows it inline.

    Attributes
    ----------
    html : str
        The complete document.
    """

    def __init__(self, page: str) -> None:
        self.html = page

    def save(self, path: str | Path) -> None:
        """Writes the page to a file."""
        Path(path).write_text(self.html, encoding="utf-8")

    def __repr__(self) -> str:
        return f"<page of {len(self.html)} characters; save(path) writes it, a notebook shows it>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.html, quote=True)}" sandbox="allow-scripts" '
            'style="width:100%;height:46em;border:1px solid #ccc"></iframe>'
        )


class Comparison(Result):
    """The error of a model along recordings, and where it occurs."""

    def __init__(self, found: _core.Result, forward: _core.Result | None = None) -> None:
        super().__init__(found)
        if forward is not None:
            self._object["forward"] = json.loads(forward.json)
            self._text += "\n" + forward.text

    @property
    def forward(self) -> dict[str, Any] | None:
        """Position errors of the model when it is simulated forward in time; None unless ``forward=True`` was given."""
        errors: dict[str, Any] | None = self._object.get("forward")
        return errors

    @property
    def nrms(self) -> float | None:
        """``||measured - model|| / ||measured||`` over all drives; None if their units differ."""
        value: float | None = self._object["nrms"]
        return value

    @property
    def channels(self) -> dict[str, dict[str, Any]]:
        """Error figures of each drive."""
        channels: dict[str, dict[str, Any]] = self._object["channels"]
        return channels

    @property
    def where(self) -> list[dict[str, Any]]:
        """Regions that contain more of the squared error than their share of the samples."""
        regions: list[dict[str, Any]] = self._object["where"]
        return regions

    @property
    def by_rate(self) -> list[dict[str, Any]]:
        """How the residual of each drive depends on its rate, as friction does; empty if it does not."""
        dependences: list[dict[str, Any]] = self._object["by_rate"]
        return dependences

    def to_pandas(self) -> pd.DataFrame:
        """A row for each drive."""
        return frame({"drive": name, **figures} for name, figures in self.channels.items())


@dataclass(frozen=True)
class Parameter:
    """An identified base parameter; ``std`` is None if the value was fixed."""

    name: str
    expression: str
    value: float
    std: float | None
    unit: str
    nominal: float | None


class ServoFit:
    """What a fit of commands, currents or voltages has besides base parameters.

    Attributes
    ----------
    parameters : list of dict
        Values of the equations with the forces of the actuators, which contain gains: ``expression``, ``value``, ``std``,
        ``unit``, ``status``, and ``relative_to`` for a value that is only known as a ratio.
    gains : list of dict
        Gains of the actuators: ``name``, ``value``, ``std``, ``unit``. Empty if only ratios are known.
    delays : list of dict
        Delays in s: ``drive``, ``value``, ``std``, ``interval`` (95 %), ``known`` for one of the model file, and
        ``determined``, which is False if several delays satisfy the equations.
    estimator : dict
        ``kind`` is ``"instruments"`` or ``"least_squares"``.
    only_ratios : list of dict
        Groups of parameters of which only ratios are known, with what fixes their scale (``fixed_by``).
    """

    def __init__(self, found: dict[str, Any]) -> None:
        self.parameters: list[dict[str, Any]] = found["parameters"]
        self.gains: list[dict[str, Any]] = (found.get("model_fit") or {}).get("gains", [])
        self.delays: list[dict[str, Any]] = found["delays"]
        self.estimator: dict[str, Any] = found["estimator"]
        self.only_ratios: list[dict[str, Any]] = found["only_ratios"]

    def __repr__(self) -> str:
        return f"<{len(self.gains)} gains, {len(self.delays)} delays by {self.estimator['kind']}>"


class Identification(Result):
    """Base parameters from recordings, with standard deviations and error figures.

    Attributes
    ----------
    values : numpy.ndarray, shape (n_base,)
        Values of the base parameters in the order of ``Model.p_min``, in their units.
    """

    def __init__(self, found: _core.Result, model: Model) -> None:
        super().__init__(found)
        self.values: NDArray[np.float64] = found.values
        self._model = model

    @property
    def _base(self) -> dict[str, Any]:
        """The part of the JSON that has the base parameters of the model."""
        if self.signals is None:
            return self._object
        return self._object.get("model_fit") or {"parameters": []}

    @property
    def model(self) -> Model:
        """The model with the identified values instead of those of its file."""
        return self._model.with_fit(self)

    @property
    def parameters(self) -> list[Parameter]:
        """The base parameters."""
        return [
            Parameter(one["name"], one["expression"], one["value"], one.get("std"), one["unit"], one.get("nominal"))
            for one in self._base["parameters"]
        ]

    @property
    def samples(self) -> int:
        """Number of samples that the fit used."""
        return int(self._object["samples"])

    @property
    def condition_number(self) -> float:
        """Condition number of the regressor; after scaling its columns to equal norm for a fit of signals."""
        if self.signals is not None:
            return float(self._object["scaled_condition_number"] or np.inf)
        return float(self._object["condition_number"])

    @property
    def fit(self) -> Figures:
        """Error figures on the recordings of the fit."""
        figures = Figures.of(self._object["fit"])
        assert figures is not None
        return figures

    @property
    def check(self) -> Figures | None:
        """Error figures on the validation runs, which the fit did not use."""
        return Figures.of(self._object.get("check"))

    @property
    def signals(self) -> ServoFit | None:
        """The fit of a log without forces: gains, delays and the estimator; None for a fit of measured forces."""
        return ServoFit(self._object) if self._object.get("source") == "signals" else None

    def to_pandas(self) -> pd.DataFrame:
        """A row for each base parameter."""
        return frame(vars(one) for one in self.parameters)

    def _repr_html_(self) -> str:
        rows = [
            (one.name, one.expression, number(one.value), number(one.std), one.unit, number(one.nominal))
            for one in self.parameters
        ]
        heads = ("", "expression", "value", "std", "unit", "nominal")
        return table_html(heads, rows) + text_html(self._text)


@dataclass(frozen=True)
class Effect:
    """A physical effect.

    Attributes
    ----------
    kind : str
        For example ``"coulomb_friction"``.
    at : list of str
        Places where it acts.
    estimates : list of dict
        ``name``, ``value``, ``std``, ``unit``.
    probability : float or None
        Probability that the effect exists.
    indistinguishable_from : list of dict
        Effects that explain the data equally well: ``kind`` and ``at``.
    shared_with : list of str
        Other places whose value the model uses here too; the estimates are the difference from that value. Empty if the
        model has no such effect here.
    """

    kind: str
    at: list[str]
    estimates: list[dict[str, Any]]
    probability: float | None
    indistinguishable_from: list[dict[str, Any]]
    shared_with: list[str]


def _effect(found: dict[str, Any]) -> Effect:
    """An effect from its entry in the JSON."""
    others = found.get("indistinguishable_from", [])
    sharing = found.get("shared_with", [])
    return Effect(found["kind"], found["at"], found["estimates"], found.get("probability"), others, sharing)


class Diagnosis(Result):
    """The physical effects that a model lacks, with the evidence."""

    def __init__(self, found: _core.Result, better: Model | None) -> None:
        super().__init__(found)
        self._page = found.page or ""
        self._better = better

    @property
    def verdict(self) -> str:
        """``"adequate"``, ``"missing_effect"`` or ``"unexplained"``."""
        return str(self._object["verdict"])

    @property
    def noise_floor(self) -> float | None:
        """Noise, as a fraction of the measured forces."""
        value: float | None = self._object["noise_floor"]
        return value

    @property
    def steps(self) -> list[dict[str, Any]]:
        """The effects that were added, step by step, and the error after each step."""
        steps: list[dict[str, Any]] = self._object["steps"]
        return steps

    @property
    def effects(self) -> list[Effect]:
        """The effects that the model lacks."""
        return [
            _effect(one)
            for one in self._object["effects"]
        ]

    @property
    def possible(self) -> list[Effect]:
        """Effects with a probability below 0.5, which do not count as missing."""
        return [
            _effect(one)
            for one in self._object.get("possible", [])
        ]

    @property
    def candidates(self) -> list[dict[str, Any]]:
        """All effects that were tried, and why each was rejected."""
        candidates: list[dict[str, Any]] = self._object["candidates"]
        return candidates

    @property
    def disturbances(self) -> list[dict[str, Any]]:
        """Disturbances in the recordings, such as outliers; they are not model errors."""
        disturbances: list[dict[str, Any]] = self._object["disturbances"]
        return disturbances

    @property
    def corrected(self) -> list[dict[str, Any]]:
        """Faults for which a trial correction was made, and what to do; all findings hold for the corrected recordings."""
        corrected: list[dict[str, Any]] = self._object.get("corrected", [])
        return corrected

    @property
    def unresolved(self) -> list[dict[str, Any]]:
        """Faults of the recordings that could not be corrected, and what to do; nothing else is stated then."""
        unresolved: list[dict[str, Any]] = self._object.get("unresolved", [])
        return unresolved

    @property
    def budget(self) -> dict[str, dict[str, Any]]:
        """The error of each drive, divided into noise, a part that varies with time and not with the state, and a repeatable part that nothing explains."""
        budget: dict[str, dict[str, Any]] = self._object["budget"]
        return budget

    @property
    def model(self) -> Model | None:
        """The model with the missing effects added, as ``diagnose --out`` writes it; None if nothing is missing. ``save`` writes its file."""
        return self._better

    def report(self) -> Page:
        """Returns the complete diagnosis as one page with figures."""
        return Page(self._page)

    def to_pandas(self) -> pd.DataFrame:
        """A row for each candidate."""
        return frame(self.candidates)


class Interpretation(Result):
    """All real solutions for physical parameters that explain the base parameters of a fit."""

    @property
    def solutions(self) -> list[dict[str, dict[str, Any]]]:
        """For each unknown: ``value``, ``std``, ``unit``, ``nominal``, and whether it is physically possible (``plausible``)."""
        solutions: list[dict[str, dict[str, Any]]] = self._object["solutions"]
        return solutions

    @property
    def identifiable(self) -> bool:
        """Whether the fit determines all unknowns; :attr:`undetermined` lists the others."""
        return bool(self._object["identifiable"])

    @property
    def undetermined(self) -> Any:
        """The unknowns that are not determined, as text."""
        return self._object["undetermined"]

    def to_pandas(self) -> pd.DataFrame:
        """A row for each solution and unknown."""
        return frame(
            {"solution": k + 1, "name": name, **one} for k, all in enumerate(self.solutions) for name, one in all.items()
        )


class Difference(Result):
    """What a variant of a model changes, and its cost in force and power along recordings."""

    @property
    def base(self) -> list[dict[str, Any]]:
        """Base parameters that changed: ``name``, ``before``, ``after``."""
        changed: list[dict[str, Any]] = self._object["base"]
        return changed

    @property
    def values(self) -> list[dict[str, Any]]:
        """Nominal values of base parameters that changed: ``name``, ``unit``, ``before``, ``after``."""
        changed: list[dict[str, Any]] = self._object["values"]
        return changed

    @property
    def along(self) -> dict[str, Any] | None:
        """Cost along recordings: drives before and after, limits, errors; None without recordings."""
        along: dict[str, Any] | None = self._object.get("along")
        return along


class Runs(Result):
    """What changed between recordings of one machine."""

    def __init__(self, found: _core.Result) -> None:
        super().__init__(found)
        self._page = found.page or ""

    @property
    def changes(self) -> list[dict[str, Any]]:
        """Physical changes: ``kind``, ``at``, ``estimates``, ``between``, ``says`` (the text)."""
        changes: list[dict[str, Any]] = self._object["changes"]
        return changes

    @property
    def moved(self) -> list[dict[str, Any]]:
        """Base parameters that changed: ``parameter``, and ``sigmas``, the change in standard deviations."""
        moved: list[dict[str, Any]] = self._object["moved"]
        return moved

    @property
    def change_points(self) -> list[dict[str, Any]]:
        """Runs at which base parameters changed permanently."""
        points: list[dict[str, Any]] = self._object["change_points"]
        return points

    @property
    def unread(self) -> list[dict[str, Any]]:
        """Recordings that could not be read, with the reason."""
        unread: list[dict[str, Any]] = self._object["unread"]
        return unread

    def report(self) -> Page:
        """Returns one page that shows the base parameters over the runs."""
        return Page(self._page)

    def to_pandas(self) -> pd.DataFrame:
        """A row for each run and base parameter."""
        return frame({"file": run["file"], **one} for run in self._object["runs"] for one in run["parameters"])


class Excitation(Result):
    """A periodic motion planned to determine base parameters, or to distinguish effects.

    Attributes
    ----------
    t : numpy.ndarray, shape (n,)
        Times of one period, s.
    q, qd, qdd : numpy.ndarray, shape (n, dof)
        Positions, rates and accelerations of the coordinates, SI units.
    picture : str
        The trajectory as SVG.
    """

    def __init__(self, found: _core.Excitation, coordinates: list[str]) -> None:
        super().__init__(found)
        self.t, *motion = found.motion()
        self.q, self.qd, self.qdd = (np.stack(part, axis=1) for part in motion)
        self.picture = found.picture
        self._csv = found.csv
        self._coordinates = coordinates

    @property
    def condition_number(self) -> float:
        """Condition number of the regressor along the motion."""
        return float(self._object["condition_number"])

    def to_pandas(self) -> pd.DataFrame:
        """Columns ``t``, then each coordinate, with ``_d`` its rate and with ``_dd`` its acceleration."""
        whole = frame([{"t": float(t)} for t in self.t])
        for part, ending in ((self.q, ""), (self.qd, "_d"), (self.qdd, "_dd")):
            for k, name in enumerate(self._coordinates):
                whole[name + ending] = part[:, k]
        return whole

    def to_csv(self, path: str | Path) -> None:
        """Writes one period as CSV, as the program does: ``t``, coordinates, rates, accelerations."""
        Path(path).write_text(self._csv, encoding="utf-8")

    def _repr_html_(self) -> str:
        return self.picture + text_html(self._text)


class Simulation(Result):
    """A simulated recording; pass ``columns`` as a recording to the methods of a model.

    Attributes
    ----------
    columns : dict of str to numpy.ndarray, each of shape (n,)
        ``t`` (s), the coordinates (rad or m), and the forces of the drives (N or N m); for a model also the rates of the
        coordinates (with ``_d``).
    """

    def __init__(self, made: _core.Simulation) -> None:
        super().__init__(made)
        self.columns: dict[str, NDArray[np.float64]] = dict(made.columns())
        self._csv = made.csv

    def to_pandas(self) -> pd.DataFrame:
        """The columns as a table."""
        whole = frame([{"t": float(t)} for t in self.columns["t"]])
        for name, values in self.columns.items():
            whole[name] = values
        return whole

    def to_csv(self, path: str | Path) -> None:
        """Writes the recording as the program does."""
        Path(path).write_text(self._csv, encoding="utf-8")
