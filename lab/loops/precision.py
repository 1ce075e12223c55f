"""The two kinds of numbers of `mechanics`: doubles, and numbers of sixty digits (mpmath) in numpy arrays of objects."""

import math
import re
from typing import Any, NamedTuple

import mpmath
import numpy as np

mpmath.mp.dps = 60

NUMBER = re.compile(r"(?<![\w.])(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


class Precision(NamedTuple):
    """A kind of numbers, and where iterations end in it."""

    read: Any
    pi: Any
    # Largest last step of Newton's method, and largest error of a closed loop.
    step: float
    residual: float
    # Number of corrections of a solution by the pseudo-inverse in double precision.
    n_corrections: int

    def array(self, x):
        return as_doubles(x) if self.read is float else np.asarray(np.frompyfunc(self.read, 1, 1)(x), dtype=object)

    def expression(self, text):
        """An expression of a model file for `eval`. The function `number` reads its decimals."""
        return NUMBER.sub(r"number('\g<0>')", text).replace("^", "**")


DOUBLE = Precision(float, math.pi, 3e-14, 1e-12, 0)
SIXTY_DIGITS = Precision(mpmath.mpf, +mpmath.mp.pi, 1e-52, 1e-50, 6)


def as_numbers(x):
    """An array of doubles, or of objects as it is."""
    x = np.asarray(x)
    return x if x.dtype == object else x.astype(float)


def as_doubles(x):
    return np.asarray(x, dtype=float)


def elementwise(name):
    """A function of arrays of either kind."""
    many = np.frompyfunc(getattr(mpmath, name), 1, 1)
    return lambda x: many(x) if np.asarray(x).dtype == object else getattr(np, name)(x)
