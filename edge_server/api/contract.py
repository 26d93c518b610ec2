"""Contract of a route, for the OpenAPI document: its bodies, parameters and statuses."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

from pydantic import BaseModel

_ATTRIBUTE: Final = "edge_contract"
_View = TypeVar("_View", bound=Callable[..., object])

PAGE: Final = ("after", "limit", "since", "vehicle_id")
"""Query parameters of a list."""


@dataclass(frozen=True, slots=True)
class Contract:
    """One route: types of its bodies; None is an empty one, or one that is not JSON."""

    answers: Mapping[int, type[BaseModel] | None]
    body: type[BaseModel] | None = None
    query: tuple[str, ...] = ()
    is_list: bool = False
    conditional: bool = False  # Evaluates If-Match or If-None-Match
    repeatable: bool = False  # Evaluates Idempotency-Key
    errors: tuple[int, ...] = ()
    files: tuple[str, ...] = ()  # Media types accepted besides JSON and a form
    other_answers: tuple[str, ...] = ()  # Media types besides JSON
    example: Any = field(default=None)


def describe(contract: Contract) -> Callable[[_View], _View]:
    """Attach a contract to a view."""

    def mark(view: _View) -> _View:
        setattr(view, _ATTRIBUTE, contract)
        return view

    return mark


def contract_of(view: object) -> Contract | None:
    """Give the contract of a view."""
    found: Contract | None = getattr(view, _ATTRIBUTE, None)
    return found
