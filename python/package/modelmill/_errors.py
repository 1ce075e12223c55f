"""Errors about the input, and warnings."""

from __future__ import annotations

import json
from typing import Any


class ModelmillError(ValueError):
    """The input has a fault; the text states where it is, what was expected, and what to do.

    Attributes
    ----------
    diagnostics : list of dict
        Each with ``severity`` and ``says`` (the text). Faults of a model file also have ``file``, ``line``, ``column``,
        ``expected`` and ``help``.
    """

    diagnostics: list[dict[str, Any]]

    def __init__(self, says: str, diagnostics: str | list[dict[str, Any]] | None = None) -> None:
        super().__init__(says)
        told: list[dict[str, Any]] | None = json.loads(diagnostics) if isinstance(diagnostics, str) else diagnostics
        self.diagnostics = told or [{"severity": "error", "says": says}]


class ModelmillWarning(UserWarning):
    """A property of a model or a recording that is possible but probably not intended."""
