"""Real keywords in the signature of methods that take options for reading recordings."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

MethodT = TypeVar("MethodT", bound=Callable[..., Any])


def with_reading_keywords(defaults: Mapping[str, Any], options: type) -> Callable[[MethodT], MethodT]:
    """Returns a decorator that shows each option with its default in ``help()`` and in completions, instead of ``**reading``."""

    def decorated(method: MethodT) -> MethodT:
        own = inspect.signature(method)
        annotations = options.__annotations__
        parameters = [one for one in own.parameters.values() if one.kind is not inspect.Parameter.VAR_KEYWORD]
        parameters += [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=_text(annotations[name]))
            for name, default in defaults.items()
            if name not in own.parameters
        ]
        signature = own.replace(parameters=parameters)
        method.__signature__ = signature  # type: ignore[attr-defined]
        # The explanation of each option follows those of the method.
        about = inspect.getdoc(method) or ""
        explained = (inspect.getdoc(options) or "").partition("----------\n")[2]
        method.__doc__ = f"{about}\n\nReading options\n---------------\n{explained}"
        return method

    return decorated


def _text(annotation: Any) -> str:
    """Returns the text of an annotation, which may be a reference to a name that is resolved later."""
    return str(getattr(annotation, "__forward_arg__", annotation))
