"""Paths: each with and without a slash at the end, never a redirect.

A rule is written without the slash, and matches with one too. The other way round a method that
a path without the slash does not have would be answered with 404 instead of 405.
"""

from collections.abc import Callable, Sequence
from typing import Any, Final

from flask import Blueprint, Flask, url_for
from flask.typing import ResponseReturnValue
from werkzeug.routing import BaseConverter, Rule

_LAST: Final = 2**63 - 1


class Int64Converter(BaseConverter):
    """Converter of ids, which the database holds in 63 bits: one spelling for each."""

    regex = "(?:0|[1-9][0-9]{0,18})"

    def to_python(self, value: str) -> int:
        """Read an id; one beyond 63 bits becomes the largest one, which no resource has.

        A refusal here would answer 405 for other methods than this rule's, instead of 404.
        """
        return min(int(value), _LAST)


def install(app: Flask) -> None:
    """Configure the URL map of an app; call it before routes are added."""
    app.url_map.converters["int64"] = Int64Converter
    app.url_map.strict_slashes = False
    app.url_map.merge_slashes = False


def canonical(rule: Rule) -> str:
    """Give the spelling of a rule's path that documents and metrics use: with the slash."""
    return rule.rule.rstrip("/") + "/"


def path_of(endpoint: str, **values: Any) -> str:
    """Give the path of a resource, for a Location header: with the slash, as documents have it."""
    return f"{url_for(endpoint, **values)}/"


def add(
    routes: Blueprint,
    names: Sequence[str],
    endpoint: str,
    view: Callable[..., ResponseReturnValue],
    method: str,
    *,
    item: str = "",
    action: str = "",
) -> None:
    """Add a view under each name, as collection or as item (`item` is its converter).

    An `action` follows the item: `/plans/5/dispatch`.
    """
    below = "".join([f"/<{item}>" if item else "", f"/{action}" if action else ""])
    for name in names:
        routes.add_url_rule(f"/{name}{below}", endpoint, view, methods=[method])
