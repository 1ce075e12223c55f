"""Base parameters, equations and fast code from a model file of a mechanism; parameter values and missing physical effects
from recordings.

>>> import modelmill
>>> m = modelmill.load("arm.toml")            # doctest: +SKIP
>>> m.p_min                                   # doctest: +SKIP
>>> m.identify("run.csv")                     # doctest: +SKIP
>>> m.diagnose("run.csv", check="other.csv")  # doctest: +SKIP

Units are SI (m, rad, kg, s, N, N m). Arrays of states have shape ``(dof,)`` for one state or ``(n, dof)`` for many.
"""

from . import fleet
from ._errors import ModelmillError, ModelmillWarning
from ._model import BaseParameter, BaseParameters, Equations, Model, Recording, kinds, load, recordings
from ._results import (
    Check,
    Comparison,
    Diagnosis,
    Difference,
    Effect,
    Excitation,
    Figures,
    Identification,
    Interpretation,
    Page,
    Parameter,
    Result,
    Runs,
    ServoFit,
    Simulation,
)
from ._rigs import Reduction, reduce, simulate

__version__ = "0.1.0"

__all__ = [
    "BaseParameter",
    "BaseParameters",
    "Check",
    "Comparison",
    "Diagnosis",
    "Difference",
    "Effect",
    "Equations",
    "Excitation",
    "Figures",
    "Identification",
    "Interpretation",
    "Model",
    "ModelmillError",
    "ModelmillWarning",
    "Page",
    "Parameter",
    "Recording",
    "Reduction",
    "Result",
    "Runs",
    "ServoFit",
    "Simulation",
    "fleet",
    "kinds",
    "load",
    "recordings",
    "reduce",
    "simulate",
]
