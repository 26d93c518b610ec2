"""What a route takes and answers, said beside the route for the OpenAPI document."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

_ATTRIBUTE: Final = "edge_contract"
_View = TypeVar("_View", bound=Callable[..., object])

PAGE: Final = ("after", "limit", "since", "vehicle_id")
"""Query parameters of a list."""


@dataclass(frozen=True, slots=True)
class Contract:
    """One route: schema names as in the OpenAPI document; None is an empty body."""

    answers: Mapping[int, str | None]
    body: str | None = None
    query: tuple[str, ...] = ()
    is_list: bool = False
    conditional: bool = False  # Knows If-Match or If-None-Match
    repeatable: bool = False  # Knows Idempotency-Key
    errors: tuple[int, ...] = ()
    files: tuple[str, ...] = ()  # Media types that are taken in place of JSON; a form too
    other_answers: tuple[str, ...] = ()  # Media types besides JSON
    example: Any = field(default=None)


def describe(contract: Contract) -> Callable[[_View], _View]:
    """Put a contract on a view."""

    def mark(view: _View) -> _View:
        setattr(view, _ATTRIBUTE, contract)
        return view

    return mark


def contract_of(view: object) -> Contract | None:
    """Give the contract of a view."""
    found: Contract | None = getattr(view, _ATTRIBUTE, None)
    return found
