"""A page of a list: bounded in number by its caller, and here in bytes."""

import json
from collections.abc import Callable, Iterable
from typing import Any, Final, TypeVar

MOST_BYTES: Final = 8 * 1024 * 1024
"""Size of a page, at most; a single object is always shown, whatever its size."""
_T = TypeVar("_T")


class Listing(list[dict[str, Any]]):
    """Objects as the API shows them, ordered by id; `is_cut` if its size ended the page."""

    is_cut = False


def fill(found: Iterable[_T], show: Callable[[_T], dict[str, Any]]) -> Listing:
    """Show one object after the other until the page is full; only the shown form is kept."""
    listing, room = Listing(), MOST_BYTES
    for one in found:
        shown = show(one)
        room -= len(json.dumps(shown))
        if listing and room < 0:
            listing.is_cut = True
            break
        listing.append(shown)
    return listing
