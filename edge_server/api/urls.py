"""Paths: each with and without a slash at the end, never a redirect."""

from collections.abc import Callable, Sequence
from typing import Final

from flask import Blueprint, Flask
from flask.typing import ResponseReturnValue
from werkzeug.routing import BaseConverter

_LAST: Final = 2**63 - 1


class Int64Converter(BaseConverter):
    """Converter of ids, which the database holds in 63 bits."""

    regex = r"\d{1,19}"

    def to_python(self, value: str) -> int:
        """Read an id; one beyond 63 bits becomes the largest one, which no resource has.

        A refusal here would answer 405 for other methods than this rule's, instead of 404.
        """
        return min(int(value), _LAST)


def install(app: Flask) -> None:
    """Configure the URL map of an app; call it before routes are added."""
    app.url_map.converters["int64"] = Int64Converter
    app.url_map.strict_slashes = True  # Both forms are separate routes
    app.url_map.merge_slashes = False


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
        for slash in ("/", ""):
            place = f"/{name}{below}{slash}"
            routes.add_url_rule(place, endpoint, view, methods=[method])
