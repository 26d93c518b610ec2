"""How addresses are written: both with and without the slash at the end, and no redirect."""

from collections.abc import Callable, Sequence
from typing import Final

from apiflask import APIBlueprint, APIFlask
from flask.typing import ResponseReturnValue
from werkzeug.routing import BaseConverter

_LAST: Final = 2**63 - 1


class Int64Converter(BaseConverter):
    """An id as the database can hold it."""

    regex = r"\d{1,19}"

    def to_python(self, value: str) -> int:
        """Read an id; one beyond 63 bits is that of nothing, like the last one that we can hold.

        To refuse it here would answer 405 to all methods but one: the others' rules match.
        """
        return min(int(value), _LAST)


def install(app: APIFlask) -> None:
    """Teach an app our addresses; call before the routes are added."""
    app.url_map.converters["int64"] = Int64Converter
    app.url_map.strict_slashes = True  # Both forms are routes of their own
    app.url_map.merge_slashes = False


def add(
    routes: APIBlueprint,
    words: Sequence[str],
    endpoint: str,
    view: Callable[..., ResponseReturnValue],
    method: str,
    *,
    item: str = "",
    action: str = "",
) -> None:
    """Add a view under each word, as collection or as item (`item` is its converter).

    An `action` is something done to an item: `/plans/5/dispatch`.
    """
    below = "".join([f"/<{item}>" if item else "", f"/{action}" if action else ""])
    for word in words:
        for slash in ("/", ""):
            place = f"/{word}{below}{slash}"
            routes.add_url_rule(place, endpoint, view, methods=[method])
