"""Progress of a long call: one line on standard error, at a terminal or in a notebook."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Told = Callable[[str, int, int], object]

# Seconds. A call that ends sooner prints nothing, so that short calls do not flicker.
_PATIENCE = 1.0


class _Line:
    """Overwrites one line of standard error with the latest progress."""

    def __init__(self, at_once: bool) -> None:
        self._begun = time.monotonic() - (_PATIENCE if at_once else 0.0)
        self._written = 0

    def __call__(self, what: str, done: int, total: int) -> None:
        if time.monotonic() - self._begun < _PATIENCE:
            return
        text = f"{what}: {min(100, 100 * done // total)} %" if total else f"{what} ..."
        text = text[:100]
        sys.stderr.write("\r" + text.ljust(self._written))
        sys.stderr.flush()
        self._written = len(text)

    def end(self) -> None:
        if self._written:
            sys.stderr.write("\r" + " " * self._written + "\r")
            sys.stderr.flush()


def _somebody_reads() -> bool:
    """Whether standard error is a terminal or belongs to a notebook."""
    if "IPython" in sys.modules:
        shell = sys.modules["IPython"].get_ipython()
        if shell is not None and type(shell).__name__ == "ZMQInteractiveShell":
            return True
    try:
        return sys.stderr.isatty()
    except (AttributeError, ValueError):
        return False


@contextmanager
def told(progress: Told | bool | None) -> Iterator[Told | None]:
    """Returns the callback that belongs to the option ``progress``.

    Parameters
    ----------
    progress : callable, bool or None
        Called as ``progress(what, done, total)``: name of the job, steps done, steps in total (0 if unknown). True prints
        progress, False prints nothing, None prints it at a terminal or in a notebook.
    """
    if callable(progress):
        yield progress
        return
    if progress is False or (progress is None and not _somebody_reads()):
        yield None
        return
    line = _Line(at_once=progress is True)
    try:
        yield line
    finally:
        line.end()
