"""Faults of what was given, and remarks."""

from __future__ import annotations

import json
from typing import Any


class ModelmillError(ValueError):
    """What was given has no answer; the text says where the fault is, what was expected, and what to do.

    Attributes
    ----------
    diagnostics : list of dict
        Each with ``severity`` and ``says``; faults of a model file also with ``file``, ``line``, ``column``, ``expected`` and
        ``help``.
    """

    diagnostics: list[dict[str, Any]]

    def __init__(self, says: str, diagnostics: str | list[dict[str, Any]] | None = None) -> None:
        super().__init__(says)
        told: list[dict[str, Any]] | None = json.loads(diagnostics) if isinstance(diagnostics, str) else diagnostics
        self.diagnostics = told or [{"severity": "error", "says": says}]


class ModelmillWarning(UserWarning):
    """Something about a model or a recording that may not be intended."""
