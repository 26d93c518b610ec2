"""URL rules whose code is compiled once per process instead of once per application.

Werkzeug compiles two functions for each rule, which build its URL; the edge server has more than
three hundred rules, and most of its tests make an application of their own. The functions depend
on the parts and defaults of the rule alone.
"""

from collections.abc import Callable
from typing import Any, Final

from werkzeug.routing import Rule

_COMPILED: Final[dict[tuple[object, ...], Callable[..., tuple[str, str]]]] = {}
_compile: Final[Callable[..., Any]] = Rule._compile_builder


def compile_once() -> None:
    """Have every later rule take functions that were compiled for an equal one."""

    def compiled(rule: Rule, append_unknown: bool = True) -> Callable[..., tuple[str, str]]:
        key = append_unknown, tuple(rule._trace), repr(rule.defaults), repr(rule._converters.keys())
        if key not in _COMPILED:
            _COMPILED[key] = _compile(rule, append_unknown)
        return _COMPILED[key]

    Rule._compile_builder = compiled  # type: ignore[assignment, method-assign]
