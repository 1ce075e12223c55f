"""Real keywords in the signature of methods that take declared options."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

MethodT = TypeVar("MethodT", bound=Callable[..., Any])


def with_keywords(*groups: tuple[Mapping[str, Any], type]) -> Callable[[MethodT], MethodT]:
    """Returns a decorator that shows each option with its default in ``help()`` and in completions, instead of ``**options``.

    A group is the defaults of options, and their class with annotations and explanations.
    """

    def decorated(method: MethodT) -> MethodT:
        own = inspect.signature(method)
        parameters = [one for one in own.parameters.values() if one.kind is not inspect.Parameter.VAR_KEYWORD]
        about = inspect.getdoc(method) or ""
        for defaults, options in groups:
            annotations = options.__annotations__
            parameters += [
                inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=_text(annotations[name]))
                for name, default in defaults.items()
                if name not in own.parameters
            ]
            # The explanation of each option follows those of the method.
            title = f"{options.__name__.removesuffix('Options')} options"
            explained = (inspect.getdoc(options) or "").partition("----------\n")[2]
            about += f"\n\n{title}\n{'-' * len(title)}\n{explained}"
        method.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        method.__doc__ = about
        return method

    return decorated


def _text(annotation: Any) -> str:
    """Returns the text of an annotation, which may be a reference to a name that is resolved later."""
    return str(getattr(annotation, "__forward_arg__", annotation))
